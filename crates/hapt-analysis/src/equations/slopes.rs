//! Combinations of slopes, the linear couplings that have them, and the steepest of them at the puck.

use hapt_model::{Coupling, Damping, End, Law, World};

use crate::equations::continuous::{LinearCoupling, Slopes, linearise};
use crate::equations::laws::{Acceleration, LinearLaw, linear_law};
use crate::error::Error;

/// Up to this many nonlinear couplings, every combination of their slopes is analysed.
pub const COMBINED: usize = 6;

/// The combinations of slopes to analyse, all flat first.
pub(crate) fn combinations(indices: &[usize]) -> Vec<Slopes> {
    if indices.len() > COMBINED {
        let single = indices.iter().map(|&i| Slopes::Chosen(vec![i]));
        return [Slopes::Flat, Slopes::Steep].into_iter().chain(single).collect();
    }
    let chosen = |bits: u32| (0..indices.len()).filter(|i| bits >> i & 1 == 1).map(|i| indices[i]).collect();
    (0..1u32 << indices.len()).map(|bits| Slopes::Chosen(chosen(bits))).collect()
}

/// The stiffness and damping of the couplings at the puck, each at its steepest slope.
pub(crate) fn at_puck(world: &World, couplings: &[Coupling]) -> Result<[f64; 2], Error> {
    let sampling = &world.sampling;
    let terms = linearise(&world.bodies, couplings, &Slopes::Steep)?;
    let touching = terms.iter().filter(|t| t.first == End::Puck || t.second == End::Puck);
    let over = |t: &LinearCoupling| match (t.first, t.second) {
        (End::Body(_), _) | (_, End::Body(_)) => sampling.step(),
        (End::Puck | End::Ground, End::Puck | End::Ground) => sampling.period,
    };
    Ok(touching.fold([0.0, 0.0], |[k, b], t| [k + t.stiffness, b + t.fixed + over(t) * t.per_period]))
}

/// The couplings of a world with nonlinear ones replaced by springs and dampers of these slopes, and compensating dampers by what they are at
/// its period. Linear ones and constants stay as they are, and torques along
/// the acceleration lose their limits.
pub(crate) fn straightened(world: &World, slopes: &Slopes) -> Result<Vec<Coupling>, Error> {
    let sampling = &world.sampling;
    let mut couplings = Vec::new();
    for (coupling, term) in world.couplings.iter().zip(linearise(&world.bodies, &world.couplings, slopes)?) {
        if Acceleration::of(&coupling.law).is_some() {
            // Within its limit.
            couplings.push(Coupling { limit: None, ..*coupling });
            continue;
        }
        if linear_law(coupling).is_some_and(|law| !matches!(law, LinearLaw::Compensating)) {
            couplings.push(*coupling);
            continue;
        }
        let over = if coupling.is_at_body() { sampling.step() } else { sampling.period };
        let damping = term.fixed + over * term.per_period;
        let laws =
            [Law::Spring { stiffness: term.stiffness, rest: 0.0 }, Law::Damper { damping: Damping::Fixed(damping) }];
        let sizes = [term.stiffness, damping];
        let acting = laws.into_iter().zip(sizes).filter(|(_, size)| *size > 0.0);
        couplings.extend(acting.map(|(law, _)| law.between(coupling.first, coupling.second)));
    }
    Ok(couplings)
}
