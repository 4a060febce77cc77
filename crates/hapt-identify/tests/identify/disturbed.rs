//! Torques that were not commanded, records that begin in the middle, and devices in other units.

use fastrand::Rng;
use hapt_identify::{Error, Identified, Interval, Known, PositionTorque, Record, TermKind, identify};
use hapt_plant::VirtualDevice;
use hapt_plant::spec::DeviceSpec;
use hapt_testing::prelude::*;

use crate::rig::{WHEEL, counted, motion, steps, times};

/// The periods of a torque in a turn, its size, and the torque at a position.
type Besides<'a> = (u32, f64, &'a dyn Fn(f64) -> f64);

/// The positions of a device on which another torque acts too, given by its position.
fn moved(rig: &DeviceSpec, torques: &[f64], besides: impl Fn(f64) -> f64) -> Vec<f64> {
    let mut device = VirtualDevice::new(rig);
    let step = |torque: &f64| {
        let position = device.puck().0;
        device.command(torque + besides(position));
        device.travel();
        position
    };
    torques.iter().map(step).collect()
}

fn identified(rig: &DeviceSpec, positions: &[f64], torques: Vec<f64>, rng: &mut Rng) -> Result<Identified, Error> {
    let seen = counted(positions, 4000.0, 0.7, rng);
    identify(&Record::new(times(rig, torques.len()), seen, torques).unwrap(), &Known::default())
}

fn found(rig: &DeviceSpec, positions: &[f64], torques: Vec<f64>, rng: &mut Rng) -> Identified {
    identified(rig, positions, torques, rng).unwrap()
}

/// Within five standard errors.
fn near(interval: Option<Interval>, truth: f64) -> bool {
    interval.is_some_and(|x| (x.value - truth).abs() < 2.6 * (x.high - x.value))
}

proptest! {
    #![proptest_config(hapt_testing::cases(16))]

    #[test]
    fn a_constant_torque_is_found_beside_the_friction(
        seed in any::<u64>(), offset in -0.01..0.01f64, friction in 1e-3..8e-3f64, damping in 3e-3..10e-3f64,
    ) {
        // Steps that are shorter than the time constant, so that it moves in both directions.
        let rig = DeviceSpec { friction, damping, delay: 1.3e-3, ..WHEEL };
        let mut rng = Rng::with_seed(seed);
        let torques = steps(&mut rng, 4000, 0.1);
        let found = found(&rig, &moved(&rig, &torques, |_| offset), torques, &mut rng);
        prop_assert!(near(found.offset, offset), "{:?}", found.offset);
        let truth = [(found.inertia, rig.inertia), (found.damping, damping), (found.friction, friction), (found.delay, rig.delay)];
        for (interval, truth) in truth {
            prop_assert!(near(interval, truth), "{interval:?} is {truth}");
        }
        prop_assert_eq!(found.unmodelled, None);
    }

    /// A drive whose torque rises in two stages, and a table that has each torque next to a later position: no delay of 0 or more fits, and
    /// the intervals allow for that.
    #[test]
    fn a_gain_beside_torques_of_later_samples_is_as_wide_as_it_is_wrong(
        seed in any::<u64>(), rise in 0.5..3.0f64, damping in 1e-3..10e-3f64, counts in 1000.0..10_000.0f64,
    ) {
        let rig = DeviceSpec { damping, ..WHEEL };
        let mut rng = Rng::with_seed(seed);
        let torques = steps(&mut rng, 3000, 0.1);
        let (mut first, mut second) = (0.0, 0.0);
        let risen = |torque: &f64| {
            first += (torque - first) / (1.0 + rise);
            second += (first - second) / (1.0 + rise);
            second
        };
        let given: Vec<f64> = torques.iter().map(risen).collect();
        let seen = counted(&motion(&rig, &given), counts, 0.2, &mut rng);
        let later = 2 + (2.0 * rise) as usize;
        let seen = seen[later..].to_vec();
        let record = Record::new(times(&rig, seen.len()), seen, torques[..torques.len() - later].to_vec()).unwrap();
        let known = Known { inertia: Some(rig.inertia), ..Known::default() };
        // A delay that may be 0 violates no bound.
        if let Some(found) = identify(&record, &known).ok().filter(|found| found.puck.delay < 0.0) {
            let gain = found.gain.unwrap();
            prop_assert!(gain.low <= 1.0 && 1.0 <= gain.high, "{gain:?}");
        }
    }

    #[test]
    fn a_linear_device_is_the_rotary_one_in_other_units_to_the_last_bit(
        seed in any::<u64>(), length in -12..4i32, force in -6..12i32, offset in -4e-3..4e-3f64,
    ) {
        let mut rng = Rng::with_seed(seed);
        let torques = steps(&mut rng, 2000, 0.08);
        let positions = moved(&DeviceSpec { damping: 5e-3, ..WHEEL }, &torques, |_| offset);
        let seen = counted(&positions, 4000.0, 0.7, &mut rng);
        // Powers of two, so that no unit rounds anything.
        let (metre, newton) = (2f64.powi(length), 2f64.powi(force));
        let of = |positions: Vec<f64>, torques: Vec<f64>, is_linear| {
            let record = Record::new(times(&WHEEL, 2000), positions, torques).unwrap();
            identify(&record, &Known { is_linear, ..Known::default() }).unwrap()
        };
        let scaled = |list: &[f64], unit: f64| list.iter().map(|x| unit * x).collect::<Vec<f64>>();
        let linear = of(scaled(&seen, metre), scaled(&torques, newton), true);
        let rotary = of(seen, torques, false);
        let times = |interval: Option<Interval>, unit: f64| {
            interval.map(|Interval { value, low, high }| Interval { value: unit * value, low: unit * low, high: unit * high })
        };
        prop_assert_eq!(linear.inertia, times(rotary.inertia, newton / metre));
        prop_assert_eq!(linear.damping, times(rotary.damping, newton / metre));
        prop_assert_eq!(linear.friction, times(rotary.friction, newton));
        prop_assert_eq!(linear.offset, times(rotary.offset, newton));
        prop_assert_eq!((linear.delay, linear.sign), (rotary.delay, rotary.sign));
        prop_assert_eq!(linear.residual.rms, metre * rotary.residual.rms);
        prop_assert_eq!(linear.lattice.map(|x| x.step), rotary.lattice.map(|x| metre * x.step));
        prop_assert!(rotary.counts.is_some() && linear.counts.is_none());
    }
}

#[test]
fn what_moves_the_puck_with_its_position_is_seen_for_what_it_is() {
    let rig = DeviceSpec { damping: 4e-3, ..WHEEL };
    for seed in hapt_testing::seeds(2) {
        let mut rng = Rng::with_seed(seed);
        let torques = steps(&mut rng, 4000, 0.1);
        let besides: [Besides; 4] = [
            (0, 0.4e-3, &|z| -0.4e-3 * z),
            (1, 1.5e-3, &|z| 1.5e-3 * (z - 0.7).sin()),
            (7, 1.5e-3, &|z| 1.5e-3 * (7.0 * z + 0.3).sin()),
            (3, 2e-3, &|z| 2e-3 * (3.0 * z + 1.3).sin()),
        ];
        for (times_a_turn, size, besides) in besides {
            // Either so little that the intervals still hold, or a term of the motion, or rejected.
            let seen = match identified(&rig, &moved(&rig, &torques, besides), torques.clone(), &mut rng) {
                Ok(found) if !found.terms.is_empty() => {
                    let times = |kind: &TermKind| match kind {
                        TermKind::Stiffness => 0,
                        TermKind::Turn { times, .. } => *times,
                        kind => panic!("seed {seed}: {kind:?}"),
                    };
                    let is_it = |term: &&hapt_identify::Term| times(&term.kind) == times_a_turn;
                    let term = found.terms.iter().find(is_it).unwrap_or_else(|| panic!("{:?}", found.terms));
                    Some(PositionTorque { times_a_turn, size: term.size.value, explains: 1.0 })
                }
                Ok(found) => found.unmodelled,
                Err(Error::Residual(left)) => {
                    // The rejected fit is still near the device.
                    let puck = left.puck.unwrap_or_else(|| panic!("seed {seed}: no fit"));
                    assert!((puck.gain * rig.inertia - 1.0).abs() < 0.2, "seed {seed}: {puck:?}");
                    left.position
                }
                Err(error) => panic!("{error}"),
            };
            let seen = seen.unwrap_or_else(|| panic!("seed {seed}: {times_a_turn} times a turn is not seen"));
            assert_eq!(seen.times_a_turn, times_a_turn, "seed {seed}: {seen:?} of {size}");
            assert!((seen.size / size - 1.0).abs() < 0.5, "seed {seed}: {seen:?} of {size}");
        }
        let nothing = found(&rig, &motion(&rig, &torques), torques, &mut rng);
        assert_eq!(nothing.unmodelled, None, "seed {seed}");
    }
}

/// The puck drifts by thousands of counts, and many fits are the best among their neighbours.
#[test]
fn a_large_constant_torque_is_found_or_nothing_is() {
    let (mut trials, mut refused, mut missed) = (0, 0, 0);
    for seed in hapt_testing::seeds(24) {
        let mut rng = Rng::with_seed(seed);
        let mut between = |low: f64, high: f64| low + (high - low) * rng.f64();
        let rig = DeviceSpec {
            damping: WHEEL.inertia / between(0.1, 3.0),
            friction: between(2e-3, 0.04),
            delay: between(0.0, 5e-3),
            ..WHEEL
        };
        let offset = between(-0.06, 0.06);
        let torques = steps(&mut rng, 3000, 0.1);
        trials += 1;
        match identified(&rig, &moved(&rig, &torques, |_| offset), torques, &mut rng) {
            Err(_) => refused += 1,
            Ok(found) => {
                // For a puck that moves in one direction the record does not separate them: then neither is given, or no constant torque
                // shows.
                let friction = found.friction.is_none() || near(found.friction, rig.friction);
                missed +=
                    i32::from(!(near(found.inertia, rig.inertia) && near(found.damping, rig.damping) && friction));
            }
        }
    }
    assert!(missed == 0 && refused <= 2, "of {trials}: {refused} refused, {missed} wrong");
}

#[test]
fn a_record_is_used_from_where_every_torque_in_it_is_known() {
    for seed in hapt_testing::seeds(8) {
        let mut rng = Rng::with_seed(seed);
        let rig = DeviceSpec { delay: 3.4e-3, damping: 4e-3, ..WHEEL };
        let torques = steps(&mut rng, 4600, 0.1);
        let seen = counted(&motion(&rig, &torques), 4000.0, 0.7, &mut rng);
        // From the middle on: the torques before are unknown.
        let record = Record::new(times(&rig, 4000), seen[600..].to_vec(), torques[600..].to_vec()).unwrap();
        let found = identify(&record, &Known::default()).unwrap();
        assert!((4..7).contains(&found.first), "seed {seed}: from sample {}", found.first);
        let truth = [(found.inertia, rig.inertia), (found.damping, rig.damping), (found.friction, rig.friction)];
        for (interval, truth) in truth.into_iter().chain([(found.delay, rig.delay)]) {
            assert!(near(interval, truth), "seed {seed}: {interval:?} is {truth}");
        }
    }
}

#[test]
fn who_goes_one_way_cannot_tell_a_constant_torque_and_says_so() {
    let torques: Vec<f64> =
        (0..3000).map(|k| if k < 100 { 0.0 } else { 0.06 + 0.04 * (k as f64 * k as f64 * 2e-5).sin() }).collect();
    let rig = DeviceSpec { damping: 5e-3, ..WHEEL };
    let mut rng = Rng::with_seed(3);
    let found = found(&rig, &motion(&rig, &torques), torques, &mut rng);
    assert_eq!(found.offset, None);
    assert!(found.warnings().iter().any(|line| line.contains("a constant torque")), "{:?}", found.warnings());
    assert!(near(found.friction, rig.friction));
}
