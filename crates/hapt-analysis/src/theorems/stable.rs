//! The claims that a loop is stable: held, and hands-off.

use std::borrow::Cow;

use hapt_model::{Coupling, World};

use crate::equations::discrete::keeps_energy;
use crate::equations::laws::{self, Acceleration, is_nonlinear};
use crate::equations::positions::at_positions;
use crate::error::Error;
use crate::passivity::within::beyond_least_friction;
use crate::stability::free::free_growth;
use crate::stability::{Stability, Verdict};
use crate::theorems::assumptions::{may_saturate, nonlinear_estimator};
use crate::theorems::{Claimed, FREE_LINEAR, FREE_PASSIVE, HELD_ENERGY, HELD_LINEAR};

fn has_nonlinear_bodies(world: &World) -> bool {
    world.couplings.iter().any(|c| is_nonlinear(c) && laws::at_body(c))
}

/// Whether eigenvalues decide how the puck moves. They do not with nonlinear laws, gravity or cogging, friction that changes with the
/// position or the speed, stops, an estimator that is not linear, an origin that slips, a torque with a state at the motor's limit, or an uncertain inertia.
fn is_linear(world: &World) -> bool {
    world.device.is_plain()
        && world.device.tolerances.inertia == 0.0
        && world.sampling.recentre.is_none()
        && !world.couplings.iter().any(is_nonlinear)
        && nonlinear_estimator(world).is_none()
        && !winds_up(world)
}

/// Whether the motor's limit may cut a torque with a state, an integral term's or one along the acceleration: a swing that reaches the limit may
/// grow though small ones die out.
pub(super) fn winds_up(world: &World) -> bool {
    let has_state = |c: &Coupling| laws::integral_gain(&c.law) > 0.0 || Acceleration::of(&c.law).is_some();
    may_saturate(world) && world.couplings.iter().any(has_state)
}

/// Whether a theorem covers the held world: the linear step by its eigenvalues, a discrete-gradient step by its energy.
pub(crate) fn is_held_covered(world: &World) -> bool {
    keeps_energy(world.sampling.method) || !has_nonlinear_bodies(world)
}

/// The claim that the held world, which was found to be `held`, does not grow; `passive` is the claim of passivity.
pub(crate) fn held_claim(world: &World, held: &Stability, passive: &Claimed) -> Claimed {
    let is_stable = held.verdict != Verdict::Unstable;
    // The puck still moves on the shaft of a handle that is held: eigenvalues do not decide the effect of nonlinear laws and of the
    // device on it.
    if world.device.handle.is_some() && !is_linear(world) {
        return passive.and(&Claimed::by(&[&FREE_PASSIVE])).when(is_stable && is_held_covered(world));
    }
    // The slip of the origin follows the bodies' torque, and the eigenvalues are of an origin that stays.
    if world.sampling.recentre.is_some() && !world.bodies.is_empty() {
        return passive.and(&Claimed::by(&[&HELD_ENERGY])).when(is_stable);
    }
    let theorem = if has_nonlinear_bodies(world) { &HELD_ENERGY } else { &HELD_LINEAR };
    Claimed::by(&[theorem]).when(is_stable && is_held_covered(world))
}

/// Whether the hands-off loop, found to be `free`, grows: by its eigenvalues at slopes that the world has at one position, without the torques that
/// the device's friction takes.
///
/// # Errors
/// As [`crate::free`].
pub(crate) fn grows(world: &World, free: &Stability) -> Result<bool, Error> {
    if free.verdict != Verdict::Unstable {
        return Ok(false);
    }
    let rest = beyond_least_friction(world);
    for near in at_positions(rest.as_ref().unwrap_or(world)) {
        // What `free` has found.
        if rest.is_none() && matches!(near, Cow::Borrowed(_)) || Verdict::of(free_growth(&near)?) == Verdict::Unstable {
            return Ok(true);
        }
    }
    Ok(false)
}

/// The claim that the hands-off loop, found to be `free`, does not grow; `passive` is the claim of passivity, `by_friction` whether it rests on
/// the device's friction, which `free` leaves out.
pub(crate) fn free_claim(world: &World, free: &Stability, passive: &Claimed, by_friction: bool) -> Claimed {
    let is_stable = free.verdict != Verdict::Unstable;
    let claim = match is_linear(world) && is_stable {
        true => Claimed::by(&[&FREE_LINEAR]),
        false => passive.and(&Claimed::by(&[&FREE_PASSIVE])),
    };
    claim.when(is_stable || by_friction)
}
