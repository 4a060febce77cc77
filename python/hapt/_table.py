"""Columns by name as NumPy arrays: the base of runs and impedances."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _hapt

if TYPE_CHECKING:
    import pandas as pd


class Table(Mapping[str, "NDArray[np.float64]"]):
    """A mapping of column names to arrays of shape (rows,), float64, SI."""

    def __init__(self, columns: dict[str, NDArray[np.float64]]) -> None:
        self._columns = columns

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        try:
            return self._columns[name]
        except KeyError:
            raise KeyError(f"there is no column {name!r}; the columns are {', '.join(self._columns)}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __repr__(self) -> str:
        return f"<hapt.{type(self).__name__}: {len(next(iter(self.values())))} rows of {', '.join(self)}>"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Table):
            return NotImplemented
        return list(self) == list(other) and all(np.array_equal(self[n], other[n], equal_nan=True) for n in self)

    __hash__ = None  # type: ignore[assignment]

    def to_pandas(self) -> pd.DataFrame:
        """A DataFrame with these columns in this order."""
        import pandas as pd

        return pd.DataFrame(self._columns)

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """The columns as Arrow doubles, null for NaN: `pyarrow.table(run)`, `polars.DataFrame(run)`."""
        return _hapt.arrow_stream(list(self.items()))


def axes_of(ax: Any) -> Any:
    """`ax`, or new axes of matplotlib. Only drawing imports matplotlib."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots()[1]
