//! Uneven samples, delays that vary and motors that lag: closed forms, aliases, hands, and energies along random motions.

use hapt_analysis::{breaking_damping, is_certified, uneven};
use hapt_model::{Delay, Tolerances};
use hapt_testing::prelude::*;
use nalgebra::Complex;

use super::*;

const PERIOD: f64 = 1e-3;

fn spring_at_puck(stiffness: f64) -> World {
    plain(vec![spring(End::Puck, End::Ground, stiffness)], PERIOD)
}

fn uneven_damping(world: &World) -> f64 {
    uneven(world).unwrap().required_damping.unwrap_or(f64::INFINITY)
}

/// The requirement of a spring at one frequency, by sums over its aliases.
fn by_aliases(stiffness: f64, delay: f64, lag: f64, phi: f64) -> f64 {
    let (mut y, mut a) = (Complex::from(0.0), 0.0);
    for n in -4000..=4000 {
        let omega = (phi + f64::from(n) * std::f64::consts::TAU) / PERIOD;
        y += Complex::from_polar(1.0, -omega * delay)
            / (Complex::new(1.0, omega * lag) * Complex::new(0.0, omega).powu(2));
        a += 1.0 / (omega * omega * (1.0 + (omega * lag).powi(2)));
    }
    y *= (1.0 - Complex::from_polar(1.0, -phi)) / PERIOD;
    let (m, spread) = (-stiffness * y.re, (a - y.norm_sqr()).max(0.0));
    0.5 * (m + (m * m + stiffness * stiffness * spread).sqrt())
}

proptest! {
    #![proptest_config(hapt_testing::cases(24))]

    #[test]
    fn a_lagging_motor_asks_for_what_the_aliases_say(
        stiffness in 0.1..100.0f64, delay in prop_oneof![Just(0.0), 0.0..3.0f64], lag in -2.0..1.5f64,
    ) {
        let (delay, lag) = (delay * PERIOD, 10f64.powf(lag) * PERIOD);
        let mut world = spring_at_puck(stiffness);
        (world.sampling.delay, world.device.lag) = (Delay::Seconds(delay), lag);
        let phis = (1..=60).map(|i| std::f64::consts::PI * (f64::from(i) / 60.0).powi(2));
        let most = phis.map(|phi| by_aliases(stiffness, delay, lag, phi)).fold(0.0, f64::max);
        let found = required(&world);
        prop_assert!(found >= most * (1.0 - 2e-4) && found <= most * 1.01, "{found} {most}");
    }

    #[test]
    fn without_delay_and_lag_a_loop_asks_for_its_longest_interval(
        bench in worlds(Dampers::Fixed, true), x in 0.01..1.9f64, stretch in 1.0..4.0f64, method in 0..8usize,
    ) {
        let (method, period) = (Method::ALL[method], x / fastest(&bench));
        let mut world = world(bench, method, Output::End, period);
        let even = required(&world);
        world.sampling.interval_max = Some(stretch * period);
        let found = uneven_damping(&world);
        prop_assert!(found == even || (found / (stretch * even) - 1.0).abs() < 1e-12, "{found} {even}");
    }

    #[test]
    fn known_numbers_are_the_verdict_at_even_samples(
        bench in worlds(Dampers::Fixed, true), x in 0.01..1.9f64, delay in 0.0..2.5f64, lag in prop_oneof![Just(0.0), 0.01..2.0f64],
    ) {
        let period = x / fastest(&bench);
        let mut world = world(bench, Method::Zoh, Output::End, period);
        (world.sampling.delay, world.device.lag) = (Delay::Seconds(delay * period), lag * period);
        let (even, found) = (passivity(&world).unwrap(), uneven(&world).unwrap());
        prop_assert_eq!(even.required_damping, found.required_damping);
        prop_assert_eq!((even.passive, even.proved, even.not_proved), (found.passive, found.proved, found.not_proved));
    }

    /// The bounds are no less than what one of their own patterns needs, and for springs hardly more.
    #[test]
    fn the_bounds_of_a_spring_are_near_what_even_samples_need(
        stiffness in 0.1..100.0f64, stretch in 1.0..3.0f64, late in 0.0..1.0f64, lag in -2.0..1.0f64,
    ) {
        let mut world = spring_at_puck(stiffness);
        // Even samples at the longest interval are one of the patterns.
        let mut slow = plain(world.couplings.clone(), stretch * PERIOD);
        world.sampling.interval_max = Some(stretch * PERIOD);
        world.sampling.delay_max = Some(Delay::Seconds(late * PERIOD));
        slow.sampling.delay = Delay::Seconds(late * PERIOD);
        let share = required(&slow) / uneven_damping(&world);
        prop_assert!((0.75..=1.0 + 1e-9).contains(&share), "{share}");
        // At even samples and with a delay that varies it is what the longest delay needs.
        (world.sampling.interval_max, world.sampling.period) = (None, stretch * PERIOD);
        near(uneven_damping(&world), required(&slow), 1e-9);
        (world.sampling.interval_max, world.sampling.period) = (Some(stretch * PERIOD), PERIOD);
        world.sampling.delay_max = None;
        slow.sampling.delay = Delay::Seconds(0.0);
        (world.device.lag, slow.device.lag) = (10f64.powf(lag) * PERIOD, 10f64.powf(lag) * PERIOD);
        let share = required(&slow) / uneven_damping(&world);
        prop_assert!((0.95..=1.0 + 1e-9).contains(&share), "{share}");
        // Delay and lag together: four fifths.
        world.sampling.delay = Delay::Seconds(late * PERIOD);
        slow.sampling.delay = world.sampling.delay;
        let share = required(&slow) / uneven_damping(&world);
        prop_assert!((0.75..=1.0 + 1e-9).contains(&share), "{share}");
    }

    #[test]
    fn a_delay_that_varies_costs_damped_bodies_no_less_than_one_that_stays(
        bench in worlds(Dampers::Fixed, false), x in 0.01..1.9f64, late in 0.01..1.0f64,
    ) {
        let period = x / fastest(&bench);
        let mut world = world(bench, Method::Zoh, Output::End, period);
        world.sampling.delay_max = Some(Delay::Seconds(late * period));
        let found = uneven(&world).unwrap();
        world.sampling.delay = Delay::Seconds(late * period);
        world.sampling.delay_max = None;
        let even = passivity(&world).unwrap().required_damping;
        match (found.required_damping, even) {
            (Some(bound), Some(even)) => prop_assert!(bound >= even * (1.0 - 1e-9), "{bound} {even}"),
            (Some(_), None) => prop_assert!(false, "a bound where even samples have none"),
            (None, _) => prop_assert!(!found.proved.holds() && !found.not_proved.is_empty()),
        }
    }

    /// In a time that runs T/L as fast, samples of L are even, and a delay takes its part of them.
    #[test]
    fn a_delay_beside_damped_bodies_asks_for_what_the_longest_intervals_need(
        bench in worlds(Dampers::Fixed, false), x in 0.01..1.9f64, stretch in 1.01..3.0f64, late in 0.01..1.0f64, least in 0.0..1.0f64,
    ) {
        let period = x / fastest(&bench);
        let mut world = world(bench, Method::Zoh, Output::End, period);
        let even = world.clone();
        let at = |delay: f64| {
            let mut even = even.clone();
            even.sampling.delay = Delay::Seconds(delay / stretch);
            passivity(&even).unwrap().required_damping.map(|b| b * stretch)
        };
        let late = late * period;
        world.sampling.interval_max = Some(stretch * period);
        world.sampling.delay = Delay::Seconds(late);
        let of = |world: &World| uneven(world).unwrap().required_damping;
        match (of(&world), at(late)) {
            (Some(bound), Some(even)) => near(bound, even, 1e-9),
            (Some(_), None) => prop_assert!(false, "a bound where even samples have none"),
            (None, _) => {}
        }
        // A delay that varies: the bound is no less than that of any constant delay, and at most twice the largest of these.
        world.sampling.delay = Delay::Seconds(least * late);
        world.sampling.delay_max = Some(Delay::Seconds(late));
        if let Some(bound) = of(&world) {
            let all = [0.0, 0.3, 0.7, 1.0].map(|part| at(late * (least + part * (1.0 - least))).unwrap());
            let most = all.into_iter().fold(0.0, f64::max);
            prop_assert!(most <= bound * (1.0 + 1e-9) && bound <= 2.0 * most + 1e-12, "{bound} {most}");
        }
    }

    #[test]
    fn no_hand_breaks_a_loop_with_a_lag(
        bench in worlds(Dampers::Fixed, false), lag in 0.01..3.0f64, delay in prop_oneof![Just(0.0), 0.0..2.0f64], at in 0..8usize,
    ) {
        let mut world = bench.world(Method::ALL[at], Output::End, PERIOD);
        (world.device.lag, world.sampling.delay) = (lag * PERIOD, Delay::Seconds(delay * PERIOD));
        let Some(required) = passivity(&world).unwrap().required_damping else { return Ok(()) };
        world.device.damping = required * (1.0 + 1e-6);
        if !is_certified(&world) {
            return Ok(());
        }
        if let Some(breaking) = breaking_damping(&world).unwrap() {
            prop_assert!(breaking.damping <= required * (1.0 + 1e-6), "{breaking:?} {required}");
        }
    }

    #[test]
    fn a_hand_breaks_a_spring_behind_a_lag_close_to_the_requirement(stiffness in 1.0..40.0f64, lag in -1.0..1.0f64) {
        let mut world = spring_at_puck(stiffness);
        world.device.lag = 10f64.powf(lag) * PERIOD;
        let breaking = breaking_damping(&world).unwrap().unwrap();
        let required = required(&world);
        prop_assert!(breaking.damping <= required * (1.0 + 1e-6) && breaking.damping > 0.8 * required, "{breaking:?} {required}");
    }

    /// A body on an undamped spring, its step exact: the torque drawn along any motion under any pattern of intervals is at most what
    /// a damping of K L/2 takes.
    #[test]
    fn no_motion_draws_energy_from_a_body_under_any_pattern(
        theta in 0.05..3.0f64, steps in prop::collection::vec((0.05..1.0f64, -1.0..1.0f64), 4..60), stretch in 1.0..3.0f64,
    ) {
        let stiffness = 10.0;
        let (longest, mut z, mut w, mut v) = (stretch * PERIOD, 0.0, 0.0, 0.0);
        let (mut drawn, mut taken) = (0.0, 0.0);
        for (share, velocity) in steps {
            let interval = share * longest;
            // w'' + θ²/T² w = θ²/T² z over one nominal period.
            let (q, rate) = (w - z, v * PERIOD / theta);
            w = z + q * theta.cos() + rate * theta.sin();
            v = (rate * theta.cos() - q * theta.sin()) * theta / PERIOD;
            let torque = stiffness * (w - z);
            drawn += torque * velocity * interval;
            taken += velocity * velocity * interval;
            z += velocity * interval;
        }
        prop_assert!(drawn <= 0.5 * stiffness * longest * taken * (1.0 + 1e-9) + 1e-15, "{drawn} {taken}");
    }

    /// Detents behind a delay that varies and a motor that lags, integrated in 320 steps an interval.
    #[test]
    fn no_motion_draws_energy_from_detents_behind_delay_and_lag(
        steps in prop::collection::vec((0.3..1.0f64, 0.0..0.3f64, prop::array::uniform8(-1.0..1.0f64)), 4..30),
        lag in prop_oneof![Just(0.0), 0.02..1.0f64], stretch in 1.0..2.0f64, late in any::<bool>(),
    ) {
        let (torque, pitch) = (0.02, 0.1);
        let mut world = plain(
            vec![Coupling { first: End::Puck, second: End::Ground, law: Law::Detent { torque, pitch, phase: 0.0 }, limit: None }],
            PERIOD,
        );
        let longest = stretch * PERIOD;
        world.sampling.interval_max = Some(longest);
        world.sampling.delay_max = late.then_some(Delay::Seconds(0.3 * PERIOD));
        world.device.lag = lag * PERIOD;
        let damping = uneven_damping(&world);
        prop_assert!(uneven(&world).unwrap().proved.holds());
        let turn = std::f64::consts::TAU / pitch;
        let law = |z: f64| -torque * (turn * z).sin();
        // From the bottom of a valley, with the motor at rest: nothing is stored at the start.
        let (mut z, mut motor, mut held, mut energy, mut most) = (0.0, 0.0, 0.0, 0.0, 0.0f64);
        for (share, delay, velocities) in steps {
            let interval = share * longest;
            let arrives = if late { delay * PERIOD } else { 0.0 };
            let next = law(z);
            let dt = interval / 320.0;
            for i in 0..320 {
                if f64::from(i) * dt >= arrives { held = next }
                let velocity = 10.0 * velocities[(i / 40) as usize];
                let gone = if lag > 0.0 { -(-dt / world.device.lag).exp_m1() } else { 1.0 };
                let mean = if lag > 0.0 { held + (motor - held) * gone * world.device.lag / dt } else { held };
                motor += (held - motor) * gone;
                energy += (mean - damping * velocity) * velocity * dt;
                z += velocity * dt;
            }
            most = most.max(energy);
        }
        // The motor held 0 before the first command came, and a torque in its lag.
        let begun = torque * 10.0 * (0.3 * PERIOD + world.device.lag);
        prop_assert!(most <= 1e-3 * torque * pitch + begun, "{most}");
    }
}

#[test]
fn tolerances_ask_for_the_least_damping_and_the_worst_lag() {
    let mut world = spring_at_puck(10.0);
    world.device.damping = 6e-3;
    assert!(uneven(&world).unwrap().passive.holds() && is_certified(&world));
    world.device.tolerances = Tolerances { damping: 0.2, ..Tolerances::default() };
    // 0.8 of 6e-3 is below KT/2.
    let found = uneven(&world).unwrap();
    assert!(!found.passive.holds() && !is_certified(&world) && found.proved.holds());
    near(found.required_damping.unwrap(), 5e-3, 1e-9);
    world.device.damping = 6.5e-3;
    assert!(uneven(&world).unwrap().passive.holds() && is_certified(&world));
    // A lag that is known within a half requires more than the middle and than both ends.
    (world.device.lag, world.device.tolerances.lag) = (0.4e-3, 0.5);
    let found = uneven_damping(&world);
    for lag in [0.2e-3, 0.4e-3, 0.6e-3] {
        let mut known = spring_at_puck(10.0);
        known.device.lag = lag;
        assert!(found >= required(&known));
    }
}

#[test]
fn an_undamped_body_has_no_proof_behind_a_delay_that_varies_or_a_lag() {
    let mut world = wheel(Method::Zoh, Output::End, 0.1);
    world.sampling.delay_max = Some(Delay::Seconds(0.1e-3));
    let found = uneven(&world).unwrap();
    assert!(found.required_damping.is_none() && !found.passive.holds() && !found.proved.holds());
    assert!(found.not_proved[0].contains("undamped"), "{:?}", found.not_proved);
    world.sampling.delay_max = None;
    world.device.lag = 0.1e-3;
    assert!(matches!(cause(&world), Some(Cause::MotorLag { .. })));
    assert!(!is_certified(&world));
}
