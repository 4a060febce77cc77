"""Couplings and hands for worlds built in Python: each is a table of the world file (docs/keys.md), nothing more.

A quantity is a string with a unit, or a number in SI. A field that is None is left out, so that the file's default holds.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Optional, Union

Quantity = Union[str, float]


class Table:
    """A table of the world file with a `kind`: the name of its class, as the file spells it."""

    kind: ClassVar[str]

    def __init_subclass__(cls) -> None:
        cls.kind = re.sub(r"(?<!^)(?=[A-Z])", "-", cls.__name__).lower()

    def to_table(self) -> dict[str, Any]:
        """The table of the world file."""
        given = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]
        return {"kind": self.kind, **{name: value for name, value in given.items() if value is not None}}


@dataclass(frozen=True)
class Coupling(Table):
    """An element `between` two ends, each "puck", "ground" or a body."""

    between: Sequence[str]


class Hand(Table):
    """What moves the puck."""


@dataclass(frozen=True)
class Spring(Coupling):
    """-stiffness · (q - rest) on the first of the two ends, q = q_first - q_second."""

    stiffness: Quantity
    rest: Optional[Quantity] = None
    limit: Optional[Quantity] = None


@dataclass(frozen=True)
class Damper(Coupling):
    """-damping · q̇; "compensating" is the period times the stiffness of the springs between the same ends."""

    damping: Quantity
    limit: Optional[Quantity] = None


@dataclass(frozen=True)
class Wall(Coupling):
    """A spring and a damper while q is beyond `at` on its `side`, "above" or "below", never pulling."""

    stiffness: Quantity
    side: str
    at: Quantity
    damping: Optional[Quantity] = None
    limit: Optional[Quantity] = None


@dataclass(frozen=True)
class Detent(Coupling):
    """-torque · sin(2π (q - phase)/pitch)."""

    torque: Quantity
    pitch: Quantity
    phase: Optional[Quantity] = None


@dataclass(frozen=True)
class DeadBand(Coupling):
    """A spring that begins `width` from `rest`, on both sides."""

    stiffness: Quantity
    width: Quantity
    rest: Optional[Quantity] = None
    limit: Optional[Quantity] = None


@dataclass(frozen=True)
class Magnet(Coupling):
    """Pulls to `at`, most at the distance `width`, with `torque`."""

    torque: Quantity
    width: Quantity
    at: Optional[Quantity] = None


@dataclass(frozen=True)
class Texture(Coupling):
    """torque · waveform over θ = 2π (q - phase)/pitch: harmonics (`sine`, `cosine`), `samples` over one period, or a `file` of them."""

    torque: Quantity
    pitch: Quantity
    phase: Optional[Quantity] = None
    sine: Optional[Sequence[float]] = None
    cosine: Optional[Sequence[float]] = None
    samples: Optional[Sequence[float]] = None
    file: Optional[str] = None


@dataclass(frozen=True)
class Friction(Coupling):
    """Coulomb friction of a `torque`, or LuGre friction of the other six."""

    torque: Optional[Quantity] = None
    coulomb: Optional[Quantity] = None
    stribeck: Optional[Quantity] = None
    stribeck_velocity: Optional[Quantity] = None
    bristle_stiffness: Optional[Quantity] = None
    bristle_damping: Optional[Quantity] = None
    viscous: Optional[Quantity] = None


@dataclass(frozen=True)
class Integral(Coupling):
    """-stiffness/time · Σ T (q - rest), between puck and ground: the integral term of a PID controller."""

    stiffness: Quantity
    time: Optional[Quantity] = None
    rest: Optional[Quantity] = None
    limit: Optional[Quantity] = None


@dataclass(frozen=True)
class Assist(Coupling):
    """torque · q̇/velocity, within ±torque, between puck and ground: what a compensation of friction is read as."""

    torque: Quantity
    velocity: Quantity


@dataclass(frozen=True)
class Constant(Coupling):
    """A constant torque on the first end."""

    torque: Quantity


@dataclass(frozen=True)
class Step(Hand):
    """The puck at 0, from `at` on at `to`; the hand is gone from `release` on."""

    to: Quantity
    at: Optional[Quantity] = None
    release: Optional[Quantity] = None


@dataclass(frozen=True)
class Ramp(Hand):
    """From 0 to `to` at constant velocity, beginning `at`, taking `over`."""

    to: Quantity
    over: Quantity
    at: Optional[Quantity] = None
    release: Optional[Quantity] = None


@dataclass(frozen=True)
class Sine(Hand):
    """amplitude · sin(2π frequency t + phase)."""

    amplitude: Quantity
    frequency: Quantity
    phase: Optional[Quantity] = None
    release: Optional[Quantity] = None


@dataclass(frozen=True)
class Path(Hand):
    """A CSV of time and position, straight between the points; relative to the current folder."""

    file: str
    release: Optional[Quantity] = None


@dataclass(frozen=True)
class Torque(Hand):
    """The puck moves by itself, pushed by a torque of the shape `moves`."""

    moves: Hand
    release: Optional[Quantity] = None


@dataclass(frozen=True)
class Grip(Hand):
    """The puck in a hand of inertia, damping and stiffness around the intended motion `moves`."""

    moves: Hand
    inertia: Optional[Quantity] = None
    damping: Optional[Quantity] = None
    stiffness: Optional[Quantity] = None
    hold: Optional[Quantity] = None
    open: Optional[Quantity] = None
    release: Optional[Quantity] = None


COUPLINGS: tuple[Any, ...] = tuple(Coupling.__subclasses__())
HANDS: tuple[Any, ...] = tuple(Hand.__subclasses__())
