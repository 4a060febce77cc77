//! The certificate: neither held nor free unstable, and passive.

use hapt_model::World;

use crate::error::Error;
use crate::passivity::required_damping;
use crate::passivity::uneven::{is_stated, uneven_damping};
use crate::stability::Verdict;
use crate::stability::clamped::held_world_growth;
use crate::stability::free::free_growth;
use crate::until::is_over;

/// Whether `check` certifies the world. A world that cannot be analysed is not certified.
pub fn is_certified(world: &World) -> bool {
    excess(world, 0.0) <= 0.0
}

/// The required damping less that of the device, over that of the device: 0 or less where `check` certifies the world, otherwise above
/// 0, and 1 where damping alone does not suffice. Hands-off is a special case of a passive hand, so a loop that is passive with a margin
/// is stable hands-off: below -`spare` the free loop is not analysed.
pub(crate) fn excess(world: &World, spare: f64) -> f64 {
    let found = || -> Result<f64, Error> {
        if is_over() {
            return Err(Error::Stopped);
        }
        // The cheapest first.
        let held = held_world_growth(world)?;
        if Verdict::of(held) == Verdict::Unstable {
            return Ok(1.0);
        }
        let Some(required) = required_damping(world)? else { return Ok(1.0) };
        // Of all that the file allows: with the least damping of the device.
        let (required, damping) = if is_stated(world) {
            let Some(all) = uneven_damping(world)? else { return Ok(1.0) };
            (required.max(all), world.device.damping_range()[0])
        } else {
            (required, world.device.damping)
        };
        if required > damping {
            return Ok(((required - damping) / damping).clamp(f64::MIN_POSITIVE, 1.0));
        }
        let excess = if damping > 0.0 { (required - damping) / damping } else { 0.0 };
        let grows = (spare == 0.0 || excess > -spare) && Verdict::of(free_growth(world)?) == Verdict::Unstable;
        Ok(if grows { 1.0 } else { excess })
    };
    found().unwrap_or(1.0)
}
