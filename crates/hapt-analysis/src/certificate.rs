//! The certificate: neither held nor free unstable, and passive.

use hapt_model::World;

use crate::error::Error;
use crate::free::free_growth;
use crate::held::held_growth;
use crate::passivity::required_damping;
use crate::stability::Verdict;

/// Whether `check` would certify the world; what cannot be computed is not certified.
pub fn is_certified(world: &World) -> bool {
    let certified = || -> Result<bool, Error> {
        let sampling = &world.sampling;
        // The cheapest first.
        let held = held_growth(&world.bodies, &world.couplings, sampling.method, sampling.period)?;
        if Verdict::of(held) == Verdict::Unstable {
            return Ok(false);
        }
        let passive = required_damping(world)?.is_some_and(|required| required <= world.device.damping);
        Ok(passive && Verdict::of(free_growth(world)?) != Verdict::Unstable)
    };
    certified().unwrap_or(false)
}
