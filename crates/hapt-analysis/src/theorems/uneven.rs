//! Passivity under uneven time: for every pattern of intervals and delays within the keys, and every device within its tolerances.

use hapt_model::World;
use serde::Serialize;

use crate::error::Error;
use crate::passivity::supremum::Wanted;
use crate::passivity::timing::Timing;
use crate::theorems::Claimed;
use crate::theorems::claim::{Claim, least};
use crate::theorems::free::FreePatterns;
use crate::theorems::passivity::Passivity;

/// The passivity of a loop whose intervals, delays and device are known within bounds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Uneven {
    /// The least and the largest interval between two samples, s: both are the period where samples are even.
    pub interval_s: [f64; 2],
    /// The longest interval between two samples, s.
    pub interval_max_s: f64,
    /// The least and the largest delay, s.
    pub delay_s: [f64; 2],
    /// The least and the largest time constant of the motor, s.
    pub lag_s: [f64; 2],
    /// A device damping that is enough for all of it, N·m·s/rad (linear: N·s/m); the least one where it is known. `None` where no
    /// finite damping is known to suffice.
    pub required_damping: Option<f64>,
    /// Whether a theorem claims that it is passive with the least device.
    pub passive: Claimed,
    /// As [`Passivity::speed_max`].
    pub speed_max: Option<f64>,
    /// Whether the required damping is proved for the whole loop, not only for its linear part.
    pub proved: Claimed,
    /// The reasons why it is not proved, one sentence each.
    pub not_proved: Vec<String>,
    /// The properties of the device that are left out, each in a few words and once.
    #[serde(skip)]
    pub omits: Vec<&'static str>,
    /// The hands-off loop under every such pattern.
    pub free: FreePatterns,
    /// The least damping of the device, in the same unit.
    #[serde(skip)]
    pub device_damping: f64,
    /// Whether the file states any of it. Otherwise it is the verdict of [`crate::passivity()`].
    #[serde(skip)]
    pub is_stated: bool,
    /// Whether the intervals are even and the delay is one, so that only the device is uncertain.
    #[serde(skip)]
    pub is_even: bool,
    /// Whether couplings, delay, estimator and times are all covered.
    #[serde(skip)]
    pub is_covered: bool,
    /// The damping is lacking in the linear loop, and friction makes up for it.
    #[serde(skip)]
    pub by_friction: bool,
    /// As [`Passivity::is_within_friction`].
    #[serde(skip)]
    pub is_within_friction: bool,
    /// Whether something was found against it.
    #[serde(skip)]
    pub is_refuted: bool,
}

/// Whether a world states bounds of its times, or tolerances of its device.
pub(crate) fn is_stated(world: &World) -> bool {
    let timing = Timing::of(world);
    let device = &world.device;
    let wide = |[least, most]: [f64; 2]| least != most;
    let friction = device.frictions_range().into_iter().any(wide);
    !timing.is_even() || wide(device.lag_range()) || wide(device.damping_range()) || friction
}

/// The passivity of a world under all that its file allows.
///
/// # Errors
/// As [`crate::passivity()`].
pub fn uneven(world: &World) -> Result<Uneven, Error> {
    let timing = Timing::of(world);
    let world_of_claim = least(world);
    let claim = Claim::of(&world_of_claim, timing, Wanted::Value)?;
    let beyond = claim.beyond(&world_of_claim, timing)?;
    let found = Passivity::new(&claim, beyond);
    let has_damping = claim.required.is_some_and(|b| b <= claim.device_damping);
    let free = match found.is_certified() && has_damping {
        true => FreePatterns::by_passivity(&found.passive),
        false => FreePatterns::of(world)?,
    };
    Ok(Uneven {
        interval_s: timing.intervals(),
        interval_max_s: timing.longest,
        delay_s: timing.delay,
        lag_s: timing.lag,
        required_damping: found.required_damping,
        is_covered: found.is_covered,
        by_friction: found.by_friction,
        is_within_friction: found.is_within_friction,
        is_refuted: found.is_refuted,
        passive: found.passive,
        speed_max: found.speed_max,
        proved: found.proved,
        not_proved: found.not_proved,
        omits: found.omits,
        free,
        device_damping: claim.device_damping,
        is_stated: is_stated(world),
        is_even: timing.is_even(),
    })
}

impl Uneven {
    /// The required damping, where theorems cover the world.
    pub fn proved_damping(&self) -> Option<f64> {
        self.required_damping.filter(|_| self.is_covered)
    }

    /// Whether it is passive, and all of couplings, delay, estimator and times are covered.
    pub fn is_certified(&self) -> bool {
        self.passive.holds() && self.is_covered
    }
}

/// Only [`Uneven::required_damping`].
///
/// # Errors
/// As [`uneven`].
pub fn uneven_damping(world: &World) -> Result<Option<f64>, Error> {
    Ok(Claim::of(&least(world), Timing::of(world), Wanted::Least)?.required)
}
