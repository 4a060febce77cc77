//! The energy stored in a world's bodies and couplings.

use hapt_core::{Body, Coupling, End};

/// The stored energy in J, at the puck's true position and the bodies' state: bodies J v²/2, and couplings by their laws
/// ([`Coupling::stored`]).
pub fn stored_energy(
    bodies: &[Body],
    couplings: &[Coupling],
    puck: f64,
    states: &[(f64, f64)],
    bristles: &[f64],
) -> f64 {
    let moving: f64 = bodies.iter().zip(states).map(|(body, (_, v))| 0.5 * body.inertia * v * v).sum();
    let at = |end: End| match end {
        End::Puck => puck,
        End::Ground => 0.0,
        End::Body(i) => states.get(i).map_or(0.0, |body| body.0),
    };
    let stored: f64 = couplings
        .iter()
        .enumerate()
        .map(|(i, coupling)| {
            let q = at(coupling.first) - at(coupling.second);
            coupling.stored(q, bristles.get(i).copied().unwrap_or(0.0))
        })
        .sum();
    moving + stored
}
