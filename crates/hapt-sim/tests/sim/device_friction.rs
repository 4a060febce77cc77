//! Friction of the device that differs by direction, changes with the position and falls with the speed, in runs of the loop.

use crate::common::{bare, rows, scenario, spring};
use hapt_analysis::is_certified;
use hapt_model::*;
use hapt_sim::{Error, Simulation};
use hapt_testing::prelude::*;

proptest! {
    #![proptest_config(hapt_testing::cases(60))]

    /// Hands-off, the energy that a push has left in the puck and the spring never increases, and friction holds the puck in the end.
    #[test]
    fn a_certified_loop_comes_to_rest_however_steeply_friction_falls(
        stiffness in 0.1_f64..2.4, friction in 1e-4_f64..0.01, backward in 1e-4_f64..0.01, more in 1e-3_f64..0.02, velocity in 0.02_f64..3.0,
        push in -0.3_f64..0.3, share in prop_oneof![Just(0.0), 0.0..0.5_f64], pitch in 0.1_f64..7.0,
    ) {
        let mut world = bare();
        world.couplings = vec![spring(End::Puck, End::Ground, stiffness)];
        let changes = FrictionByPosition { share, pitch, phase: 0.2, waveform: Waveform { sine: [1.0, 0.5, 0.0, 0.0], cosine: [0.0; 4] } };
        world.device.friction_by_position = Some(changes);
        (world.device.friction, world.device.friction_backward) = (friction, Some(backward));
        world.device.stribeck = Some(Stribeck { torque: more, velocity });
        prop_assert!(is_certified(&world));
        let hand = Drive::Torque(Shape::Step { to: push, at: 0.0 });
        let rows = rows(&world, &scenario(6.0, hand, Some(0.2)));
        let energy = |row: &hapt_sim::Row| {
            0.5 * world.device.inertia * row.puck_velocity.powi(2) + 0.5 * stiffness * row.puck.powi(2)
        };
        let free: Vec<f64> = rows.iter().skip(200).map(energy).collect();
        // Between two samples the held torque differs from the spring's by up to K dz; damping dissipates the energy of that difference.
        let slack = 0.5 * stiffness * rows.iter().map(|row| (row.puck_velocity * 1e-3).powi(2)).fold(0.0, f64::max);
        for pair in free.windows(2) {
            prop_assert!(pair[1] <= pair[0] + slack + 1e-12);
        }
        let last = rows.last().unwrap();
        let level = more + changes.at(last.puck) * if last.puck < 0.0 { friction } else { backward };
        prop_assert!(last.puck_velocity == 0.0 && last.torque.abs() <= level * (1.0 + 1e-9), "{last:?}");
        let ledger = last.ledger;
        let left = ledger.hand + ledger.motor - ledger.damping - ledger.friction;
        prop_assert!(left.abs() <= 1e-9 * (ledger.hand.abs() + ledger.friction), "{ledger:?}");
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(60))]

    /// (T77): hands-off the energy never grows, although the eigenvalues of an integral term may show growth, and the path is at most that
    /// energy over the friction that integral term and assist leave.
    #[test]
    fn what_friction_takes_neither_grows_nor_hunts_for_ever(
        stiffness in 0.05_f64..2.4, gain in 1.0_f64..500.0, limits in [1e-4_f64..0.02, 1e-4_f64..0.02], velocity in 1e-3_f64..1.0, more in 0.05_f64..1.0,
        stribeck in prop::option::of((1e-3_f64..0.02, 0.02_f64..3.0)), counts in any::<bool>(), push in -0.3_f64..0.3,
    ) {
        let mut world = bare();
        world.sampling.estimator = EstimatorKind::Difference;
        world.device.encoder = counts.then_some(20_000.0);
        let rounded = 0.5 * stiffness * world.count().unwrap_or(0.0);
        let integral = Law::Integral { stiffness: 0.1 * gain, time: 0.1, rest: 0.02 }.between(End::Puck, End::Ground);
        world.couplings = vec![
            spring(End::Puck, End::Ground, stiffness),
            Coupling { limit: Some(limits[0]), ..integral },
            Law::Assist { torque: limits[1], velocity }.between(End::Puck, End::Ground),
        ];
        let left = more * (limits[0] + limits[1]);
        world.device.friction = limits[0] + limits[1] + rounded + left;
        world.device.stribeck = stribeck.map(|(torque, velocity)| Stribeck { torque, velocity });
        prop_assert!(is_certified(&world));
        let rows = rows(&world, &scenario(6.0, Drive::Torque(Shape::Step { to: push, at: 0.0 }), Some(0.2)));
        let energy = |row: &hapt_sim::Row| {
            0.5 * world.device.inertia * row.puck_velocity.powi(2) + 0.5 * stiffness * row.puck.powi(2)
        };
        let start = energy(&rows[201]);
        let mut travel = 0.0;
        for pair in rows[201..].windows(2) {
            travel += (pair[1].puck - pair[0].puck).abs();
            let energy = energy(&pair[1]);
            prop_assert!(energy + left * travel <= start * (1.0 + 1e-9) + 1e-15, "{energy} J and {travel} rad of {start} J");
        }
        prop_assert_eq!(rows.last().unwrap().puck_velocity, 0.0);
    }
}

#[test]
fn friction_that_falls_too_fast_for_the_period_is_refused_by_name() {
    let mut world = bare();
    world.device.stribeck = Some(Stribeck { torque: 1.0, velocity: 1e-6 });
    let hand = scenario(0.1, Drive::Torque(Shape::Step { to: 0.0, at: 0.0 }), None);
    let error = Simulation::new(&world, &hand).map(|_| ()).unwrap_err();
    assert!(matches!(error, Error::Device { table: "stribeck", key: "velocity", .. }), "{error}");
}
