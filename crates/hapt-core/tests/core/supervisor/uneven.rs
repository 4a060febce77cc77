//! Time that the certificate covers: within it nothing happens, beyond it the torque is removed according to the world.

use hapt_core::{CertifiedTime, Reason, WhenLate};
use hapt_testing::prelude::*;

use super::*;

for_both! {
    a_late_sample_under_a_fault_has_no_torque_and_clears_when_time_keeps
    a_late_sample_under_a_fade_takes_the_torque_for_good
    a_late_sample_that_only_counts_changes_no_torque
    a_late_command_is_judged_at_the_next_sample_and_once
    without_a_torque_nothing_is_late
    the_interval_before_a_swap_is_one_of_the_old_period
}

/// A bound of a quarter of a period beyond a sample, and of half a period for a command.
fn limits(when_late: WhenLate) -> Limits {
    Limits { time: CertifiedTime { interval: 1.25 * T, delay: 0.5 * T, when_late }, ..LIMITS }
}

/// A reading at 0.5, `late` periods after its instant, after `missed` samples.
fn at<F: Real>(late: f64, missed: u32) -> Reading<F> {
    Reading { late: F::from_f64(late * T), missed, ..reading(0.5) }
}

fn a_late_sample_under_a_fault_has_no_torque_and_clears_when_time_keeps<F: Real>() {
    for late in [at(0.3, 0), at(0.0, 1), at(f64::NAN, 0)] {
        let mut guard = Guard::<F>::running(&limits(WhenLate::Fault), &WORLD, 0.5);
        let now = guard.step(&late, None);
        assert_eq!((now.phase, now.output, now.outside), (Phase::Faulted, F::ZERO, true));
        let reason = if late.late.to_f64().is_nan() { Reason::NotFinite } else { Reason::Uneven };
        assert_eq!((now.reason, guard.watch.outside()), (Some(reason), 1));
        // Every other sample late, it does not clear; 16 in time, it does.
        for k in 0..40 {
            let late = if k % 2 == 0 { 0.0 } else { 0.4 };
            assert_eq!(guard.step(&at(late, 0), Some(Request::Clear)).phase, Phase::Faulted);
        }
        for _ in 0..16 {
            assert_eq!(guard.step(&at(0.4, 0), None).phase, Phase::Faulted);
        }
        assert_eq!(guard.step(&at(0.4, 0), Some(Request::Clear)).phase, Phase::Disarmed);
        assert_eq!(guard.watch.outside(), 1, "without a torque");
    }
}

fn a_late_sample_under_a_fade_takes_the_torque_for_good<F: Real>() {
    let mut guard = Guard::<F>::running(&limits(WhenLate::Fade), &WORLD, 0.5);
    let mut last = guard.watch.output.abs();
    for k in 0..10 {
        // The first is late; the times are kept from then on, or not.
        let now = guard.step(&at(if k % 3 == 0 { 0.3 } else { 0.0 }, 0), None);
        assert!(now.output.abs() < last, "{k}: {:?}", now.output);
        assert_eq!(now.reason, Some(Reason::Uneven));
        last = now.output.abs();
    }
    assert_eq!((guard.watch.phase, guard.watch.output), (Phase::Disarmed, F::ZERO));
    for _ in 0..100 {
        assert_eq!(guard.at(0.5).output, F::ZERO, "nobody has armed it");
    }
    let armed = guard.step(&reading(0.5), Some(Request::Arm));
    assert_eq!((armed.phase, armed.reason), (Phase::FadingIn, None));
}

fn a_late_sample_that_only_counts_changes_no_torque<F: Real>() {
    let mut counts = Guard::<F>::running(&limits(WhenLate::Count), &WORLD, 0.5);
    let mut any = Guard::<F>::running(&LIMITS, &WORLD, 0.5);
    for k in 0..100_u32 {
        let reading = at(if k % 4 == 1 { 0.3 } else { 0.0 }, u32::from(k % 7 == 0));
        let (now, other) = (counts.step(&reading, None), any.step(&reading, None));
        assert_eq!((now.output, now.phase, now.reason), (other.output, Phase::Running, None));
        assert_eq!((now.outside, other.outside), (k % 4 == 1 || k % 7 == 0, false));
    }
    assert_eq!(counts.watch.outside(), (0..100).filter(|k| k % 4 == 1 || k % 7 == 0).count() as u32);
    assert_eq!((counts.watch.warning, any.watch.warning), (Some(Reason::Uneven), None));
    // The warning belonged to that world, and is cleared for the next.
    counts.watch.swap(counts.world.period(), counts.world.period());
    assert_eq!((counts.at(0.5).warning, counts.step(&at(0.3, 0), None).warning), (None, Some(Reason::Uneven)));
}

fn a_late_command_is_judged_at_the_next_sample_and_once<F: Real>() {
    for (delay, is_late) in [(0.5, false), (0.51, true), (f64::NAN, true)] {
        let mut guard = Guard::<F>::running(&limits(WhenLate::Count), &WORLD, 0.5);
        guard.watch.commanded(F::from_f64(delay * T));
        assert_eq!(guard.at(0.5).outside, is_late, "{delay}");
        for _ in 0..20 {
            assert!(!guard.at(0.5).outside, "it is another command's time");
        }
        assert_eq!(guard.watch.outside(), u32::from(is_late));
        let mut guard = Guard::<F>::running(&limits(WhenLate::Fault), &WORLD, 0.5);
        guard.watch.commanded(F::from_f64(delay * T));
        let now = guard.at(0.5);
        assert_eq!((now.output == F::ZERO, now.reason), (is_late, is_late.then_some(Reason::Uneven)));
    }
}

fn without_a_torque_nothing_is_late<F: Real>() {
    for when_late in WhenLate::ALL {
        let mut guard = Guard::<F>::new(&limits(when_late), &WORLD);
        for k in 0..50 {
            guard.watch.commanded(F::from_f64(0.7 * T));
            guard.step(&at(0.0, k % 3), None);
        }
        let armed = guard.step(&at(0.9, 2), Some(Request::Arm));
        assert_eq!((armed.phase, armed.outside, guard.watch.outside()), (Phase::FadingIn, false, 0), "{when_late:?}");
    }
}

fn the_interval_before_a_swap_is_one_of_the_old_period<F: Real>() {
    for (before, after) in [(T, 0.5 * T), (0.5 * T, T)] {
        let bound = |period: f64| Limits {
            time: CertifiedTime { interval: 1.01 * period.max(before), ..limits(WhenLate::Fault).time },
            ..LIMITS
        };
        let mut guard = Guard::<F>::running(&bound(before), &Spec { period: before, ..WORLD }, 0.5);
        let next = Guard::<F>::new(&bound(after), &Spec { period: after, ..WORLD });
        (guard.world, guard.supervisor, guard.state) = (next.world, next.supervisor, next.state);
        guard.watch.swap(F::from_f64(before), F::from_f64(after));
        for _ in 0..50 {
            assert!(!guard.at(0.5).outside, "{before} {after}");
        }
    }
}

#[test]
fn no_time_of_a_certificate_is_shorter_than_the_period_or_below_zero() {
    let time = limits(WhenLate::Count).time;
    for (time, what) in [
        (CertifiedTime { interval: 0.9 * T, ..time }, "interval_max"),
        (CertifiedTime { interval: f64::NAN, ..time }, "interval_max"),
        (CertifiedTime { delay: -1e-9, ..time }, "delay_max"),
        (CertifiedTime { delay: f64::NAN, ..time }, "delay_max"),
    ] {
        let error = Supervisor::<f32, 1, 1>::new(&Limits { time, ..LIMITS }, &WORLD).unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    }
    Supervisor::<f32, 1, 1>::new(&Limits { time: CertifiedTime { interval: T, ..time }, ..LIMITS }, &WORLD).unwrap();
}

proptest! {
    #![proptest_config(hapt_testing::cases(100))]

    /// Whatever the pattern: within the bounds nothing is counted and no bit differs from a loop without any; with tighter ones exactly the
    /// samples beyond them are counted.
    #[test]
    fn only_what_is_beyond_the_bounds_counts(
        pattern in proptest::collection::vec((0.0..0.999f64, 0u32..4, 0.0..2.0f64), 1..300),
        (part, of_delay) in (0.0..1.0f64, 0.0..1.0f64),
        (amplitude, when) in (0.0..0.5f64, 0usize..3),
    ) {
        let mut last = 0.0;
        let mut times = Vec::new();
        for (late, missed, delay) in &pattern {
            times.push((f64::from(1 + missed) + late - last, *delay));
            last = *late;
        }
        // No sample judges the command of the last one.
        let longest = times.iter().fold(1.0, |most: f64, (interval, _)| most.max(*interval));
        let latest = times.iter().fold(0.0, |most: f64, (_, delay)| most.max(*delay));
        let when_late = WhenLate::ALL[when];
        let bounds = |interval: f64, delay: f64, when_late| CertifiedTime { interval: interval * T, delay: delay * T, when_late };
        let wide = Limits { stall: 1.0, jump: 10.0, ..LIMITS };
        let inside = bounds(longest, latest, when_late);
        let tight = (1.0 + part * (longest - 1.0), of_delay * latest);
        let beyond = bounds(tight.0, tight.1, WhenLate::Count);
        let mut guards = [CertifiedTime::NOT_STATED, inside, beyond]
            .map(|time| Guard::<f64>::running(&Limits { time, ..wide }, &WORLD, 0.1));
        let mut counted = 0;
        let mut command = 0.0;
        for (k, ((late, missed, delay), (interval, _))) in pattern.iter().zip(&times).enumerate() {
            let now = Reading { late: late * T, missed: *missed, ..reading(0.1 + 0.01 * amplitude * (k as f64 * 0.1).sin()) };
            let [any, inside, beyond] = guards.each_mut().map(|guard| guard.step(&now, None));
            prop_assert_eq!((inside.output.to_bits(), inside.phase), (any.output.to_bits(), Phase::Running));
            prop_assert!(!inside.outside && inside.warning.is_none());
            // Within rounding of a bound either result is right.
            let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
            if !near(*interval, tight.0) && !near(command, tight.1) {
                prop_assert_eq!(beyond.outside, *interval > tight.0 || command > tight.1, "{} {:?}", k, tight);
            }
            counted += u32::from(beyond.outside);
            command = *delay;
            for guard in &mut guards {
                guard.watch.commanded(delay * T);
            }
        }
        prop_assert_eq!(guards.each_ref().map(|guard| guard.watch.outside()), [0, 0, counted]);
    }
}
