//! The claim of passivity: what the theorems prove of a world at its times.

use hapt_model::{Coupling, Tolerances, World};

use crate::equations::delay::Delay;
use crate::equations::laws::Acceleration;
use crate::equations::positions::at_positions;
use crate::equations::slopes::at_puck;
use crate::error::Error;
use crate::passivity::quantisation::quantisation;
use crate::passivity::required::Cause;
use crate::passivity::supremum::{Wanted, rounded_requirement};
use crate::passivity::timing::Timing;
use crate::passivity::within::{beyond_friction, taken};
use crate::theorems::assumptions::{Omission, beyond, is_estimate, outside};
use crate::theorems::demands::{Demand, best, estimate, steepest_at_hz};
use crate::theorems::{Claimed, FRICTION, WITHIN_FRICTION};

/// The claim that a loop is passive against every passive hand.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Claim {
    /// The device damping that is enough by the best theorem, or the linear estimate; `None` where no finite one is known to suffice.
    pub required: Option<f64>,
    pub at_hz: Option<f64>,
    /// Why no finite damping is enough.
    pub cause: Option<Cause>,
    /// The theorems that make `required` enough.
    pub covered: Claimed,
    /// Whether something was found against it: less than the linear loop requires at some slopes.
    pub is_refuted: bool,
    /// The properties that no theorem covers: they keep the world from being certified.
    pub outside: Vec<String>,
    /// The speed below which the device's friction makes up for missing damping, rad/s (linear: m/s).
    pub speed_max: Option<f64>,
    /// Whether friction of the device takes torques of the world, so that the claim is about the rest, (T76).
    pub is_within_friction: bool,
    /// The device damping that the claim is about.
    pub device_damping: f64,
    /// The largest speed that the supervisor allows, where the file states it.
    overspeed: Option<f64>,
}

/// The world of a claim: the least device within its tolerances, one delay and one lag. Its times are in a [`Timing`].
pub(crate) fn least(world: &World) -> World {
    let mut least = world.clone();
    least.device.damping = world.device.damping_range()[0];
    least.device.set_friction(world.device.friction_range()[0]);
    least.device.tolerances = Tolerances::default();
    least.sampling.interval_max = None;
    least.sampling.delay_max = None;
    least
}

impl Claim {
    /// Of `world`, with one device, one delay and one lag, under `timing`.
    pub fn of(world: &World, timing: Timing, wanted: Wanted) -> Result<Claim, Error> {
        let rest = beyond_friction(world);
        let is_within_friction = taken(&world.couplings) > taken(&rest.couplings);
        let world = &*rest;
        let device_damping = world.device.damping;
        let demanded = best(world, timing, wanted)?;
        let mut reasons = outside(world);
        let mut is_covered = !is_estimate(world);
        let mut is_refuted = false;
        let (demand, is_estimated) = match demanded.demand {
            Demand::Outside(why) => {
                reasons.push(why);
                is_covered = false;
                (estimate(world, timing, wanted)?, true)
            }
            demand @ (Demand::Enough { .. } | Demand::Never { .. }) => (demand, false),
        };
        let (required, at_hz, cause) = match demand {
            Demand::Enough { damping, at_hz, is_least } => {
                let required = rounded_requirement(device_damping, damping);
                if required > device_damping {
                    is_refuted = is_least && !is_estimated || lacks(world, timing, wanted)?;
                }
                (Some(required), at_hz, None)
            }
            Demand::Never { cause, at_hz } => {
                is_refuted = !is_estimated || lacks(world, timing, wanted)?;
                (None, at_hz, Some(cause))
            }
            Demand::Outside(why) => {
                reasons.extend((!reasons.contains(&why)).then_some(why));
                (None, None, None)
            }
        };
        let at_hz = if wanted == Wanted::Value { steepest_at_hz(world, timing)?.unwrap_or(at_hz) } else { at_hz };
        let mut theorems = demanded.theorems;
        theorems.extend(is_within_friction.then_some(&WITHIN_FRICTION));
        let covered = Claimed::by(&theorems).when(is_covered);
        let speed_max = match required {
            Some(required) if covered.holds() && required > device_damping => speed_max(world, timing, required)?,
            _ => None,
        };
        let kept = [world.safety.overspeed, world.safety.velocity.filter(|_| world.safety.overspeed.is_some())];
        let overspeed = kept.into_iter().flatten().reduce(f64::max);
        Ok(Claim {
            required,
            at_hz,
            cause,
            covered,
            is_refuted,
            outside: reasons,
            speed_max,
            is_within_friction,
            device_damping,
            overspeed,
        })
    }

    /// Whether the device has the damping, or its friction makes up for it up to a speed that the supervisor keeps.
    pub fn passive(&self) -> Claimed {
        let is_enough = self.required.is_some_and(|b| b <= self.device_damping);
        if is_enough {
            return self.covered.clone();
        }
        self.covered.and(&Claimed::by(&[&FRICTION]).when(self.is_by_friction()))
    }

    /// Whether damping is missing, and friction makes up for it up to a speed that the supervisor keeps.
    pub fn is_by_friction(&self) -> bool {
        self.covered.holds() && self.speed_max.zip(self.overspeed).is_some_and(|(most, kept)| kept <= most)
    }

    /// The required damping, where theorems cover the world with its couplings, delay, estimator and times.
    pub fn proved_damping(&self) -> Option<f64> {
        self.required.filter(|_| self.covered.holds() && self.outside.is_empty())
    }

    /// How far the claim is from its edge, over the damping of the device: 0 or less where it holds for the couplings and times of the world.
    pub fn excess(&self) -> f64 {
        let Some(required) = self.proved_damping() else { return 1.0 };
        let damping = self.device_damping;
        let lacks = match required > damping {
            true => ((required - damping) / damping).clamp(f64::MIN_POSITIVE, 1.0),
            false if damping > 0.0 => (required - damping) / damping,
            false => 0.0,
        };
        match self.speed_max.zip(self.overspeed) {
            Some((most, kept)) if lacks > 0.0 => lacks.min(kept / most - 1.0),
            _ => lacks,
        }
    }

    /// The claim, with what is left out of it: counts, levels, the motor's limit and friction of the device.
    pub(super) fn beyond(&self, world: &World, timing: Timing) -> Result<Vec<Omission>, Error> {
        beyond(&beyond_friction(world), timing, self.required.map(|b| b.max(self.device_damping)))
    }
}

/// Whether the linear loop needs more damping at slopes that the world has at one position: a bound that is only enough refutes nothing.
fn lacks(world: &World, timing: Timing, wanted: Wanted) -> Result<bool, Error> {
    // The linear loop refutes nothing of a torque with a limit: friction may take it while it is small, and it does not grow beyond the limit.
    let is_open = |c: &Coupling| c.limit.is_some() && Acceleration::of(&c.law).is_some();
    let mut world = world.clone();
    if world.device.least_friction() > 0.0 {
        world.couplings.retain(|c| !is_open(c));
    }
    let world = &world;
    for near in at_positions(world) {
        let lacks = match estimate(&near, timing, wanted)? {
            Demand::Enough { damping, is_least, .. } => {
                is_least && rounded_requirement(world.device.damping, damping) > world.device.damping
            }
            Demand::Never { .. } => true,
            Demand::Outside(_) => false,
        };
        if lacks {
            return Ok(true);
        }
    }
    Ok(false)
}

/// (T66): the speed up to which friction makes up for missing damping; `None` where it does at none.
///
/// In an interval in which the puck moves by δ the loop gives at most (b_required - b) δ²/T and counts, dampers and levels at
/// most c |δ|, and friction takes f |δ|. The supervisor sees the speed to within a count at either end of a sample.
fn speed_max(world: &World, timing: Timing, required: f64) -> Result<Option<f64>, Error> {
    let delay = Delay::of_loop(&world.sampling)?;
    let is_whole = timing.is_even() && delay.fraction == 0.0 && timing.lag[1] == 0.0;
    if !(is_whole || timing.is_at_once()) {
        return Ok(None);
    }
    let count = world.count().unwrap_or(0.0);
    let [stiffness, _] = at_puck(world, &world.couplings)?;
    let cost = 0.5 * stiffness * count + quantisation(world)?.least_friction;
    let speed =
        (world.device.least_friction() - cost) / (required - world.device.damping) - 2.0 * count / timing.period;
    Ok((speed > 0.0 && speed.is_finite()).then_some(speed))
}
