//! Devices between end stops, and records that run into both.

use std::f64::consts::TAU;

use anyhow::{Context, Result};
use fastrand::Rng;
use hapt_identify::{Claims, Error, Identified, Known, Record, against, identify};
use hapt_plant::VirtualDevice;
use hapt_plant::spec::{DeviceSpec, Stops};
use rayon::prelude::*;

use super::share;

/// What is found with an interval.
const NAMES: [&str; 8] =
    ["inertia", "damping", "friction", "delay", "the low stop", "the high stop", "their stiffness", "their damping"];
const PERIOD: f64 = 1e-3;
/// Samples of a record: every fourth device has the long one, with hundreds of impacts.
const SAMPLES: [usize; 4] = [3000, 3000, 3000, 10_000];

/// What became of one device.
struct Outcome {
    is_long: bool,
    /// Whether the intervals cover the truth; `None`: no stops were found, or the number is not told.
    covers: Option<[Option<bool>; 8]>,
    /// Whether the record contradicts nothing of its own device's file.
    agrees: bool,
}

fn outcome(seed: u64, i: u64) -> Result<Outcome> {
    let mut rng = Rng::with_seed(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ i);
    let samples = SAMPLES[i as usize % SAMPLES.len()];
    let mut between = |low: f64, high: f64| low * (high / low).powf(rng.f64());
    let inertia = between(3e-4, 2e-3);
    let (damping, friction, delay) = (inertia * between(1.0, 8.0), between(2e-3, 8e-3), between(0.1e-3, 4e-3));
    let stiffness = inertia * between(80.0, 400.0).powi(2);
    let lost = 2.0 * between(0.05, 0.8) * (stiffness * inertia).sqrt();
    let stops = Stops { low: Some(-between(0.2, 1.0)), high: Some(between(0.2, 1.0)), stiffness, damping: lost };
    let rig = DeviceSpec { delay, damping, friction, stops: Some(stops), ..DeviceSpec::new(PERIOD, inertia) };
    let mut torques = vec![0.0];
    while torques.len() < samples {
        let level = 100.0 * inertia * (2.0 * rng.f64() - 1.0);
        torques.extend(std::iter::repeat_n(level, rng.usize(5..150)));
    }
    torques.truncate(samples);
    let count = TAU / 20_000.0;
    let mut device = VirtualDevice::new(&rig);
    let mut seen = Vec::new();
    for torque in &torques {
        // Box and Muller.
        let normal = (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (TAU * rng.f64()).cos();
        seen.push((device.puck().0 / count + 0.7 * normal).round() * count);
        device.command(*torque);
        device.travel();
    }
    let record = Record::new((0..samples).map(|k| k as f64 * PERIOD).collect(), seen, torques)?;
    let agrees = against(&record, &claims(&rig), false)?.agrees();
    let covers = match identify(&record, &Known::default()) {
        Err(Error::Residual(_) | Error::Unexplained) => None,
        found => covers(&found?, &rig, stops),
    };
    Ok(Outcome { is_long: samples > SAMPLES[0], covers, agrees })
}

fn covers(found: &Identified, rig: &DeviceSpec, truth: Stops) -> Option<[Option<bool>; 8]> {
    let [low, high, stiffness, damping] = found.stops?.named().map(|(_, interval)| interval);
    let pairs = [
        (found.inertia, Some(rig.inertia)),
        (found.damping, Some(rig.damping)),
        (found.friction, Some(rig.friction)),
        (found.delay, Some(rig.delay)),
        (low, truth.low),
        (high, truth.high),
        (stiffness, Some(truth.stiffness)),
        (damping, Some(truth.damping)),
    ];
    Some(pairs.map(|(interval, truth)| Some(interval?.covers(truth?))))
}

/// What a file of this device says of it.
fn claims(rig: &DeviceSpec) -> Claims {
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
    }
}

/// Of `n` devices.
pub fn campaign(n: u64, seed: u64) -> Result<String> {
    let of = |i| outcome(seed, i).with_context(|| format!("stops: device {i} of seed {seed}"));
    let outcomes = (0..n).into_par_iter().map(of).collect::<Result<Vec<Outcome>>>()?;
    let mut text = "| found | intervals that cover the truth | of records of 3 s | of records of 10 s |\n\
         | --- | --- | --- | --- |\n"
        .to_string();
    for (i, name) in NAMES.into_iter().enumerate() {
        let of = |is_it: &dyn Fn(&Outcome) -> bool| {
            let told = outcomes.iter().filter(|x| is_it(x)).filter_map(|x| x.covers?[i]);
            let told: Vec<bool> = told.collect();
            share(told.iter().filter(|covers| **covers).count(), told.len())
        };
        text += &format!("| {name} | {} | {} | {} |\n", of(&|_| true), of(&|x| !x.is_long), of(&|x| x.is_long));
    }
    let found = outcomes.iter().filter(|outcome| outcome.covers.is_some()).count();
    let agree = outcomes.iter().filter(|outcome| outcome.agrees).count();
    text += &format!(
        "\nStops are found in {found} of {n}. The record contradicts nothing of its own device's file in {agree} of {n}.\n"
    );
    Ok(text)
}
