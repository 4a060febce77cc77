//! Passivity under uneven time: for every pattern of intervals and delays within the keys, and every device within its tolerances.

use hapt_model::{Coupling, EstimatorKind, World};
use serde::Serialize;

use crate::equations::laws::{self, Kind, is_nonlinear};
use crate::equations::slopes::at_puck;
use crate::error::Error;
use crate::passivity::proof;
use crate::passivity::quantisation::quantisation;
use crate::passivity::required::{
    Requirement, largest_gain, late_requirement, linear_requirement_wanted, requirement_wanted,
};
use crate::passivity::supremum::{Wanted, requirement_beside};
use crate::passivity::timing::Timing;
use crate::stability::patterns::{FreePatterns, patterns};

/// The passivity of a loop whose intervals, delays and device are known within bounds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Uneven {
    /// The longest interval between two samples, s.
    pub interval_max_s: f64,
    /// The least and the largest delay, s.
    pub delay_s: [f64; 2],
    /// The least and the largest time constant of the motor, s.
    pub lag_s: [f64; 2],
    /// A device damping that is enough for all of it, N·m·s/rad (linear: N·s/m); the least one where it is known. `None` where no
    /// finite damping is known to suffice.
    pub required_damping: Option<f64>,
    /// Whether the least damping of the device is enough.
    pub passive: bool,
    /// Whether the verdict is proved for the whole loop, not only for its linear part.
    pub proved: bool,
    /// The reasons why it is not proved, one sentence each.
    pub not_proved: Vec<String>,
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
}

/// Whether a world states bounds of its times, or tolerances of its device.
pub(crate) fn is_stated(world: &World) -> bool {
    let timing = Timing::of(world);
    let device = &world.device;
    let wide = |[least, most]: [f64; 2]| least != most;
    !timing.is_even() || wide(device.lag_range()) || wide(device.damping_range()) || wide(device.friction_range())
}

/// The passivity of a world under all that its file allows.
///
/// # Errors
/// As [`crate::passivity()`].
pub fn uneven(world: &World) -> Result<Uneven, Error> {
    let timing = Timing::of(world);
    let (required, not_proved) = Claim::of(world, timing, Wanted::Value)?.with_reasons()?;
    let [least, _] = world.device.damping_range();
    let passive = required.is_some_and(|b| b <= least);
    let free = if passive && (not_proved.is_empty() || is_as_certified(world)) {
        FreePatterns::by_passivity(world)
    } else {
        patterns(world)?
    };
    Ok(Uneven {
        interval_max_s: timing.longest,
        delay_s: timing.delay,
        lag_s: timing.lag,
        required_damping: required,
        passive,
        proved: not_proved.is_empty(),
        not_proved,
        free,
        device_damping: least,
        is_stated: is_stated(world),
        is_even: timing.is_even(),
    })
}

/// Whether passivity is that of the loop hands-off: linear, with the estimator that is certified. Counts, levels and limits are no part of
/// `free`.
pub(crate) fn is_as_certified(world: &World) -> bool {
    let estimator = world.sampling.estimator;
    let changes = matches!(estimator, EstimatorKind::Foaw | EstimatorKind::FoawBest);
    let undamped = || at_puck(world, &world.couplings).is_ok_and(|[_, damping]| damping == 0.0);
    let is_linear = !world.couplings.iter().any(is_nonlinear);
    is_linear && !changes && (estimator != EstimatorKind::Exact || undamped())
}

/// [`Uneven::required_damping`] alone.
///
/// # Errors
/// As [`uneven`].
pub fn uneven_damping(world: &World) -> Result<Option<f64>, Error> {
    uneven_damping_wanted(Wanted::Least, world)
}

/// The same, or a bound of it as is `wanted`.
pub(crate) fn uneven_damping_wanted(wanted: Wanted, world: &World) -> Result<Option<f64>, Error> {
    Ok(Claim::of(world, Timing::of(world), wanted)?.required())
}

/// What makes the claim.
enum Ground {
    /// The requirement at even samples, times this.
    Even(Requirement, f64),
    /// A bound, or the reason why none is known.
    Bound(Result<f64, String>),
}

struct Claim {
    /// The world with the least device: even samples, one delay.
    world: World,
    timing: Timing,
    ground: Ground,
}

impl Claim {
    fn of(world: &World, timing: Timing, wanted: Wanted) -> Result<Claim, Error> {
        let mut least = world.clone();
        least.device.damping = world.device.damping_range()[0];
        least.device.friction = world.device.friction_range()[0];
        least.device.tolerances = hapt_model::Tolerances::default();
        least.sampling.interval_max = None;
        least.sampling.delay_max = None;
        let one_lag = timing.lag[0] == timing.lag[1];
        let ground = if timing.is_even() && one_lag {
            Ground::Even(linear_requirement_wanted(wanted, &least)?, 1.0)
        } else if timing.is_at_once() {
            Ground::Even(linear_requirement_wanted(wanted, &least)?, timing.longest / timing.period)
        } else {
            Ground::Bound(bound(&least, timing, wanted)?)
        };
        Ok(Claim { world: least, timing, ground })
    }

    fn required(&self) -> Option<f64> {
        let required = match &self.ground {
            Ground::Even(found, stretch) => found.damping.ok().map(|b| b * stretch),
            Ground::Bound(found) => found.as_ref().ok().copied(),
        };
        required.map(|b| requirement_beside(self.world.device.damping, b))
    }

    /// The required damping, and the reasons why the claim is not proved of the whole loop.
    fn with_reasons(mut self) -> Result<(Option<f64>, Vec<String>), Error> {
        let required = self.required();
        let reasons = match &self.ground {
            Ground::Even(found, stretch) => {
                // The energies are those of even samples and a device with less damping.
                self.world.device.damping /= stretch;
                proof::unproved(&self.world, found, *stretch)?
            }
            Ground::Bound(Err(reason)) => vec![reason.clone()],
            Ground::Bound(Ok(_)) => bound_reasons(&self.world, self.timing, required)?,
        };
        Ok((required, reasons))
    }
}

/// The world with one delay or none, and one lag or none.
fn fixed(world: &World, delay: bool, lag: Option<f64>) -> World {
    let mut fixed = world.clone();
    if !delay {
        fixed.sampling.delay = hapt_model::Delay::Seconds(0.0);
    }
    fixed.device.lag = lag.unwrap_or(0.0);
    fixed
}

/// A device damping that is enough for the linear loop of `world` under `timing`, or why none is known.
fn bound(world: &World, timing: Timing, wanted: Wanted) -> Result<Result<f64, String>, Error> {
    if world.sampling.bodies_every > 1 {
        return Ok(Err(
            "bodies that step every n-th sample are proved only where the torque comes at once: leave out loop.delay, \
                       loop.delay_max and device.lag"
                .into(),
        ));
    }
    // Coulomb friction and growth have no requirement under any timing.
    let even = linear_requirement_wanted(wanted, &fixed(world, false, None))?;
    if even.damping.is_err() {
        return Ok(Err("the loop has no finite required damping at even samples and without delay".into()));
    }
    let linear = of_linear(world, timing, (&world.couplings, wanted))?;
    if !world.bodies.is_empty() {
        return Ok(linear);
    }
    let laws = timing.of_laws(at_puck(world, &world.couplings)?)?;
    Ok(Ok(linear.map_or(laws, |linear| linear.min(laws))))
}

/// The bound of the linear loop of `couplings`, nonlinear ones at their steepest slopes.
fn of_linear(
    world: &World,
    timing: Timing,
    (couplings, wanted): (&[Coupling], Wanted),
) -> Result<Result<f64, String>, Error> {
    if timing.lag[1] > 0.0 && timing.is_even() {
        let middle = 0.5 * (timing.lag[0] + timing.lag[1]);
        let found = requirement_wanted(wanted, &fixed(world, true, Some(middle)), couplings)?.damping;
        let gain = largest_gain(wanted, world, couplings)?;
        let all = found.ok().zip(gain.and_then(|gain| timing.of_lag(gain))).map(|(b, more)| b + more);
        return Ok(all.ok_or_else(|| {
            "a lag of the motor that is known within bounds has no proof with undamped bodies, or where it may be 0"
                .into()
        }));
    }
    if timing.lag[1] > 0.0 {
        return Ok(Err(
            "with bodies the motor's lag is proved at even samples and a fixed delay only, since short intervals let \
                       the bodies take any number of steps while the motor's torque still follows: leave out \
                       loop.interval_max and loop.delay_max, or device.lag"
                .into(),
        ));
    }
    if !timing.arrives_in_time() {
        return Ok(Err(
            "with bodies a delay that varies, or stays while intervals vary, is proved up to one period only".into(),
        ));
    }
    let parts = timing.delay.map(|delay| delay / timing.longest);
    let found = late_requirement(wanted, world, couplings, (timing.longest, parts))?;
    Ok(found.ok_or_else(|| {
        "an undamped mode of the world has no proof with a delay that varies, or stays while intervals vary: \
                       a damper from the bodies to ground would take energy from it"
            .into()
    }))
}

/// The reasons why the bound of the linear loop is not proved of the whole one.
fn bound_reasons(world: &World, timing: Timing, required: Option<f64>) -> Result<Vec<String>, Error> {
    let claimed = required.map(|b| b.max(world.device.damping));
    let falls_short = |bound: f64| claimed.is_some_and(|b| b < bound * (1.0 - 1e-9));
    let mut reasons = proof::reasons_at_any_time(world);
    let nonlinear: Vec<Coupling> = world.couplings.iter().filter(|c| is_nonlinear(c)).cloned().collect();
    if world.sampling.estimator == EstimatorKind::LowPass && !nonlinear.is_empty() {
        reasons.push(proof::LOW_PASS.to_string());
    }
    if nonlinear.iter().any(|c| Kind::of(c) == Kind::Lugre) {
        reasons.push(proof::BRISTLE.to_string());
    }
    if proof::may_saturate(world) {
        if !world.bodies.is_empty() {
            reasons.push(proof::SATURATION.to_string());
        } else {
            let bound = timing.of_laws(at_puck(world, &world.couplings)?)?;
            if falls_short(bound) {
                reasons.push(proof::saturated_from(world, bound));
            }
        }
    }
    if nonlinear.iter().any(laws::at_body) {
        reasons.push(
            "nonlinear couplings at bodies are proved only where the torque comes at once: with a delay or a lag of the motor the \
             energy theorem does not hold"
                .to_string(),
        );
    } else if !nonlinear.is_empty() {
        let rest: Vec<Coupling> = world.couplings.iter().filter(|c| !is_nonlinear(c)).cloned().collect();
        let of_rest = if world.bodies.is_empty() {
            timing.of_laws(at_puck(world, &rest)?)?
        } else {
            of_linear(world, timing, (&rest, Wanted::Value))?.unwrap_or(f64::INFINITY)
        };
        let bound = of_rest + timing.of_laws(at_puck(world, &nonlinear)?)?;
        if falls_short(bound) {
            reasons.push(proof::nonlinear_from(world, bound));
        }
    }
    // Counts: as at even samples, with the damping of the longest interval.
    let mut stretched = world.clone();
    stretched.device.damping *= timing.period / timing.longest;
    reasons.extend(proof::friction(world, &quantisation(&stretched)?));
    Ok(reasons)
}
