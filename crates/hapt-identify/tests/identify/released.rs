//! Records of a spring on a device that a hand has turned and released.

use std::f64::consts::TAU;

use fastrand::Rng;
use hapt_identify::{Known, Record, against, identify};
use hapt_model::Waveform;
use hapt_plant::VirtualDevice;
use hapt_plant::spec::{Cogging, DeviceSpec, DeviceTorque, Gravity, Stops, Stribeck};

use crate::against::claims;
use crate::rig::{WHEEL, times};

/// The record of a loop with a spring to ground, from the release at a place on; the encoder adds no noise, and with 0 counts nothing.
fn released(rig: &DeviceSpec, from: f64, stiffness: f64, samples: usize, counts: f64) -> Record {
    let mut device = VirtualDevice::new(rig);
    device.set_out((from, 0.0), (from, 0.0));
    let count = std::f64::consts::TAU / counts;
    let step = |_| {
        let z = device.puck().0;
        let seen = if counts > 0.0 { (z / count).round() * count } else { z };
        let torque = -stiffness * seen;
        device.command(torque);
        device.travel();
        (seen, torque)
    };
    let (seen, torques): (Vec<f64>, Vec<f64>) = (0..samples).map(step).unzip();
    Record::new(times(rig, samples), seen, torques).unwrap()
}

/// On a spring damping, delay and inertia explain each other over a valley that bends. A record determines little of them, and contradicts
/// none.
#[test]
fn a_spring_that_a_hand_releases_contradicts_nothing_of_its_own_device() {
    for seed in hapt_testing::seeds(36) {
        let mut rng = Rng::with_seed(seed);
        let mut between = |low: f64, high: f64| low * (high / low).powf(rng.f64());
        let inertia = between(1e-4, 5e-3);
        let (rate, swing) = (between(0.5, 8.0), between(15.0, 80.0));
        let (friction, delay, lag) = (inertia * between(1.6, 12.0), between(1e-4, 2e-3), between(3e-4, 3e-3));
        let from = between(0.2, 1.5);
        let stribeck = Stribeck { torque: friction * between(0.06, 0.9), velocity: between(0.1, 2.0) };
        let stiffness = inertia * between(100.0, 300.0).powi(2);
        let damping = inertia * between(5.0, 50.0);
        let stops = Stops { low: Some(-0.6 * from), high: Some(0.5 * from), stiffness, damping };
        let mut has = |x: f64, parts: usize| if rng.usize(..parts) == 0 { 0.0 } else { x };
        let (friction, delay) = (has(friction, 2), has(delay, 2));
        let rig = DeviceSpec { inertia, damping: rate * inertia, friction, delay, lag: lag - has(lag, 4), ..WHEEL };
        let (rig, from) = match seed % 3 {
            0 => (rig, from),
            1 => (DeviceSpec { friction: stribeck.torque, stribeck: Some(stribeck), ..rig }, from),
            _ => (DeviceSpec { stops: Some(stops), ..rig }, 0.3 * from),
        };
        let counts = [0.0, 0.0, 1000.0, 20_000.0][rng.usize(..4)];
        let record = released(&rig, from, inertia * swing * swing, [800, 2000][rng.usize(..2)], counts);
        let found = against(&record, &claims(&rig, 0.0), false).unwrap();
        assert!(found.agrees(), "seed {seed}, {counts} counts, {rig:?}: {:?} {:?}", found.wrong, found.numbers);
    }
}

/// Positions without counts or noise are exact, and so are the numbers: delay, damping and inertia of a release on a spring differ by
/// millionths of their effects.
#[test]
fn a_release_without_counts_gives_the_numbers_of_its_device() {
    let (mut determined, mut missed) = (0, Vec::new());
    for seed in hapt_testing::seeds(24) {
        let mut rng = Rng::with_seed(seed);
        let mut between = |low: f64, high: f64| low * (high / low).powf(rng.f64());
        let inertia = between(1e-4, 5e-3);
        let (rate, swing, friction) = (between(0.5, 8.0), between(15.0, 80.0), inertia * between(1.6, 12.0));
        let (from, delay) = (between(0.2, 1.5), between(1e-4, 2e-3));
        let delay = if rng.bool() { delay } else { 0.0 };
        let rig = DeviceSpec { inertia, damping: rate * inertia, friction, delay, ..WHEEL };
        let record = released(&rig, from, inertia * swing * swing, [800, 2000][rng.usize(..2)], 0.0);
        let found = identify(&record, &Known::default()).unwrap();
        let numbers = [
            ("inertia", rig.inertia, found.inertia),
            ("damping", rig.damping, found.damping),
            ("friction", rig.friction, found.friction),
            ("delay", rig.delay, found.delay),
        ];
        for (name, own, found) in numbers {
            let Some(found) = found else { continue };
            determined += 1;
            let rounding = 1e-9 * own + 1e-12;
            if !(found.low - rounding..=found.high + rounding).contains(&own) {
                missed.push((seed, name, own, found));
            }
        }
        assert!(found.sign.is_none_or(|sign| sign.value == 1.0), "seed {seed}: {found:?}");
    }
    assert!(determined > 0 && missed.len() * 20 <= determined, "{} of {determined}: {missed:?}", missed.len());
}

/// A swing has a frequency and a decay, two numbers, and a device has three: inertia, damping and delay. The opposite torque half a period
/// later is as good too.
#[test]
fn a_swing_without_friction_tells_no_number_wrongly() {
    let (mut determined, mut missed) = (0, Vec::new());
    for seed in hapt_testing::seeds(24) {
        let mut rng = Rng::with_seed(seed);
        let mut between = |low: f64, high: f64| low * (high / low).powf(rng.f64());
        let inertia = between(1e-4, 5e-3);
        let (swing, delay) = (between(30.0, 200.0), between(1e-4, 2e-3));
        // A delay takes the stiffness times itself and half a period from the damping, and the swing decays.
        let rate = 0.5 + between(1.05, 4.0) * swing * swing * (delay + 0.5e-3);
        let rig = DeviceSpec { inertia, damping: rate * inertia, friction: 0.0, delay, ..WHEEL };
        let (from, counts) = (between(0.2, 1.5), [0.0, 4000.0][rng.usize(..2)]);
        let record = released(&rig, from, inertia * swing * swing, 800, counts);
        let Ok(found) = identify(&record, &Known::default()) else { continue };
        assert!(found.sign.is_none_or(|sign| sign.value == 1.0), "seed {seed}: {found:?}");
        for (own, found) in [(rig.inertia, found.inertia), (rig.damping, found.damping), (rig.delay, found.delay)] {
            let Some(found) = found else { continue };
            determined += 1;
            if !(found.low..=found.high).contains(&own) {
                missed.push((seed, counts, own, found));
            }
        }
    }
    assert!(missed.len() * 10 <= determined, "{} of {determined}: {missed:?}", missed.len());
}

/// In a loop with a spring the torque follows the position, so a spring alone, without any inertia, satisfies the torque's equation. The
/// motion tells the device all the same, with its gravity and its cogging.
#[test]
fn a_spring_of_the_loop_hides_no_torque_of_the_device() {
    // With fine counts the delay's valley is rough beside the noise, and over a short travel a slow cogging stands for gravity.
    let (mut found, mut determined, mut missed) = (0, 0, Vec::new());
    let seeds: Vec<u64> = hapt_testing::seeds(32).collect();
    for seed in &seeds {
        let mut rng = Rng::with_seed(*seed);
        let mut between = |low: f64, high: f64| low * (high / low).powf(rng.f64());
        let inertia = between(1e-4, 5e-3);
        let (rate, swing, friction) = (between(0.5, 6.0), between(12.0, 50.0), inertia * between(1.6, 9.0));
        let stiffness = inertia * swing * swing;
        let gravity = Gravity { torque: stiffness * between(0.05, 0.3), phase: TAU * between(0.01, 1.0) };
        let waveform = Waveform { sine: [1.0, 0.0, 0.0, 0.0], cosine: [0.0; 4] };
        let (torque, from) = (stiffness * between(0.01, 0.06), between(1.3, 3.0));
        let cogging = Cogging { torque, pitch: TAU / [6.0, 12.0, 24.0][rng.usize(..3)], phase: 0.05, waveform };
        let (has_gravity, has_cogging) = [(true, true), (true, false), (false, true)][rng.usize(..3)];
        let rig = DeviceSpec {
            inertia,
            damping: rate * inertia,
            friction,
            torque: DeviceTorque {
                gravity: Some(gravity).filter(|_| has_gravity),
                cogging: Some(cogging).filter(|_| has_cogging),
            },
            ..WHEEL
        };
        let counts = [4000.0, 20_000.0, 80_000.0][rng.usize(..3)];
        let record = released(&rig, from, stiffness, 1500, counts);
        let Ok(identified) = identify(&record, &Known::default()) else { continue };
        found += 1;
        let numbers = [
            ("inertia", rig.inertia, identified.inertia),
            ("damping", rig.damping, identified.damping),
            ("friction", rig.friction, identified.friction),
            ("delay", rig.delay, identified.delay),
        ];
        for (name, own, found) in numbers {
            let Some(found) = found else { continue };
            determined += 1;
            let half = 0.25 * (found.high - found.low);
            if !(found.low - half..=found.high + half).contains(&own) {
                missed.push((seed, name, own, found));
            }
        }
    }
    assert!(3 * found >= seeds.len(), "found {found} of {}", seeds.len());
    assert!(missed.len() * 4 <= determined, "{} of {determined}: {missed:?}", missed.len());
}
