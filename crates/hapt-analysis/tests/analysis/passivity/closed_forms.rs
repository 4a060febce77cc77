//! The required damping in closed form.

use std::f64::consts::{PI, TAU};

use hapt_analysis::{Error, MAX_IN_FLIGHT, Passivity, uneven_damping};
use hapt_testing::prelude::*;

use super::*;

proptest! {
    #![proptest_config(hapt_testing::cases(32))]

    #[test]
    fn a_spring_and_a_differenced_damper_to_ground(k in 0.0..1e4f64, b in 0.0..10.0f64, period in 1e-4..1e-2f64) {
        near(required(&plain(to_ground(k, b), period)), 0.5 * k * period + b, 1e-12);
    }

    #[test]
    fn a_low_pass_takes_less(k in 0.0..1e3f64, b in 0.0..10.0f64, period in 1e-4..1e-2f64, cutoff in 0.1..1e4f64) {
        let mut world = plain(to_ground(k, b), period);
        world.sampling.estimator = EstimatorKind::LowPass;
        world.sampling.cutoff = Some(cutoff);
        let tau = 1.0 / (TAU * cutoff);
        near(required(&world), 0.5 * k * period + b * period / (period + 2.0 * tau), 1e-10);
    }

    /// (T71), by a grid of its own.
    #[test]
    fn a_damper_on_a_difference_over_samples(k in 0.0..1e3f64, b in 0.01..10.0f64, period in 1e-4..1e-2f64, every in 1..60u32) {
        let mut world = plain(to_ground(k, b), period);
        world.sampling.every = every;
        let mean = |theta: f64| -(1..=every).map(|i| (f64::from(i) * theta).cos()).sum::<f64>() / f64::from(every);
        let points = 200 * every;
        let most = (0..=points).map(|i| mean(PI * f64::from(i) / f64::from(points))).fold(0.0, f64::max);
        let found = (required(&world) - 0.5 * k * period) / b;
        prop_assert!(found > most - 1e-9 && found < most + 2e-4, "{found} {most}");
        prop_assert!(found < 0.21724 + 1.0 / f64::from(every));
        if let Some(closed) = [1.0, 9.0 / 16.0].get(every as usize - 1) {
            prop_assert!((found - closed).abs() < 1e-9, "{found} {closed}");
        }
    }

    /// (T70), linear and not.
    #[test]
    fn a_spring_behind_a_filter_of_the_position(
        k in 0.1..1e3f64, period in 1e-4..1e-2f64, x in -3.0..1.0f64, d in 0..4u32, damping in 0.0..1.0f64,
    ) {
        let mut world = plain(to_ground(k, 0.0), period);
        let x = 10f64.powf(x);
        world.sampling.filter = Some(x / (TAU * period));
        let wanted = 0.5 * k * period / (0.5 * x).tanh();
        near(required(&world), wanted, 1e-9);
        world.sampling.interval_max = Some(3.0 * period);
        near(uneven_damping(&world).unwrap().unwrap(), 3.0 * wanted, 1e-9);
        world.sampling.interval_max = None;
        world.sampling.delay = hapt_model::Delay::Seconds(f64::from(d) * period);
        near(required(&world), wanted + k * period * f64::from(d), 1e-9);
        // A wall requires what its spring requires, and its damping.
        let law = Law::Wall { side: Side::Above, at: 0.1, stiffness: k, damping };
        world.couplings = vec![Coupling { first: End::Puck, second: End::Ground, law, limit: None }];
        near(required(&world), wanted + k * period * f64::from(d) + damping, 1e-9);
        prop_assert!(passivity(&world).unwrap().not_proved.is_empty());
        world.device.limit = Some(1.0);
        prop_assert!(passivity(&world).unwrap().not_proved.is_empty());
    }

    #[test]
    fn a_spring_under_a_delay(k in 0.1..1e4f64, d in 0..40u32, a in 0.001..0.999f64, period in 1e-4..1e-2f64) {
        let mut world = plain(to_ground(k, 0.0), period);
        world.sampling.delay = hapt_model::Delay::Seconds(f64::from(d) * period);
        near(required(&world), k * period * (0.5 + f64::from(d)), 1e-11);
        world.sampling.delay = hapt_model::Delay::Seconds((f64::from(d) + a) * period);
        let q = 1.0 + 2.0 * (f64::from(d) + a);
        near(required(&world), 0.25 * k * period * (q + (q * q + 4.0 * a * (1.0 - a)).sqrt()), 1e-9);
    }

    #[test]
    fn at_the_end_of_a_lossless_step_any_world_costs_its_bare_springs(bench in worlds(Dampers::None, true), x in 0.01..1.9f64, at in 0..5usize) {
        let method = [Method::Zoh, Method::Trapezoidal, Method::BackwardEuler, Method::SemiImplicitEuler, Method::Zoh][at];
        let output = if method == Method::SemiImplicitEuler { Output::Middle } else { Output::End };
        let period = x / fastest(&bench);
        let k: f64 = bench.couplings.iter().filter(|c| c.first == End::Puck || c.second == End::Puck).map(|c| match c.law {
            Law::Spring { stiffness, .. } => stiffness,
            _ => 0.0,
        }).sum();
        let world = world(bench, method, output, period);
        let found = passivity(&world).unwrap();
        if method == Method::BackwardEuler {
            prop_assert!(found.required_damping.unwrap() <= 0.5 * k * period * (1.0 + 1e-9));
        } else {
            near(found.required_damping.unwrap(), 0.5 * k * period, 1e-9);
        }
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(24))]

    #[test]
    fn dampers_at_the_puck_cost_their_damping_more_at_most(bench in worlds(Dampers::Fixed, true), x in 0.01..1.9f64, at in 0..3usize) {
        let method = [Method::Zoh, Method::Trapezoidal, Method::BackwardEuler][at];
        // Over hours a stiff damper's λ is within 1e-9/s of -1, and counts as on the circle.
        let period = (x / fastest(&bench)).min(1.0);
        let at_puck = |of: fn(&Law) -> f64| -> f64 {
            bench.couplings.iter().filter(|c| c.first == End::Puck || c.second == End::Puck).map(|c| of(&c.law)).sum()
        };
        let k = at_puck(|law| if let Law::Spring { stiffness, .. } = law { *stiffness } else { 0.0 });
        let b = at_puck(|law| if let Law::Damper { damping: Damping::Fixed(b) } = law { *b } else { 0.0 });
        let found = passivity(&world(bench, method, Output::End, period)).unwrap();
        match found.required_damping {
            Some(found) => prop_assert!(found <= (0.5 * k * period + b) * (1.0 + 1e-9), "{found} {}", 0.5 * k * period + b),
            // Poles so near to each other that their sum loses its digits: nothing is claimed.
            None => prop_assert!(!found.passive.holds() && found.not_proved.iter().any(|reason| reason.contains("double precision")), "{found:?}"),
        }
    }

    #[test]
    fn steps_ahead_make_up_for_whole_samples_of_delay(
        bench in worlds(Dampers::None, false), x in 0.01..1.9f64, d in 1..6u32, trapezoidal in any::<bool>(),
    ) {
        let period = x / fastest(&bench);
        let k: f64 = bench.couplings.iter().filter(|c| c.first == End::Puck || c.second == End::Puck).map(|c| match c.law {
            Law::Spring { stiffness, .. } => stiffness,
            _ => 0.0,
        }).sum();
        prop_assume!(k > 0.0);
        let method = if trapezoidal { Method::Trapezoidal } else { Method::Zoh };
        let mut world = world(bench, method, Output::End, period);
        world.sampling.delay = hapt_model::Delay::Seconds(f64::from(d) * period);
        world.sampling.advance = d;
        prop_assert!(required(&world) <= k * period * (0.5 + f64::from(d)) * (1.0 + 1e-9));
        world.sampling.advance = 0;
        let found = cause(&world);
        prop_assert!(matches!(found, Some(Cause::NegativeResidue { .. })), "{found:?}");
        world.sampling.delay = hapt_model::Delay::Seconds((f64::from(d) + 0.3) * period);
        let found = cause(&world);
        prop_assert!(matches!(found, Some(Cause::FractionalDelay { .. })), "{found:?}");
    }

    #[test]
    fn foaw_is_the_worse_of_its_windows(k in 0.0..1e3f64, b in 0.01..10.0f64, window in 2..256u32, best in any::<bool>()) {
        let mut world = plain(to_ground(k, b), 1e-3);
        world.sampling.estimator = if best { EstimatorKind::FoawBest } else { EstimatorKind::Foaw };
        world.sampling.window = window;
        let found = passivity(&world).unwrap();
        // The shortest is the difference.
        near(found.required_damping.unwrap(), 0.5e-3 * k + b, 1e-9);
        prop_assert!(!found.proved.holds() && found.not_proved[0].contains("window"));
    }
}

#[test]
fn backward_euler_from_the_start_costs_nine_eighths_and_up() {
    for (x, times, digits) in [(1e-3, 1.125, 1e-6), (1.0, 5f64.sqrt() - 1.0, 1e-9), (3.0, 1.69, 5e-3)] {
        near(required(&wheel(Method::BackwardEuler, Output::Start, x)), 0.05 * times, digits);
    }
    // At END, backward Euler's numerical damping lowers the requirement: K T/2/(1 + x²/4).
    near(required(&wheel(Method::BackwardEuler, Output::End, 1.0)), 0.05 / 1.25, 1e-9);
}

#[test]
fn a_delay_beyond_the_longest_is_named() {
    let mut world = plain(to_ground(10.0, 0.0), 1e-3);
    world.sampling.delay = hapt_model::Delay::Seconds(1e-3 * MAX_IN_FLIGHT as f64);
    near(required(&world), 0.01 * (MAX_IN_FLIGHT as f64 + 0.5), 1e-9);
    world.sampling.delay = hapt_model::Delay::Seconds(1e-3 * MAX_IN_FLIGHT as f64 + 1e-3);
    let error = passivity(&world).unwrap_err();
    assert!(matches!(error, Error::InFlight { limit: MAX_IN_FLIGHT, .. }));
    assert!(error.to_string().contains("501 periods") && error.to_string().contains("500"));
}

#[test]
fn nothing_at_the_puck_asks_for_nothing() {
    let Passivity { required_damping, at_hz, passive, proved, .. } = passivity(&plain(vec![], 1e-3)).unwrap();
    assert_eq!((required_damping, at_hz, passive.holds(), proved.holds()), (Some(0.0), None, true, true));
}

/// Steps of a sine of a whole number of turns, of which a hand draws what the law gives beyond b ∫ż² (T29).
fn drawn(theta: f64, damping: f64, [mass, pole, period]: [f64; 3]) -> f64 {
    let turns = 400;
    let samples = (turns as f64 * TAU / theta).round() as usize;
    let (mut z, mut steps, mut rate, mut last) = ([0.0; 2], [0.0; 2], 0.0, 0.0);
    let mut work = 0.0;
    for k in 0..samples {
        z = [(theta * k as f64).sin(), z[0]];
        // The velocity behind the low-pass, and its difference as the acceleration.
        steps = [z[0] - z[1], steps[0]];
        rate += (1.0 - pole) * (steps[0] / period - rate);
        let torque = mass * (rate - last) / period;
        last = rate;
        let travel = (theta * (k + 1) as f64).sin() - z[0];
        // The first half is a transient.
        if 2 * k > samples {
            work += torque * travel - damping * travel * travel / period;
        }
    }
    work
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    /// (T78): the damping that a compensation of inertia by a low-passed acceleration requires, at the worst of all frequencies and no
    /// less.
    #[test]
    fn a_compensated_inertia_costs_more_than_it_is_worth(mass in 1e-5..1e-2_f64, ratio in -2.0..2.0_f64, period in 1e-4..1e-2_f64) {
        let tau = period * 10_f64.powf(ratio);
        let pole = tau / (tau + period);
        let root = (1.0 + pole).sqrt();
        let cost = mass / period * (1.0 - pole) * (root - (1.0 - pole)).powi(2) / (2.0 * pole * pole);
        // Where the bound is reached: y = (1 - p) √(1 + p).
        let worst = ((1.0 + pole * pole - (1.0 - pole) * root) / (2.0 * pole)).acos();
        let numbers = [mass, pole, period];
        prop_assert!(drawn(worst, 0.98 * cost, numbers) > 0.0);
        for part in 1..60 {
            let theta = PI * f64::from(part) / 60.0;
            prop_assert!(drawn(theta, 1.02 * cost, numbers) < 0.0);
        }
        prop_assert!(drawn(worst, 1.02 * cost, numbers) < 0.0);
        // Below the filter's corner ω J_c is less.
        prop_assert!(cost * (1.0 + 1e-12) >= mass / (tau + period));
    }
}
