//! Combinations of slopes, and the steepest of them at the puck.

use hapt_model::{Coupling, End, World};

use crate::equations::continuous::{Slopes, ties};
use crate::error::Error;

/// Up to this many nonlinear couplings every combination of their slopes is looked at.
pub const COMBINED: usize = 6;

/// The combinations of slopes to look at, all flat first.
pub(crate) fn combinations(bent: &[usize]) -> Vec<Slopes> {
    if bent.len() > COMBINED {
        let alone = bent.iter().map(|&i| Slopes::Chosen(vec![i]));
        return [Slopes::Flat, Slopes::Steep].into_iter().chain(alone).collect();
    }
    let chosen = |bits: u32| (0..bent.len()).filter(|i| bits >> i & 1 == 1).map(|i| bent[i]).collect();
    (0..1u32 << bent.len()).map(|bits| Slopes::Chosen(chosen(bits))).collect()
}

/// The stiffness and damping of the couplings at the puck, each on its steepest rise.
pub(crate) fn at_puck(world: &World, couplings: &[Coupling]) -> Result<[f64; 2], Error> {
    let period = world.sampling.period;
    let ties = ties(&world.bodies, couplings, &Slopes::Steep)?;
    let touching = ties.iter().filter(|t| t.first == End::Puck || t.second == End::Puck);
    Ok(touching.fold([0.0, 0.0], |[k, b], t| [k + t.stiffness, b + t.fixed + period * t.per_period]))
}
