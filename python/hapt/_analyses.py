"""Analyses of a world, a record or a specification without a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Optional

import numpy as np
from numpy.typing import NDArray

from ._answer import Answer
from ._table import Table, axes_of

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from ._world import World


class Design(Answer):
    """`stiffness`, `inertia`, `compensating_damping`, `natural_frequency_hz`, `peak_torque` of the notes' wheel, in SI.

    `world` is the wheel under forward Euler with the compensating damper, as `hapt design` prints it.
    """

    def __init__(self, fields: dict[str, Any], world: World) -> None:
        super().__init__(fields)
        self.world = world


class Identified(Answer):
    """`inertia`, `damping`, `friction`, `delay_s`, `lag_s`, `late_s`, `offset`, `sign`, `counts_per_rev`.

    Each `{"value", "low", "high"}` (95 %) or None. Where the record runs into end stops, `stops` has their `low`, `high`, `stiffness` and `damping`
    likewise. A lag that may be 0 is not distinguished from a delay: `delay_s` is then both together, as
    `late_s` is. Of a device that is richer than the model the numbers are those of the torque's equation; there is a warning then, and delay
    and lag are None.
    """

    def __init__(self, fields: dict[str, Any], warnings: list[str]) -> None:
        super().__init__(fields)
        self.warnings = warnings


class Comparison(Answer):
    """Whether a record agrees with a world: true where nothing in it contradicts the world's device.

    `agrees`; `numbers`, each with `name`, `estimate` (`{"value", "low", "high"}`, 95 %, or None), the `file`'s range, `sigmas` (standard
    errors outside of it), `verdict` ("agrees", "contradicts" or "not told") and `reason`; `unexplained`; `residual`.
    """

    def __bool__(self) -> bool:
        return bool(self["agrees"])


class Worst(Answer):
    """The passive hand that draws most energy from a loop, of a network the hands at all stations: the fields of `hapt worst --json`.

    `world` has the scenario `worst` that shows it, a network with its messages as they were then; it is None for a motion.
    """

    def __init__(self, fields: dict[str, Any], world: Optional[World]) -> None:
        super().__init__(fields)
        self.world = world


class Impedance(Table):
    """The impedance at the puck against frequency: rendered by the loop, ideal, and of loop and device together (`whole_`).

    Columns as `hapt impedance --out` writes them, shape (points,), NaN where one is unbounded. `info` has the rest of the command's JSON:
    `nyquist_hz`, what is `asked`, `resonances`, `device`, `notes`.
    """

    def __init__(self, columns: dict[str, NDArray[np.float64]], info: dict[str, Any]) -> None:
        super().__init__(columns)
        self.info = info

    def plot(self, element: str = "stiffness", ax: Any = None) -> Any:
        """Draws an element ("stiffness", "damping" or "inertia") over frequency; returns matplotlib's axes."""
        names = [name for name in self if element in name]
        if not names:
            raise ValueError(f'element is {element!r}, but must be "stiffness", "damping" or "inertia"')
        ax = axes_of(ax)
        for name in names:
            ax.semilogx(self["frequency_hz"], self[name], label=name)
        ax.set_xlabel("frequency_hz")
        ax.legend()
        return ax


class Piece(NamedTuple):
    """An edge in one piece: the keys' values of its points in SI, and Hz where an eigenvalue crosses there, else NaN."""

    claim: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    hz: NDArray[np.float64]


class Boundary:
    """Where a loop stops being stable or passive, or a network passive, in the plane of two keys.

    `keys` are the two keys, `pieces` the edges. `everywhere` is, for each claim without an edge, whether it fails everywhere (True) or nowhere
    (False), and is None for a claim with an edge or without a verdict. `lost` is, for each claim, where its edge goes on but is not followed,
    because it turns or narrows within a hundred-thousandth of the plane: a smaller plane around such a point shows it. `undecided` is the
    reason why a claim has no verdict in the plane, for those that have none.
    """

    def __init__(
        self,
        keys: tuple[str, str],
        pieces: list[Piece],
        everywhere: dict[str, Optional[bool]],
        lost: dict[str, list[tuple[float, float]]],
        undecided: dict[str, str],
    ) -> None:
        self.keys = keys
        self.pieces = pieces
        self.everywhere = everywhere
        self.lost = lost
        self.undecided = undecided

    def __repr__(self) -> str:
        return f"<hapt.Boundary over {self.keys[0]} and {self.keys[1]}: {len(self.pieces)} pieces>"

    def to_pandas(self) -> pd.DataFrame:
        """A row for each point: `edge`, `piece` (from 1 in each claim), the two keys, `hz`."""
        import pandas as pd

        count: dict[str, int] = {}
        frames = []
        for piece in self.pieces:
            count[piece.claim] = count.get(piece.claim, 0) + 1
            columns = {"edge": piece.claim, "piece": count[piece.claim], self.keys[0]: piece.x, self.keys[1]: piece.y}
            frames.append(pd.DataFrame({**columns, "hz": piece.hz}))
        return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=["edge", "piece", *self.keys, "hz"])

    def plot(self, ax: Any = None) -> Any:
        """Draws the edges in the plane; returns matplotlib's axes."""
        ax = axes_of(ax)
        colours: dict[str, str] = {}
        for piece in self.pieces:
            colour = colours.setdefault(piece.claim, f"C{len(colours)}")
            ax.plot(piece.x, piece.y, color=colour, label=piece.claim)
        ax.set_xlabel(self.keys[0])
        ax.set_ylabel(self.keys[1])
        ax.ticklabel_format(scilimits=(-2, 4))
        if colours:
            ax.legend()
        return ax
