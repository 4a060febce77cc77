//! The certificate: neither held nor free unstable, and passive.

use hapt_model::World;

use crate::error::Error;
use crate::passivity::required::required_damping_wanted;
use crate::passivity::supremum::{SPARE, Wanted};
use crate::passivity::uneven::{is_as_certified, is_stated, uneven_damping, uneven_damping_wanted};
use crate::stability::Verdict;
use crate::stability::clamped::held_world_growth;
use crate::stability::free::free_growth;
use crate::until::is_over;

/// Relative accuracy of a bound that is far from the damping.
const ROUGH: f64 = 1e-3;

/// Whether `check` certifies the world. A world that cannot be analysed is not certified.
pub fn is_certified(world: &World) -> bool {
    excess_or_sign(world, 0.0, true) <= 0.0
}

/// The required damping less that of the device, over that of the device: 0 or less where `check` certifies the world, otherwise above
/// 0, and 1 where damping alone does not suffice. Hands-off is a special case of a passive hand, so a loop that is passive with a margin
/// is stable hands-off: below -`spare` the free loop is not analysed. Where passivity is that of the free loop itself, [`SPARE`] is
/// enough always.
pub(crate) fn excess(world: &World, spare: f64) -> f64 {
    excess_or_sign(world, spare, false)
}

/// The same, or where the sign is enough any number of the same sign.
fn excess_or_sign(world: &World, spare: f64, sign: bool) -> f64 {
    let found = || -> Result<f64, Error> {
        if is_over() {
            return Err(Error::Stopped);
        }
        // The cheapest first.
        let held = held_world_growth(world)?;
        if Verdict::of(held) == Verdict::Unstable {
            return Ok(1.0);
        }
        // Of all that the file allows: with the least damping of the device.
        let stated = is_stated(world);
        let damping = if stated { world.device.damping_range()[0] } else { world.device.damping };
        let over = |required: f64| ((required - damping) / damping).clamp(f64::MIN_POSITIVE, 1.0);
        let wanted = if sign { Wanted::AtMost(damping) } else { Wanted::From(damping) };
        // The bound for uneven time is cheaper than the proof for a delay of many samples.
        let mut required = 0.0f64;
        if stated {
            // Far from the damping a bound of few digits has the same sign.
            let Some(rough) = uneven_damping_wanted(Wanted::Bound(ROUGH), world)? else { return Ok(1.0) };
            let near = (rough - damping).abs() <= 4.0 * ROUGH * rough;
            let all = if near { uneven_damping(world)? } else { Some(rough) };
            let Some(all) = all else { return Ok(1.0) };
            required = all;
        }
        // One delay and even samples are among the patterns: the search for an end does not look at them by themselves.
        if !stated || (sign && required <= wanted.enough()) {
            let Some(even) = required_damping_wanted(wanted, world)? else { return Ok(1.0) };
            required = required.max(even);
        }
        if required > damping {
            return Ok(over(required));
        }
        let excess = if damping > 0.0 { (required - damping) / damping } else { 0.0 };
        let spare = if spare == 0.0 && is_as_certified(world) { SPARE } else { spare };
        let grows = (spare == 0.0 || excess > -spare) && Verdict::of(free_growth(world)?) == Verdict::Unstable;
        Ok(if grows { 1.0 } else { excess })
    };
    found().unwrap_or(1.0)
}
