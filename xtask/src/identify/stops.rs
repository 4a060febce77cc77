//! Devices with end stops, and records that run into them.

use std::f64::consts::TAU;

use anyhow::{Context, Result};
use fastrand::Rng;
use hapt_identify::{Claims, Error, Identified, Known, Record, TermKind, against, identify};
use hapt_model::Waveform;
use hapt_plant::VirtualDevice;
use hapt_plant::spec::{Cogging, DeviceSpec, DeviceTorque, Gravity, Stops};
use rayon::prelude::*;

use super::share;

/// The parameters with an interval.
const NAMES: [&str; 12] = [
    "inertia",
    "damping",
    "friction",
    "delay",
    "lag",
    "delay and lag",
    "the low stop",
    "the high stop",
    "the stops' stiffness",
    "their damping",
    "gravity",
    "cogging",
];
type Covers = [Option<bool>; NAMES.len()];
const PERIOD: f64 = 1e-3;
/// The largest acceleration by a command, in rad/s².
const LARGEST: f64 = 100.0;
/// Samples of a record: every fourth device has the long one, with hundreds of impacts.
const SAMPLES: [usize; 4] = [3000, 3000, 3000, 10_000];

/// One device in this many has torques of the position too, in a table of its own: their search takes longer.
const LOADED: u64 = 5;

/// A device, its commands, and how often it goes into a stop.
struct Trial {
    rig: DeviceSpec,
    stops: Stops,
    torques: Vec<f64>,
    touches: usize,
}

/// The result of one device.
struct Outcome {
    is_long: bool,
    has_one: bool,
    is_touched_once: bool,
    lags: bool,
    torque: DeviceTorque,
    /// Whether the intervals cover the truth; `None`: no stops were found, or the number is not determined.
    covers: Option<Covers>,
    /// Whether the record agrees with its own device's file.
    agrees: bool,
}

/// Where a device is at each sample.
pub fn motion(rig: &DeviceSpec, torques: &[f64]) -> Vec<f64> {
    let mut device = VirtualDevice::new(rig);
    let at = |torque: &f64| {
        let position = device.puck().0;
        device.command(*torque);
        device.travel();
        position
    };
    torques.iter().map(at).collect()
}

/// A random device whose record goes into each of its stops; `is_loaded`: it has gravity, cogging or both.
fn trial(rng: &mut Rng, samples: usize, is_loaded: bool) -> Trial {
    loop {
        let mut between = |low: f64, high: f64| low * (high / low).powf(rng.f64());
        let inertia = between(3e-4, 2e-3);
        let (damping, friction, delay) = (inertia * between(1.0, 8.0), between(2e-3, 8e-3), between(0.1e-3, 4e-3));
        let stiffness = inertia * between(80.0, 400.0).powi(2);
        let lost = 2.0 * between(0.05, 0.8) * (stiffness * inertia).sqrt();
        let (low, high, lag) = (-between(0.2, 1.0), between(0.2, 1.0), between(0.3e-3, 4e-3));
        // Half of the devices have one stop, and half of them a lag.
        let [has_low, has_high] = [[true, true], [true, true], [true, false], [false, true]][rng.usize(0..4)];
        let lag = if rng.bool() { lag } else { 0.0 };
        let [low, high] = [(low, has_low), (high, has_high)].map(|(place, has)| Some(place).filter(|_| has));
        let stops = Stops { low, high, stiffness, damping: lost };
        let torque = if is_loaded { torque(rng, inertia) } else { DeviceTorque::default() };
        let rig = DeviceSpec {
            delay,
            lag,
            damping,
            friction,
            torque,
            stops: Some(stops),
            ..DeviceSpec::new(PERIOD, inertia)
        };
        let mut torques = vec![0.0];
        while torques.len() < samples {
            let level = LARGEST * inertia * (2.0 * rng.f64() - 1.0);
            torques.extend(std::iter::repeat_n(level, rng.usize(5..150)));
        }
        torques.truncate(samples);
        let path = motion(&rig, &torques);
        let entries =
            |is_in: &dyn Fn(f64) -> bool| path.windows(2).filter(|pair| !is_in(pair[0]) && is_in(pair[1])).count();
        let touches = [low.map(|low| entries(&|z| z < low)), high.map(|high| entries(&|z| z > high))];
        if touches.iter().flatten().all(|touches| *touches > 0) {
            return Trial { rig, stops, torques, touches: touches.iter().flatten().sum() };
        }
    }
}

/// Random torques of the position, of a tenth to two fifths of the largest command.
fn torque(rng: &mut Rng, inertia: f64) -> DeviceTorque {
    let mut between = |low: f64, high: f64| low * (high / low).powf(rng.f64());
    let largest = LARGEST * inertia;
    let gravity = Gravity { torque: largest * between(0.1, 0.4), phase: between(0.1, TAU) };
    let waveform = Waveform { sine: [1.0, 0.0, 0.0, 0.0], cosine: [0.0; 4] };
    let pitch = TAU / between(12.0, 36.0).floor();
    let cogging = Cogging { torque: largest * between(0.1, 0.4), pitch, phase: pitch * between(0.1, 1.0), waveform };
    let [has_gravity, has_cogging] = [[true, true], [true, false], [false, true]][rng.usize(0..3)];
    DeviceTorque { gravity: Some(gravity).filter(|_| has_gravity), cogging: Some(cogging).filter(|_| has_cogging) }
}

fn outcome(seed: u64, i: u64, is_loaded: bool) -> Result<Outcome> {
    let mut rng = Rng::with_seed(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ i);
    let samples = SAMPLES[i as usize % SAMPLES.len()];
    let Trial { rig, stops, torques, touches } = trial(&mut rng, samples, is_loaded);
    let count = TAU / 20_000.0;
    let counted = |z: f64| {
        // Box and Muller.
        let normal = (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (TAU * rng.f64()).cos();
        (z / count + 0.7 * normal).round() * count
    };
    let seen = motion(&rig, &torques).into_iter().map(counted).collect();
    let record = Record::new((0..samples).map(|k| k as f64 * PERIOD).collect(), seen, torques)?;
    let agrees = against(&record, &claims(&rig), false)?.agrees();
    let covers = match identify(&record, &Known::default()) {
        Err(Error::Residual(_) | Error::Unexplained) => None,
        found => covers(&found?, &rig, stops),
    };
    let has_one = stops.low.is_none() || stops.high.is_none();
    Ok(Outcome {
        is_long: samples > SAMPLES[0],
        has_one,
        is_touched_once: has_one && touches == 1,
        lags: rig.lag > 0.0,
        torque: rig.torque,
        covers,
        agrees,
    })
}

fn covers(found: &Identified, rig: &DeviceSpec, truth: Stops) -> Option<Covers> {
    let term = |is: &dyn Fn(&TermKind) -> bool| found.terms.iter().find(|term| is(&term.kind)).map(|term| term.size);
    let [low, high, stiffness, damping] = found.stops?.named().map(|(_, interval)| interval);
    // Else it is the delay with the lag.
    let is_apart = rig.lag == 0.0 || found.lag.is_some_and(|lag| lag.low > 0.0);
    let pairs = [
        (found.inertia, Some(rig.inertia)),
        (found.damping, Some(rig.damping)),
        (found.friction, Some(rig.friction)),
        (found.delay.filter(|_| is_apart), Some(rig.delay)),
        (found.lag, Some(rig.lag)),
        (found.late, Some(rig.delay + rig.lag)),
        (low, truth.low),
        (high, truth.high),
        (stiffness, Some(truth.stiffness)),
        (damping, Some(truth.damping)),
        (term(&|kind| matches!(kind, TermKind::Turn { times: 1, .. })), rig.torque.gravity.map(|x| x.torque)),
        (term(&|kind| matches!(kind, TermKind::Turn { times: 2.., .. })), rig.torque.cogging.map(|x| x.torque)),
    ];
    // A stop that the device does not have counts as wrong.
    Some(pairs.map(|(interval, truth)| {
        Some(truth.is_some_and(|truth| interval.is_some_and(|x| x.covers(truth)))).filter(|_| interval.is_some())
    }))
}

/// The claims of a file of this device.
pub fn claims(rig: &DeviceSpec) -> Claims {
    let exact = |x: f64| [x, x];
    Claims {
        inertia: exact(rig.inertia),
        damping: exact(rig.damping),
        friction: exact(rig.friction),
        lean: 0.0,
        lag: exact(rig.lag),
        delay: exact(rig.delay),
        period: rig.period,
        handle: None,
        stribeck: None,
        stops: rig.stops,
        torque: rig.torque,
        friction_by_position: rig.friction_by_position,
    }
}

/// Which devices a column of the table is of.
type Column = (&'static str, fn(&Outcome) -> bool);
const COLUMNS: [Column; 5] = [
    ("all", |_| true),
    ("records of 10 s", |x| x.is_long),
    ("one stop", |x| x.has_one),
    ("touched once", |x| x.is_touched_once),
    ("with a lag", |x| x.lags),
];

const LOADS: [Column; 4] = [
    ("all", |_| true),
    ("gravity", |x| x.torque.cogging.is_none()),
    ("cogging", |x| x.torque.gravity.is_none()),
    ("both", |x| x.torque.cogging.is_some() && x.torque.gravity.is_some()),
];

/// Of `n` devices, and of fewer with torques of the position.
pub fn campaign(n: u64, seed: u64) -> Result<String> {
    let of = |is_loaded: bool, n: u64| {
        let of = |i| outcome(seed, i, is_loaded).with_context(|| format!("stops: device {i} of seed {seed}"));
        (0..n).into_par_iter().map(of).collect::<Result<Vec<Outcome>>>()
    };
    let plain = table(&of(false, n)?, &COLUMNS);
    let loaded = table(&of(true, n / LOADED)?, &LOADS);
    Ok(format!(
        "{plain}\nDevices of the same kind with gravity, cogging of 12 to 36 periods a turn, or both:\n\n{loaded}"
    ))
}

fn table(outcomes: &[Outcome], columns: &[Column]) -> String {
    let row = |name: &str, is_so: &dyn Fn(&Outcome) -> Option<bool>| {
        let all: Vec<Vec<bool>> =
            columns.iter().map(|(_, is_it)| outcomes.iter().filter(|x| is_it(x)).filter_map(is_so).collect()).collect();
        if all.iter().all(Vec::is_empty) {
            return String::new();
        }
        let of = |answers: &Vec<bool>| match answers.len() {
            0 => " |".to_owned(),
            n => format!(" {} |", share(answers.iter().filter(|is| **is).count(), n)),
        };
        format!("| {name} |{}\n", all.iter().map(of).collect::<String>())
    };
    let heads: String = columns
        .iter()
        .map(|(name, is_it)| format!(" {name}: {} |", outcomes.iter().filter(|x| is_it(x)).count()))
        .collect();
    let mut text = format!("| |{heads}\n|{}\n", " --- |".repeat(columns.len() + 1));
    text += &row("stops are found", &|x| Some(x.covers.is_some()));
    text += &row("nothing in the device's own file is contradicted", &|x| Some(x.agrees));
    for (i, name) in NAMES.into_iter().enumerate() {
        text += &row(&format!("the interval covers {name}"), &|x| x.covers?[i]);
    }
    text
}
