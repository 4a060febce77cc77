//! The least damping against any passive hand: closed forms, and brute force over frequencies.

mod closed_forms;
mod counts;
mod frequencies;
mod laws;
mod poles;
mod proof;
mod timing;

use hapt_analysis::{Cause, Status, passivity};
use hapt_model::{Coupling, Damping, End, EstimatorKind, Law, Method, Output, Side, World};

use crate::common::*;

/// On a device without damping: the required damping is the whole damping.
fn world(bench: Bench, method: Method, output: Output, period: f64) -> World {
    let mut world = bench.world(method, output, period);
    world.device.damping = 0.0;
    world
}

fn plain(couplings: Vec<Coupling>, period: f64) -> World {
    world(Bench::of(couplings), Method::Zoh, Output::End, period)
}

fn to_ground(stiffness: f64, damping: f64) -> Vec<Coupling> {
    vec![spring(End::Puck, End::Ground, stiffness), damper(End::Ground, End::Puck, damping)]
}

fn required(world: &World) -> f64 {
    passivity(world).unwrap().required_damping.unwrap_or(f64::INFINITY)
}

fn near(found: f64, wanted: f64, relative: f64) {
    assert!((found - wanted).abs() <= relative * wanted.abs(), "{found} is not {wanted}");
}

/// A body on a spring to the puck, ωT = x, in units of K T/2 at K = 100, T = 1 ms.
fn wheel(method: Method, output: Output, x: f64) -> World {
    let period = 1e-3;
    world(chain(1, 100.0 * period * period / (x * x), 100.0), method, output, period)
}

fn cause(world: &World) -> Option<Cause> {
    passivity(world).unwrap().cause
}

fn reasons(world: &World) -> Vec<String> {
    passivity(world).unwrap().not_proved
}
