//! Friction that depends on the position: closed forms, its energy, and short Runge-Kutta steps.

use std::f64::consts::TAU;

use hapt_plant::VirtualDevice;
use hapt_plant::spec::{DeviceSpec, Drive, FrictionByPosition, Shape};
use hapt_testing::prelude::*;

use crate::fields::{any_changes, any_device, any_hand, moved};

const T: f64 = 1e-3;

fn free() -> Drive {
    Drive::Torque(Shape::Step { to: 0.0, at: 0.0 })
}

/// The integral of the level from 0 to x, for a mean of 1.
fn taken(changes: &FrictionByPosition, x: f64) -> f64 {
    let rate = TAU / changes.pitch;
    let [from, to] = [0.0, x].map(|x| rate * (x - changes.phase));
    let of = |(n, sine, cosine): (f64, f64, f64)| {
        (sine * ((n * from).cos() - (n * to).cos()) + cosine * ((n * to).sin() - (n * from).sin())) / (n * rate)
    };
    x + changes.share * changes.waveform.harmonics().map(of).sum::<f64>()
}

proptest! {
    #![proptest_config(hapt_testing::cases(300))]

    /// Kinetic energy is the area below the level.
    #[test]
    fn a_thrown_puck_slides_until_friction_has_taken_its_energy(
        changes in any_changes(), inertia in 1e-4_f64..1e-2, levels in (1e-3_f64..0.05, 1e-3_f64..0.05), velocity in -10.0_f64..10.0,
        period in 1e-4_f64..0.1,
    ) {
        let (friction, backward) = levels;
        let spec = DeviceSpec {
            friction, friction_backward: Some(backward), friction_by_position: Some(changes), period, ..DeviceSpec::new(period, inertia)
        };
        let (energy, level) = (0.5 * inertia * velocity * velocity, if velocity < 0.0 { backward } else { friction });
        // The level is above a tenth of the mean: it takes at most ten times as long as under the mean.
        let samples = (10.0 * inertia * velocity.abs() / level / period).ceil() as usize + 1;
        let device = moved(&spec, &free(), velocity, &vec![0.0; samples]);
        let (x, v) = device.puck();
        prop_assert_eq!(v, 0.0);
        prop_assert!((level * taken(&changes, x).abs() - energy).abs() < 1e-11 * energy, "{x} {energy}");
        prop_assert!((device.ledger().friction - energy).abs() < 1e-11 * energy, "{:?} {energy}", device.ledger());
    }

    /// Rounded harmonics may ask for more than all of the mean level.
    #[test]
    fn friction_never_pushes_whatever_share_it_is_given(
        changes in any_changes(), much in 1.0_f64..3.0, inertia in 1e-4_f64..1e-2, friction in 1e-3_f64..0.05, velocity in -10.0_f64..10.0,
    ) {
        let changes = FrictionByPosition { share: changes.share / changes.most() * much, ..changes };
        let spec = DeviceSpec { friction, friction_by_position: Some(changes), ..DeviceSpec::new(T, inertia) };
        let mut device = VirtualDevice::new(&spec);
        device.set_out((0.0, velocity), (0.0, 0.0));
        let mut speed = velocity.abs();
        for _ in 0..200 {
            device.travel();
            let now = device.puck().1.abs();
            prop_assert!(now <= speed * (1.0 + 1e-12), "{now} after {speed}");
            speed = now;
        }
    }

    #[test]
    fn the_level_at_its_place_holds_a_puck_against_less_and_lets_it_go_under_more(
        changes in any_changes(), inertia in 1e-4_f64..1e-2, levels in (1e-3_f64..0.05, 1e-3_f64..0.05), place in -3.0_f64..3.0,
        part in prop_oneof![0.0_f64..1.0 - 1e-9, 1.0 + 1e-9..2.0], back in any::<bool>(), more in 0.0_f64..0.01,
    ) {
        let (friction, backward) = levels;
        let stribeck = Some(hapt_plant::spec::Stribeck { torque: more, velocity: 1.0 });
        let spec = DeviceSpec {
            friction, friction_backward: Some(backward), friction_by_position: Some(changes), stribeck, ..DeviceSpec::new(T, inertia)
        };
        let (sign, mean) = if back { (-1.0, backward) } else { (1.0, friction) };
        let mut device = VirtualDevice::new(&spec);
        device.set_out((place, 0.0), (0.0, 0.0));
        device.command(sign * part * (mean * changes.at(place) + more));
        (0..5).for_each(|_| device.travel());
        if part < 1.0 {
            prop_assert_eq!(device.puck(), (place, 0.0));
        } else {
            prop_assert!(sign * (device.puck().0 - place) > 0.0);
        }
    }

    /// A torque that rises slowly starts the puck where it reaches the level of the place.
    #[test]
    fn a_rising_torque_starts_the_puck_at_the_level_of_its_place(
        changes in any_changes(), inertia in 1e-4_f64..1e-2, friction in 1e-3_f64..0.05, slope in 0.05_f64..2.0, back in any::<bool>(),
    ) {
        let spec = DeviceSpec { friction, friction_by_position: Some(changes), ..DeviceSpec::new(T, inertia) };
        let sign = if back { -1.0 } else { 1.0 };
        let starts = friction * changes.at(0.0) / slope;
        let hand = Drive::Torque(Shape::Ramp { to: sign * slope, at: 0.0, over: 1.0 });
        let samples = (starts / T).floor() as usize;
        // The ramp takes a second.
        prop_assume!(starts < 0.9 && (starts / T).fract() > 1e-3);
        prop_assert_eq!(moved(&spec, &hand, 0.0, &vec![0.0; samples]).puck(), (0.0, 0.0));
        let (x, v) = moved(&spec, &hand, 0.0, &vec![0.0; samples + 1]).puck();
        // From there the torque beyond the level grows with the time: x = slope t³/6J, as long as the level changes little.
        let t = (samples + 1) as f64 * T - starts;
        let rate = friction * changes.steepest() / inertia * t * t;
        prop_assume!(rate < 0.1);
        let wanted = slope * t.powi(3) / (6.0 * inertia);
        prop_assert!((sign * x - wanted).abs() < 0.1 * rate * wanted + 1e-9 * wanted && sign * v > 0.0, "{x} {wanted}");
    }

    /// Gravity, cogging, a shaft, stops, hands: friction never supplies energy under any of them, and changes of 0 have no effect.
    #[test]
    fn friction_takes_in_every_period_and_changes_of_0_change_no_bit(
        spec in any_device(), changes in any_changes(), hand in any_hand(), velocity in -20.0_f64..20.0,
        commands in prop::collection::vec(-0.2_f64..0.2, 30),
    ) {
        let run = |changes: Option<FrictionByPosition>| {
            let mut device = moved(&DeviceSpec { friction_by_position: changes, ..spec }, &hand, velocity, &[]);
            let mut seen = Vec::new();
            for command in &commands {
                device.command(*command);
                device.travel();
                seen.push((device.puck(), device.handle(), device.ledger()));
            }
            seen
        };
        let mut before = 0.0;
        for (.., ledger) in run(Some(changes)) {
            prop_assert!(ledger.friction >= before * (1.0 - 1e-12) - 1e-15, "{before} {ledger:?}");
            before = ledger.friction;
        }
        prop_assert_eq!(run(None), run(Some(FrictionByPosition { share: 0.0, ..changes })));
    }

    /// A prescribed motion loses the level times the path, in closed form, for any number of turns of the hand in a period.
    #[test]
    fn a_prescribed_motion_pays_the_level_along_its_way(
        changes in any_changes(), levels in (1e-3_f64..0.05, 1e-3_f64..0.05),
        sine in (0.01_f64..0.3, prop_oneof![0.5_f64..50.0, 500.0_f64..5000.0], 0.0..TAU), periods in 1_usize..6,
    ) {
        let ((friction, backward), (amplitude, frequency, phase)) = (levels, sine);
        let spec = DeviceSpec { friction, friction_backward: Some(backward), friction_by_position: Some(changes), ..DeviceSpec::new(T, 1e-3) };
        let hand = Drive::Position(Shape::Sine { amplitude, frequency, phase });
        let first = moved(&spec, &hand, 0.0, &[0.0]);
        let device = moved(&spec, &hand, 0.0, &vec![0.0; 1 + periods]);
        let (steps, omega) = (400_000, TAU * frequency);
        let h = periods as f64 * T / f64::from(steps);
        let power = |i: i32| {
            let (sin, cos) = (omega * (T + h * (f64::from(i) + 0.5)) + phase).sin_cos();
            let v = amplitude * omega * cos;
            (if v < 0.0 { backward } else { friction }) * changes.at(amplitude * sin) * v.abs()
        };
        let work = h * (0..steps).map(power).sum::<f64>();
        let found = device.ledger().friction - first.ledger().friction;
        // A midpoint sum misses the corner of |v| by the square of its step.
        let size = amplitude * omega * periods as f64 * T * 0.1 + 1e-9;
        prop_assert!((found - work).abs() < 1e-7 * size, "{found} {work}");
    }

    #[test]
    fn friction_stays_where_the_device_is_when_the_origin_moves(changes in any_changes(), by in -5.0_f64..5.0, velocity in -5.0_f64..5.0) {
        let spec = DeviceSpec { friction: 0.02, friction_by_position: Some(changes), ..DeviceSpec::new(T, 1e-3) };
        let mut one = VirtualDevice::new(&spec);
        one.set_out((0.0, velocity), (0.0, 0.0));
        let mut other = one.clone();
        other.shift(by);
        for device in [&mut one, &mut other] {
            (0..20).for_each(|_| device.travel());
        }
        prop_assert!((one.puck().0 - other.puck().0 - by).abs() < 1e-11 && (one.puck().1 - other.puck().1).abs() < 1e-8);
    }
}

proptest! {
    #![proptest_config(hapt_testing::cases(100))]

    /// A puck that is driven to and fro: it slides, sticks, turns and starts again, with a spring of the hand.
    #[test]
    fn a_fine_integrator_finds_the_same_motion_and_the_same_loss(
        changes in any_changes(), inertia in 5e-4_f64..1e-2, damping in 0.0_f64..5e-3, levels in (5e-3_f64..0.05, 5e-3_f64..0.05),
        velocity in -5.0_f64..5.0, commands in prop::collection::vec(-0.1_f64..0.1, 12),
    ) {
        let changes = FrictionByPosition { pitch: changes.pitch.max(0.3), ..changes };
        let (friction, backward) = levels;
        let spec = DeviceSpec {
            damping, friction, friction_backward: Some(backward), friction_by_position: Some(changes), ..DeviceSpec::new(5.0 * T, inertia)
        };
        let device = moved(&spec, &free(), velocity, &commands);
        // Position, velocity, and the energy that friction has dissipated.
        let level = |d: f64, x: f64| (if d < 0.0 { backward } else { friction }) * changes.at(x);
        let step = |y: [f64; 3], command: f64, d: f64, h: f64| {
            let rate = |y: [f64; 3]| {
                let held = d * level(d, y[0]);
                [y[1], (command - damping * y[1] - held) / inertia, held * y[1]]
            };
            let ahead = |k: [f64; 3], part: f64| [0, 1, 2].map(|i| y[i] + part * h * k[i]);
            let a = rate(y);
            let b = rate(ahead(a, 0.5));
            let c = rate(ahead(b, 0.5));
            let e = rate(ahead(c, 1.0));
            [0, 1, 2].map(|i| y[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + e[i]))
        };
        let mut y = [0.0, velocity, 0.0];
        for command in &commands {
            let steps = 500;
            for _ in 0..steps {
                let mut left = spec.period / f64::from(steps);
                while left > 0.0 {
                    let d = if y[1] != 0.0 { y[1].signum() } else { command.signum() };
                    if y[1] == 0.0 && command.abs() <= level(d, y[0]) * (1.0 + 1e-12) {
                        break;
                    }
                    let next = step(y, *command, d, left);
                    if d * next[1] >= 0.0 {
                        y = next;
                        break;
                    }
                    let (mut low, mut high) = (0.0, left);
                    for _ in 0..60 {
                        let middle = 0.5 * (low + high);
                        if d * step(y, *command, d, middle)[1] < 0.0 { high = middle } else { low = middle }
                    }
                    y = step(y, *command, d, high);
                    y[1] = 0.0;
                    left -= high;
                }
            }
        }
        let (x, v) = device.puck();
        let fast = velocity.abs() + commands.iter().map(|command| command.abs()).sum::<f64>() * spec.period / inertia;
        prop_assert!((x - y[0]).abs() < 1e-9 * (1.0 + y[0].abs()), "{x} {v}, {y:?}");
        prop_assert!((v - y[1]).abs() < 1e-8 * fast, "{x} {v}, {y:?}");
        prop_assert!((device.ledger().friction - y[2]).abs() < 1e-9 * (1e-3 + y[2]), "{:?} {y:?}", device.ledger());
    }
}

/// At a place without friction the puck can start in either direction, and a level of 0 holds nothing.
#[test]
fn a_level_that_falls_to_0_holds_no_puck_there() {
    let waveform = hapt_core::Waveform { sine: [0.0; 4], cosine: [-1.0, 0.0, 0.0, 0.0] };
    let changes = FrictionByPosition { share: 1.0, pitch: TAU, phase: 0.0, waveform };
    let spec = DeviceSpec { friction: 0.02, friction_by_position: Some(changes), ..DeviceSpec::new(T, 1e-3) };
    for torque in [1e-9, -1e-9, 1e-3] {
        let device = moved(&spec, &free(), 0.0, &[torque; 20]);
        assert!(device.puck().0 * torque > 0.0, "{:?}", device.puck());
        // Its momentum carries it to where the level is three times the torque: F (1 - cos x) takes F x³/6 of torque · x.
        assert!(device.ledger().friction >= 0.0 && changes.at(device.puck().0) * 0.02 < 4.0 * torque.abs());
    }
    assert_eq!(moved(&spec, &free(), 0.0, &[0.0; 20]).puck(), (0.0, 0.0));
}
