//! The real core on the exact device: whether a motion grows, and whether a hand draws work from it.

use fastrand::Rng;
use hapt_model::{Coupling, Drive, End, EstimatorKind, Hand, Scenario, Shape, Switching, Timing, World};
use hapt_sim::{DelayWork, Row, Simulation, world_energy};

use crate::random::log_uniform;

/// Below this part of the largest energy there is only rounding.
const NOTHING: f64 = 1e-20;
/// An energy this many times the first counts as grown.
const GROWN: f64 = 1e20;

/// The result of a motion over some samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// It has died out, or left double precision.
    Gone,
    /// It has grown beyond all bounds.
    Grown,
    /// Its amplitude has changed by this rate in 1/s, between the middle of the run and its end.
    Rate(f64),
}

/// A hand that holds the puck at 0, or one that releases it at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum At {
    Held,
    Free,
}

/// The energy of device and world in J.
pub fn energy(world: &World, row: &Row) -> f64 {
    let puck = 0.5 * world.device.inertia * row.puck_velocity * row.puck_velocity;
    let shaft = world.device.handle.zip(row.handle).map_or(0.0, |(shaft, (handle, velocity))| {
        let bend = handle - row.puck;
        0.5 * shaft.inertia * velocity * velocity + 0.5 * shaft.stiffness * bend * bend
    });
    puck + shaft + world_energy(world, row.puck, &row.bodies, &row.bristles)
}

/// The world from a random start, all its bodies moving, for `samples` samples; with how many were taken.
pub fn motion(rng: &mut Rng, world: &World, at: At, samples: u64) -> (Outcome, u64) {
    let mut world = world.clone();
    let period = world.sampling.period;
    for body in &mut world.bodies {
        body.position = rng.f64() - 0.5;
        body.velocity = (rng.f64() - 0.5) / (100.0 * period);
    }
    // Held: the bodies move, and a handle jerks to move the puck. Hands-off: the puck is pushed first, or the handle.
    let still = match world.device.handle {
        None => Shape::Step { to: 0.0, at: 0.0 },
        Some(_) => Shape::Path { file: String::new(), points: vec![(0.0, 0.0), (period, 0.1), (2.0 * period, 0.0)] },
    };
    let push = world.device.inertia / (100.0 * period) / period;
    let drive = match at {
        At::Held => Drive::Position(still),
        At::Free => Drive::Torque(Shape::Step { to: push, at: 0.0 }),
    };
    let release = (at == At::Free).then_some(period);
    let scenario = Scenario {
        name: "brute".into(),
        duration: samples as f64 * period,
        hand: Hand { drive, release },
        timing: Default::default(),
    };
    let Ok(mut run) = Simulation::new(&world, &scenario) else { return (Outcome::Gone, 0) };
    let (mut first, mut middle, mut end, mut largest) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    let mut taken = 0;
    while let Some(row) = run.next() {
        // A diverging loop leaves double precision.
        let Ok(row) = row else { return (Outcome::Grown, taken) };
        let energy = energy(&world, row);
        largest = largest.max(energy);
        if taken == 2 {
            first = largest;
        }
        taken += 1;
        let part = taken as f64 / samples as f64;
        if (0.4..0.5).contains(&part) {
            middle = middle.max(energy);
        } else if part >= 0.9 {
            end = end.max(energy);
        }
        if taken > 2 && energy > GROWN * first && first > 0.0 {
            return (Outcome::Grown, taken);
        }
        if taken.is_multiple_of(4096) && energy < 1e-3 * NOTHING * largest && middle < NOTHING * largest {
            return (Outcome::Gone, taken);
        }
    }
    if middle <= NOTHING * largest {
        return (Outcome::Gone, taken);
    }
    (Outcome::Rate((end / middle).ln() / samples as f64 / period), taken)
}

/// The most energy that a hand has drawn from the loop at any sample, beyond the stored energy and the energy lent by its delay, in parts
/// of all the work exchanged; not above 0, up to rounding, where the loop is passive.
pub fn drawn(world: &World, hand: Hand, samples: u64) -> (f64, u64) {
    drawn_under(world, hand, samples, Timing::Even)
}

/// The same under a timing, over as many periods.
pub fn drawn_under(world: &World, hand: Hand, samples: u64, timing: Timing) -> (f64, u64) {
    let duration = samples as f64 * world.sampling.period;
    let scenario = Scenario { name: "hand".into(), duration, hand, timing };
    let Ok(mut run) = Simulation::new(world, &scenario) else { return (0.0, 0) };
    let (mut most, mut taken) = (f64::NEG_INFINITY, 0);
    let (mut stored, mut round, mut last) = (0.0, 0.0, 0.0);
    // The energy that a grip's own spring passes on is the rest of its energy.
    let grip = match scenario.hand.drive {
        Drive::Grip { stiffness, .. } => stiffness,
        _ => 0.0,
    };
    let mut lent = DelayWork::new(world);
    // The claim leaves out the energy from constant torques at the puck.
    let pushed = |puck: f64| -> f64 {
        let of = |c: &Coupling| match (c.law.constant(), c.first, c.second) {
            (Some(torque), End::Puck, End::Ground) => torque * puck,
            (Some(torque), End::Ground, End::Puck) => -torque * puck,
            _ => 0.0,
        };
        world.couplings.iter().map(of).sum()
    };
    let mut start = 0.0;
    while let Some(row) = run.next() {
        let Ok(row) = row else { break };
        let ledger = row.ledger;
        lent.add(row);
        if taken == 0 {
            // All hands start at 0, where only a detent stores energy, and a puck with an initial speed.
            stored = world_energy(world, row.puck, &row.bodies, &row.bristles)
                + 0.5 * world.device.inertia * row.puck_velocity * row.puck_velocity
                + pushed(row.puck);
            start = pushed(row.puck);
            round = stored;
        }
        round += (ledger.hand - last).abs() + 1e-5 * grip * row.puck * row.puck;
        last = ledger.hand;
        // Against a constant that the motor's limit cuts the hand has less to give.
        let push = pushed(row.puck) - start;
        let push = if world.device.limit.is_some() { push.max(0.0) } else { push };
        let given = stored + lent.work + push;
        most = most.max((-ledger.hand - given) / (round + ledger.damping + ledger.shaft + f64::MIN_POSITIVE));
        taken += 1;
    }
    (most, taken)
}

/// A random hand: a grip on a still or moving intention, a torque, or a position that it prescribes.
pub fn hand(rng: &mut Rng, world: &World) -> Hand {
    let period = world.sampling.period;
    let stiffness: f64 = world.couplings.iter().map(|c| c.law.slopes().stiffness).sum();
    let size = log_uniform(rng, -3.0, 0.0);
    let frequency = log_uniform(rng, -3.0, -0.1) * 0.5 / period;
    // No jump of a prescribed position: it would avoid the device's damping.
    let shape = |rng: &mut Rng, size: f64, jumps: bool| match rng.u8(..3) {
        0 if jumps => Shape::Step { to: size, at: 0.0 },
        0 | 1 => Shape::Sine { amplitude: size, frequency, phase: 0.0 },
        _ => {
            // A hand at its roughest: anywhere at any time.
            let mut at = 0.0;
            let further = (0..50).map(|_| {
                at += period * 20.0 * rng.f64().max(1e-3);
                (at, size * (2.0 * rng.f64() - 1.0))
            });
            let points = std::iter::once((0.0, 0.0)).chain(further).collect();
            Shape::Path { file: String::new(), points }
        }
    };
    let drive = match rng.u8(..4) {
        0 => Drive::Position(shape(rng, size, false)),
        1 => Drive::Torque(shape(rng, size * stiffness, true)),
        _ => Drive::Grip {
            inertia: world.device.inertia * log_uniform(rng, -1.0, 2.0),
            damping: if rng.bool() { 0.0 } else { world.device.damping * rng.f64() },
            stiffness: stiffness * log_uniform(rng, -2.0, 1.0),
            moves: shape(rng, size, true),
            switching: rng.bool().then(|| {
                let mut samples = || f64::from(rng.u32(1..200)) * period;
                Switching { hold: samples(), open: samples() }
            }),
        },
    };
    Hand { drive, release: None }
}

/// The loop of the certificate of passivity: the exact estimator counts as the difference.
pub fn as_certified(world: &World) -> World {
    let mut world = world.clone();
    if world.sampling.estimator == EstimatorKind::Exact {
        (world.sampling.estimator, world.sampling.every) = (EstimatorKind::Difference, 1);
    }
    world
}
