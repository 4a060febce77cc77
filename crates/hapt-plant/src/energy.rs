//! What a world's bodies and couplings store.

use hapt_core::{Body, Clampable, Coupling, End, Law, Side};

/// What they store in J, at the puck's true position and the bodies' state: bodies J v²/2, springs k (q - rest)²/2, walls
/// k (q - at)²/2 inside, detents torque · pitch/2π · (1 - cos 2π(q - phase)/pitch), constants -torque · q, bristles σ0 s²/2; a
/// clamped spring or wall k x²/2 up to the x at which it reaches its limit, and limit · x from there on.
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
            stored(&coupling.law, q, bristles.get(i).copied().unwrap_or(0.0))
        })
        .sum();
    moving + stored
}

fn stored(law: &Law, q: f64, bristle: f64) -> f64 {
    let square = |x: f64| x * x;
    let depth = |side: Side, at: f64| match side {
        Side::Above => (q - at).max(0.0),
        Side::Below => (at - q).max(0.0),
    };
    match *law {
        Law::Spring { stiffness, rest } => 0.5 * stiffness * square(q - rest),
        Law::Wall { side, at, stiffness, .. } => 0.5 * stiffness * square(depth(side, at)),
        Law::Detent { torque, pitch, phase } => {
            // 1 - cos 2a = 2 sin² a: a small swing about a rest keeps its digits.
            torque * pitch / core::f64::consts::PI * square(libm::sin(core::f64::consts::PI * (q - phase) / pitch))
        }
        Law::Constant { torque } => -torque * q,
        Law::Lugre { bristle_stiffness, .. } => 0.5 * bristle_stiffness * square(bristle),
        Law::Clamped { law: Clampable::Spring { stiffness, rest }, limit } => {
            clamped(stiffness, (q - rest).abs(), limit)
        }
        Law::Clamped { law: Clampable::Wall { side, at, stiffness, .. }, limit } => {
            clamped(stiffness, depth(side, at), limit)
        }
        Law::Damper { .. } | Law::Coulomb { .. } | Law::Clamped { law: Clampable::Damper { .. }, .. } => 0.0,
    }
}

/// The work of min(stiffness · x, limit) from 0 to x.
fn clamped(stiffness: f64, x: f64, limit: f64) -> f64 {
    let slope = x.min(limit / stiffness);
    0.5 * stiffness * slope * slope + if x > slope { limit * (x - slope) } else { 0.0 }
}
