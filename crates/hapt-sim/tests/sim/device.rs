//! The physical puck between the samples, against closed forms and conservation laws.

use crate::common::{self, bare, rows, scenario, spring, step};
use hapt_model::*;
use hapt_sim::{Row, Simulation};
use hapt_testing::prelude::*;

fn torque(shape: Shape) -> Drive {
    Drive::Torque(shape)
}

fn close(a: f64, b: f64, scale: f64) -> bool {
    (a - b).abs() <= 1e-9 * scale
}

proptest! {
    #![proptest_config(hapt_testing::cases(100))]

    #[test]
    fn a_held_torque_moves_a_damped_puck_as_its_equation_says(
        inertia in 1e-4_f64..1e-2, damping in 1e-5_f64..10.0, push in -1.0_f64..1.0, at in 0.0_f64..0.05,
    ) {
        let mut world = bare();
        (world.device.inertia, world.device.damping) = (inertia, damping);
        let run = rows(&world, &scenario(0.1, torque(Shape::Step { to: push, at }), None));
        for row in &run {
            let t = (row.time - at).max(0.0);
            let tau = inertia / damping;
            let v = push / damping * -(-t / tau).exp_m1();
            // t/τ - 1 + e^{-t/τ}, which cancels where t is short of τ.
            let z = push / damping * (t + tau * (-t / tau).exp_m1());
            let scale = (push / damping).abs();
            prop_assert!(close(row.puck_velocity, v, scale), "{} {v}", row.puck_velocity);
            prop_assert!(close(row.puck, z, scale * 0.1), "{} {z}", row.puck);
        }
    }

    #[test]
    fn coulomb_friction_stops_a_released_puck_where_and_when_its_energy_is_spent(
        inertia in 1e-4_f64..1e-2, friction in 1e-3_f64..0.1, velocity in -20.0_f64..20.0,
    ) {
        prop_assume!(velocity.abs() > 0.1);
        let mut world = bare();
        (world.device.inertia, world.device.damping, world.device.friction) = (inertia, 0.0, friction);
        let ramp = Drive::Position(Shape::Ramp { to: velocity * 0.1, at: 0.0, over: 0.1 });
        let stop = 0.1 + inertia * velocity.abs() / friction;
        let duration = (stop + 0.05).min(3.0);
        let run = rows(&world, &scenario(duration, ramp, Some(0.1)));
        let place = 0.1 * velocity + 0.5 * inertia * velocity * velocity.abs() / friction;
        for row in run.iter().filter(|row| row.time >= 0.1) {
            if row.time >= stop {
                prop_assert_eq!(row.puck_velocity, 0.0);
                prop_assert!(close(row.puck, place, place.abs()), "{} {place}", row.puck);
            } else {
                let left = (stop - row.time) * friction / inertia * velocity.signum();
                prop_assert!(close(row.puck_velocity, left, velocity.abs()));
            }
        }
    }

    #[test]
    fn a_torque_below_friction_moves_nothing_and_one_above_starts_when_it_passes_it(
        friction in 0.01_f64..0.1, over in 0.2_f64..1.0, ratio in 0.5_f64..2.0,
    ) {
        let mut world = bare();
        (world.device.damping, world.device.friction) = (0.0, friction);
        let to = friction * ratio;
        let run = rows(&world, &scenario(over, torque(Shape::Ramp { to, at: 0.0, over }), None));
        let (start, rate) = (over / ratio, to / over);
        for row in run.iter().filter(|row| row.time <= over) {
            // J v̇ = rate (t - start)
            let t = (row.time - start).max(0.0);
            let (v, z) = (rate * t * t / 2.0 / 6.4e-4, rate * t.powi(3) / 6.0 / 6.4e-4);
            prop_assert!(close(row.puck_velocity, v, 1e3) && close(row.puck, z, 1e3));
            if row.time < start {
                prop_assert_eq!((row.puck, row.puck_velocity), (0.0, 0.0));
            }
        }
    }

    #[test]
    fn a_gripped_puck_swings_with_the_hands_inertia_on_the_hands_spring(
        inertia in 1e-4_f64..1e-2, stiffness in 0.1_f64..50.0, to in -1.0_f64..1.0,
    ) {
        let mut world = bare();
        world.device.damping = 0.0;
        let grip = Drive::Grip { inertia, damping: 0.0, stiffness, moves: Shape::Step { to, at: 0.0 }, switching: None };
        let omega = (stiffness / (inertia + 6.4e-4)).sqrt();
        for row in rows(&world, &scenario(0.5, grip, None)) {
            let z = to * (1.0 - (omega * row.time).cos());
            prop_assert!(close(row.puck, z, to.abs()), "{} {z}", row.puck);
            prop_assert!(close(row.puck_velocity, to * omega * (omega * row.time).sin(), to.abs() * omega));
        }
    }

    #[test]
    fn a_sine_torque_at_the_grips_resonance_grows_without_bound(stiffness in 0.1_f64..50.0, amplitude in 0.01_f64..1.0) {
        let mut world = bare();
        world.device.damping = 0.0;
        let omega = (stiffness / 6.4e-4).sqrt();
        let moves = Shape::Sine { amplitude, frequency: omega / std::f64::consts::TAU, phase: 0.0 };
        let grip = Drive::Grip { inertia: 0.0, damping: 0.0, stiffness, moves, switching: None };
        for row in rows(&world, &scenario(0.2, grip, None)) {
            // w = (A/2)(sin ωt - ωt cos ωt), here by the device itself.
            let x = omega * row.time;
            let z = amplitude / 2.0 * (x.sin() - x * x.cos());
            prop_assert!(close(row.puck, z, amplitude * (1.0 + x)), "{} {z}", row.puck);
        }
    }

    #[test]
    fn the_works_of_hand_motor_damping_friction_and_motion_add_up(run in random_run()) {
        let (world, scenario) = run;
        let mut size = 0.0_f64;
        for row in rows(&world, &scenario) {
            let ledger = row.ledger;
            let moving = 0.5 * world.device.inertia * row.puck_velocity * row.puck_velocity;
            let terms = [ledger.hand, ledger.motor, -ledger.damping, -ledger.friction, -moving];
            size = terms.iter().fold(size, |m, x| m.max(x.abs()));
            prop_assert!(terms.iter().sum::<f64>().abs() <= 1e-9 * size, "{terms:?} at {}", row.time);
            prop_assert!(ledger.damping >= 0.0 && ledger.friction >= 0.0);
        }
    }

    #[test]
    fn the_devices_motion_does_not_depend_on_the_sampling(run in random_run(), split in 2_u32..5) {
        let (mut world, scenario) = run;
        // Without virtual bodies and couplings, so that the loop gives no torque.
        (world.bodies, world.couplings, world.names) = (vec![], vec![], vec![]);
        let coarse = rows(&world, &scenario);
        world.sampling.period /= f64::from(split);
        let fine = rows(&world, &scenario);
        let size = |get: fn(&Row) -> f64| fine.iter().fold(1e-6_f64, |m, row| m.max(get(row).abs()));
        let (z, v) = (size(|row| row.puck), size(|row| row.puck_velocity));
        for (row, other) in coarse.iter().zip(fine.iter().step_by(split as usize)) {
            prop_assert!((row.puck - other.puck).abs() <= 1e-8 * z, "{} {} {}", row.time, row.puck, other.puck);
            prop_assert!((row.puck_velocity - other.puck_velocity).abs() <= 1e-7 * v);
        }
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(24))]

    /// A motor's torque that nearly balances friction, and a hand that repeatedly adds the rest, where rounding decides between sticking and sliding.
    #[test]
    fn the_motion_of_a_puck_that_sticks_and_slips_does_not_depend_on_the_sampling(
        stiffness in 0.1_f64..10.0, amplitude in 0.01_f64..0.1, frequency in 100.0_f64..2000.0,
        part in 0.01_f64..0.99, pull in -3.0_f64..3.0, split in 2_u32..5,
    ) {
        let mut world = bare();
        (world.device.inertia, world.device.damping) = (1e-5, 0.01);
        world.device.friction = part * stiffness * amplitude;
        let constant = Law::Constant { torque: pull * stiffness * amplitude };
        world.couplings = vec![Coupling { first: End::Puck, second: End::Ground, law: constant, limit: None }];
        let moves = Shape::Sine { amplitude, frequency, phase: 0.0 };
        let grip = Drive::Grip { inertia: 0.0, damping: 0.0, stiffness, moves, switching: None };
        let coarse = rows(&world, &scenario(0.2, grip.clone(), None));
        world.sampling.period /= f64::from(split);
        let fine = rows(&world, &scenario(0.2, grip, None));
        for (row, other) in coarse.iter().zip(fine.iter().step_by(split as usize)) {
            prop_assert!((row.puck - other.puck).abs() <= 1e-8 * amplitude, "{} {} {}", row.time, row.puck, other.puck);
        }
    }
}

fn shape() -> impl Strategy<Value = Shape> {
    // Instants anywhere, on samples and between them.
    let at = prop_oneof![(0_u32..40).prop_map(|k| f64::from(k) * 4e-3), 0.0_f64..0.15];
    prop_oneof![
        (-1.0_f64..1.0, at.clone()).prop_map(|(to, at)| Shape::Step { to, at }),
        (-1.0_f64..1.0, at.clone(), 0.01_f64..0.1).prop_map(|(to, at, over)| Shape::Ramp { to, at, over }),
        (0.01_f64..1.0, 1.0_f64..60.0, -3.0_f64..3.0).prop_map(|(amplitude, frequency, phase)| Shape::Sine {
            amplitude,
            frequency,
            phase
        }),
        prop::collection::vec((0.001_f64..0.05, -1.0_f64..1.0), 1..6).prop_map(|steps| {
            let mut t = 0.0;
            let points = steps.into_iter().map(|(dt, value)| {
                t += dt;
                (t, value)
            });
            Shape::Path { file: "path.csv".into(), points: points.collect() }
        }),
    ]
}

/// A wheel on a spring, a wall and a detent at the puck, on a device with friction and delay, in any hand.
pub fn random_run() -> impl Strategy<Value = (World, Scenario)> {
    let scale = |shape: Shape, factor: f64| match shape {
        Shape::Step { to, at } => Shape::Step { to: factor * to, at },
        Shape::Ramp { to, at, over } => Shape::Ramp { to: factor * to, at, over },
        Shape::Sine { amplitude, frequency, phase } => Shape::Sine { amplitude: factor * amplitude, frequency, phase },
        Shape::Path { file, points } => {
            Shape::Path { file, points: points.into_iter().map(|(t, value)| (t, factor * value)).collect() }
        }
    };
    let drive = prop_oneof![
        shape().prop_map(Drive::Position),
        shape().prop_map(move |shape| Drive::Torque(scale(shape, 0.1))),
        ((0.0_f64..1e-3, 0.0_f64..0.02, 0.0_f64..10.0), shape(), prop::option::of((1e-3_f64..0.05, 1e-3_f64..0.05)))
            .prop_map(|((inertia, damping, stiffness), moves, switching)| {
                let switching = switching.map(|(hold, open)| Switching { hold, open });
                Drive::Grip { inertia, damping, stiffness, moves, switching }
            }),
    ];
    let device = (1e-4_f64..1e-2, prop_oneof![Just(0.0), 0.0_f64..0.05], prop_oneof![Just(0.0), 0.0_f64..0.05]);
    let delay = prop_oneof![Just(0.0), 0.0_f64..0.01];
    let release = prop_oneof![Just(None), (0.0_f64..0.2).prop_map(Some)];
    let lag = prop_oneof![Just(0.0), 1e-5_f64..0.03];
    (drive, device, (delay, lag), release, 0.1_f64..3.0).prop_map(
        |(drive, device, (delay, lag), release, stiffness)| {
            let mut world = common::wheel(Method::Zoh, Output::End);
            world.sampling.period = 4e-3;
            world.sampling.delay = hapt_model::Delay::Seconds(delay);
            (world.device.limit, world.device.lag) = (Some(0.5), lag);
            (world.device.inertia, world.device.damping, world.device.friction) = device;
            world.couplings.push(spring(End::Puck, End::Ground, stiffness));
            let wall = Law::Wall { side: Side::Above, at: 0.2, stiffness: 3.0, damping: 0.0 };
            world.couplings.push(Coupling { first: End::Puck, second: End::Ground, law: wall, limit: None });
            (world, scenario(0.2, drive, release))
        },
    )
}

#[test]
fn a_stiff_grip_and_a_heavy_damper_stay_exact() {
    let mut world = bare();
    (world.device.inertia, world.device.damping, world.device.friction) = (1e-9, 10.0, 1e-3);
    let run = rows(&world, &scenario(1.0, torque(Shape::Step { to: 1.0, at: 0.0 }), None));
    // Terminal velocity at once: (1 - friction)/damping.
    assert!(close(run[1].puck_velocity, 0.0999, 1.0) && close(run[1000].puck, 0.0999, 1.0));
}

#[test]
fn the_work_of_a_step_is_against_the_torque_held_before_it() {
    let mut world = bare();
    let law = Law::Constant { torque: 0.3 };
    world.couplings = vec![Coupling { first: End::Puck, second: End::Ground, law, limit: None }];
    // Exactly on a sample, and between two of them.
    for at in [0.05, 0.0503] {
        let last = rows(&world, &scenario(0.1, step(0.5, at), None)).pop().unwrap();
        assert!(close(last.ledger.motor, 0.15, 1.0) && close(last.ledger.hand, -0.15, 1.0), "{:?}", last.ledger);
    }
    let at_start = rows(&world, &scenario(0.1, step(0.5, 0.0), None)).pop().unwrap();
    assert_eq!(at_start.ledger.motor, 0.0, "before the first command the motor holds nothing");
}

#[test]
fn a_release_keeps_position_and_velocity_from_the_left() {
    let mut world = bare();
    world.device.damping = 0.0;
    // At the ramp's very end, where the prescribed velocity would become 0.
    let ramp = Drive::Position(Shape::Ramp { to: 1.0, at: 0.0, over: 0.5 });
    let run = rows(&world, &scenario(1.0, ramp, Some(0.5)));
    assert!(close(run[500].puck_velocity, 2.0, 1.0) && close(run[1000].puck, 2.0, 1.0));
    // A step at the instant of release never comes.
    let run = rows(&world, &scenario(1.0, step(1.0, 0.5), Some(0.5)));
    assert!(run.iter().all(|row| row.puck == 0.0 && row.puck_velocity == 0.0));
}

#[test]
fn a_grips_inertia_is_gone_with_the_hand() {
    let mut world = bare();
    world.device.damping = 0.0;
    world.couplings = vec![spring(End::Puck, End::Ground, 0.0), {
        Coupling { first: End::Puck, second: End::Ground, law: Law::Constant { torque: 0.1 }, limit: None }
    }];
    let grip = Drive::Grip {
        inertia: 3.2e-3,
        damping: 0.0,
        stiffness: 0.0,
        moves: Shape::Step { to: 0.0, at: 0.0 },
        switching: None,
    };
    let run = rows(&world, &scenario(0.2, grip, Some(0.1)));
    let (held, free) = (0.1 / (3.2e-3 + 6.4e-4), 0.1 / 6.4e-4);
    assert!(close(run[100].puck_velocity, held * 0.1, 1.0));
    assert!(close(run[200].puck_velocity, held * 0.1 + free * 0.1, 10.0));
}

#[test]
fn the_motor_holds_a_command_from_its_sample_and_delay_on() {
    let mut world = common::wheel(Method::Zoh, Output::End);
    let hand = || Drive::Position(Shape::Sine { amplitude: 0.5, frequency: 2.0, phase: 0.7 });
    for (delay, behind) in [(0.0, 0), (1e-3, 1), (3e-3, 3), (0.4e-3, 1), (2.5e-3, 3), (2.9999999999e-3, 3)] {
        world.sampling.delay = hapt_model::Delay::Seconds(delay);
        let run = rows(&world, &scenario(0.1, hand(), None));
        for (k, row) in run.iter().enumerate() {
            let expected = if k >= behind { run[k - behind].command } else { 0.0 };
            assert_eq!(row.applied, expected, "delay {delay}, sample {k}");
        }
    }
}

#[test]
fn a_delayed_constant_acts_on_the_free_puck_from_the_fraction_on() {
    let mut world = bare();
    world.device.damping = 0.0;
    let law = Law::Constant { torque: 0.1 };
    world.couplings = vec![Coupling { first: End::Puck, second: End::Ground, law, limit: None }];
    for delay in [0.0, 0.3e-3, 2.7e-3, 5e-3] {
        world.sampling.delay = hapt_model::Delay::Seconds(delay);
        for row in rows(&world, &scenario(0.05, torque(Shape::Step { to: 0.0, at: 0.0 }), None)) {
            let t = (row.time - delay).max(0.0);
            assert!(close(row.puck, 0.1 / 6.4e-4 * t * t / 2.0, 1.0), "{delay} {}", row.time);
        }
    }
}

#[test]
fn an_event_of_the_hand_between_samples_acts_at_its_own_instant() {
    let mut world = bare();
    world.device.damping = 0.0;
    let push = torque(Shape::Step { to: 0.1, at: 0.01234 });
    let run = rows(&world, &scenario(0.02, push, Some(0.01678)));
    let velocity = 0.1 / 6.4e-4 * (0.01678 - 0.01234);
    assert!(close(run[20].puck_velocity, velocity, 1.0), "{} {velocity}", run[20].puck_velocity);
}

#[test]
fn limit_and_levels_and_counts_are_what_the_rows_show() {
    let mut world = common::wheel(Method::ForwardEuler, Output::Start);
    (world.device.limit, world.device.levels, world.device.encoder) = (Some(0.5), Some(10), Some(400.0));
    let run = rows(&world, &scenario(2.0, step(0.7, 0.1), None));
    let count = std::f64::consts::TAU / 400.0;
    assert!(run.iter().any(|row| row.torque.abs() > 0.6));
    for row in &run {
        assert!((row.command / 0.1 - (row.command / 0.1).round()).abs() < 1e-9 && row.command.abs() <= 0.5);
        assert!((row.measured / count - (row.measured / count).round()).abs() < 1e-9);
        assert!((row.measured - row.puck).abs() <= 0.5001 * count);
    }
}

#[test]
fn a_run_that_diverges_ends_with_its_last_finite_row() {
    let mut world = common::wheel(Method::ForwardEuler, Output::Start);
    world.sampling.period = 10.0;
    let mut run = Simulation::new(&world, &scenario(1e4, step(1.0, 0.0), None)).unwrap();
    let mut finite = 0;
    let error = loop {
        match run.next() {
            Some(Ok(row)) => {
                assert!(row.is_finite());
                finite += 1;
            }
            Some(Err(error)) => break error,
            None => panic!("it should have run away"),
        }
    };
    assert!(finite > 10);
    assert!(error.to_string().contains("stops being finite at t = "), "{error}");
    assert!(run.next().is_none());
}
