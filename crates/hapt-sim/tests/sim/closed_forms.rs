//! The notes' closed forms against runs of loop, device and hand at random parameters.

use crate::common::{self, bare, rows, scenario, spring, step};
use hapt_analysis::closed_form;
use hapt_model::*;
use hapt_sim::Simulation;
use hapt_testing::prelude::*;
use nalgebra::{DMatrix, DVector};

/// One virtual wheel on a spring from the puck, torque from x_k.
fn wheel(inertia: f64, stiffness: f64, period: f64, method: Method) -> World {
    let mut world = common::wheel(method, Output::Start);
    world.sampling.period = period;
    world.bodies[0].inertia = inertia;
    world.couplings = vec![spring(End::Puck, End::Body(0), stiffness)];
    world
}

/// The largest |error| of the wheel's position over a run, against `exact`.
fn error(world: &World, scenario: &Scenario, exact: impl Fn(f64) -> f64) -> f64 {
    rows(world, scenario).iter().fold(0.0, |m, row| f64::max(m, (row.bodies[0].0 - exact(row.time)).abs()))
}

const ORDERS: [(Method, f64); 6] = [
    (Method::ForwardEuler, 1.0),
    (Method::BackwardEuler, 1.0),
    (Method::SemiImplicitEuler, 1.0),
    (Method::Trapezoidal, 2.0),
    (Method::Rk4, 4.0),
    (Method::Tustin, 2.0),
];

proptest! {
    #![proptest_config(hapt_testing::cases(40))]

    #[test]
    fn after_a_step_the_wheel_swings_by_2_3_and_pulls_by_2_4(
        frequency in 0.3_f64..20.0, log_stiffness in -2.0_f64..2.0, z0 in -2.0_f64..2.0, start in 0_u32..200,
    ) {
        let stiffness = 10_f64.powf(log_stiffness);
        let omega = std::f64::consts::TAU * frequency;
        let world = wheel(stiffness / (omega * omega), stiffness, 1e-3, Method::Zoh);
        let at = f64::from(start) * 1e-3;
        for row in rows(&world, &scenario(2.0, step(z0, at), None)) {
            let t = row.time - at;
            let (w, torque) = if start <= (row.time / 1e-3).round() as u32 {
                (z0 * (1.0 - (omega * t).cos()), -stiffness * z0 * (omega * t).cos())
            } else {
                (0.0, 0.0)
            };
            prop_assert!((row.bodies[0].0 - w).abs() <= 1e-9 * z0.abs(), "{} {w}", row.bodies[0].0);
            prop_assert!((row.bodies[0].1 - omega * z0 * (omega * t).sin() * f64::from(t >= -1e-9)).abs() <= 1e-9 * omega * z0.abs());
            prop_assert!((row.torque - torque).abs() <= 1e-9 * stiffness * z0.abs(), "{} {torque}", row.torque);
        }
    }

    #[test]
    fn foh_is_exact_while_the_puck_runs_straight(
        frequency in 0.3_f64..20.0, damping_ratio in 0.0_f64..0.9, velocity in -3.0_f64..3.0,
    ) {
        // A damper to ground, so that w'' + 2ζω w' + ω² w = ω² vt.
        let omega = std::f64::consts::TAU * frequency;
        let (stiffness, inertia) = (1.7, 1.7 / (omega * omega));
        let mut world = wheel(inertia, stiffness, 1e-3, Method::Foh);
        let damping = Damping::Fixed(2.0 * damping_ratio * omega * inertia);
        world.couplings.push(Coupling { first: End::Body(0), second: End::Ground, law: Law::Damper { damping }, limit: None });
        let ramp = Drive::Position(Shape::Ramp { to: velocity * 1.0, at: 0.0, over: 1.0 });
        let lag = 2.0 * damping_ratio / omega;
        let damped = omega * (1.0 - damping_ratio * damping_ratio).sqrt();
        let exact = |t: f64| {
            // v (t - lag) + e^{-ζωt} (a cos + b sin), from rest.
            let (a, b) = (lag, (damping_ratio * omega * lag - 1.0) / damped);
            velocity * (t - lag + (-damping_ratio * omega * t).exp() * (a * (damped * t).cos() + b * (damped * t).sin()))
        };
        let error = error(&world, &scenario(1.0, ramp, None), exact);
        prop_assert!(error <= 1e-9 * velocity.abs(), "{error:e}");
    }

    #[test]
    fn the_first_sample_that_forward_euler_clips_is_the_one_the_formula_names(
        frequency in 0.5_f64..5.0, z0 in 0.1_f64..1.0, margin in 1.001_f64..1.3,
    ) {
        let omega = std::f64::consts::TAU * frequency;
        let stiffness = 1.3;
        let mut world = wheel(stiffness / (omega * omega), stiffness, 1e-3, Method::ForwardEuler);
        let limit = margin * stiffness * z0;
        world.device.limit = Some(limit);
        let run = rows(&world, &scenario(10.0, step(z0, 0.0), None));
        let first = run.iter().position(|row| row.torque.abs() > limit);
        let predicted = closed_form::forward_euler_exceeds(stiffness, z0, omega, 1e-3, limit);
        match first {
            Some(first) => prop_assert_eq!(predicted, Some(first as u64)),
            None => prop_assert!(predicted.is_none_or(|k| k > 10_000)),
        }
    }

    #[test]
    fn excited_at_resonance_the_wheel_grows_as_its_formula_says(frequency in 0.5_f64..3.0, amplitude in 0.01_f64..1.0) {
        let omega = std::f64::consts::TAU * frequency;
        let exact = |t: f64| amplitude / 2.0 * ((omega * t).sin() - omega * t * (omega * t).cos());
        let sine = Drive::Position(Shape::Sine { amplitude, frequency, phase: 0.0 });
        let scenario = scenario(3.0, sine, None);
        // Every method tends to it as the period shrinks: held input has an error of the first order (semi-implicit Euler's lag and lead
        // cancel here), linear input one of the second.
        for (method, order) in Method::ALL.map(|method| (method, if method.takes_new_sample_first() { 2.0 } else { 1.0 })) {
            let error_at = |period: f64| error(&wheel(1.0 / (omega * omega), 1.0, period, method), &scenario, exact);
            let (coarse, fine) = (error_at(1e-3), error_at(0.5e-3));
            let slope = (coarse / fine).log2();
            prop_assert!(slope > order - 0.25, "{}: {slope}", method.name());
            prop_assert!(fine < 0.1 * amplitude * (1.0 + omega * 3.0));
        }
    }

    #[test]
    fn with_the_puck_held_halving_the_period_shows_each_methods_order(frequency in 0.5_f64..3.0, z0 in 0.1_f64..1.0) {
        let omega = std::f64::consts::TAU * frequency;
        // Away from the instants at which a first-order error vanishes by its phase.
        let duration = 0.8 / frequency;
        let exact = |t: f64| z0 * (1.0 - (omega * t).cos());
        for (method, order) in ORDERS {
            let error_at = |parts: f64| {
                let world = wheel(1.0 / (omega * omega), 1.0, duration / parts, method);
                // Tustin's straight line before sample 0 is not the step's: the jump is half a sample early.
                error(&world, &scenario(duration, step(z0, 0.0), None), exact)
            };
            let slope = (error_at(100.0) / error_at(200.0)).log2();
            prop_assert!((slope - order).abs() < 0.2, "{}: {slope}", method.name());
        }
    }

    #[test]
    fn released_masses_tend_to_their_separation_with_and_without_loss(
        ratio in 0.02_f64..2.0, stiffness in 0.1_f64..2.0, loss in prop_oneof![Just(0.0), 1e-4_f64..1e-2], z0 in 0.1_f64..1.0,
    ) {
        let device = 6.4e-4;
        let inertia = device / ratio;
        // (3.6) with row 3 right, and the device's damping in row 2.
        let a = DMatrix::from_row_slice(4, 4, &[
            0.0, 1.0, 0.0, 0.0,
            -stiffness / device, -loss / device, stiffness / device, 0.0,
            0.0, 0.0, 0.0, 1.0,
            stiffness / inertia, 0.0, -stiffness / inertia, 0.0,
        ]);
        let release = 0.05;
        let omega = (stiffness / inertia).sqrt();
        let swung = [z0, 0.0, z0 * (1.0 - (omega * release).cos()), omega * z0 * (omega * release).sin()];
        let duration = 0.25;
        let error_at = |period: f64| {
            // The one method and output that conserves momentum exactly.
            let mut world = wheel(inertia, stiffness, period, Method::Trapezoidal);
            world.sampling.output = Output::Middle;
            world.device.damping = loss;
            let run = rows(&world, &scenario(duration, step(z0, 0.0), Some(release)));
            let (flow, mut exact) = ((&a * period).exp(), DVector::from_row_slice(&swung));
            let mut error = 0.0_f64;
            for row in &run[(release / period).round() as usize..] {
                error = error.max(((row.puck - row.bodies[0].0) - (exact[0] - exact[2])).abs());
                exact = &flow * exact;
            }
            if loss == 0.0 {
                // Without loss the centre of mass keeps its velocity, for any motion of the separation, to rounding.
                let momentum = |row: &hapt_sim::Row| device * row.puck_velocity + inertia * row.bodies[0].1;
                let released = momentum(&run[(release / period).round() as usize]);
                for row in run.iter().filter(|row| row.time >= release) {
                    prop_assert!((momentum(row) - released).abs() < 1e-12, "{} {released}", momentum(row));
                }
            }
            Ok(error / z0)
        };
        let (coarse, fine) = (error_at(2e-4)?, error_at(1e-4)?);
        prop_assert!(fine < 0.6 * coarse + 1e-7 && fine < 0.05, "{coarse} {fine}");
    }
}

#[test]
fn the_notes_wheel_grows_by_euler_into_the_limit_as_predicted() {
    let mut world = common::wheel(Method::ForwardEuler, Output::Start);
    world.device.limit = Some(0.82225);
    let scenario = scenario(10.0, step(std::f64::consts::FRAC_PI_4, 0.0), None);
    let run = rows(&world, &scenario);
    let (k, z0, omega) = (common::STIFFNESS, std::f64::consts::FRAC_PI_4, std::f64::consts::TAU);
    let growth = closed_form::forward_euler_growth(omega, 1e-3);
    assert!((growth - 0.0197388).abs() < 5e-8, "{growth}");
    let clipped = run.iter().position(|row| row.command.abs() < row.torque.abs()).unwrap() as u64;
    assert_eq!(closed_form::forward_euler_exceeds(k, z0, omega, 1e-3, 0.82225), Some(clipped));
    for (sample, row) in run.iter().enumerate().step_by(97) {
        let torque = closed_form::forward_euler_torque(k, z0, omega, 1e-3, sample as u64);
        assert!((row.torque - torque).abs() < 1e-9, "{sample}");
    }
}

#[test]
fn the_michigan_wheel_released_swings_at_six_and_a_half_hertz_and_spins_off() {
    let mut world = common::wheel(Method::Zoh, Output::Middle);
    world.sampling.period = 1e-5;
    world.device.damping = 0.0;
    let run = rows(&world, &scenario(3.0, step(0.5, 0.0), Some(0.3)));
    let crossings: Vec<f64> = run
        .windows(2)
        .filter(|pair| pair[0].time > 0.3)
        .filter(|pair| (pair[0].puck - pair[0].bodies[0].0) < 0.0 && (pair[1].puck - pair[1].bodies[0].0) >= 0.0)
        .map(|pair| pair[1].time)
        .collect();
    let frequency = (crossings.len() - 1) as f64 / (crossings[crossings.len() - 1] - crossings[0]);
    let formula = (common::STIFFNESS * (1.0 / 6.4e-4 + 1.0 / common::INERTIA)).sqrt() / std::f64::consts::TAU;
    assert!((formula - 6.43).abs() < 0.005, "{formula}");
    assert!((frequency / formula - 1.0).abs() < 1e-3, "{frequency} {formula}");
}

#[test]
fn growth_fitted_to_a_run_is_the_growth_predicted() {
    for method in [Method::ForwardEuler, Method::BackwardEuler, Method::Trapezoidal, Method::Zoh, Method::Rk4] {
        let mut world = common::wheel(method, Output::End);
        if method == Method::Trapezoidal {
            let damping = Damping::Fixed(2e-3);
            world.couplings.push(Coupling {
                first: End::Body(0),
                second: End::Ground,
                law: Law::Damper { damping },
                limit: None,
            });
        }
        let scenario = scenario(10.0, step(0.7, 0.25), None);
        let mut run = Simulation::new(&world, &scenario).unwrap();
        let mut summary = hapt_sim::Summary::new(&world, &run);
        while let Some(row) = run.next() {
            summary.add(row.unwrap());
        }
        let predicted =
            hapt_analysis::held(&world.bodies, &world.couplings, world.sampling.method, world.sampling.period)
                .unwrap()
                .growth_per_s
                .unwrap();
        let fitted = summary.fitted_growth().unwrap();
        // A damped oscillation loses its energy in two pulses per cycle.
        assert!((fitted - predicted).abs() < 5e-3 * predicted.abs() + 1e-6, "{}: {fitted} {predicted}", method.name());
    }
}

/// Energies from 1 to far beyond the square of the largest number, and from 1 to rounding: no block's product overflows or underflows.
#[test]
fn growth_is_fitted_over_hundreds_of_decades() {
    for (method, period, duration) in
        [(Method::ForwardEuler, 0.2, 140.0), (Method::ForwardEuler, 1e-2, 100.0), (Method::BackwardEuler, 1e-2, 100.0)]
    {
        let mut world = common::wheel(method, Output::End);
        world.sampling.period = period;
        let scenario = scenario(duration, step(0.7, 0.0), None);
        let mut run = Simulation::new(&world, &scenario).unwrap();
        let mut summary = hapt_sim::Summary::new(&world, &run);
        while let Some(row) = run.next() {
            summary.add(row.unwrap());
        }
        // |1 ± i ωT|: ln(1 + ω²T²)/2T.
        let turn = period * (common::STIFFNESS / common::INERTIA).sqrt();
        let sign = if method == Method::ForwardEuler { 1.0 } else { -1.0 };
        let growth = sign * (turn * turn).ln_1p() / (2.0 * period);
        let fitted = summary.fitted_growth().unwrap();
        assert!((fitted - growth).abs() < 1e-6 * growth.abs(), "{}: {fitted} {growth}", method.name());
    }
}

#[test]
fn a_system_at_rest_stays_at_rest() {
    for row in rows(&bare(), &scenario(0.1, Drive::Torque(Shape::Step { to: 0.0, at: 0.0 }), None)) {
        assert_eq!((row.puck, row.puck_velocity, row.torque, row.command), (0.0, 0.0, 0.0, 0.0));
    }
}

/// With an integral term the puck comes back to its rest under a constant torque of the hand, and the integral carries it.
#[test]
fn an_integral_term_carries_a_constant_torque() {
    let mut world = bare();
    let (stiffness, torque) = (1.0, 0.05);
    world.sampling.estimator = EstimatorKind::Difference;
    world.couplings = vec![
        Law::Spring { stiffness, rest: 0.1 }.between(End::Puck, End::Ground),
        Law::Damper { damping: Damping::Fixed(0.02) }.between(End::Puck, End::Ground),
        Law::Integral { stiffness, time: 0.1, rest: 0.1 }.between(End::Puck, End::Ground),
    ];
    let push = |world: &World| {
        let run = rows(world, &scenario(5.0, Drive::Torque(Shape::Step { to: torque, at: 0.0 }), None));
        run.last().map(|row| (row.puck, row.torque)).unwrap()
    };
    let (puck, held) = push(&world);
    assert!((puck - 0.1).abs() < 1e-9 && (held + torque).abs() < 1e-9, "{puck} {held}");
    // Beyond its limit the spring has to carry the rest.
    world.couplings[2].limit = Some(0.02);
    let (puck, held) = push(&world);
    assert!((puck - 0.1 - (torque - 0.02) / stiffness).abs() < 1e-9 && (held + torque).abs() < 1e-9, "{puck} {held}");
}

/// A torque along the acceleration takes its inertia off the puck's under a constant torque of the hand, exactly once the low-pass follows.
#[test]
fn a_puck_with_its_inertia_compensated_is_as_light_as_the_rest() {
    for (share, cutoff) in [(0.1, 5.0), (0.5, 2.0), (0.9, 20.0)] {
        let mut world = bare();
        world.sampling.estimator = EstimatorKind::Difference;
        world.device.damping = 0.0;
        let inertia = share * world.device.inertia;
        world.couplings = vec![Law::Acceleration { inertia, cutoff }.between(End::Ground, End::Puck)];
        let torque = 1e-4;
        let run = rows(&world, &scenario(6.0, Drive::Torque(Shape::Step { to: torque, at: 0.0 }), None));
        let velocity = |from_end: usize| run[run.len() - 1 - from_end].puck_velocity;
        let gained = velocity(0) - velocity(100);
        let wanted = 100.0 * world.sampling.period * torque / (world.device.inertia - inertia);
        assert!((gained / wanted - 1.0).abs() < 1e-9, "{share} {cutoff}: {gained} {wanted}");
        // Its limit is all that it helps with.
        let limit = 1e-5;
        world.couplings[0].limit = Some(limit);
        let run = rows(&world, &scenario(6.0, Drive::Torque(Shape::Step { to: torque, at: 0.0 }), None));
        let velocity = |from_end: usize| run[run.len() - 1 - from_end].puck_velocity;
        let least = (torque * share / (1.0 - share)).min(limit);
        let wanted = 100.0 * world.sampling.period * (torque + least) / world.device.inertia;
        assert!(((velocity(0) - velocity(100)) / wanted - 1.0).abs() < 1e-9, "{share} {cutoff}");
    }
}
