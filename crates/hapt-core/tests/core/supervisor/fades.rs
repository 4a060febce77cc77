//! Fades in and out, the lost link, a swap of worlds, and braking after a fault.

use hapt_core::Reason;

use super::*;

for_both! {
    the_torque_rises_and_falls_by_equal_parts
    the_torque_is_off_within_the_links_time_of_the_last_heartbeat_the_fade_included
    a_lost_link_fades_out_or_faults
    a_swap_does_not_step_the_torque
    a_stop_within_a_fade_brakes_no_longer_than_the_fade_would_have_taken
    braking_opposes_the_motion_and_ends
}

fn the_torque_rises_and_falls_by_equal_parts<F: Real>() {
    let mut guard = Guard::<F>::new(&LIMITS, &WORLD);
    assert_eq!(guard.at(0.5).output, F::ZERO);
    let mut last = guard.step(&reading(0.5), Some(Request::Arm)).output.to_f64();
    for k in 2..=10 {
        let guarded = guard.at(0.5);
        let output = guarded.output.to_f64();
        assert!((output - last + 0.05).abs() < 1e-6, "{k}: {output}");
        assert_eq!(guarded.phase == Phase::Running, k == 10);
        last = output;
    }
    guard.step(&reading(0.5), Some(Request::Disarm));
    for k in 2..=10 {
        let guarded = guard.at(0.5);
        assert!((guarded.output.to_f64() + 0.5 - 0.05 * f64::from(k)).abs() < 1e-6, "{k}: {:?}", guarded.output);
        assert_eq!(guarded.phase == Phase::Disarmed, k == 10);
    }
    assert_eq!(guard.watch.output, F::ZERO);
}

fn a_lost_link_fades_out_or_faults<F: Real>() {
    let silent = Reading { silent: F::from_f64(0.31), ..reading(0.5) };
    let mut guard = Guard::<F>::running(&LIMITS, &WORLD, 0.5);
    let mut last = guard.watch.output.abs();
    for _ in 0..10 {
        let guarded = guard.step(&silent, None);
        assert!(guarded.output.abs() < last);
        assert_eq!(guarded.reason, Some(Reason::Link));
        last = guarded.output.abs();
    }
    assert_eq!((guard.watch.phase, guard.watch.output), (Phase::Disarmed, F::ZERO));
    assert_eq!(guard.step(&silent, Some(Request::Arm)).phase, Phase::Disarmed);
    assert_eq!(guard.step(&reading(0.5), Some(Request::Arm)).phase, Phase::FadingIn);
    assert_eq!(guard.watch.reason, None);

    let mut guard = Guard::<F>::running(&Limits { link_faults: true, ..LIMITS }, &WORLD, 0.5);
    let guarded = guard.step(&silent, None);
    assert_eq!((guarded.phase, guarded.reason, guarded.output), (Phase::Faulted, Some(Reason::Link), F::ZERO));
    assert_eq!(guard.step(&silent, Some(Request::Clear)).phase, Phase::Faulted);
    assert_eq!(guard.step(&reading(0.5), Some(Request::Clear)).phase, Phase::Disarmed);
}

fn the_torque_is_off_within_the_links_time_of_the_last_heartbeat_the_fade_included<F: Real>() {
    for (link, fade, delay, faults, brake) in [
        (0.3, 0.1, 0.0, false, 0.0),
        (0.15, 0.1, 0.004, false, 0.0),
        (0.3, 0.0123, 0.0025, false, 0.0),
        (0.05, 0.04, 0.0, false, 0.0),
        (0.05, 0.1, 0.001, true, 0.0),
        (0.3, 0.1, 0.0, false, 1e-3),
        // The braking after the fault is a torque too.
        (0.3, 0.1, 0.001, true, 1e-3),
    ] {
        let limits = Limits { link, fade, delay, link_faults: faults, brake, ..LIMITS };
        let mut guard = Guard::<F>::running(&limits, &WORLD, 0.5);
        let off = (1..1000).find(|k| {
            let silent = F::from_f64(T * f64::from(*k));
            guard.step(&Reading { silent, ..reading(0.5 + 1e-3 * f64::from(*k)) }, None).output == F::ZERO
        });
        let off = T * f64::from(off.unwrap()) + delay;
        assert!(off <= link + 1e-6, "off after {off} s of {link} s");
        // And not much earlier.
        assert!(off > link - 3.5 * T, "off after {off} s of {link} s");
    }
    // The time is too short for the fade.
    let spec = Limits { link: 0.1, fade: 0.1, ..LIMITS };
    let error = Supervisor::<F, 1, 1>::new(&spec, &WORLD).unwrap_err().to_string();
    assert!(error.contains("link") && error.contains("fade"), "{error}");
}

fn a_swap_does_not_step_the_torque<F: Real>() {
    let soft = [Coupling { law: Law::Spring { stiffness: 0.2 * K, rest: 0.0 }, ..SPRING[0] }];
    let spec = Spec { couplings: &soft, ..WORLD };
    let mut guard = Guard::<F>::running(&LIMITS, &WORLD, 0.5);
    let next = Guard::<F>::new(&LIMITS, &spec);
    let mut last = guard.watch.output;
    (guard.world, guard.supervisor, guard.state) = (next.world, next.supervisor, next.state);
    guard.watch.swap(guard.world.period(), guard.world.period());
    for k in 0..12 {
        let output = guard.at(0.5).output;
        let step = (output - last).to_f64();
        // From -0.5 to -0.1 in the ten samples of a fade, after one without a change.
        let expected = if (1..=10).contains(&k) { 0.04 } else { 0.0 };
        assert!((step - expected).abs() < 1e-6, "{k}: {step}");
        last = output;
    }
    assert_eq!(guard.watch.phase, Phase::Running);
}

/// The torque fades out for any reason, and then stop is pressed.
fn a_stop_within_a_fade_brakes_no_longer_than_the_fade_would_have_taken<F: Real>() {
    let limits = Limits { brake: 1e-3, ..LIMITS };
    for pressed in 1..9 {
        let mut guard = Guard::<F>::running(&limits, &WORLD, 0.5);
        let off = (0..30).find(|k| {
            let request = match *k {
                0 => Some(Request::Disarm),
                k if k == pressed => Some(Request::Stop),
                _ => None,
            };
            guard.step(&reading(0.5 + 1e-3 * f64::from(*k)), request).output == F::ZERO
        });
        assert_eq!(guard.watch.reason, Some(Reason::Stop));
        assert!(off.unwrap() <= (limits.fade / T) as u32, "off after {off:?} samples");
    }
}

fn braking_opposes_the_motion_and_ends<F: Real>() {
    for (brake, brakes) in [(1e-2, true), (0.0, false)] {
        let mut guard = Guard::<F>::running(&Limits { brake, ..LIMITS }, &WORLD, 0.1);
        guard.at(0.11);
        guard.at(0.12);
        let mut position = 0.12;
        for k in 0..30 {
            position += 0.01;
            let guarded = guard.step(&reading(position), (k == 0).then_some(Request::Stop));
            assert_eq!(guarded.phase, Phase::Faulted);
            let torque = guarded.output.to_f64();
            assert_eq!(torque < 0.0, brakes && k < 9, "{k}: {torque}");
            assert!(torque.abs() <= 10.0 * brake, "{k}: {torque}");
        }
        // A reading that is wrong ends it.
        let mut guard = Guard::<F>::running(&Limits { brake, ..LIMITS }, &WORLD, 0.1);
        guard.at(0.11);
        guard.step(&reading(0.12), Some(Request::Stop));
        assert_eq!(guard.at(0.5).output, F::ZERO);
        assert_eq!(guard.at(0.51).output, F::ZERO);
    }
}
