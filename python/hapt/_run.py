"""The run of a scenario."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional

import numpy as np
from numpy.typing import NDArray

from ._table import Table, axes_of

if TYPE_CHECKING:
    import xarray as xr


class Run(Table):
    """The run of a scenario: `run["torque_Nm"]` is the array of that CSV column, shape (rows,), in SI.

    `summary` has the numbers that `hapt sim` prints, in SI: `rows`; `peak_torque` (before the limit) and `peak_time_s`; `clipped` (the number
    of samples beyond the motor's limit) and `first_clipped_s`; `final_energy` of the world; the fitted `growth_per_s` or None; the energies
    supplied by hand and motor, and those dissipated by damping, friction, end stops and the damping of a handle's shaft, as `*_energy`.
    `ended` is the reason for an end before the scenario's duration, or None.
    """

    def __init__(
        self, scenario: str, columns: dict[str, NDArray[np.float64]], summary: dict[str, Any], ended: Optional[str]
    ) -> None:
        super().__init__(columns)
        self.scenario = scenario
        self.summary = summary
        self.ended = ended

    def __repr__(self) -> str:
        return f"<hapt.Run {self.scenario}: {self.summary['rows']} rows of {', '.join(self)}>"

    @property
    def time(self) -> NDArray[np.float64]:
        """The times t_k of the samples in s, shape (rows,)."""
        return self["time_s"]

    def to_xarray(self) -> xr.Dataset:
        """An xarray Dataset of the columns over the coordinate `time_s`, with the summary as attributes."""
        import xarray as xr

        columns = {name: ("time_s", column) for name, column in self.items() if name != "time_s"}
        attributes = {name: value for name, value in self.summary.items() if value is not None}
        return xr.Dataset(columns, coords={"time_s": self.time}, attrs={"scenario": self.scenario, **attributes})

    def plot(self, *columns: str, ax: Any = None) -> Any:
        """Draws columns over time, by default positions and torque, one below the other, and returns matplotlib's axes.

        With `ax` all columns are drawn in these axes. Raises KeyError for an unknown column.
        """
        names = [name for name in self if name != "time_s"]
        chosen = list(columns) or [n for n in names if n.startswith(("puck_", "torque_", "force_")) and "_per_s" not in n]
        if ax is not None:
            for name in chosen:
                ax.plot(self.time, self[name], label=name)
            ax.set_xlabel("time_s")
            ax.legend()
            return ax
        import matplotlib.pyplot as plt

        figure, rows = plt.subplots(len(chosen), sharex=True, squeeze=False)
        for name, place in zip(chosen, rows[:, 0]):
            axes_of(place).plot(self.time, self[name])
            place.set_ylabel(name)
        rows[-1, 0].set_xlabel("time_s")
        figure.suptitle(self.scenario)
        return rows[:, 0]
