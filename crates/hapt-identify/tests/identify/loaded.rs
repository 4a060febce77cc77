//! Gravity, cogging, a spring to ground and changes of friction with the position, alone and with end stops.

use std::f64::consts::TAU;

use fastrand::Rng;
use hapt_identify::{Comparison, Identified, Interval, Known, Record, TermKind, Verdict, against, identify};
use hapt_model::Waveform;
use hapt_plant::VirtualDevice;
use hapt_plant::spec::{Cogging, DeviceSpec, DeviceTorque, FrictionByPosition, Gravity, Stops};

use crate::against::claims;
use crate::rig::{WHEEL, counted, motion, steps, times};
use crate::stops;

/// The torque of a device besides those of its stops.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Load {
    Gravity,
    Cogging,
    Spring,
}

/// A random device between two stops with torques of the position, the stiffness of its spring to ground, and a record that runs into both
/// stops.
fn loaded(loads: &[Load], rng: &mut Rng) -> (DeviceSpec, f64, Record) {
    loop {
        let mut between = |low: f64, high: f64| low * (high / low).powf(rng.f64());
        let inertia = between(3e-4, 2e-3);
        let (rate, friction, delay) = (between(1.0, 8.0), between(2e-3, 8e-3), between(0.1e-3, 4e-3));
        let stiffness = inertia * between(80.0, 400.0).powi(2);
        let damping = 2.0 * between(0.05, 0.8) * (stiffness * inertia).sqrt();
        let [low, high] = [-between(0.6, 2.0), between(0.6, 2.0)];
        let stops = Stops { low: Some(low), high: Some(high), stiffness, damping };
        let largest = 100.0 * inertia;
        let mut size = || largest * between(0.1, 0.4);
        let sizes = [size(), size(), size()];
        let (phase, teeth) = (TAU * between(0.1, 1.0), between(8.0, 24.0).floor());
        let has = |load: Load| loads.contains(&load);
        let gravity = Some(Gravity { torque: sizes[0], phase }).filter(|_| has(Load::Gravity));
        let waveform = Waveform { sine: [1.0, 0.0, 0.0, 0.0], cosine: [0.0; 4] };
        let cogging = Cogging { torque: sizes[1], pitch: TAU / teeth, phase: phase / teeth, waveform };
        let cogging = Some(cogging).filter(|_| has(Load::Cogging));
        let spring = if has(Load::Spring) { sizes[2] } else { 0.0 };
        let rig = DeviceSpec {
            delay: if has(Load::Spring) { 0.0 } else { delay },
            inertia,
            damping: rate * inertia,
            friction,
            stops: Some(stops),
            torque: DeviceTorque { gravity, cogging },
            ..WHEEL
        };
        let mut torques = steps(rng, 4000, largest);
        torques[0] = 0.0;
        // The spring follows the position in steps of a tenth of a period.
        let mut device = VirtualDevice::new(&DeviceSpec { period: 0.1 * rig.period, ..rig });
        let sample = |torque: &f64| {
            let position = device.puck().0;
            for _ in 0..10 {
                device.command(torque - spring * device.puck().0);
                device.travel();
            }
            position
        };
        let path: Vec<f64> = torques.iter().map(sample).collect();
        let beyond = |side: f64, stop: f64| path.iter().any(|z| side * (z - stop) > 0.01);
        if beyond(-1.0, low) && beyond(1.0, high) {
            let seen = counted(&path, 20_000.0, 0.7, rng);
            return (rig, spring, Record::new(times(&rig, 4000), seen, torques).unwrap());
        }
    }
}

/// The numbers of a result with their truths, its torques of the position among them.
fn numbers(found: &Identified, rig: &DeviceSpec, spring: f64) -> Vec<(Interval, f64)> {
    let terms = found.terms.iter().map(|term| {
        let truth = match term.kind {
            TermKind::Stiffness => spring,
            TermKind::Turn { times: 1, .. } => rig.torque.gravity.map_or(0.0, |gravity| gravity.torque),
            TermKind::Turn { .. } => rig.torque.cogging.map_or(0.0, |cogging| cogging.torque),
            _ => 0.0,
        };
        (term.size, truth)
    });
    stops::numbers(found, rig).into_iter().chain(terms).collect()
}

const LOADS: [&[Load]; 6] = [
    &[Load::Gravity],
    &[Load::Cogging],
    &[Load::Spring],
    &[Load::Gravity, Load::Cogging],
    &[Load::Cogging, Load::Spring],
    &[Load::Gravity, Load::Cogging, Load::Spring],
];

#[test]
fn stops_are_found_together_with_torques_of_the_position() {
    let (mut all, mut found, mut determined, mut covered) = (0, 0, 0, 0);
    for seed in hapt_testing::seeds(50) {
        let loads = LOADS[seed as usize % LOADS.len()];
        let (rig, spring, record) = loaded(loads, &mut Rng::with_seed(seed));
        all += 1;
        // A device that is not found has no numbers.
        let Ok(answer) = identify(&record, &Known::default()) else { continue };
        assert!(answer.stops.is_some(), "seed {seed}: {rig:?}: {answer:?}");
        found += 1;
        for (interval, truth) in numbers(&answer, &rig, spring) {
            determined += 1;
            covered += u32::from(interval.covers(truth));
        }
    }
    assert!(10 * found >= 7 * all, "{found} of {all}");
    // The numbers of one record go together.
    assert!(100 * covered + 1000 >= 93 * determined, "{covered} of {determined}");
}

/// A device with gravity, cogging and friction that changes with the position, or some of them, and a record of it.
fn waved(rng: &mut Rng) -> (DeviceSpec, Record) {
    let has = 1 + rng.u8(..7);
    let mut between = |low: f64, high: f64| low * (high / low).powf(rng.f64());
    let inertia = between(3e-4, 2e-3);
    let largest = 100.0 * inertia;
    let (rate, friction, delay) = (between(1.0, 8.0), largest * between(0.05, 0.2), between(0.1e-3, 4e-3));
    let gravity = Gravity { torque: largest * between(0.1, 0.4), phase: between(0.1, 6.0) };
    let mut single = || (between(0.2, 1.0) * if between(0.1, 10.0) < 1.0 { -1.0 } else { 1.0 }) as f32;
    let waveform = Waveform { sine: [single(), single(), 0.0, 0.0], cosine: [0.0, single(), single(), 0.0] };
    let pitch = TAU / between(3.0, 12.0).floor();
    let cogging = Cogging { torque: largest * between(0.05, 0.2), pitch, phase: between(0.1, 1.0), waveform };
    let sine = Waveform { sine: [1.0, 0.0, 0.0, 0.0], cosine: [-0.5, 0.0, 0.0, 0.0] };
    let pitch = TAU / between(1.0, 6.0).floor();
    let changes = FrictionByPosition { share: between(0.3, 0.85), pitch, phase: between(0.1, 1.0), waveform: sine };
    let rig = DeviceSpec {
        delay,
        inertia,
        damping: rate * inertia,
        friction,
        torque: DeviceTorque {
            gravity: Some(gravity).filter(|_| has & 1 > 0),
            cogging: Some(cogging).filter(|_| has & 2 > 0),
        },
        friction_by_position: Some(changes).filter(|_| has & 4 > 0),
        ..WHEEL
    };
    let torques = steps(rng, 3000, largest);
    let seen = counted(&motion(&rig, &torques), 20_000.0, 0.7, rng);
    (rig, Record::new(times(&rig, 3000), seen, torques).unwrap())
}

/// The motion explains such a record without a file, and the intervals of the device's own numbers cover the truth.
#[test]
fn a_device_without_stops_is_found_with_its_torques_of_the_position() {
    let (mut all, mut found, mut determined, mut covered) = (0, 0, 0, 0);
    for seed in hapt_testing::seeds(16) {
        let (rig, record) = waved(&mut Rng::with_seed(800 + seed));
        all += 1;
        let Ok(answer) = identify(&record, &Known::default()) else { continue };
        found += 1;
        let pairs = [
            (answer.inertia, rig.inertia),
            (answer.damping, rig.damping),
            (answer.friction, rig.friction),
            (answer.late, rig.delay),
        ];
        for (interval, truth) in pairs.into_iter().filter_map(|(interval, truth)| Some((interval?, truth))) {
            determined += 1;
            covered += u32::from(interval.covers(truth));
        }
    }
    assert!(10 * found + 20 >= 7 * all, "{found} of {all}");
    // The numbers of one record go together.
    assert!(10 * covered + 10 >= 9 * determined, "{covered} of {determined}");
}

fn is_of_a_wave(name: &str) -> bool {
    name.contains("sine")
}

#[test]
fn a_file_is_compared_in_each_harmonic_of_its_torques_and_its_friction() {
    let (mut all, mut determined, mut agrees, mut covered) = (0, 0, 0, 0);
    for seed in hapt_testing::seeds(48) {
        let (rig, record) = waved(&mut Rng::with_seed(seed));
        let right = against(&record, &claims(&rig, 0.0), false).unwrap();
        assert!(right.agrees(), "seed {seed}: {rig:?}: {:?} {:?}", right.wrong, right.numbers);
        for number in right.numbers.iter().filter(|number| is_of_a_wave(number.name)) {
            all += 1;
            let Some(estimate) = number.estimate else { continue };
            determined += 1;
            agrees += u32::from(number.verdict == Verdict::Agrees);
            covered += u32::from(estimate.covers(number.file[0]));
        }
    }
    assert!(10 * determined >= 9 * all && 10 * agrees >= 8 * all, "{agrees} agree, {determined} are found, of {all}");
    // The numbers of one record go together.
    assert!(10 * covered + 10 >= 9 * determined, "{covered} of {determined}");
}

/// A harmonic of the file that is wrong is contradicted, and no other number is.
#[test]
fn a_harmonic_that_is_off_is_named() {
    let (mut all, mut named) = (0, 0);
    for seed in hapt_testing::seeds(24) {
        let (rig, record) = waved(&mut Rng::with_seed(400 + seed));
        let mut off = rig;
        let names: &[&str] = if let Some(cogging) = &mut off.torque.cogging {
            // A harmonic that the file has and the device has not, by a third of the amplitude, is one of them.
            cogging.waveform.cosine[1] += 0.5;
            &["cogging cosine 2"]
        } else if let Some(gravity) = &mut off.torque.gravity {
            gravity.torque *= 1.5;
            &["gravity sine", "gravity cosine"]
        } else {
            off.friction_by_position.as_mut().unwrap().share *= 0.5;
            &["friction sine 1", "friction cosine 1"]
        };
        let found = against(&record, &claims(&off, 0.0), false).unwrap();
        assert!(!found.agrees(), "seed {seed}: {rig:?}");
        all += 1;
        let wrong: Vec<&str> = wrong(&found);
        assert!(found.wrong.is_some() || wrong.iter().all(|name| names.contains(name)), "seed {seed}: {wrong:?}");
        named += u32::from(found.wrong.is_none() && names.iter().any(|name| wrong.contains(name)));
    }
    assert!(10 * named >= 9 * all, "{named} of {all}");
}

fn wrong(found: &Comparison) -> Vec<&'static str> {
    let is_wrong = |number: &&hapt_identify::Compared| number.verdict == Verdict::Contradicts;
    found.numbers.iter().filter(is_wrong).map(|number| number.name).collect()
}

/// A device has torques of the position that its file lacks: they are contradicted, and the numbers of the stops are not.
#[test]
fn a_file_without_the_torques_of_a_device_between_stops_is_contradicted() {
    let (mut all, mut named) = (0, 0);
    for seed in hapt_testing::seeds(20) {
        let loads = LOADS[seed as usize % LOADS.len()];
        let (rig, spring, record) = loaded(loads, &mut Rng::with_seed(600 + seed));
        let own = against(&record, &claims(&rig, 0.0), false).unwrap();
        assert!(spring > 0.0 || own.agrees(), "seed {seed}: {rig:?}: {:?} {:?}", own.wrong, own.numbers);
        let file = DeviceSpec { torque: DeviceTorque::default(), ..rig };
        let found = against(&record, &claims(&file, 0.0), false).unwrap();
        assert!(!found.agrees(), "seed {seed}: {rig:?}: {:?}", found.numbers);
        all += 1;
        let wrong = wrong(&found);
        // A spring is relaxed elsewhere than in the middle of the motion.
        let is_of_a_spring = |name: &str| spring > 0.0 && ["spring", "constant torque"].contains(&name);
        let is_of_a_torque = |name: &&str| is_of_a_wave(name) || is_of_a_spring(name);
        assert!(found.wrong.is_some() || wrong.iter().all(is_of_a_torque), "seed {seed}: {wrong:?}");
        named += u32::from(found.wrong.is_none());
    }
    assert!(2 * named >= all, "{named} of {all}");
}
