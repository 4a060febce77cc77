//! Stops and starts of a puck whose velocity settles faster than a sample, or slower.

use std::f64::consts::FRAC_PI_2;

use hapt_plant::spec::{DeviceSpec, Drive, Hand, Shape};
use hapt_plant::{Script, VirtualDevice};
use hapt_testing::prelude::*;

use crate::reference::{Body, Complex, Push, advance};

const T: f64 = 1e-3;

/// A puck, the hand on it, and the motor's command at each sample.
#[derive(Clone, Debug)]
struct Case {
    spec: DeviceSpec,
    drive: Drive,
    commands: Vec<f64>,
}

/// Positions at the samples after the first, by the device.
fn by_device(case: &Case) -> Vec<f64> {
    let mut device = VirtualDevice::new(&case.spec);
    let hand = Hand { drive: case.drive.clone(), release: None };
    device.begin(&mut Script::new(&hand, 1e3 * case.spec.period, case.spec.period));
    let step = |command: &f64| {
        device.command(*command);
        device.travel();
        device.puck().0
    };
    case.commands.iter().map(step).collect()
}

/// The same in closed form, and how often the puck stops or starts.
fn by_closed_form(case: &Case) -> (Vec<f64>, u32) {
    let DeviceSpec { period, lag, inertia, damping, friction, friction_backward, .. } = case.spec;
    let friction = [friction, friction_backward.unwrap_or(friction)];
    let (shape, hand) = match &case.drive {
        Drive::Torque(shape) => (shape, None),
        Drive::Grip { inertia, damping, stiffness, moves, .. } => (moves, Some((*inertia, *damping, *stiffness))),
        Drive::Position(_) => unreachable!("a puck that moves by itself"),
    };
    let (extra, damper, stiffness) = hand.unwrap_or_default();
    let body = Body { mass: inertia + extra, damping: damping + damper, stiffness, friction };
    // The hand's push at the intended position `value` and this intended velocity.
    let push = |value: f64, velocity: f64| if hand.is_some() { stiffness * value + damper * velocity } else { value };
    let (mut x, mut v, mut motor, mut gap, mut all) = (0.0, 0.0, 0.0, 0.0, 0);
    let mut places = Vec::new();
    for (k, &command) in case.commands.iter().enumerate() {
        let t = k as f64 * period;
        if lag > 0.0 {
            gap += motor - command;
        }
        motor = command;
        let decay = if lag > 0.0 { 1.0 / lag } else { 0.0 };
        let mut u = Push { value: motor, gap, decay, ..Push::default() };
        match *shape {
            Shape::Sine { amplitude, frequency, phase } => {
                let omega = std::f64::consts::TAU * frequency;
                let turned = Complex::polar(amplitude, omega * t + phase);
                u.omega = omega;
                u.sine = turned
                    * if hand.is_some() { Complex::new(stiffness, damper * omega) } else { Complex::new(1.0, 0.0) };
            }
            Shape::Ramp { to, over, .. } => {
                u.value += push(to / over * t, to / over);
                u.slope = push(to / over, 0.0);
            }
            Shape::Step { to, .. } => u.value += push(to, 0.0),
            Shape::Path { .. } => unreachable!(),
        }
        // In parts of a few radians, so that the search for events is as fine in all of them.
        let parts = (u.omega * period / 3.0).ceil().max(1.0);
        for part in 0..parts as u32 {
            let events;
            (x, v, events) = advance(body, u.later(f64::from(part) * period / parts), (x, v), period / parts);
            all += events;
        }
        gap *= (-decay * period).exp();
        places.push(x);
    }
    (places, all)
}

fn spec(inertia: f64, damping: f64, friction: f64, lag: f64) -> DeviceSpec {
    DeviceSpec { lag, damping, friction, ..DeviceSpec::new(T, inertia) }
}

fn compare(case: &Case) -> Result<u32, TestCaseError> {
    let ((right, events), found) = (by_closed_form(case), by_device(case));
    // Differences far below the distance that a torque of friction's size moves it in a sample are rounding.
    let friction = case.spec.friction.max(case.spec.friction_backward.unwrap_or(0.0));
    let least = 1e-3 * friction * T / case.spec.damping;
    let size = right.iter().fold(least, |most, x| most.max(x.abs()));
    for (k, (found, right)) in found.iter().zip(&right).enumerate() {
        prop_assert!((found - right).abs() <= 1e-8 * size, "{found:e} is not {right:e} after sample {k}: {case:?}");
    }
    Ok(events)
}

/// Torques about the level of friction, where friction decides whether the puck moves.
fn about(friction: f64) -> impl Strategy<Value = f64> {
    let near = (-6.0_f64..-0.5).prop_map(|power| 1.0 + 10_f64.powf(power));
    (prop_oneof![near, 0.2_f64..3.0], any::<bool>())
        .prop_map(move |(part, up)| if up { part * friction } else { -part * friction })
}

/// J/b from 1e-4 T to 10 T.
fn pucks() -> impl Strategy<Value = DeviceSpec> {
    let lag = prop_oneof![Just(0.0), (-2.0_f64..1.5).prop_map(|power| T * 10_f64.powf(power))];
    let friction = (1e-3_f64..0.3, prop::option::of(prop_oneof![1 => Just(0.0), 4 => 0.05_f64..2.0]));
    (-7.0_f64..-2.0, -4.0_f64..1.0, friction, lag).prop_map(|(inertia, settles, (friction, backward), lag)| {
        let inertia = 10_f64.powf(inertia);
        let friction_backward = backward.map(|part| part * friction);
        let damping = inertia / (T * 10_f64.powf(settles));
        DeviceSpec { friction_backward, ..spec(inertia, damping, friction, lag) }
    })
}

/// Sines of any phase, and those with a summit, or a valley, in the first samples.
fn sines(level: f64, most: f64) -> impl Strategy<Value = Shape> {
    let phase =
        prop_oneof![(0.0_f64..6.3).prop_map(|phase| (phase, 0.0)), (0.0_f64..4.0).prop_map(|at| (FRAC_PI_2, at))];
    (about(level), -1.0_f64..most, phase).prop_map(|(amplitude, frequency, (phase, at))| {
        let frequency = 10_f64.powf(frequency);
        Shape::Sine { amplitude, frequency, phase: phase - std::f64::consts::TAU * frequency * at * T }
    })
}

fn pushed() -> impl Strategy<Value = Case> {
    pucks().prop_flat_map(|spec| {
        let sine = sines(spec.friction, 3.0);
        // As long as the commands last: a ramp's end is an event.
        let ramp = about(spec.friction).prop_map(|to| Shape::Ramp { to, at: 0.0, over: 8.0 * T });
        let step = about(spec.friction).prop_map(|to| Shape::Step { to, at: 0.0 });
        let commands = prop::collection::vec(prop_oneof![Just(0.0), about(spec.friction)], 8);
        (prop_oneof![3 => sine, 1 => ramp, 1 => step], commands).prop_map(move |(shape, commands)| Case {
            spec,
            drive: Drive::Torque(shape),
            commands,
        })
    })
}

fn gripped() -> impl Strategy<Value = Case> {
    (pucks(), -2.0_f64..1.0, 0.0_f64..1.0).prop_flat_map(|(mut spec, stiff, share)| {
        // The grip is underdamped or overdamped; the damping is shared between device and hand.
        let stiffness = spec.damping / T * 10_f64.powf(stiff) * 0.1;
        let damping = spec.damping * share;
        spec.damping -= damping;
        let level = spec.friction / stiffness;
        let sine = sines(level, 2.7);
        let ramp = about(level).prop_map(|to| Shape::Ramp { to, at: 0.0, over: 8.0 * T });
        let step = about(level).prop_map(|to| Shape::Step { to, at: 0.0 });
        let commands = prop::collection::vec(prop_oneof![Just(0.0), about(spec.friction)], 8);
        (prop_oneof![2 => sine, 1 => ramp, 1 => step], commands).prop_map(move |(moves, commands)| {
            let drive = Drive::Grip { inertia: 0.0, damping, stiffness, moves, switching: None };
            Case { spec, drive, commands }
        })
    })
}

proptest! {
    #![proptest_config(hapt_testing::cases(1500))]

    #[test]
    fn a_pushed_puck_stops_and_starts_when_its_equation_says_however_fast_damping_settles_it(case in pushed()) {
        compare(&case)?;
    }

    #[test]
    fn a_gripped_puck_stops_and_starts_when_its_equation_says_however_fast_damping_settles_it(case in gripped()) {
        compare(&case)?;
    }
}

/// The motor's push of a puck ends. Damping stops the puck within microseconds, and the maximum of the hand's torque moves it forward again within
/// the same sample, to its second stop.
#[test]
fn a_puck_that_stops_slips_and_stops_within_a_sample_has_not_gone_on() {
    for (frequency, at) in [(20.0, 3.7), (60.0, 3.3), (100.0, 3.3)] {
        let phase = FRAC_PI_2 - std::f64::consts::TAU * frequency * at * T;
        let drive = Drive::Torque(Shape::Sine { amplitude: 0.1001, frequency, phase });
        let case = Case { spec: spec(1e-7, 0.05, 0.1, 0.0), drive, commands: vec![0.0, 0.0, 0.02, 0.0, 0.0] };
        assert!(compare(&case).unwrap() > 2, "{case:?}");
    }
}

/// Twice in each half turn of the torque the puck starts, and stops.
#[test]
fn a_torque_that_swings_five_hundred_times_in_a_sample_moves_the_puck_to_its_end() {
    let shape = Shape::Sine { amplitude: 0.15, frequency: 4700.0, phase: 0.4 };
    let spec = DeviceSpec { period: 0.1, ..spec(1e-6, 0.05, 0.1, 0.0) };
    let case = Case { spec, drive: Drive::Torque(shape), commands: vec![0.02, 0.0] };
    let stops = compare(&case).unwrap();
    assert!(stops > 2000, "{stops}");
}

proptest! {
    #![proptest_config(hapt_testing::cases(40))]

    /// Each half swing is about a centre that friction shifts, from turning point to turning point.
    #[test]
    fn a_grip_that_swings_a_thousand_times_in_a_sample_swings_on_to_its_end(
        (inertia, turns) in (1e-5_f64..1e-3, 100.0_f64..950.0), (ratio, to) in (0.0_f64..1e-4, 0.01_f64..1.0), part in 1e-5_f64..1e-3,
    ) {
        let period = 0.1;
        let omega = std::f64::consts::PI * turns / period;
        let (stiffness, damping) = (inertia * omega * omega, 2.0 * ratio * inertia * omega);
        let friction = part * stiffness * to;
        let moves = Shape::Step { to, at: 0.0 };
        let drive = Drive::Grip { inertia: 0.0, damping: 0.0, stiffness, moves, switching: None };
        let spec = DeviceSpec { period, ..spec(inertia, damping, friction, 0.0) };
        let found = by_device(&Case { spec, drive, commands: vec![0.0; 2] });
        let sigma = ratio * omega;
        let swing = omega * (1.0 - ratio * ratio).sqrt();
        let half = std::f64::consts::PI / swing;
        let (mut at, mut from) = (0.0_f64, 0.0);
        for (k, found) in found.iter().enumerate() {
            let end = (k + 1) as f64 * period;
            while (to - at).abs() > part * to && from + half <= end {
                let about = to - part * to * (to - at).signum();
                (at, from) = (about - (at - about) * (-sigma * half).exp(), from + half);
            }
            let about = to - part * to * (to - at).signum();
            let t = end - from;
            let turned = (swing * t).cos() + sigma / swing * (swing * t).sin();
            let right = if (to - at).abs() > part * to { about + (at - about) * (-sigma * t).exp() * turned } else { at };
            prop_assert!((found - right).abs() < 1e-8 * to, "{found} is not {right} after sample {k}");
        }
    }
}
