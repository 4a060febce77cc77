//! Nonlinear couplings at bodies under zoh, trapezoidal and backward Euler: the discrete-gradient step of docs/contract.md,
//! section 4.

mod bounces;
mod energy;
mod friction;
mod rule;

use hapt_core::{Body, Coupling, End, Law, Loop, Method, Real, Side, Vector};

type Small = Loop<f64, 6, 12, 3>;

const METHODS: [Method; 3] = [Method::Zoh, Method::Trapezoidal, Method::BackwardEuler];
/// The methods that conserve the energy of lossless worlds.
const KEEPING: [Method; 2] = [Method::Zoh, Method::Trapezoidal];

fn list<F: Real, const B: usize>(x: &Vector<F, B>, n: usize) -> Vec<f64> {
    x.position[..n].iter().chain(&x.velocity[..n]).map(|x| x.to_f64()).collect()
}

/// A body J at a position with a velocity.
fn body(inertia: f64, position: f64, velocity: f64) -> Body {
    Body { inertia, position, velocity }
}

/// A body to ground.
fn grounded(law: Law) -> Coupling {
    Coupling { first: End::Body(0), second: End::Ground, law, limit: None }
}

fn spring(stiffness: f64) -> Law {
    Law::Spring { stiffness, rest: 0.0 }
}

/// A lossless wall below q = 0.
fn floor(stiffness: f64, damping: f64) -> Law {
    Law::Wall { side: Side::Below, at: 0.0, stiffness, damping }
}
