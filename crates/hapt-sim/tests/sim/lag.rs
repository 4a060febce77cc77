//! A motor whose torque follows its command by a first-order lag: closed forms, an independent integration, energies and limits.

use crate::common::{bare, rows, scenario, spring};
use hapt_model::*;
use hapt_testing::prelude::*;

fn constant(torque: f64) -> Coupling {
    Coupling { first: End::Puck, second: End::Ground, law: Law::Constant { torque }, limit: None }
}

/// A hand that pushes with 0.
fn no_hand() -> Drive {
    Drive::Torque(Shape::Step { to: 0.0, at: 0.0 })
}

fn close(a: f64, b: f64, scale: f64) -> bool {
    (a - b).abs() <= 1e-9 * scale
}

proptest! {
    #![proptest_config(hapt_testing::cases(60))]

    /// J v̇ = -b v + c (1 - e^(-t/τ)), also where J/b is τ, or nearly.
    #[test]
    fn a_constant_command_moves_the_puck_as_two_exponentials(
        inertia in 1e-4_f64..1e-2, lag in 1e-5_f64..0.03, ratio in prop_oneof![Just(1.0), Just(1.0 + 1e-9), 0.01_f64..5.0],
        torque in -1.0_f64..1.0, delay in prop_oneof![Just(0.0), 0.0_f64..4e-3],
    ) {
        let mut world = bare();
        let rate = ratio / lag;
        (world.device.inertia, world.device.damping, world.device.lag) = (inertia, inertia * rate, lag);
        world.sampling.delay = hapt_model::Delay::Seconds(delay);
        world.couplings = vec![constant(torque)];
        for row in rows(&world, &scenario(0.1, no_hand(), None)) {
            let t = (row.time - delay).max(0.0);
            // (e^(-t/τ) - e^(-rate t))/(rate - 1/τ) as e^(-t/τ) (1 - e^(-x t))/x.
            let x = rate - 1.0 / lag;
            let divided = (-t / lag).exp() * if x == 0.0 { t } else { -(-x * t).exp_m1() / x };
            let v = torque / (inertia * rate) * -(-rate * t).exp_m1() - torque / inertia * divided;
            prop_assert!(close(row.applied, -torque * (-t / lag).exp_m1(), torque.abs()), "{} at {}", row.applied, row.time);
            prop_assert!(close(row.puck_velocity, v, torque.abs() / (inertia * rate)), "{} {v}", row.puck_velocity);
        }
    }

    /// Stuck, until c (1 - e^(-t/τ)) passes the friction f inside of an interval; then J v̇ = c - f - c e^(-t/τ).
    #[test]
    fn a_stuck_puck_breaks_loose_when_the_rising_torque_passes_friction(
        friction in 0.01_f64..0.1, ratio in prop_oneof![0.2_f64..1.0, 1.0_f64..4.0], lag in 1e-4_f64..0.02,
    ) {
        let mut world = bare();
        (world.device.damping, world.device.friction, world.device.lag) = (0.0, friction, lag);
        let torque = friction * ratio;
        world.couplings = vec![constant(torque)];
        let start = if ratio > 1.0 { -lag * (-1.0 / ratio).ln_1p() } else { f64::INFINITY };
        for row in rows(&world, &scenario(0.05, no_hand(), None)) {
            if row.time <= start {
                prop_assert_eq!((row.puck, row.puck_velocity), (0.0, 0.0), "{} before {}", row.time, start);
                continue;
            }
            let faded = torque * lag * ((-row.time / lag).exp() - (-start / lag).exp());
            let v = ((torque - friction) * (row.time - start) + faded) / world.device.inertia;
            prop_assert!(close(row.puck_velocity, v, 10.0), "{} {v} at {}", row.puck_velocity, row.time);
        }
    }

    /// The work is integrated by Simpson's rule.
    #[test]
    fn the_work_on_a_prescribed_hand_is_that_of_the_lagged_torque(
        lag in 1e-4_f64..0.05, torque in -1.0_f64..1.0, amplitude in -1.0_f64..1.0, frequency in 0.5_f64..30.0,
        ramp in any::<bool>(),
    ) {
        let mut world = bare();
        world.device.lag = lag;
        world.couplings = vec![constant(torque)];
        let shape = match ramp {
            true => Shape::Ramp { to: amplitude, at: 0.013, over: 0.0317 },
            false => Shape::Sine { amplitude, frequency, phase: 0.0 },
        };
        let omega = std::f64::consts::TAU * frequency;
        let velocity = |t: f64| match ramp {
            true => if (0.013..0.0447).contains(&t) { amplitude / 0.0317 } else { 0.0 },
            false => amplitude * omega * (omega * t).cos(),
        };
        let last = rows(&world, &scenario(0.06, Drive::Position(shape), None)).pop().unwrap();
        // Simpson's rule over smooth parts.
        let part = |from: f64, to: f64| {
            let n = 2000;
            let h = (to - from) / f64::from(n);
            let power = |i: i32| {
                let t = (from + h * f64::from(i)).clamp(from + 1e-12, to - 1e-12);
                velocity(t) * -torque * (-t / lag).exp_m1()
            };
            let weight = |i: i32| if i == 0 || i == n { 1.0 } else if i % 2 == 1 { 4.0 } else { 2.0 };
            (0..=n).map(|i| weight(i) * power(i)).sum::<f64>() * h / 3.0
        };
        let work = part(0.0, 0.013) + part(0.013, 0.0447) + part(0.0447, 0.06);
        prop_assert!((last.ledger.motor - work).abs() < 1e-8 * (1.0 + omega), "{} {work}", last.ledger.motor);
    }

    /// Runge-Kutta steps of 5 µs from the run's own commands, with or without a grip.
    #[test]
    fn an_independent_integration_of_the_same_commands_gives_the_same_motion(
        inertia in 3e-4_f64..1e-2, damping in 0.0_f64..0.02, lag in 2e-4_f64..0.02, delay in prop_oneof![Just(0.0), Just(4e-4), Just(2.6e-3)],
        grip in prop::option::of((0.0_f64..1e-3, 0.0_f64..0.02, 0.0_f64..10.0)), stiffness in 0.1_f64..3.0, push in -0.3_f64..0.3,
    ) {
        let mut world = bare();
        world.sampling.delay = hapt_model::Delay::Seconds(delay);
        (world.device.inertia, world.device.damping, world.device.lag) = (inertia, damping, lag);
        world.couplings = vec![spring(End::Puck, End::Ground, stiffness)];
        let moves = Shape::Ramp { to: push, at: 0.0, over: 1.0 };
        let drive = match grip {
            Some((inertia, damping, stiffness)) => Drive::Grip { inertia, damping, stiffness, moves, switching: None },
            None => Drive::Torque(moves),
        };
        let run = rows(&world, &scenario(0.06, drive, None));
        let (mass, b, k) = grip.map_or((inertia, damping, 0.0), |(j, b, k)| (inertia + j, damping + b, k));
        let hand = |t: f64| grip.map_or(push * t, |(_, b, k)| k * push * t + b * push);
        let (steps, h) = (200, 5e-6);
        let late = (delay / 1e-3).floor() as usize;
        let change = ((delay - late as f64 * 1e-3) / h).round() as usize;
        let (mut y, mut held) = ([0.0, 0.0, 0.0], 0.0);
        for (index, row) in run.iter().enumerate() {
            let size = 1.0 + row.puck_velocity.abs();
            prop_assert!((row.puck - y[0]).abs() < 1e-8 * size && (row.puck_velocity - y[1]).abs() < 1e-6 * size, "{row:?} {y:?}");
            for step in 0..steps {
                if step == change && index >= late {
                    held = run[index - late].command;
                }
                let t = row.time + step as f64 * h;
                let rate = |y: [f64; 3], t: f64| [y[1], (hand(t) + y[2] - b * y[1] - k * y[0]) / mass, (held - y[2]) / lag];
                let ahead = |y: [f64; 3], d: [f64; 3], h: f64| std::array::from_fn(|i| y[i] + h * d[i]);
                let k1 = rate(y, t);
                let k2 = rate(ahead(y, k1, h / 2.0), t + h / 2.0);
                let k3 = rate(ahead(y, k2, h / 2.0), t + h / 2.0);
                let k4 = rate(ahead(y, k3, h), t + h);
                y = std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
            }
        }
    }

    /// The motion tends to that without a lag as the lag vanishes; a lag far longer than the run integrates the commands.
    #[test]
    fn a_vanishing_lag_has_no_effect_and_a_long_one_integrates(friction in prop_oneof![Just(0.0), 0.0_f64..0.02], stiffness in 0.1_f64..3.0) {
        let mut world = bare();
        (world.device.damping, world.device.friction) = (5e-3, friction);
        world.couplings = vec![spring(End::Puck, End::Ground, stiffness)];
        let drive = || Drive::Torque(Shape::Sine { amplitude: 0.1, frequency: 3.0, phase: 0.5 });
        let lagged = |lag: f64| {
            let mut world = world.clone();
            world.device.lag = lag;
            rows(&world, &scenario(0.1, drive(), None))
        };
        let at_once = lagged(0.0);
        for (short, none) in lagged(1e-12).iter().zip(&at_once) {
            prop_assert!(close(short.puck, none.puck, 1.0) && close(short.puck_velocity, none.puck_velocity, 10.0));
        }
        let long = lagged(1e6);
        let mut integral = 0.0;
        for row in &long {
            prop_assert!((row.applied - integral / 1e6).abs() < 1e-6 * (integral / 1e6_f64).abs() + 1e-15, "{} {integral}", row.applied);
            integral += row.command * 1e-3;
        }
    }
}
