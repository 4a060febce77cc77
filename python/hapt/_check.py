"""The certificate of a world or network."""

from __future__ import annotations

from typing import Any, Optional, TypedDict, cast

from ._answer import Certificate


class Eigenvalue(TypedDict):
    """An eigenvalue of the map from one sample to the next, with its absolute value."""

    re: float
    im: float
    abs: float


class Mode(TypedDict):
    """A mode of the continuous system, and the sampled loop's mode nearest to it; frequencies in Hz."""

    frequency_hz: float
    damping_ratio: float
    discrete_frequency_hz: Optional[float]
    discrete_damping_ratio: Optional[float]


class Stability(TypedDict):
    """Stability: of the world with the puck held ("held"), or of the loop on its device without a hand ("free").

    Growth in 1/s, the critical period in s.
    """

    eigenvalues: list[Eigenvalue]
    spectral_radius: float
    growth_per_s: Optional[float]
    verdict: str
    critical_period_s: Optional[float]
    critical_period_reason: Optional[str]
    modes: list[Mode]


class Passivity(TypedDict):
    """Passivity of the loop for every passive hand; dampings in N·m·s/rad (linear: N·s/m), the speed in rad/s (m/s), `at_hz` in Hz."""

    required_damping: Optional[float]
    device_damping: float
    at_hz: Optional[float]
    passive: bool
    speed_max: Optional[float]
    proved: bool
    not_proved: list[str]


class Pattern(TypedDict):
    """A repeating pattern of intervals and delays in s, and the growth of the loop without a hand under it in 1/s."""

    intervals_s: list[float]
    delays_s: list[float]
    growth_per_s: float


class FreePatterns(TypedDict):
    """Stability of the loop without a hand under every pattern of intervals and delays.

    `verdict` is "proved", "broken" (`pattern` makes the motion grow) or "open".
    """

    verdict: str
    by: Optional[str]
    pattern: Optional[Pattern]
    reason: Optional[str]


class Uneven(TypedDict):
    """Passivity for all intervals, delays and devices within the world's tolerances; times in s, the rest as in `Passivity`."""

    interval_s: list[float]
    interval_max_s: float
    delay_s: list[float]
    lag_s: list[float]
    required_damping: Optional[float]
    passive: bool
    speed_max: Optional[float]
    proved: bool
    not_proved: list[str]
    free: FreePatterns


class TheoremUse(TypedDict):
    """A theorem of docs/theory.md, its claims about this world ("held", "free", "passive"), and its assumptions."""

    id: str
    claims: list[str]
    assumes: list[str]


class Check(Certificate):
    """The mapping of `hapt check --json` (docs/contract.md, section 7; of a network section 9). `print` shows the text of `hapt check`.

    It is true where everything is certified: `assert world.check()`. A network has no `status`, `theorems`, `held`, `free`, `passivity`
    and `uneven`: `["stations"]` has them for each station.
    """

    @property
    def certified(self) -> bool:
        """Whether theorems that cover the world prove it stable (held and free) and passive; of a network, each station and the whole."""
        return bool(self._fields["certified"])

    @property
    def status(self) -> str:
        """The verdict: "certified", "refuted", or "open" where nothing refutes the world and no theorem covers it."""
        return cast(str, self._fields["status"])

    @property
    def theorems(self) -> list[TheoremUse]:
        """The theorems that prove the claims."""
        return cast("list[TheoremUse]", self._fields["theorems"])

    @property
    def held(self) -> Stability:
        """Stability of the world without the device, with the puck held still."""
        return cast(Stability, self._fields["held"])

    @property
    def free(self) -> Stability:
        """Stability of world, estimator, delay, hold and device together, without a hand."""
        return cast(Stability, self._fields["free"])

    @property
    def passivity(self) -> Passivity:
        """Passivity of the loop for every passive hand, at even times."""
        return cast(Passivity, self._fields["passivity"])

    @property
    def uneven(self) -> Uneven:
        """Passivity and stability of the loop for uneven times and all devices within the tolerances."""
        return cast(Uneven, self._fields["uneven"])

    @property
    def remedies(self) -> Optional[dict[str, Any]]:
        """Changes that make the loop certified, or the margins of a certified loop; None with `check(remedies=False)`."""
        return cast("Optional[dict[str, Any]]", self._fields["remedies"])

    @property
    def notes(self) -> list[str]:
        """The conditions under which the numbers hold."""
        return cast("list[str]", self._fields["notes"])
