//! States of an FMU: saved, restored, as bytes.

use hapt_fmi::{Kind, Version};
use hapt_testing::cases;
use hapt_testing::prelude::*;

use crate::fmu::{Fmu, Instance, WHEEL, world};

/// Runs this many steps from step `from` on, of 0.4 periods; every output after each.
fn run(instance: &Instance, from: u32, steps: u32) -> Vec<Vec<u64>> {
    let mut seen = Vec::new();
    for k in from..from + steps {
        let input = (f64::from(k) * 0.1).sin() * 0.05;
        assert!(instance.set_all(&[1], &[input]));
        assert!(instance.step(f64::from(k) * 0.4e-3, 0.4e-3), "{}", instance.message());
        seen.push(instance.outputs().iter().map(|value| value.to_bits()).collect());
    }
    seen
}

proptest! {
    #![proptest_config(cases(48))]

    /// From a state the same inputs give the same bits: in this instance, in another one, and after serialisation.
    #[test]
    fn a_restored_state_goes_on_to_the_bit(before in 0_u32..400, after in 1_u32..200, whole in any::<bool>(), tuned in any::<bool>(), three in any::<bool>()) {
        let kind = if whole { Kind::Whole } else { Kind::Loop };
        let fmu = Fmu::new(kind, &world(WHEEL, &["loop.delay=1.3 samples"]));
        let version = if three { Version::Three } else { Version::Two };
        let first = fmu.instance(version);
        first.start(0.0);
        if tuned {
            assert!(first.set("couplings.0.stiffness", 0.7));
        }
        run(&first, 0, before);
        let state = first.save();
        let expected = run(&first, before, after);
        assert!(first.restore(state));
        prop_assert_eq!(&run(&first, before, after), &expected);

        let second = fmu.instance(version);
        let bytes = first.serialize(state);
        let there = second.deserialize(&bytes).unwrap();
        prop_assert_eq!(second.serialize(there), bytes);
        assert!(second.restore(there));
        if tuned {
            prop_assert_eq!(second.get("couplings.0.stiffness"), 0.7);
        }
        prop_assert_eq!(&run(&second, before, after), &expected);
        // A state is the importer's until it is freed, and can be restored any number of times.
        assert!(first.restore(state));
        prop_assert_eq!(&run(&first, before, after), &expected);
        first.free(state);
        second.free(there);
    }

    /// Bytes that are not of this FMU are refused.
    #[test]
    fn damaged_bytes_are_no_state(at in 0.0_f64..1.0, flip in 1_u8..=255, cut in 0.0_f64..1.0) {
        let fmu = Fmu::new(Kind::Whole, &world(WHEEL, &[]));
        let instance = fmu.instance(Version::Two);
        instance.start(0.0);
        run(&instance, 0, 20);
        let state = instance.save();
        let bytes = instance.serialize(state);
        instance.free(state);
        let mut damaged = bytes.clone();
        damaged[(at * (bytes.len() - 1) as f64) as usize] ^= flip;
        prop_assert!(instance.deserialize(&damaged).is_none());
        prop_assert!(instance.deserialize(&bytes[..(cut * (bytes.len() - 1) as f64) as usize]).is_none());
        prop_assert!(instance.message().contains("no serialised state of this FMU"), "{}", instance.message());
        let other = Fmu::new(Kind::Loop, &world(WHEEL, &[]));
        let other = other.instance(Version::Two);
        prop_assert!(other.deserialize(&bytes).is_none());
    }
}

#[test]
fn saving_into_a_state_that_is_there_replaces_it() {
    let fmu = Fmu::new(Kind::Whole, &world(WHEEL, &[]));
    let instance = fmu.instance(Version::Two);
    instance.start(0.0);
    let mut state = instance.save();
    run(&instance, 0, 50);
    let before = state;
    assert_eq!(unsafe { hapt_fmi::fmi2::fmi2GetFMUstate(instance.c, &mut state) }, 0);
    assert_eq!(state, before);
    let expected = run(&instance, 50, 20);
    assert!(instance.restore(state));
    assert_eq!(run(&instance, 50, 20), expected);
    instance.free(state);
}

#[test]
fn a_reset_instance_is_as_it_was_made() {
    for kind in Kind::ALL {
        let fmu = Fmu::new(kind, &world(WHEEL, &[]));
        let instance = fmu.instance(Version::Two);
        instance.start(0.0);
        let expected = run(&instance, 0, 60);
        assert!(instance.set("couplings.0.stiffness", 0.1));
        run(&instance, 60, 60);
        assert!(instance.reset());
        assert_ne!(instance.get("couplings.0.stiffness"), 0.1);
        instance.start(0.0);
        assert_eq!(run(&instance, 0, 60), expected);
    }
}

#[test]
fn two_instances_share_no_state() {
    let fmu = Fmu::new(Kind::Whole, &world(WHEEL, &[]));
    let uninterrupted = fmu.instance(Version::Two);
    uninterrupted.start(0.0);
    let expected = run(&uninterrupted, 0, 100);
    let (one, other) = (fmu.instance(Version::Two), fmu.instance(Version::Three));
    one.start(0.0);
    assert!(other.set("bodies.wheel.inertia", 1.0) && other.set_up(5.0, None) && other.enter() && other.exit());
    for k in 0..100 {
        assert_eq!(run(&one, k, 1)[0], expected[k as usize]);
        assert!(
            other.set("hand_torque_Nm", 0.3) && other.step(5.0 + f64::from(k) * 0.7e-3, 0.7e-3),
            "{}",
            other.message()
        );
    }
}

#[test]
fn ten_thousand_instances_come_and_go() {
    let fmu = Fmu::new(Kind::Whole, &world(WHEEL, &[]));
    let before = resident();
    for k in 0..10_000 {
        let version = if k % 2 == 0 { Version::Two } else { Version::Three };
        let instance = fmu.instance(version);
        if k % 100 == 0 {
            instance.start(0.0);
            let state = instance.save();
            run(&instance, 0, 3);
            assert!(instance.restore(state));
            instance.free(state);
        }
    }
    // Each instance has more than 100 kB: a leak of one in ten would show.
    let grown = resident().saturating_sub(before);
    assert!(grown < 50 << 20, "{grown} bytes more");
}

/// The memory of this process in bytes, where the system reports it.
fn resident() -> u64 {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    text.split_whitespace().nth(1).and_then(|pages| pages.parse::<u64>().ok()).map_or(0, |pages| 4096 * pages)
}
