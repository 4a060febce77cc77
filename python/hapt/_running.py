"""The loop without its device, and the device without its loop, stepped sample by sample from other simulators."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional

from . import _hapt
from ._system import a_scenario

if TYPE_CHECKING:
    from ._world import World


class Loop:
    """The loop of a world. Call `step` once a period with the puck's true position and velocity.

    `copy.copy`, `copy.deepcopy` and `pickle` keep the state to the bit: the copy continues with the same torques.

    >>> import hapt
    >>> world = hapt.load('''
    ... loop.period = "1 ms"
    ... device.inertia = "6.4e-4 kg m^2"
    ... [[couplings]]
    ... kind = "spring"
    ... between = ["puck", "ground"]
    ... stiffness = "2 N m/rad"
    ... ''')
    >>> loop = world.loop()
    >>> loop.step(0.1, 0.0)
    -0.2
    """

    def __init__(self, world: World, native: Optional[_hapt.Loop] = None) -> None:
        self._world = world
        self._native = world._native.running() if native is None else native

    def step(self, position: float, velocity: float = 0.0) -> float:
        """Takes one sample, and returns the couplings' torque on the puck in N·m (linear: N), before levels and limit (column `torque_Nm`).

        `position` in rad (linear: m), `velocity` in rad/s (m/s). Only the estimator "exact" uses the velocity; the others derive their own.
        Raises TypeError for an argument that is no number, ValueError for one that is not finite, and OverflowError where the loop's state
        stops being finite, as a run ends there (`Run.ended`): then only `reset` makes it usable again.
        """
        try:
            return self._native.step(position, velocity)
        except TypeError as error:
            raise TypeError(f"position and velocity: {error}") from None

    def reset(self) -> None:
        """Sets the state to the beginning: the bodies at their initial state, no earlier samples."""
        self._native.reset()

    @property
    def command(self) -> float:
        """The torque commanded to the motor at the last sample, after levels and limit, in N·m (linear: N)."""
        return self._native.command

    @property
    def measured(self) -> tuple[float, float]:
        """The puck's measured position and estimated velocity at the last sample, in rad and rad/s (linear: m and m/s)."""
        return self._native.measured

    @property
    def period(self) -> float:
        """The loop's period T in s."""
        return self._native.period

    @property
    def bodies(self) -> dict[str, tuple[float, float]]:
        """Position and velocity of each body at the last sample, in rad and rad/s (linear: m and m/s)."""
        return {name: (position, velocity) for name, position, velocity in self._native.bodies}

    def __copy__(self) -> Loop:
        return Loop(self._world, self._native.copy())

    def __deepcopy__(self, memo: dict[int, Any]) -> Loop:
        return self.__copy__()

    def __reduce__(self) -> tuple[Any, ...]:
        return (_loop, (self._world, self._native.get_state()))


def _loop(world: World, state: bytes) -> Loop:
    loop = Loop(world)
    loop._native.set_state(state)
    return loop


class Device:
    """The device of a world, integrated exactly: inertia, viscous damping, Coulomb friction, delay, with the hand of a scenario or without.

    `copy.copy`, `copy.deepcopy` and `pickle` keep the state to the bit: the copy continues with the same motion.
    """

    def __init__(self, world: World, scenario: Optional[str] = None, native: Optional[_hapt.Device] = None) -> None:
        self._world = world
        self._scenario = scenario
        self._native = world._native.device(None if scenario is None else a_scenario(scenario)) if native is None else native

    def step(self, torque: float) -> tuple[float, float]:
        """Commands `torque` (N·m; linear: N) to the motor for a period, and returns the puck's position and velocity at the period's end.

        Position in rad (linear: m), velocity in rad/s (m/s). The device applies no levels and no limit: `Loop.command` has both. Raises
        TypeError for a torque that is no number, ValueError for one that is not finite, and OverflowError where the puck's motion stops being
        finite: then only `reset` makes it usable again.
        """
        try:
            return self._native.step(torque)
        except TypeError as error:
            raise TypeError(f"torque: {error}") from None

    def reset(self) -> None:
        """Sets the state to the beginning: at rest at 0, or where the scenario's hand begins."""
        self._native.reset()

    @property
    def puck(self) -> tuple[float, float]:
        """The puck's true position and velocity, in rad and rad/s (linear: m and m/s)."""
        return self._native.puck

    @property
    def handle(self) -> Optional[tuple[float, float]]:
        """The true position and velocity of a handle on a shaft, in the units of `puck`; None where the puck is the handle."""
        return self._native.handle

    @property
    def applied(self) -> float:
        """The torque that the motor applies, in N·m (linear: N)."""
        return self._native.applied

    def __copy__(self) -> Device:
        return Device(self._world, self._scenario, self._native.copy())

    def __deepcopy__(self, memo: dict[int, Any]) -> Device:
        return self.__copy__()

    def __reduce__(self) -> tuple[Any, ...]:
        return (_device, (self._world, self._scenario, self._native.get_state()))


def _device(world: World, scenario: Optional[str], state: bytes) -> Device:
    device = Device(world, scenario)
    device._native.set_state(state)
    return device
