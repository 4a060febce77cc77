//! Published results on encoder, sampling and friction at a virtual wall, as motions: Abbott and Okamura 2005,
//! "Effects of position quantization and sampling rate on virtual-wall passivity", IEEE Trans. Robotics 21(5); Diolaiti, Niemeyer,
//! Barbagli and Salisbury 2006, "Stability of haptic rendering: discretization, quantization, time delay, and Coulomb effects",
//! ibid. 22(2). Both: K ≤ min(2b/T, 2 f_c/Δ) for a device with damping b, friction f_c and counts of Δ.

use std::f64::consts::TAU;

use crate::common::*;
use hapt_model::*;
use hapt_testing::prelude::*;

/// A spring to ground of `part` times the limit that friction and counts set; with just enough damping for it where `damped`.
fn wall(part: f64, friction: f64, counts: f64, damped: bool) -> World {
    let mut world = bare();
    let stiffness = part * 2.0 * friction * counts / TAU;
    world.couplings = vec![spring(End::Puck, End::Ground, stiffness)];
    (world.device.friction, world.device.encoder) = (friction, Some(counts));
    world.device.damping = if damped { 0.5 * stiffness * world.sampling.period } else { 0.0 };
    world
}

/// The largest energy that the hand has drawn up to any sample, and the energy that friction has dissipated in the run.
fn drawn(world: &World, points: Vec<(f64, f64)>) -> (f64, f64) {
    let duration = points.last().unwrap().0;
    let drive = Drive::Position(Shape::Path { file: String::new(), points });
    let rows = rows(world, &scenario(duration, drive, None));
    let start = 0.5 * world.device.inertia * rows[0].puck_velocity.powi(2);
    let most = rows.iter().map(|row| -row.ledger.hand - start).fold(f64::NEG_INFINITY, f64::max);
    (most, rows.last().unwrap().ledger.friction)
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    #[test]
    fn within_the_limit_no_motion_draws_energy(
        friction in 1e-3..0.1f64,
        counts in 200.0..1e5f64,
        reach in 0.5..500.0f64,
        steps in prop::collection::vec((1e-5..5e-3f64, -1.0..1.0f64), 3..60),
    ) {
        let world = wall(0.999_999, friction, counts, true);
        let mut points = vec![(0.0, 0.0)];
        for (time, place) in steps {
            points.push((points.last().unwrap().0 + time, place * reach * TAU / counts));
        }
        let (most, round) = drawn(&world, points);
        prop_assert!(most <= 1e-12 * round, "{most} of {round}");
    }

    #[test]
    fn beyond_the_counts_a_tremble_about_an_edge_draws_energy(
        friction in 1e-3..0.1f64,
        counts in 200.0..1e5f64,
        n in 0..20u32,
        tremble in 0.001..0.1f64,
    ) {
        // Out while the count is high, back while it is low, by ε: each turn brings ε (K Δ - 2 f_c).
        let count = TAU / counts;
        let edge = (f64::from(n) + 0.5) * count;
        let turns = 2000;
        let points: Vec<(f64, f64)> = std::iter::once((0.0, 0.0))
            .chain((1..=2 * turns).map(|i| {
                let side = if i % 2 == 0 { 0.5 } else { -0.5 };
                (f64::from(i) * 1e-3, edge + side * tremble * count)
            }))
            .collect();
        for (part, draws) in [(0.98, false), (1.02, true)] {
            let world = wall(part, friction, counts, false);
            let drive = Drive::Position(Shape::Path { file: String::new(), points: points.clone() });
            let rows = rows(&world, &scenario(4.0, drive, None));
            // Between two samples of equal speed: neither the approach nor the stop at the end counts.
            let turning = rows[2 * turns as usize - 2].ledger.hand - rows[2].ledger.hand;
            let wanted = 2.0 * friction * (1.0 - part) * tremble * count * f64::from(turns - 2);
            prop_assert!((turning - wanted).abs() <= 1e-3 * wanted.abs(), "{turning} {wanted}");
            prop_assert_eq!(turning < 0.0, draws);
        }
    }

    #[test]
    fn within_the_limit_the_puck_comes_to_rest(friction in 1e-3..0.1f64, counts in 200.0..1e4f64, start in 1.0..100.0f64) {
        // Held at `start` counts, then released. Half of the stiffness keeps the run short.
        let mut world = wall(0.5, friction, counts, true);
        world.device.damping *= 2.0;
        let from = start * TAU / counts;
        // A swing loses some counts to friction.
        let Law::Spring { stiffness, .. } = world.couplings[0].law else { unreachable!() };
        let swings = 100.0 * TAU * (world.device.inertia / stiffness).sqrt();
        let rows = rows(&world, &scenario(swings, step(from, 0.0), Some(0.01)));
        let end = rows.last().unwrap();
        let speed = from * (stiffness / world.device.inertia).sqrt();
        prop_assert!(end.puck_velocity.abs() <= 1e-9 * speed, "{} of {speed}", end.puck_velocity);
        prop_assert!(rows.iter().all(|row| row.puck.abs() <= from * (1.0 + 1e-12)));
    }
}

/// Diolaiti's third region: neither damping nor friction suffices, and the oscillation grows until the motor's limit bounds it.
#[test]
fn beyond_both_limits_the_puck_never_rests() {
    let mut world = wall(4.0, 1e-3, 2000.0, false);
    world.device.damping = 0.02 * world.sampling.period;
    world.device.limit = Some(0.5);
    let rows = rows(&world, &scenario(20.0, step(20.0 * TAU / 2000.0, 0.0), Some(0.01)));
    let fastest = |from: f64, to: f64| {
        rows.iter().filter(|r| (from..to).contains(&r.time)).map(|r| r.puck_velocity.abs()).fold(0.0, f64::max)
    };
    assert!(fastest(18.0, 20.0) >= 0.9 * fastest(0.02, 2.0), "{} {}", fastest(18.0, 20.0), fastest(0.02, 2.0));
    assert!(rows.iter().any(|row| row.command.abs() == 0.5));
}
