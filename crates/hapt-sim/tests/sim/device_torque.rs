//! Gravity and cogging of the device in runs of the loop.

use crate::common::{bare, rows, scenario, spring};
use hapt_analysis::is_certified;
use hapt_model::*;
use hapt_sim::{Error, Simulation};
use proptest::prelude::*;

fn cogging(torque: f64, pitch: f64) -> Option<Cogging> {
    Some(Cogging {
        torque,
        pitch,
        phase: 0.1,
        waveform: Waveform { sine: [1.0, 0.3, 0.0, 0.0], cosine: [0.0, 0.0, 0.2, 0.0] },
    })
}

/// From the nearest top of what is stored, which is at least 0.
fn stored(torque: &DeviceTorque, z: f64) -> f64 {
    // The work from z to a way beyond, by Simpson's rule on fine parts.
    let parts = 2000;
    let h = z / f64::from(parts);
    let at = |i: f64| torque.at(i * h);
    let sum: f64 = (0..parts).map(f64::from).map(|i| (at(i) + 4.0 * at(i + 0.5) + at(i + 1.0)) * h / 6.0).sum();
    -sum
}

proptest! {
    #![proptest_config(hapt_testing::cases(60))]

    /// What a push has left the puck with, and what the torques store: nothing adds to it hands-off.
    #[test]
    fn a_certified_loop_gains_no_energy_under_gravity_and_cogging(
        stiffness in 0.1_f64..2.4, gravity in 0.0_f64..0.5, phase in -3.0_f64..3.0, torque in 0.0_f64..0.05, pitch in 0.05_f64..0.5,
        push in -0.3_f64..0.3, friction in prop_oneof![Just(0.0), 1e-3..0.02_f64],
    ) {
        let mut world = bare();
        world.couplings = vec![spring(End::Puck, End::Ground, stiffness)];
        world.device.friction = friction;
        world.device.torque = DeviceTorque { gravity: Some(Gravity { torque: gravity, phase }), cogging: cogging(torque, pitch) };
        prop_assert!(is_certified(&world));
        let hand = Drive::Torque(Shape::Step { to: push, at: 0.0 });
        let rows = rows(&world, &scenario(1.5, hand, Some(0.2)));
        let energy = |row: &hapt_sim::Row| {
            let (z, v) = (row.puck, row.puck_velocity);
            0.5 * world.device.inertia * v * v + 0.5 * stiffness * z * z + stored(&world.device.torque, z)
        };
        let free: Vec<f64> = rows.iter().skip(200).map(energy).collect();
        // Between two samples the held torque lacks up to K dz of the spring's, which damping takes by and by.
        let slack = 0.5 * stiffness * rows.iter().map(|row| (row.puck_velocity * 1e-3).powi(2)).fold(0.0, f64::max);
        for pair in free.windows(2) {
            prop_assert!(pair[1] <= pair[0] + slack + 1e-12);
        }
        prop_assert!(free.last().unwrap() <= &(free[0] + slack));
    }

    /// A spring that is stiffer than gravity falls holds the puck where the torques balance, a weaker one lets it fall.
    #[test]
    fn a_puck_that_stands_on_its_head_needs_a_spring_as_stiff_as_gravity_falls(part in 0.3_f64..2.0, gravity in 0.2_f64..1.0) {
        prop_assume!((part - 1.0).abs() > 0.25);
        let mut world = bare();
        world.device.damping = 0.02;
        world.couplings = vec![spring(End::Puck, End::Ground, part * gravity)];
        world.device.torque.gravity = Some(Gravity { torque: gravity, phase: 0.0 });
        let nudge = Drive::Torque(Shape::Step { to: 1e-6, at: 0.0 });
        let rows = rows(&world, &scenario(12.0, nudge, Some(0.1)));
        let z = rows.last().unwrap().puck;
        prop_assert_eq!(z.abs() < 1e-3, part > 1.0, "{} at {}", z, part);
        prop_assert!((gravity * z.sin() - part * gravity * z).abs() < 1e-6 * gravity);
    }
}

#[test]
fn a_torque_too_fast_for_the_period_is_refused_by_name() {
    let mut world = bare();
    world.device.torque.cogging = cogging(1e6, 1e-3);
    let hand = scenario(0.1, Drive::Torque(Shape::Step { to: 0.0, at: 0.0 }), None);
    let error = Simulation::new(&world, &hand).map(|_| ()).unwrap_err();
    assert!(matches!(error, Error::Device { table: "cogging", key: "torque", .. }), "{error}");
}
