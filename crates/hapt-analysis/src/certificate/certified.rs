//! The certificate: held, free and passive, each by a theorem that covers the world.

use hapt_model::World;

use crate::error::Error;
use crate::passivity::supremum::{SPARE, Wanted};
use crate::passivity::timing::Timing;
use crate::stability::Verdict;
use crate::stability::clamped::held_world_growth;
use crate::stability::free::free_growth;
use crate::theorems::claim::{Claim, least};
use crate::theorems::stable::is_held_covered;
use crate::theorems::uneven::is_stated;
use crate::until::is_over;

/// Relative accuracy of a bound that is far from the damping.
const ROUGH: f64 = 1e-3;

/// Whether `check` certifies the world. A world that cannot be analysed is not certified.
pub fn is_certified(world: &World) -> bool {
    excess_or_sign(world, 0.0, true) <= 0.0
}

/// The required damping less that of the device, over that of the device: 0 or less where `check` certifies the world, otherwise above
/// 0, and 1 where no damping suffices, or the world cannot be analysed.
pub fn excess(world: &World) -> f64 {
    excess_below(world, 0.0)
}

/// [`excess`], in less time. Hands-off is a special case of a passive hand, so a loop that is passive with a margin
/// is stable hands-off: below -`spare` the free loop is not analysed. Where passivity is that of the free loop itself, [`SPARE`] is
/// enough always.
pub(crate) fn excess_below(world: &World, spare: f64) -> f64 {
    excess_or_sign(world, spare, false)
}

/// [`excess_below`]; with `sign`, any number of the same sign.
fn excess_or_sign(world: &World, spare: f64, sign: bool) -> f64 {
    let found = || -> Result<f64, Error> {
        if is_over() {
            return Err(Error::Stopped);
        }
        // The cheapest first.
        if !is_held_covered(world) || Verdict::of(held_world_growth(world)?) == Verdict::Unstable {
            return Ok(1.0);
        }
        // The worst of all that the file allows: the device has its least damping.
        let mut excess = f64::NEG_INFINITY;
        let mut by_friction = false;
        let mut take = |claim: &Claim| {
            excess = excess.max(claim.excess());
            by_friction |= claim.is_by_friction() || claim.is_within_friction;
            excess
        };
        if is_stated(world) {
            let (world, timing) = (least(world), Timing::of(world));
            let damping = world.device.damping;
            // Far from the damping a bound of few digits has the same sign.
            let rough = Claim::of(&world, timing, Wanted::Bound(ROUGH))?;
            let near =
                rough.required.is_some_and(|b| (b - damping).abs() <= 4.0 * ROUGH * b) || rough.speed_max.is_some();
            let all = take(&if near { Claim::of(&world, timing, Wanted::Least)? } else { rough });
            // One delay and even samples are among the patterns.
            if !sign || all > 0.0 {
                return finish(world_is_free(&world, spare, all, by_friction)?, all);
            }
        }
        let wanted = if sign { Wanted::AtMost(world.device.damping) } else { Wanted::From(world.device.damping) };
        let mut claim = Claim::of(world, Timing::even(world), wanted)?;
        if claim.speed_max.is_some() {
            claim = Claim::of(world, Timing::even(world), Wanted::Least)?;
        }
        let all = take(&claim);
        finish(world_is_free(world, spare, all, by_friction)?, all)
    };
    found().unwrap_or(1.0)
}

fn finish(is_free: bool, excess: f64) -> Result<f64, Error> {
    Ok(if excess > 0.0 || is_free { excess } else { 1.0 })
}

/// Whether the loop is stable hands-off: by passivity with a margin, by the friction that dissipates the energy, or by its eigenvalues.
fn world_is_free(world: &World, spare: f64, excess: f64, by_friction: bool) -> Result<bool, Error> {
    let spare = if spare == 0.0 { SPARE } else { spare };
    if excess > 0.0 || excess <= -spare || by_friction {
        return Ok(true);
    }
    Ok(Verdict::of(free_growth(world)?) != Verdict::Unstable)
}
