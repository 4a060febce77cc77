"""The results of analyses of a world, a record of motion, or a design."""

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
    """The design of the notes' wheel: `stiffness`, `inertia`, `compensating_damping`, `natural_frequency_hz`, `peak_torque`, in SI.

    `world` is the world that `hapt design` prints: the wheel under forward Euler with the compensating damper.
    """

    def __init__(self, fields: dict[str, Any], world: World) -> None:
        super().__init__(fields)
        self.world = world


class Identified(Answer):
    """A device identified from a record: `inertia`, `damping`, `friction`, `delay_s`, `lag_s`, `late_s`, `offset`, `sign`, `counts_per_rev`.

    Each is `{"value", "low", "high"}` in SI with the 95 % interval, or None where the record does not determine it. Where the record reaches
    end stops, `stops` has their `low`, `high`, `stiffness` and `damping` in the same form. `late_s` is delay and lag together; where the lag
    may be 0, the two cannot be distinguished, and `delay_s` is the same sum. `misfit` is what the torque's equation leaves, with the numbers of
    its best fit, as `hapt identify --json` has it. Where the model does not explain the motion, the numbers are a fit of that equation:
    `warnings` has the reason, delay and lag are None, and `inertia_by_torque`, `inertia_by_motion` and, where there are some, `terms` are added.
    """

    def __init__(self, fields: dict[str, Any], warnings: list[str]) -> None:
        super().__init__(fields)
        self.warnings = warnings


class Comparison(Answer):
    """A comparison of a record with a world's device. It is true where the model explains the motion and no number contradicts the world.

    `agrees` is the same. `numbers` is a list, each with `name`, `estimate` (`{"value", "low", "high"}`, 95 %, or None), `file` (the world's
    range), `sigmas` (the estimate's distance from that range in standard errors), `verdict` ("agrees", "contradicts", or "not determined" where the
    record does not determine the number) and `reason`. `unexplained` is the reason why the model does not explain the motion, or None.
    `misfit` is None unless the numbers are those of the torque's equation. `residual` is the rest of the fit: `rms` and `noise_rms` in rad
    (linear: m), `correlation`, and `counts` (the rms in encoder counts).
    """

    def __bool__(self) -> bool:
        return bool(self["agrees"])


class Worst(Answer):
    """The fields of `hapt worst --json`: the passive hand found that draws most energy from a loop; of a network the hands at all stations.

    `world` is the world or network with the scenario `worst`, which repeats it; a network also has the messages' delays of that run.
    `world` is None where the hand is a prescribed motion.
    """

    def __init__(self, fields: dict[str, Any], world: Optional[World]) -> None:
        super().__init__(fields)
        self.world = world


class Impedance(Table):
    """The impedance at the puck against frequency: rendered by the loop, ideal, and of loop and device together (`whole_`).

    The columns are those of `hapt impedance --out`, shape (points,), NaN where a value is unbounded. `info` has the rest of the command's
    JSON, in SI: `period_s`, `nyquist_hz`, `asked` (the world's nominal impedance), `resonances`, `device` and `notes`.
    """

    def __init__(self, columns: dict[str, NDArray[np.float64]], info: dict[str, Any]) -> None:
        super().__init__(columns)
        self.info = info

    def plot(self, element: str = "stiffness", ax: Any = None) -> Any:
        """Draws an element ("stiffness", "damping" or "inertia") over frequency, and returns matplotlib's axes.

        Raises ValueError for another element.
        """
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
    """A connected piece of the edge of `claim`: `x` and `y` are the two keys' values in SI, shape (points,).

    `hz` is the frequency in Hz at which an eigenvalue crosses the unit circle there, NaN where none does.
    """

    claim: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    hz: NDArray[np.float64]


class Boundary:
    """The edges in the plane of two keys at which a loop stops being stable or passive, or a network passive.

    `keys` are the two keys, `pieces` the pieces of the edges. `everywhere[claim]` is True where the claim fails in the whole plane, False
    where it fails in no part of it, and None where it has an edge or no verdict. `lost[claim]` are the points (x, y) in SI from which an edge
    continues but is not followed, because it turns or narrows within a hundred-thousandth of the plane: a smaller plane around the point
    shows it. `undecided[claim]` is the reason for a missing verdict; claims with a verdict have no entry.
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
        """A DataFrame with a row for each point: `edge` (the claim), `piece` (from 1 in each claim), the two keys in SI, `hz`."""
        import pandas as pd

        count: dict[str, int] = {}
        frames = []
        for piece in self.pieces:
            count[piece.claim] = count.get(piece.claim, 0) + 1
            columns = {"edge": piece.claim, "piece": count[piece.claim], self.keys[0]: piece.x, self.keys[1]: piece.y}
            frames.append(pd.DataFrame({**columns, "hz": piece.hz}))
        return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=["edge", "piece", *self.keys, "hz"])

    def plot(self, ax: Any = None) -> Any:
        """Draws the edges in the plane, and returns matplotlib's axes."""
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
