"""Couplings and hands for worlds built in Python. Each class is a table of the world file, with the keys of docs/keys.md as fields.

A quantity is a string with a unit, or a number in SI. A field that is None is left out of the table: the file's default applies.
In the formulas q = q_first - q_second is the position between the two ends, and the torque acts on the first end.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Optional, Union

Quantity = Union[str, float]


class Table:
    """A table of the world file with a `kind`: the name of its class in lower case, with hyphens."""

    kind: ClassVar[str]

    def __init_subclass__(cls) -> None:
        cls.kind = re.sub(r"(?<!^)(?=[A-Z])", "-", cls.__name__).lower()

    def to_table(self) -> dict[str, Any]:
        """The table of the world file."""
        given = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        return {"kind": self.kind, **{name: value for name, value in given.items() if value is not None}}


@dataclass(frozen=True)
class Coupling(Table):
    """A coupling `between` two ends, each "puck", "ground" or the name of a body."""

    between: Sequence[str]


class Hand(Table):
    """A hand: the motion of the puck or the torque on it."""


@dataclass(frozen=True)
class Spring(Coupling):
    """A spring: -stiffness · (q - rest), within ±limit."""

    stiffness: Quantity
    rest: Optional[Quantity] = None
    limit: Optional[Quantity] = None


@dataclass(frozen=True)
class Damper(Coupling):
    """A damper: -damping · q̇, within ±limit. "compensating" is the period times the stiffness of the springs between the same ends."""

    damping: Quantity
    limit: Optional[Quantity] = None


@dataclass(frozen=True)
class Wall(Coupling):
    """A wall: a spring and a damper while q is beyond `at` on its `side`, "above" or "below". It pushes and never pulls."""

    stiffness: Quantity
    side: str
    at: Quantity
    damping: Optional[Quantity] = None
    limit: Optional[Quantity] = None


@dataclass(frozen=True)
class Detent(Coupling):
    """Detents: -torque · sin(2π (q - phase)/pitch)."""

    torque: Quantity
    pitch: Quantity
    phase: Optional[Quantity] = None


@dataclass(frozen=True)
class DeadBand(Coupling):
    """A spring with a dead band: no torque within `width` of `rest` on either side, -stiffness times the distance beyond it."""

    stiffness: Quantity
    width: Quantity
    rest: Optional[Quantity] = None
    limit: Optional[Quantity] = None


@dataclass(frozen=True)
class Magnet(Coupling):
    """A magnet that pulls to `at`. The pull is greatest at the distance `width`, where it is `torque`."""

    torque: Quantity
    width: Quantity
    at: Optional[Quantity] = None


@dataclass(frozen=True)
class Texture(Coupling):
    """A texture: torque · waveform(θ), θ = 2π (q - phase)/pitch.

    The waveform is given by one of these: harmonics (`sine`, `cosine`), `samples` over one pitch, or a `file` of samples.
    """

    torque: Quantity
    pitch: Quantity
    phase: Optional[Quantity] = None
    sine: Optional[Sequence[float]] = None
    cosine: Optional[Sequence[float]] = None
    samples: Optional[Sequence[float]] = None
    file: Optional[str] = None


@dataclass(frozen=True)
class Friction(Coupling):
    """Coulomb friction with `torque`, or LuGre friction with the other six fields."""

    torque: Optional[Quantity] = None
    coulomb: Optional[Quantity] = None
    stribeck: Optional[Quantity] = None
    stribeck_velocity: Optional[Quantity] = None
    bristle_stiffness: Optional[Quantity] = None
    bristle_damping: Optional[Quantity] = None
    viscous: Optional[Quantity] = None


@dataclass(frozen=True)
class Integral(Coupling):
    """The integral term of a PID controller between puck and ground: -stiffness/time · Σ T (q - rest), within ±limit."""

    stiffness: Quantity
    time: Optional[Quantity] = None
    rest: Optional[Quantity] = None
    limit: Optional[Quantity] = None


@dataclass(frozen=True)
class Assist(Coupling):
    """A compensation of friction between puck and ground: torque · q̇/velocity, within ±torque."""

    torque: Quantity
    velocity: Quantity


@dataclass(frozen=True)
class Acceleration(Coupling):
    """A compensation of inertia between puck and ground: inertia times the change of the velocity behind a low-pass, within ±limit."""

    inertia: Quantity
    cutoff: Quantity
    limit: Optional[Quantity] = None


@dataclass(frozen=True)
class Constant(Coupling):
    """A constant torque on the first end."""

    torque: Quantity


@dataclass(frozen=True)
class Step(Hand):
    """A prescribed step: the puck is at 0 before the time `at` and at `to` from then on. From the time `release` on there is no hand."""

    to: Quantity
    at: Optional[Quantity] = None
    release: Optional[Quantity] = None


@dataclass(frozen=True)
class Ramp(Hand):
    """A prescribed ramp from 0 to `to` at constant velocity. It begins at the time `at` and takes the time `over`."""

    to: Quantity
    over: Quantity
    at: Optional[Quantity] = None
    release: Optional[Quantity] = None


@dataclass(frozen=True)
class Sine(Hand):
    """A prescribed sine: amplitude · sin(2π frequency t + phase)."""

    amplitude: Quantity
    frequency: Quantity
    phase: Optional[Quantity] = None
    release: Optional[Quantity] = None


@dataclass(frozen=True)
class Path(Hand):
    """A prescribed motion from a CSV `file` of times and positions, linear between the points. Its path is relative to the current folder."""

    file: str
    release: Optional[Quantity] = None


@dataclass(frozen=True)
class Torque(Hand):
    """A torque on the free puck. Its course over time is that of the motion `moves`, with torques as amplitudes."""

    moves: Hand
    release: Optional[Quantity] = None


@dataclass(frozen=True)
class Grip(Hand):
    """A hand of inertia, damping and stiffness that holds the puck; `moves` is its intended motion."""

    moves: Hand
    inertia: Optional[Quantity] = None
    damping: Optional[Quantity] = None
    stiffness: Optional[Quantity] = None
    hold: Optional[Quantity] = None
    open: Optional[Quantity] = None
    release: Optional[Quantity] = None


COUPLINGS: tuple[Any, ...] = tuple(Coupling.__subclasses__())
HANDS: tuple[Any, ...] = tuple(Hand.__subclasses__())
