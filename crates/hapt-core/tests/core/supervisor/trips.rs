//! The causes of faults, and the recovery from each.

use hapt_core::Reason;

use super::*;

for_both! {
    what_cannot_be_faults_at_once_for_its_own_reason
    a_reading_within_the_limits_is_no_fault
    a_cause_that_stands_cannot_be_cleared
    heat_trips_when_the_first_order_model_says
    a_step_that_a_simulated_hand_announces_is_no_fault
}

/// A wrong reading, and its reason.
fn faults<F: Real>() -> [(&'static str, Reading<F>, Reason); 10] {
    let f = F::from_f64;
    let still = reading::<F>(0.1);
    let nan = f(f64::NAN);
    [
        ("no position", Reading { position: nan, ..still }, Reason::NotFinite),
        ("no velocity", Reading { velocity: f(f64::INFINITY), ..still }, Reason::NotFinite),
        ("no time", Reading { late: nan, ..still }, Reason::NotFinite),
        ("a jump", reading(0.13), Reason::Jump),
        ("a jump back", reading(0.07), Reason::Jump),
        ("too far in two samples", Reading { missed: 1, ..reading(0.31) }, Reason::Velocity),
        ("too fast in two samples", Reading { missed: 1, ..reading(0.21) }, Reason::Overspeed),
        ("too late", Reading { late: f(5.1e-3), ..still }, Reason::Late),
        ("too early", Reading { late: f(-5.1e-3), ..still }, Reason::Late),
        ("too many missed", Reading { missed: 6, ..still }, Reason::Late),
    ]
}

fn what_cannot_be_faults_at_once_for_its_own_reason<F: Real>() {
    for (what, wrong, reason) in faults::<F>() {
        let mut guard = Guard::<F>::running(&LIMITS, &WORLD, 0.1);
        let guarded = guard.step(&wrong, None);
        assert_eq!((guarded.phase, guarded.reason), (Phase::Faulted, Some(reason)), "{what}");
        for _ in 0..100 {
            assert_eq!(guarded.output, F::ZERO, "{what}");
            assert_eq!(guard.step(&reading(0.1), Some(Request::Arm)).output, F::ZERO, "{what}");
        }
        assert_eq!(guard.watch.reason, Some(reason), "{what}");
        // And back: clear, then arm.
        assert_eq!(guard.step(&reading(0.1), Some(Request::Clear)).phase, Phase::Disarmed, "{what}");
        assert_eq!(guard.at(0.1).output, F::ZERO, "{what}");
        assert_eq!(guard.step(&reading(0.1), Some(Request::Arm)).phase, Phase::FadingIn, "{what}");
    }
}

fn a_reading_within_the_limits_is_no_fault<F: Real>() {
    let mut guard = Guard::<F>::running(&LIMITS, &WORLD, 0.1);
    for good in [
        reading(0.125),
        Reading { missed: 4, ..reading(0.125) },
        Reading { late: F::from_f64(4.9e-3), ..reading(0.125) },
        Reading { silent: F::from_f64(0.28), ..reading(0.125) },
    ] {
        assert_eq!(guard.step(&good, None).phase, Phase::Running, "{good:?}");
    }
    // Faster than a hand moves it, but with no more torque than friction: the motor does not drive it.
    let mut guard = Guard::<F>::running(&LIMITS, &WORLD, 0.0);
    for k in 0..9 {
        let speed = 6e-3 * f64::from(k);
        guard.watch.output = F::ZERO;
        assert_eq!(guard.at(speed * f64::from(k)).phase, Phase::Running);
    }
}

fn a_cause_that_stands_cannot_be_cleared<F: Real>() {
    let mut guard = Guard::<F>::running(&LIMITS, &WORLD, 0.1);
    let late = Reading { late: F::from_f64(1.0), ..reading(0.1) };
    for _ in 0..30 {
        guard.step(&late, Some(Request::Clear));
        assert_eq!(guard.watch.phase, Phase::Faulted);
    }
    // The cause counts as gone only after a while.
    for k in 1..=16 {
        let phase = guard.step(&reading(0.1), Some(Request::Clear)).phase;
        assert_eq!(phase, if k < 16 { Phase::Faulted } else { Phase::Disarmed }, "{k}");
    }
    // Armed while something is wrong, it gives the reason and no torque.
    assert_eq!(guard.step(&late, Some(Request::Arm)).reason, Some(Reason::Late));
    assert_eq!(guard.watch.output, F::ZERO);
    // A stop that stays pressed is a cause that persists.
    let mut guard = Guard::<F>::running(&LIMITS, &WORLD, 0.1);
    for _ in 0..30 {
        assert_eq!(guard.step(&reading(0.1), Some(Request::Stop)).reason, Some(Reason::Stop));
    }
    assert_eq!(guard.step(&reading(0.1), Some(Request::Clear)).phase, Phase::Faulted);
}

fn heat_trips_when_the_first_order_model_says<F: Real>() {
    for (limits, reason) in [
        (Limits { motor: Heat { rms: 0.3, time: 2.0 }, ..LIMITS }, Reason::Heat),
        (Limits { driver: Heat { rms: 0.3, time: 2.0 }, ..LIMITS }, Reason::DriverHeat),
    ] {
        // 0.5 N·m held: τ² (1 - e^{-t/2 s}) reaches rms² at t = -2 s ln(1 - 0.36).
        let mut guard = Guard::<F>::running(&limits, &WORLD, 0.5);
        let mut samples = 15;
        while guard.at(0.5).phase == Phase::Running {
            samples += 1;
        }
        assert_eq!(guard.watch.reason, Some(reason));
        let expected = -2.0 * (1.0_f64 - 0.36).ln() / T;
        assert!((f64::from(samples) - expected).abs() < 5.0, "{samples} {expected}");
        // It cools to half of its limit in 2 s ln 2.
        let cooling = (2.0 * 2.0_f64.ln() / T) as u32;
        for _ in 0..cooling - 5 {
            assert_eq!(guard.step(&reading(0.5), Some(Request::Clear)).phase, Phase::Faulted);
        }
        for _ in 0..10 {
            guard.step(&reading(0.5), Some(Request::Clear));
        }
        assert_eq!(guard.watch.phase, Phase::Disarmed);
    }
}

fn a_step_that_a_simulated_hand_announces_is_no_fault<F: Real>() {
    let step = Reading { announced: true, ..reading(0.7) };
    let mut guard = Guard::<F>::running(&LIMITS, &WORLD, 0.0);
    assert_eq!(guard.step(&step, None).phase, Phase::Running);
    assert_eq!(guard.at(0.7).phase, Phase::Running);
    let mut guard = Guard::<F>::running(&Limits { announcements: false, ..LIMITS }, &WORLD, 0.0);
    assert_eq!(guard.step(&step, None).reason, Some(Reason::Jump));
}

#[test]
fn a_command_beyond_its_limit_and_a_slew_beyond_its_own_are_faults() {
    let mut guard = Guard::<f64>::running(&Limits { torque: 0.3, ..LIMITS }, &WORLD, 0.28);
    assert_eq!(guard.at(0.31).reason, Some(Reason::Jump));
    let mut guard = Guard::<f64>::running(&Limits { torque: 0.3, ..LIMITS }, &WORLD, 0.28);
    assert_eq!(guard.at(0.301).reason, Some(Reason::Torque));
    let mut guard = Guard::<f64>::running(&Limits { slew: 0.01, ..LIMITS }, &WORLD, 0.0);
    assert_eq!(guard.at(0.009).phase, Phase::Running);
    assert_eq!(guard.at(0.02).reason, Some(Reason::Slew));
}

#[test]
fn codes_and_names_are_each_their_own() {
    for (i, reason) in Reason::ALL.into_iter().enumerate() {
        assert_eq!(usize::from(reason.code()), i + 1);
        assert_eq!(Reason::from_code(reason.code()), Some(reason));
        assert!(reason.sentence().ends_with('.') && reason.remedy().ends_with('.'));
        assert!(Reason::ALL.iter().filter(|other| other.name() == reason.name()).count() == 1);
    }
    assert_eq!(Reason::from_code(0), None);
    assert_eq!(Reason::from_code(200), None);
}

#[test]
fn limits_that_are_none_are_refused_by_name() {
    for (limits, name) in [
        (Limits { fade: 0.0, ..LIMITS }, "fade"),
        (Limits { velocity: f64::NAN, ..LIMITS }, "velocity"),
        (Limits { energy: -1.0, ..LIMITS }, "energy"),
        (Limits { pulse: f64::INFINITY, ..LIMITS }, "pulse"),
        (Limits { delay: -1.0, ..LIMITS }, "delay"),
    ] {
        let error = Supervisor::<f64, 4, 8>::new(&limits, &WORLD).unwrap_err();
        assert!(error.to_string().contains(name), "{error}");
    }
}
