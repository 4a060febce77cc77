//! The verdict on passivity at even samples.

use hapt_model::World;
use serde::Serialize;

use crate::error::Error;
use crate::passivity::required::Cause;
use crate::passivity::supremum::Wanted;
use crate::passivity::timing::Timing;
use crate::theorems::Claimed;
use crate::theorems::assumptions::Omission;
use crate::theorems::claim::Claim;

/// The result of the passivity analysis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Passivity {
    /// The device damping that is enough by the theorem that requires the least, N·m·s/rad (linear: N·s/m); of a linear loop the least
    /// there is. Where no theorem covers the world, the worst of the linear loops at its flat and steep slopes. `None` where no finite
    /// damping is known to suffice.
    pub required_damping: Option<f64>,
    /// The device damping, in the same unit.
    pub device_damping: f64,
    /// The lowest frequency that requires all of it; 0 when it is the limit toward 0, `None` when all frequencies require the same.
    pub at_hz: Option<f64>,
    /// Whether a theorem claims that the loop is passive: the device has the damping, or `speed_max` is kept.
    pub passive: Claimed,
    /// The speed below which the device's friction makes up for the damping that is missing, rad/s (linear: m/s); `None` where none is
    /// missing, or where friction does not. A loop that `safety.overspeed` keeps below it is passive.
    pub speed_max: Option<f64>,
    /// Whether the required damping is proved for the whole loop, not only for its linear part.
    pub proved: Claimed,
    /// The reasons why it is not proved, one sentence each.
    pub not_proved: Vec<String>,
    /// The properties of the device that are left out, each in a few words and once.
    #[serde(skip)]
    pub omits: Vec<&'static str>,
    /// Why `required_damping` is `None`.
    #[serde(skip)]
    pub cause: Option<Cause>,
    /// Whether couplings, delay, estimator and times are all covered.
    #[serde(skip)]
    pub is_covered: bool,
    /// Whether something was found against it.
    #[serde(skip)]
    pub is_refuted: bool,
    /// The damping is lacking in the linear loop, and friction makes up for it: `speed_max` is kept.
    #[serde(skip)]
    pub by_friction: bool,
    /// The device's friction takes torques of the world, (T76); `free` includes these torques and no friction.
    #[serde(skip)]
    pub is_within_friction: bool,
}

impl Passivity {
    pub(super) fn new(claim: &Claim, beyond: Vec<Omission>) -> Passivity {
        let mut omits: Vec<&'static str> = Vec::new();
        for Omission { what, .. } in &beyond {
            if !omits.contains(what) {
                omits.push(what);
            }
        }
        let mut not_proved = claim.outside.clone();
        not_proved.extend(beyond.into_iter().map(|omission| omission.why));
        Passivity {
            required_damping: claim.required,
            device_damping: claim.device_damping,
            at_hz: claim.at_hz,
            passive: claim.passive(),
            speed_max: claim.speed_max,
            proved: claim.covered.clone().when(not_proved.is_empty()),
            not_proved,
            omits,
            cause: claim.cause,
            is_covered: claim.covered.holds() && claim.outside.is_empty(),
            is_refuted: claim.is_refuted,
            by_friction: claim.is_by_friction(),
            is_within_friction: claim.is_within_friction,
        }
    }

    /// The required damping, where theorems cover the world.
    pub fn proved_damping(&self) -> Option<f64> {
        self.required_damping.filter(|_| self.is_covered)
    }

    /// Whether it is passive, and all of couplings, delay, estimator and times are covered.
    pub fn is_certified(&self) -> bool {
        self.passive.holds() && self.is_covered
    }
}

/// Whether the loop of a world is passive on its device against every passive hand.
///
/// # Errors
/// [`Error::InFlight`] for a delay of too many periods, [`Error::Search`], and as [`crate::held()`].
pub fn passivity(world: &World) -> Result<Passivity, Error> {
    let timing = Timing::even(world);
    let claim = Claim::of(world, timing, Wanted::Value)?;
    let beyond = claim.beyond(world, timing)?;
    Ok(Passivity::new(&claim, beyond))
}

/// Only [`Passivity::required_damping`].
///
/// # Errors
/// As [`passivity`].
pub fn required_damping(world: &World) -> Result<Option<f64>, Error> {
    Ok(Claim::of(world, Timing::even(world), Wanted::Least)?.required)
}
