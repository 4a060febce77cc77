"""The certificate."""

from __future__ import annotations

from typing import Any, Optional, TypedDict, cast

from ._answer import Certificate


class Eigenvalue(TypedDict):
    """An eigenvalue of one sample's map."""

    re: float
    im: float
    abs: float


class Mode(TypedDict):
    """A mode of the continuous system, and the loop's nearest to it."""

    frequency_hz: float
    damping_ratio: float
    discrete_frequency_hz: Optional[float]
    discrete_damping_ratio: Optional[float]


class Stability(TypedDict):
    """The world with the puck held, without the device, or the loop on its device with no hand."""

    eigenvalues: list[Eigenvalue]
    spectral_radius: float
    growth_per_s: Optional[float]
    verdict: str
    critical_period_s: Optional[float]
    critical_period_reason: Optional[str]
    modes: list[Mode]


class Passivity(TypedDict):
    """The loop against every passive hand; dampings in N·m·s/rad (linear: N·s/m)."""

    required_damping: Optional[float]
    device_damping: float
    at_hz: Optional[float]
    passive: bool
    speed_max: Optional[float]
    proved: bool
    not_proved: list[str]


class Pattern(TypedDict):
    """Intervals and delays in s that repeat, and the growth of the hands-off loop under them in 1/s."""

    intervals_s: list[float]
    delays_s: list[float]
    growth_per_s: float


class FreePatterns(TypedDict):
    """The hands-off loop under every pattern of intervals and delays; `verdict` is "proved", "broken" or "open"."""

    verdict: str
    by: Optional[str]
    pattern: Optional[Pattern]
    reason: Optional[str]


class Uneven(TypedDict):
    """Passivity for all intervals, delays and devices that the world allows; times in s, dampings as in `Passivity`."""

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
    """A theorem of docs/theory.md, what it claims of this world ("held", "free", "passive"), and what it assumes."""

    id: str
    claims: list[str]
    assumes: list[str]


class Check(Certificate):
    """The mapping of `hapt check --json` (docs/contract.md, section 7; of a network section 9); `print` shows it as `hapt check` does.

    Its truth is whether all of it is certified: `assert world.check()`. A network has no `status`, `theorems`, `held`, `free`, `passivity`
    and `uneven`: each station's are below `["stations"]`.
    """

    @property
    def certified(self) -> bool:
        """Held, free and passive, each by a theorem that covers the world; every station by itself, and all passive together."""
        return bool(self._fields["certified"])

    @property
    def status(self) -> str:
        """One of "certified"; "open": nothing was found against it, and no theorem covers it; or "refuted"."""
        return cast(str, self._fields["status"])

    @property
    def theorems(self) -> list[TheoremUse]:
        """The theorems that make the claims."""
        return cast("list[TheoremUse]", self._fields["theorems"])

    @property
    def held(self) -> Stability:
        """The world without the device, the puck held still."""
        return cast(Stability, self._fields["held"])

    @property
    def free(self) -> Stability:
        """World, estimator, delay, hold and device together, no hand on the puck."""
        return cast(Stability, self._fields["free"])

    @property
    def passivity(self) -> Passivity:
        """The loop against every passive hand."""
        return cast(Passivity, self._fields["passivity"])

    @property
    def uneven(self) -> Uneven:
        """The loop against every passive hand under uneven time and tolerances."""
        return cast(Uneven, self._fields["uneven"])

    @property
    def remedies(self) -> Optional[dict[str, Any]]:
        """What makes the loop certified, or the margins of a certified one; None where they were not asked for."""
        return cast("Optional[dict[str, Any]]", self._fields["remedies"])

    @property
    def notes(self) -> list[str]:
        """Conditions that apply to the numbers."""
        return cast("list[str]", self._fields["notes"])
