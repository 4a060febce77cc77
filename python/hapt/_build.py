"""Couplings and hands for worlds built in Python: each is a table of the world file (docs/keys.md), nothing more.

A quantity is a string with a unit, or a number in SI. A field that is None is left out, so that the file's default holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Optional, Union

Quantity = Union[str, float]


class Table:
    """A table with a `kind`."""

    kind: ClassVar[str]

    def to_table(self) -> dict[str, Any]:
        """The table of the world file."""
        given = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        return {"kind": self.kind, **{name: value for name, value in given.items() if value is not None}}


@dataclass(frozen=True)
class Spring(Table):
    """-stiffness · (q - rest) on the first of the two ends, q = q_first - q_second."""

    kind: ClassVar[str] = "spring"
    between: Sequence[str]
    stiffness: Quantity
    rest: Optional[Quantity] = None
    limit: Optional[Quantity] = None


@dataclass(frozen=True)
class Damper(Table):
    """-damping · q̇; "compensating" is the period times the stiffness of the springs between the same ends."""

    kind: ClassVar[str] = "damper"
    between: Sequence[str]
    damping: Quantity
    limit: Optional[Quantity] = None


@dataclass(frozen=True)
class Wall(Table):
    """A spring and a damper while q is beyond `at` on its `side`, "above" or "below", never pulling."""

    kind: ClassVar[str] = "wall"
    between: Sequence[str]
    stiffness: Quantity
    side: str
    at: Quantity
    damping: Optional[Quantity] = None
    limit: Optional[Quantity] = None


@dataclass(frozen=True)
class Detent(Table):
    """-torque · sin(2π (q - phase)/pitch)."""

    kind: ClassVar[str] = "detent"
    between: Sequence[str]
    torque: Quantity
    pitch: Quantity
    phase: Optional[Quantity] = None


@dataclass(frozen=True)
class DeadBand(Table):
    """A spring that begins `width` from `rest`, on both sides."""

    kind: ClassVar[str] = "dead-band"
    between: Sequence[str]
    stiffness: Quantity
    width: Quantity
    rest: Optional[Quantity] = None
    limit: Optional[Quantity] = None


@dataclass(frozen=True)
class Magnet(Table):
    """Pulls to `at`, most at the distance `width`, with `torque`."""

    kind: ClassVar[str] = "magnet"
    between: Sequence[str]
    torque: Quantity
    width: Quantity
    at: Optional[Quantity] = None


@dataclass(frozen=True)
class Texture(Table):
    """torque · waveform over θ = 2π (q - phase)/pitch: harmonics (`sine`, `cosine`), `samples` over one period, or a `file` of them."""

    kind: ClassVar[str] = "texture"
    between: Sequence[str]
    torque: Quantity
    pitch: Quantity
    phase: Optional[Quantity] = None
    sine: Optional[Sequence[float]] = None
    cosine: Optional[Sequence[float]] = None
    samples: Optional[Sequence[float]] = None
    file: Optional[str] = None


@dataclass(frozen=True)
class Friction(Table):
    """Coulomb friction of a `torque`, or LuGre friction of the other six."""

    kind: ClassVar[str] = "friction"
    between: Sequence[str]
    torque: Optional[Quantity] = None
    coulomb: Optional[Quantity] = None
    stribeck: Optional[Quantity] = None
    stribeck_velocity: Optional[Quantity] = None
    bristle_stiffness: Optional[Quantity] = None
    bristle_damping: Optional[Quantity] = None
    viscous: Optional[Quantity] = None


@dataclass(frozen=True)
class Constant(Table):
    """A constant torque on the first end."""

    kind: ClassVar[str] = "constant"
    between: Sequence[str]
    torque: Quantity


@dataclass(frozen=True)
class Step(Table):
    """The puck at 0, from `at` on at `to`; the hand is gone from `release` on."""

    kind: ClassVar[str] = "step"
    to: Quantity
    at: Optional[Quantity] = None
    release: Optional[Quantity] = None


@dataclass(frozen=True)
class Ramp(Table):
    """From 0 to `to` at constant velocity, beginning `at`, taking `over`."""

    kind: ClassVar[str] = "ramp"
    to: Quantity
    over: Quantity
    at: Optional[Quantity] = None
    release: Optional[Quantity] = None


@dataclass(frozen=True)
class Sine(Table):
    """amplitude · sin(2π frequency t + phase)."""

    kind: ClassVar[str] = "sine"
    amplitude: Quantity
    frequency: Quantity
    phase: Optional[Quantity] = None
    release: Optional[Quantity] = None


@dataclass(frozen=True)
class Path(Table):
    """A CSV of time and position, straight between the points; relative to the current folder."""

    kind: ClassVar[str] = "path"
    file: str
    release: Optional[Quantity] = None


@dataclass(frozen=True)
class Torque(Table):
    """The puck moves by itself, pushed by a torque of the shape `moves`."""

    kind: ClassVar[str] = "torque"
    moves: Table
    release: Optional[Quantity] = None


@dataclass(frozen=True)
class Grip(Table):
    """The puck in a hand of inertia, damping and stiffness around the intended motion `moves`."""

    kind: ClassVar[str] = "grip"
    moves: Table
    inertia: Optional[Quantity] = None
    damping: Optional[Quantity] = None
    stiffness: Optional[Quantity] = None
    hold: Optional[Quantity] = None
    open: Optional[Quantity] = None
    release: Optional[Quantity] = None


COUPLINGS = (Spring, Damper, Wall, Detent, DeadBand, Magnet, Texture, Friction, Constant)
HANDS = (Step, Ramp, Sine, Path, Torque, Grip)

__all__ = [
    "Constant",
    "Damper",
    "DeadBand",
    "Detent",
    "Friction",
    "Grip",
    "Magnet",
    "Path",
    "Ramp",
    "Sine",
    "Spring",
    "Step",
    "Texture",
    "Torque",
    "Wall",
]
