//! Gravity and cogging of the device in runs of the loop.

use crate::common::{bare, rows, scenario, spring};
use hapt_analysis::is_certified;
use hapt_model::*;
use hapt_sim::{Error, Simulation};
use hapt_testing::prelude::*;

fn cogging(torque: f64, pitch: f64) -> Option<Cogging> {
    Some(Cogging {
        torque,
        pitch,
        phase: 0.1,
        waveform: Waveform { sine: [1.0, 0.3, 0.0, 0.0], cosine: [0.0, 0.0, 0.2, 0.0] },
    })
}

/// The stored energy at z, relative to that at 0.
fn stored(torque: &DeviceTorque, z: f64) -> f64 {
    // The work of the torque from 0 to z, by Simpson's rule on fine parts.
    let parts = 2000;
    let h = z / f64::from(parts);
    let at = |i: f64| torque.at(i * h);
    let sum: f64 = (0..parts).map(f64::from).map(|i| (at(i) + 4.0 * at(i + 0.5) + at(i + 1.0)) * h / 6.0).sum();
    -sum
}

/// A rotary device with gravity and cogging, of which the loop compensates shares.
fn compensated([gravity, phase, torque, pitch]: [f64; 4], shares: [f64; 2]) -> World {
    let text = format!(
        "loop = {{ period = 1e-3 }}\n[device]\ninertia = 6.4e-4\ndamping = 1.2e-3\ngravity = {{ torque = {gravity}, phase = {phase} }}\n\
         cogging = {{ torque = {torque}, pitch = {pitch}, phase = 0.1, sine = [1.0, 0.3], cosine = [0.0, 0.0, 0.2] }}\n\
         [[compensation]]\nof = \"gravity\"\nshare = {}\n[[compensation]]\nof = \"cogging\"\nshare = {}\n",
        shares[0], shares[1]
    );
    World::read(&Source::from_text("device.toml", text), &[]).unwrap()
}

proptest! {
    #![proptest_config(hapt_testing::cases(40))]

    /// The loop's torque is the opposite of the device's, times its share; a world that is written and read again is the same.
    #[test]
    fn a_compensation_cancels_its_share(
        gravity in 0.001_f64..0.5, phase in -3.0_f64..3.0, torque in 0.001_f64..0.05, pitch in 0.2_f64..1.0, by_gravity in 0.0_f64..=1.0,
        by_cogging in 0.0_f64..=1.0,
    ) {
        let world = compensated([gravity, phase, torque, pitch], [by_gravity, by_cogging]);
        let [whole, cogs] = [true, false].map(|is_gravity| DeviceTorque {
            gravity: world.device.torque.gravity.filter(|_| is_gravity),
            cogging: world.device.torque.cogging.filter(|_| !is_gravity),
        });
        let hand = Drive::Position(Shape::Sine { amplitude: 2.0, frequency: 3.0, phase: 0.0 });
        for row in rows(&world, &scenario(0.2, hand, None)) {
            let wanted = -by_gravity * whole.at(row.puck) - by_cogging * cogs.at(row.puck);
            prop_assert!((row.torque - wanted).abs() < 1e-12 * (1.0 + wanted.abs()) + 1e-7 * torque, "{} {wanted}", row.torque);
        }
        let again = World::read(&Source::from_text("again.toml", world.to_toml()), &[]).unwrap();
        prop_assert_eq!((&again.couplings, &again.compensations), (&world.couplings, &world.compensations));
        let compensated: Vec<_> = world.couplings.iter().filter_map(|c| world.device.compensated_by(c)).collect();
        for (of, share) in compensated {
            let wanted = if of == Compensated::Gravity { by_gravity } else { by_cogging };
            prop_assert!((share - wanted).abs() < 1e-12);
        }
    }

    /// Fully compensated, a released lever stays in place up to the error of sampling; partly compensated, it falls more slowly.
    #[test]
    fn a_lever_whose_weight_is_compensated_stays(gravity in 0.02_f64..0.2, z in 0.3_f64..1.2, share in 0.0_f64..1.0) {
        let speed = |share| {
            let world = compensated([gravity, 0.0, 1e-9, 0.5], [share, 0.0]);
            let rows = rows(&world, &scenario(0.11, Drive::Position(Shape::Step { to: z, at: 0.0 }), Some(0.1)));
            rows.last().unwrap().puck_velocity
        };
        let (whole, part, none) = (speed(1.0), speed(share), speed(0.0));
        prop_assert!(whole.abs() < 1e-3 * none.abs() && none > 0.0, "{whole} {none}");
        prop_assert!(part <= none * (1.0 + 1e-9) && part >= (1.0 - share) * none * 0.9, "{part} {none} {share}");
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(60))]

    /// Hands-off, the energy that a push has left in the puck and in the device's own torques never grows.
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
        // Between two samples the held torque differs from the spring's by up to K dz; damping dissipates the energy of that difference.
        let slack = 0.5 * stiffness * rows.iter().map(|row| (row.puck_velocity * 1e-3).powi(2)).fold(0.0, f64::max);
        for pair in free.windows(2) {
            prop_assert!(pair[1] <= pair[0] + slack + 1e-12);
        }
        prop_assert!(free.last().unwrap() <= &(free[0] + slack));
    }

    /// A spring stiffer than the slope of gravity's torque holds the puck where the torques balance; with a weaker one it falls.
    #[test]
    fn an_inverted_pendulum_needs_a_spring_as_stiff_as_the_slope_of_gravity(part in 0.3_f64..2.0, gravity in 0.2_f64..1.0) {
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
