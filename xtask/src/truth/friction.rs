//! Friction that makes up for damping up to a speed, (T66): hands just below the speed draw nothing, and faster ones often do.

use fastrand::Rng;
use hapt_analysis::required_damping;
use hapt_model::{Drive, Hand, Shape, World};
use hapt_sweep::worst::work_motion;

use super::{Claim, Counts, ROUNDING, brute};

/// Samples of a motion, and motions a loop.
const SAMPLES: usize = 3_000;
const MOTIONS: u32 = 4;
/// Parts of the speed: just below it, and well above.
const BELOW: f64 = 1.0 - 1e-9;
const ABOVE: f64 = 1.5;
/// Samples of the motion for which the motor's work is largest.
const WORKED: usize = 300;

/// Gives every third loop with friction less damping than it requires, and friction beyond that for counts and levels.
pub fn spare(rng: &mut Rng, world: &mut World) {
    let part = 0.2 + 0.75 * rng.f64();
    let more = 1.0 + 4.0 * rng.f64();
    if rng.u8(..3) > 0 || world.device.least_friction() == 0.0 || world.device.handle.is_some() {
        return;
    }
    if let Ok(Some(required)) = required_damping(world) {
        world.device.damping = part * required;
        world.device.friction *= more;
        world.device.friction_backward = world.device.friction_backward.map(|backward| more * backward);
    }
}

/// A motion no faster than `speed` in any sample: there and back for random times, or a sine with this largest speed.
fn motion(rng: &mut Rng, world: &World, speed: f64) -> Vec<(f64, f64)> {
    let period = world.sampling.period;
    let longest = 10f64.powf(3.0 * rng.f64());
    let sine = rng.u8(..3) == 0;
    let mut forth = 1.0;
    let mut points = vec![(0.0, 0.0)];
    let (mut k, mut position) = (0.0, 0.0);
    while k < SAMPLES as f64 {
        let length = if sine { 1.0 } else { 1.0 + (longest * rng.f64()).floor() };
        forth = if sine { (std::f64::consts::TAU * k / (4.0 * longest)).cos() } else { -forth };
        k += length;
        position += forth * speed * length * period;
        points.push((k * period, position));
    }
    points
}

/// The most energy that motions at `speed` draw, in parts of the work exchanged.
fn drawn(rng: &mut Rng, world: &World, speed: f64, taken: &mut u64) -> f64 {
    let mut motions: Vec<Vec<(f64, f64)>> = (0..MOTIONS).map(|_| motion(rng, world, speed)).collect();
    motions.extend(work_motion(world, WORKED).map(|worst| worst.at_speed(SAMPLES / WORKED, speed)));
    let of = |points| {
        let hand = Hand { drive: Drive::Position(Shape::Path { file: String::new(), points }), release: None };
        let (work, samples) = brute::drawn(world, hand, SAMPLES as u64);
        *taken += samples;
        work
    };
    motions.into_iter().map(of).fold(f64::NEG_INFINITY, f64::max)
}

/// A loop that lacks damping, and whose friction makes up for it up to `speed`.
pub fn judge(rng: &mut Rng, world: &World, speed: f64, found: &mut Counts, report: &mut dyn FnMut(String)) {
    let work = drawn(rng, world, BELOW * speed, &mut found.samples);
    let holds = work <= ROUNDING;
    if !holds {
        report(format!(
            "passive by friction up to {speed:e} per second, and a motion below it draws {work:e} of the work"
        ));
    }
    found.faster += u64::from(drawn(rng, world, ABOVE * speed, &mut found.samples) > ROUNDING);
    found.by_friction += Claim { loops: 1, confirmed: u64::from(holds), slow: 0, contradicted: u64::from(!holds) };
}
