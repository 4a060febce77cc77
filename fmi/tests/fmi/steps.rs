//! Communication steps that are not a whole number of periods.

use hapt_fmi::{Clock, Kind, Version};
use hapt_testing::cases;
use hapt_testing::prelude::*;

use crate::fmu::{Fmu, Instance, WHEEL, world};

/// Steps from communication point to communication point; the instants are multiples of a 64th of a period.
fn walk(instance: &Instance, lengths: &[u32], mut each: impl FnMut(u64, &Instance)) {
    const UNIT: f64 = 1e-3 / 64.0;
    let mut at = 0_u64;
    for length in lengths {
        each(at, instance);
        assert!(instance.step(at as f64 * UNIT, f64::from(*length) * UNIT), "{}", instance.message());
        at += u64::from(*length);
    }
    each(at, instance);
}

proptest! {
    #![proptest_config(cases(64))]

    /// Between its samples a loop holds its output: the torque of a step is that of the last sample before its end, taken with the puck
    /// that was set for the step that contains the sample.
    #[test]
    fn a_loops_samples_fall_where_they_fall_whatever_the_steps(lengths in prop::collection::vec(1_u32..200, 1..60)) {
        let fmu = Fmu::new(Kind::Loop, &world(WHEEL, &[]));
        let (uneven, even) = (fmu.instance(Version::Two), fmu.instance(Version::Three));
        let puck = |at: u64| (at as f64 * 1e-3).sin();
        uneven.start(0.0);
        even.start(0.0);
        let (mut taken, mut begun) = (0_u64, 0_u64);
        walk(&uneven, &lengths, |at, instance| {
            // Samples in the step that ends here, from its beginning to before its end.
            while taken * 64 < at {
                assert!(even.set_all(&[1, 2], &[puck(begun), 0.0]));
                assert!(even.step(taken as f64 * 1e-3, 1e-3));
                taken += 1;
            }
            if at > 0 {
                assert_eq!(instance.outputs(), even.outputs(), "at {at}/64 of a period");
            }
            assert!(instance.set_all(&[1, 2], &[puck(at), 0.0]));
            begun = at;
        });
    }

    /// With a hand whose torque is constant the device's motion does not depend on the communication points.
    #[test]
    fn a_device_moves_the_same_way_whatever_the_steps(
        lengths in prop::collection::vec(1_u32..200, 1..40), torque in -0.1_f64..0.1, delay in 0_u32..3,
    ) {
        let delay = format!("loop.delay={} ms", 0.3 * f64::from(delay));
        let smooth = WHEEL.replace("encoder = 4000\nlevels = 2048\n", "");
        let fmu = Fmu::new(Kind::Whole, &world(&smooth, &[&delay]));
        let (uneven, even) = (fmu.instance(Version::Three), fmu.instance(Version::Two));
        for instance in [&uneven, &even] {
            instance.start(0.0);
            assert!(instance.set("hand_torque_Nm", torque));
        }
        let mut taken = 0_u64;
        walk(&uneven, &lengths, |at, instance| {
            while (taken + 1) * 64 <= at {
                assert!(even.step(taken as f64 * 1e-3, 1e-3));
                taken += 1;
            }
            if at % 64 == 0 {
                for (a, b) in instance.outputs().iter().zip(even.outputs()) {
                    assert!((a - b).abs() < 1e-11 * (1.0 + b.abs()), "{a} {b} at {at}/64");
                }
            }
        });
    }

    /// A clock's samples are those with an instant not after it.
    #[test]
    fn a_clock_counts_whole_periods_and_snaps_to_samples(
        period in 1e-5_f64..1e-1, start in -100.0_f64..100.0, steps in prop::collection::vec(0.01_f64..20.0, 1..50),
    ) {
        let mut clock = Clock::new(period, start);
        let mut periods = 0.0;
        for step in steps {
            let at = start + periods * period;
            let next = clock.after(at, step * period).unwrap();
            periods += step;
            prop_assert!((next.sample, next.part) >= (clock.sample, clock.part));
            prop_assert!((0.0..period).contains(&next.part));
            prop_assert!((next.time() - (start + periods * period)).abs() < 1e-5 * period, "{next:?}");
            clock = next;
        }
        let whole = clock.after(clock.time(), 7.0 * period).unwrap();
        prop_assert_eq!((whole.sample, whole.part), (clock.sample + 7, clock.part));
    }
}

#[test]
fn thirds_of_a_period_come_back_to_every_sample() {
    let mut clock = Clock::new(1e-3, 0.0);
    for k in 0..30_000_u64 {
        assert_eq!((clock.sample, clock.part == 0.0), (k / 3, k % 3 == 0), "{clock:?}");
        clock = clock.after(k as f64 * 1e-3 / 3.0, 1e-3 / 3.0).unwrap();
    }
}

#[test]
fn steps_that_are_nearly_a_period_keep_to_the_importers_time() {
    for periods in [1.0 + 5e-7, 1.0 - 5e-7, 3.0 + 1e-7] {
        let (mut clock, step) = (Clock::new(1e-3, 0.0), periods * 1e-3);
        for k in 0..1_000_000_u64 {
            clock = clock.after(k as f64 * step, step).unwrap();
        }
        assert!((clock.time() - 1e6 * step).abs() < 1e-8, "{clock:?} after {periods} periods a step");
    }
}

#[test]
fn a_run_may_begin_at_any_time() {
    let fmu = Fmu::new(Kind::Whole, &world(WHEEL, &[]));
    let (early, late) = (fmu.instance(Version::Two), fmu.instance(Version::Three));
    early.start(-3.0);
    late.start(1e6);
    for k in 0..100 {
        let torque = f64::from(k) * 1e-3;
        assert!(early.set("hand_torque_Nm", torque) && late.set("hand_torque_Nm", torque));
        assert!(early.step(-3.0 + f64::from(k) * 1e-3, 1e-3), "{}", early.message());
        assert!(late.step(1e6 + f64::from(k) * 1e-3, 1e-3), "{}", late.message());
        assert_eq!(early.outputs(), late.outputs());
    }
    assert_eq!(late.get("time_s"), 1e6 + 99.0 * 1e-3 + 1e-3);
}
