//! Gravity and cogging: closed forms, energy, and short Runge-Kutta steps.

use std::f64::consts::{PI, TAU};

use hapt_core::Waveform;
use hapt_plant::spec::{
    Cogging, DeviceSpec, DeviceTorque, Drive, FrictionByPosition, Gravity, Hand, Handle, Shape, Stops, Stribeck,
};
use hapt_plant::{Script, VirtualDevice};
use hapt_testing::prelude::*;

const T: f64 = 1e-3;

pub fn gravity(torque: f64, phase: f64) -> DeviceTorque {
    DeviceTorque { gravity: Some(Gravity { torque, phase }), cogging: None }
}

fn bare(inertia: f64, torque: DeviceTorque) -> DeviceSpec {
    DeviceSpec { torque, ..DeviceSpec::new(T, inertia) }
}

/// The energy that gravity and cogging store at x.
fn stored(torque: &DeviceTorque, x: f64) -> f64 {
    let gravity = torque.gravity.map_or(0.0, |gravity| gravity.torque * (x + gravity.phase).cos());
    let cogging = torque.cogging.map_or(0.0, |Cogging { torque, pitch, phase, waveform }| {
        let angle = TAU * (x - phase) / pitch;
        let of = |(n, sine, cosine): (f64, f64, f64)| (sine * (n * angle).cos() - cosine * (n * angle).sin()) / n;
        torque * pitch / TAU * waveform.harmonics().map(of).sum::<f64>()
    });
    gravity + cogging
}

prop_compose! {
    fn any_torque()(
        gravity in prop::option::of((0.0_f64..0.2, -PI..PI)),
        cogging in prop::option::of((0.0_f64..0.05, 0.05_f64..1.0, -1.0_f64..1.0)),
        sine in prop::array::uniform4(-1.0_f32..1.0), cosine in prop::array::uniform4(-1.0_f32..1.0),
    ) -> DeviceTorque {
        DeviceTorque {
            gravity: gravity.map(|(torque, phase)| Gravity { torque, phase }),
            cogging: cogging.map(|(torque, pitch, phase)| Cogging { torque, pitch, phase, waveform: Waveform { sine, cosine } }),
        }
    }
}

/// Most cases have no Stribeck friction.
pub fn any_stribeck() -> impl Strategy<Value = Option<Stribeck>> {
    let some = (1e-4_f64..0.05, 0.01_f64..20.0).prop_map(|(torque, velocity)| Some(Stribeck { torque, velocity }));
    prop_oneof![2 => Just(None), 1 => some]
}

prop_compose! {
    /// Friction that falls to a tenth of its mean level at least.
    pub fn any_changes()(
        most in 0.05_f64..0.9, pitch in prop_oneof![0.05_f64..1.0, Just(TAU)], phase in -1.0_f64..1.0,
        sine in prop::array::uniform4(-1.0_f32..1.0), cosine in prop::array::uniform4(0.1_f32..1.0),
    ) -> FrictionByPosition {
        let whole = FrictionByPosition { share: 1.0, pitch, phase, waveform: Waveform { sine, cosine } };
        FrictionByPosition { share: most / whole.most(), ..whole }
    }
}

/// Stops on both sides of 0 or on one; half of the cases have none.
pub fn any_stops() -> impl Strategy<Value = Option<Stops>> {
    let damping = prop_oneof![Just(0.0), 1e-4..0.05_f64];
    let some = (prop::option::of(1e-3_f64..0.1), 1e-3_f64..0.1, 1.0_f64..1000.0, damping, any::<bool>()).prop_map(
        |(one, other, stiffness, damping, turned)| {
            let (low, high) = if turned { (Some(-other), one) } else { (one.map(|at| -at), Some(other)) };
            Some(Stops { low, high, stiffness, damping })
        },
    );
    prop_oneof![Just(None), some]
}

prop_compose! {
    pub fn any_device()(
        inertia in 1e-4_f64..1e-2, damping in prop_oneof![Just(0.0), 1e-4..1e-2_f64], friction in prop_oneof![Just(0.0), 1e-3..0.05_f64],
        (friction_backward, friction_by_position) in (prop::option::of(prop_oneof![Just(0.0), 1e-3..0.05_f64]), prop::option::of(any_changes())),
        (stribeck, stops) in (any_stribeck(), any_stops()),
        lag in prop_oneof![Just(0.0), 1e-5..2e-3_f64], delay in prop_oneof![Just(0.0), 0.0..2e-3_f64], torque in any_torque(),
        handle in prop::option::of((1e-4_f64..1e-2, 1.0_f64..100.0, 0.0_f64..0.01)),
    ) -> DeviceSpec {
        let handle = handle.map(|(inertia, stiffness, damping)| Handle { inertia, stiffness, damping });
        DeviceSpec {
            delay, lag, damping, friction, friction_backward, friction_by_position, stribeck, stops, handle, torque,
            ..DeviceSpec::new(T, inertia)
        }
    }
}

pub fn any_hand() -> impl Strategy<Value = Drive> {
    let sine = || {
        (0.01_f64..0.3, 0.5_f64..40.0, 0.0..TAU).prop_map(|(amplitude, frequency, phase)| Shape::Sine {
            amplitude,
            frequency,
            phase,
        })
    };
    let ramp = (-0.2_f64..0.2, 1e-3_f64..0.05).prop_map(|(to, over)| Shape::Ramp { to, at: 0.0, over });
    prop_oneof![
        sine().prop_map(Drive::Torque),
        ramp.prop_map(Drive::Torque),
        sine().prop_map(Drive::Position),
        (sine(), 0.0_f64..1e-3, 0.0_f64..0.02, 0.0_f64..10.0).prop_map(|(moves, inertia, damping, stiffness)| {
            Drive::Grip { inertia, damping, stiffness, moves, switching: None }
        }),
    ]
}

/// Moves the device by these commands, from these velocities of puck and handle on.
pub fn moved(spec: &DeviceSpec, hand: &Drive, velocity: f64, commands: &[f64]) -> VirtualDevice {
    let mut device = VirtualDevice::new(spec);
    device.set_out((0.0, velocity), (0.0, velocity));
    device.begin(&mut Script::new(&Hand { drive: hand.clone(), release: None }, 1e3 * T, spec.period));
    for command in commands {
        device.command(*command);
        device.travel();
    }
    device
}

proptest! {
    #![proptest_config(hapt_testing::cases(300))]

    /// The works are integrals along the motion, the stored energy is one of the position.
    #[test]
    fn the_energy_of_hand_motor_gravity_and_cogging_is_dissipated_stored_or_kinetic(
        spec in any_device(), hand in any_hand(), velocity in -20.0_f64..20.0, commands in prop::collection::vec(-0.2_f64..0.2, 40),
    ) {
        let kinetic = |device: &VirtualDevice| {
            let ((x, v), handle) = (device.puck(), device.handle());
            let beyond = spec.handle.zip(handle).map_or(0.0, |(shaft, (h, w))| {
                0.5 * shaft.inertia * w * w + 0.5 * shaft.stiffness * (h - x) * (h - x)
            });
            let depth = |side: f64, at: Option<f64>| at.map_or(0.0, |at| (side * (x - at)).max(0.0));
            let pressed = spec.stops.map_or(0.0, |stops| {
                0.5 * stops.stiffness * (depth(1.0, stops.high).powi(2) + depth(-1.0, stops.low).powi(2))
            });
            0.5 * spec.inertia * v * v + beyond + pressed
        };
        let (before, after) = (moved(&spec, &hand, velocity, &[]), moved(&spec, &hand, velocity, &commands));
        let of = |device: &VirtualDevice| {
            let ledger = device.ledger();
            ledger.hand + ledger.motor + ledger.field - ledger.damping - ledger.friction - ledger.shaft - ledger.stops
        };
        let (change, given) = (kinetic(&after) - kinetic(&before), of(&after) - of(&before));
        let ledger = after.ledger();
        prop_assert!(ledger.stops >= -1e-12 && ledger.friction >= -1e-12, "{ledger:?}");
        let size = kinetic(&after) + kinetic(&before) + ledger.hand.abs() + ledger.motor.abs() + ledger.field.abs() + ledger.damping + ledger.friction + 1e-3;
        prop_assert!((change - given).abs() < 1e-11 * size, "{change} {given}");
        let fell = stored(&spec.torque, before.puck().0) - stored(&spec.torque, after.puck().0);
        prop_assert!((ledger.field - before.ledger().field - fell).abs() < 1e-12 * size, "{} {fell}", ledger.field);
    }

    #[test]
    fn a_motion_does_not_depend_on_how_its_time_is_cut(
        spec in any_device(), velocity in -20.0_f64..20.0, torque in -0.2_f64..0.2, parts in 2_usize..7,
    ) {
        let spec = DeviceSpec { delay: 0.0, ..spec };
        let hand = Drive::Torque(Shape::Step { to: torque, at: 0.0 });
        let whole = moved(&spec, &hand, velocity, &[0.0; 20]);
        let cut = DeviceSpec { period: T / parts as f64, ..spec };
        let cut = moved(&cut, &hand, velocity, &vec![0.0; 20 * parts]);
        let ((x, v), (y, w)) = (whole.puck(), cut.puck());
        // Steep cogging, and friction that changes steeply, amplify differences of rounding.
        let most = spec.friction.max(spec.friction_backward.unwrap_or(0.0));
        let steepest = spec.torque.steepest() + spec.friction_by_position.map_or(0.0, |changes| most * changes.steepest());
        let spread = (steepest / spec.inertia).sqrt() * 20.0 * T;
        let error = 1e-11 * (1.0 + spread).powi(2) * spread.min(20.0).exp();
        prop_assert!((x - y).abs() < error * (1.0 + x.abs()) && (v - w).abs() < 1e2 * error * (1.0 + v.abs()), "{x} {y}, {v} {w}");
    }

    /// With a stored energy of 0 at the bottom, a pendulum's period is 2π/(ω M(1, cos(a/2))), M the arithmetic-geometric mean (Gauss).
    #[test]
    fn a_pendulum_swings_with_the_period_of_gauss(inertia in 1e-4_f64..1e-2, torque in 0.01_f64..1.0, angle in 0.01_f64..3.1) {
        let (mut a, mut b): (f64, f64) = (1.0, (0.5 * angle).cos());
        while (a - b).abs() > 1e-15 {
            (a, b) = (0.5 * (a + b), (a * b).sqrt());
        }
        let swing = TAU / ((torque / inertia).sqrt() * a);
        // Hanging where z = -angle, so that it starts at its summit.
        let spec = DeviceSpec { period: swing / 8.0, ..bare(inertia, gravity(torque, PI + angle)) };
        let device = moved(&spec, &Drive::Torque(Shape::Step { to: 0.0, at: 0.0 }), 0.0, &[0.0; 8]);
        let (x, v) = device.puck();
        let fastest = (torque / inertia).sqrt();
        // A swing near the top depends on its start by 1/cos(a/2).
        let error = 1e-12 / (0.5 * angle).cos().powi(2);
        prop_assert!(x.abs() < error && v.abs() < error * fastest, "{x} {v}");
        let half = moved(&spec, &Drive::Torque(Shape::Step { to: 0.0, at: 0.0 }), 0.0, &[0.0; 4]);
        prop_assert!((half.puck().0 + 2.0 * angle).abs() < error, "{}", half.puck().0);
    }

    #[test]
    fn short_runge_kutta_steps_give_the_same_motion(
        spec in any_device(), velocity in -20.0_f64..20.0, command in -0.2_f64..0.2,
    ) {
        let spec = DeviceSpec { delay: 0.0, lag: 0.0, friction: 0.0, friction_backward: None, stribeck: None, stops: None, handle: None, ..spec };
        let DeviceSpec { inertia, damping, torque, .. } = spec;
        let device = moved(&spec, &Drive::Torque(Shape::Step { to: 0.0, at: 0.0 }), velocity, &[command; 5]);
        let rate = |[x, v]: [f64; 2]| [v, (command + torque.at(x) - damping * v) / inertia];
        let (steps, mut y) = (4000, [0.0, velocity]);
        let h = 5.0 * T / f64::from(steps);
        for _ in 0..steps {
            let along = |k: [f64; 2], part: f64| [y[0] + part * h * k[0], y[1] + part * h * k[1]];
            let a = rate(y);
            let b = rate(along(a, 0.5));
            let c = rate(along(b, 0.5));
            let d = rate(along(c, 1.0));
            y = [0, 1].map(|i| y[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
        }
        let (x, v) = device.puck();
        prop_assert!((x - y[0]).abs() < 1e-8 && (v - y[1]).abs() < 1e-6 * (1.0 + v.abs()), "{x} {v}, {y:?}");
    }

    /// Between two teeth the steepest torque decides.
    #[test]
    fn friction_holds_a_puck_where_gravity_is_weaker(
        inertia in 1e-4_f64..1e-2, torque in 0.01_f64..0.2, phase in -PI..PI, friction in 0.001_f64..0.2,
    ) {
        prop_assume!((torque * phase.sin().abs() - friction).abs() > 1e-9);
        let spec = DeviceSpec { friction, ..bare(inertia, gravity(torque, phase)) };
        let device = moved(&spec, &Drive::Torque(Shape::Step { to: 0.0, at: 0.0 }), 0.0, &[0.0; 10]);
        if torque * phase.sin().abs() < friction {
            prop_assert_eq!(device.puck(), (0.0, 0.0));
        } else {
            prop_assert!(device.puck().0 * phase.sin() > 0.0);
        }
    }

    /// From one turning point to the next, a swing under friction loses friction · path of its energy.
    #[test]
    fn a_pendulum_under_friction_comes_to_rest_where_friction_holds_it(
        inertia in 1e-4_f64..1e-3, torque in 0.05_f64..0.5, angle in -3.0_f64..3.0, part in 0.05_f64..0.9,
    ) {
        let friction = part * torque;
        let spec = DeviceSpec { friction, period: 20.0 * T, ..bare(inertia, gravity(torque, PI + angle)) };
        let device = moved(&spec, &Drive::Torque(Shape::Step { to: 0.0, at: 0.0 }), 0.0, &[0.0; 1000]);
        let (x, v) = device.puck();
        prop_assert_eq!(v, 0.0);
        prop_assert!(spec.torque.at(x).abs() <= friction * (1.0 + 1e-12));
        let ledger = device.ledger();
        prop_assert!((ledger.field - ledger.friction).abs() < 1e-12 * torque, "{ledger:?}");
    }

    #[test]
    fn a_field_stays_where_the_device_is_when_the_origin_moves(torque in any_torque(), by in -5.0_f64..5.0, velocity in -5.0_f64..5.0) {
        let spec = bare(1e-3, torque);
        let mut one = VirtualDevice::new(&spec);
        one.set_out((0.0, velocity), (0.0, 0.0));
        let mut other = one.clone();
        other.shift(by);
        for device in [&mut one, &mut other] {
            (0..5).for_each(|_| device.travel());
        }
        prop_assert!((one.puck().0 - other.puck().0 - by).abs() < 1e-10 && (one.puck().1 - other.puck().1).abs() < 1e-8);
    }
}

/// The computation ends for a device that diverges or turns extremely fast.
#[test]
fn extreme_numbers_end_the_computation() {
    let waveform = Waveform { sine: [1.0; 4], cosine: [1.0; 4] };
    let torque =
        DeviceTorque { gravity: None, cogging: Some(Cogging { torque: 1.0, pitch: 1e-3, phase: 0.0, waveform }) };
    for velocity in [1e6, 1e30, f64::INFINITY, f64::NAN] {
        let device = moved(&bare(1e-3, torque), &Drive::Torque(Shape::Step { to: 0.0, at: 0.0 }), velocity, &[1e20; 3]);
        assert!(device.puck().0.is_nan() || device.puck().0.abs() >= 1.0);
    }
    // Towards a stop, which the search for its instant has to give up.
    let stops = Some(Stops { low: Some(-1.0), high: Some(1.0), stiffness: 10.0, damping: 0.1 });
    for velocity in [0.0, 1e6, 1e30, 1e150, 1e300, f64::INFINITY, f64::NAN] {
        for command in [1.0, 1e20, 1e150, 1e300] {
            for friction in [0.0, 0.01] {
                let spec = DeviceSpec { stops, friction, ..bare(1e-3, torque) };
                let device = moved(&spec, &Drive::Torque(Shape::Step { to: 0.0, at: 0.0 }), velocity, &[command; 3]);
                assert!(device.puck().0.is_nan() || device.puck().0.abs() > 0.0);
            }
        }
    }
    // From rest, with a large torque; without and with a handle.
    let handle = Some(Handle { inertia: 1e-3, stiffness: 20.0, damping: 0.0 });
    for (handle, command) in [(None, 1e20), (handle, 1e20), (None, 1e300), (None, 1e8), (handle, 1e5)] {
        let spec = DeviceSpec { handle, ..bare(1e-3, torque) };
        let device = moved(&spec, &Drive::Torque(Shape::Step { to: 0.0, at: 0.0 }), 0.0, &[command; 20]);
        assert!(device.puck().0.is_nan() || device.puck().0.abs() >= 1.0);
    }
}

/// Fast for cogging, slow for gravity.
#[test]
fn fine_cogging_at_high_speed_does_not_change_gravity() {
    let waveform = Waveform { sine: [1.0, 0.0, 0.0, 0.0], cosine: [0.0; 4] };
    let cogging = Cogging { torque: 1e-9, pitch: 1e-6, phase: 0.0, waveform };
    let both = DeviceTorque { cogging: Some(cogging), ..gravity(0.1, 0.5) };
    let push = Drive::Torque(Shape::Step { to: 0.0, at: 0.0 });
    let (with, without) = (
        moved(&bare(1e-3, both), &push, 5.0, &[0.0; 50]),
        moved(&bare(1e-3, gravity(0.1, 0.5)), &push, 5.0, &[0.0; 50]),
    );
    assert!((with.puck().0 - without.puck().0).abs() < 1e-6, "{:?} {:?}", with.puck(), without.puck());
}

proptest! {
    #![proptest_config(hapt_testing::cases(64))]

    /// A puck that speeds up from rest passes many periods of cogging within a sample, however fine they are.
    #[test]
    fn fine_cogging_does_not_change_a_start_from_rest(
        decades in -30.0_f64..-3.0, part in 0.0_f64..1e-6, command in 0.05_f64..5.0,
        friction in prop_oneof![Just(0.0), Just(0.01)], has_handle in any::<bool>(),
        phase in prop_oneof![Just(0.0), -1e9_f64..1e9, Just(1e300)],
    ) {
        let slow = gravity(0.01, 0.5);
        let pitch = 10_f64.powf(decades);
        let waveform = Waveform { sine: [1.0, 0.0, 0.0, 0.5], cosine: [0.0, 1.0, 0.0, 0.0] };
        let fine = Cogging { torque: part * command * pitch.min(1e-2), pitch, phase, waveform };
        let torque = DeviceTorque { cogging: Some(fine), ..slow };
        let changes = FrictionByPosition { share: part, pitch, phase, waveform };
        let handle = has_handle.then_some(Handle { inertia: 1e-3, stiffness: 20.0, damping: 1e-3 });
        let push = Drive::Torque(Shape::Step { to: 0.0, at: 0.0 });
        let end = |torque, friction_by_position| {
            let spec = DeviceSpec { friction, friction_by_position, handle, ..bare(1e-3, torque) };
            moved(&spec, &push, 0.0, &[command; 3]).puck()
        };
        let without = end(slow, None);
        for with in [end(torque, None), end(slow, Some(changes))] {
            let near = |a: f64, b: f64| (a - b).abs() <= 1e-5 * b.abs();
            prop_assert!(near(with.0, without.0) && near(with.1, without.1), "{with:?} {without:?}");
        }
    }
}
