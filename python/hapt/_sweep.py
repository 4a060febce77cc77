"""Sweeps: measures over a grid of a world, computed in this process or in shards."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Callable, Optional, Union

import numpy as np
from numpy.typing import NDArray

from . import _hapt
from ._shards import Dataset, Job, Manifest, ends, run, shards_of
from ._table import axes_of
from ._target import Target

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

#: The intended computing time of a stretch of cells in s. The progress bar moves after each.
STRETCH = 0.1


def here(job: Job, grid: _hapt.Sweep, progress: Optional[bool], threads: int) -> Sweep:
    """Computes all rows of a grid in this process, in stretches: between two Ctrl-C is handled and the bar moves."""
    width = len(job.measures)
    table = np.empty((grid.cells, width))
    done, stretch = 0, 16 * (threads or os.cpu_count() or 1)
    with _bar(grid.cells, progress) as advance:
        while done < grid.cells:
            began = time.monotonic()
            end = min(done + stretch, grid.cells)
            table[done:end] = grid.rows(done, end, threads).reshape(-1, width)
            advance(end - done)
            done = end
            spent = time.monotonic() - began
            stretch = min(2 * stretch, 1 << 16) if spent < STRETCH / 2 else max(stretch // 2, 1) if spent > STRETCH else stretch
    return Sweep.of_table(job, table)


def in_shards(
    job: Job,
    grid: _hapt.Sweep,
    progress: Optional[bool],
    threads: Optional[int],
    client: Any,
    shards: Optional[int],
    target: Optional[Target],
) -> Union[Sweep, Dataset]:
    """Computes all rows in shards: in memory, or as files of a target, where finished shards are not computed again."""
    cells, fingerprint = grid.cells, job.fingerprint(grid)
    workers = threads if threads is not None else 0 if client is None else 1

    def default() -> int:
        return shards_of(cells, grid, workers)

    if target is None:
        count = shards or default()
        table = np.empty((cells, len(job.measures)))
        with _bar(cells, progress) as advance:
            for shard, rows in run(job, fingerprint, list(range(count)), cells, count, client, workers, None):
                start, end = ends(cells, count, shard)
                table[start:end] = rows
                advance(end - start)
        return Sweep.of_table(job, table)
    import pyarrow  # noqa: F401 - raises ImportError before a file is written

    manifest = Manifest.open(target, fingerprint, cells, shards, default)
    count, todo = manifest.shards, manifest.missing
    with _bar(cells, progress) as advance:
        advance(cells - sum(end - start for start, end in (ends(cells, count, shard) for shard in todo)))
        try:
            for shard, _ in run(job, fingerprint, todo, cells, count, client, workers, target):
                start, end = ends(cells, count, shard)
                manifest.note(shard)
                advance(end - start)
        except BaseException:
            with suppress(OSError):  # The first error is raised, not that of the manifest.
                manifest.write()
            raise
        if todo:
            manifest.write()
    return Dataset(target, cells, count)


@contextmanager
def _bar(cells: int, progress: Optional[bool]) -> Iterator[Callable[[int], Any]]:
    """A function that adds cells done to a progress bar; without tqdm, or when `progress` is False, there is no bar."""
    if progress is False or find_spec("tqdm") is None:
        yield lambda _: None
        return
    from tqdm.auto import tqdm

    with tqdm(total=cells, unit="cell", delay=0.0 if progress else 0.5) as bar:
        yield bar.update


class Sweep(Mapping[str, "NDArray[np.float64]"]):
    """Measures over a grid: `sweep["certified"]` is an array with an axis for each key, in order, in SI; NaN where a measure has no value.

    `axes` maps each key to its values in SI, shape (n,).
    """

    def __init__(self, axes: dict[str, NDArray[np.float64]], measures: dict[str, NDArray[np.float64]]) -> None:
        self.axes = axes
        self._measures = measures

    @classmethod
    def of_table(cls, job: Job, table: NDArray[np.float64]) -> Sweep:
        """The sweep from the measures of all cells, shape (cells, measures)."""
        shape = [len(values) for values in job.axes.values()]
        return cls(job.axes, {name: table[:, i].reshape(shape) for i, name in enumerate(job.measures)})

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        try:
            return self._measures[name]
        except KeyError:
            raise KeyError(f"there is no measure {name!r}; there are {', '.join(self._measures)}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._measures)

    def __len__(self) -> int:
        return len(self._measures)

    def __repr__(self) -> str:
        shape = " x ".join(f"{key} ({len(values)})" for key, values in self.axes.items())
        return f"<hapt.Sweep of {', '.join(self)} over {shape}>"

    def to_pandas(self) -> pd.DataFrame:
        """A DataFrame as `hapt sweep` writes it: a column for each key, the last varying fastest, then one for each measure."""
        import pandas as pd

        return pd.DataFrame(self._columns())

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """The table of `to_pandas` as Arrow doubles, null for NaN: `pyarrow.table(sweep)`, `polars.DataFrame(sweep)`."""
        return _hapt.arrow_stream(list(self._columns().items()))

    def _columns(self) -> dict[str, NDArray[np.float64]]:
        grid = np.meshgrid(*self.axes.values(), indexing="ij")
        columns = {key: values.ravel() for key, values in zip(self.axes, grid)}
        return {**columns, **{name: values.ravel() for name, values in self.items()}}

    def to_xarray(self) -> xr.Dataset:
        """An xarray Dataset of the measures, with the keys as coordinates."""
        import xarray as xr

        return xr.Dataset({name: (list(self.axes), values) for name, values in self.items()}, coords=self.axes)

    def plot(self, measure: Optional[str] = None, ax: Any = None) -> Any:
        """Draws a measure, by default the first, as a curve over one key or a map over two, and returns matplotlib's axes.

        Raises KeyError for an unknown measure, ValueError for more than two keys.
        """
        name = measure if measure is not None else next(iter(self))
        values = self[name]
        if values.ndim > 2:
            raise ValueError(f"{values.ndim} keys are varied, but only one (a curve) or two (a map) can be drawn")
        ax = axes_of(ax)
        keys = list(self.axes)
        if values.ndim == 1:
            ax.plot(self.axes[keys[0]], values)
            ax.set_ylabel(name)
        else:
            mesh = ax.pcolormesh(self.axes[keys[0]], self.axes[keys[1]], values.T, shading="nearest")
            ax.figure.colorbar(mesh, ax=ax, label=name)
            ax.set_ylabel(keys[1])
        ax.set_xlabel(keys[0])
        return ax
