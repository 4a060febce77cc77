//! The certificate: neither held nor free unstable, and passive.

use hapt_model::World;

use crate::error::Error;
use crate::passivity::required_damping;
use crate::stability::Verdict;
use crate::stability::free::free_growth;
use crate::stability::held::held_growth;

/// Whether `check` would certify the world; what cannot be computed is not certified.
pub fn is_certified(world: &World) -> bool {
    excess(world, 0.0) <= 0.0
}

/// How much more damping the world asks for than its device has, in parts of that: 0 or less where `check` would certify it, else above
/// 0, and 1 where more damping alone is not what is missing. Let go, the puck is one of the passive hands, so that what is passive with
/// damping to spare is stable then: below the negative of `spare` the free loop is not looked at.
pub(crate) fn excess(world: &World, spare: f64) -> f64 {
    let found = || -> Result<f64, Error> {
        let sampling = &world.sampling;
        // The cheapest first.
        let held = held_growth(&world.bodies, &world.couplings, sampling.method, sampling.period)?;
        if Verdict::of(held) == Verdict::Unstable {
            return Ok(1.0);
        }
        let Some(required) = required_damping(world)? else { return Ok(1.0) };
        let damping = world.device.damping;
        if required > damping {
            return Ok(((required - damping) / damping).clamp(f64::MIN_POSITIVE, 1.0));
        }
        let excess = if damping > 0.0 { (required - damping) / damping } else { 0.0 };
        let grows = (spare == 0.0 || excess > -spare) && Verdict::of(free_growth(world)?) == Verdict::Unstable;
        Ok(if grows { 1.0 } else { excess })
    };
    found().unwrap_or(1.0)
}
