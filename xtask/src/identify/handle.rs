//! Devices whose handle is on a flexible shaft, with motors that lag; the samples of every second one are uneven.

use std::f64::consts::TAU;

use anyhow::{Context, Result};
use fastrand::Rng;
use hapt_identify::{Error, Interval, Record, WithHandle, identify_handle};
use hapt_plant::VirtualDevice;
use hapt_plant::spec::{DeviceSpec, Handle};
use rayon::prelude::*;

use super::share;

/// The parameters with an interval.
const NAMES: [&str; 9] = [
    "inertia",
    "damping",
    "friction",
    "delay",
    "lag",
    "delay and lag",
    "handle's inertia",
    "shaft's stiffness",
    "shaft's damping",
];
/// Samples of a record.
const SAMPLES: usize = 1500;
/// Samples without a command at the start.
const REST: usize = 60;
/// Sample times are whole multiples of this part of a period.
const PART: u64 = 20;

/// Why a record has no result.
#[derive(Clone, Copy, PartialEq)]
enum Refused {
    /// No device was found that explains it.
    Unexplained,
    /// A device without a handle explains it as well.
    Rigid,
}

/// The result of one device.
pub struct Outcome {
    device: u64,
    is_uneven: bool,
    /// Whether the interval covers the truth, or why there is none.
    covers: Result<[bool; 9], Refused>,
    /// The lag is distinguished from a delay.
    apart: bool,
}

struct Trial {
    rig: DeviceSpec,
    /// Of each sample, in parts of a period.
    times: Vec<u64>,
    torques: Vec<f64>,
    count: f64,
    /// In counts.
    noise: f64,
    rng: Rng,
}

impl Trial {
    fn new(seed: u64, i: u64) -> Self {
        let mut rng = Rng::with_seed(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ i);
        let mut between = |low: f64, high: f64| low + (high - low) * rng.f64();
        let (inertia, handle) = (between(3e-4, 1e-3), between(2e-4, 1e-3));
        let (omega, mass) = (TAU * between(20.0, 60.0), inertia * handle / (inertia + handle));
        let shaft =
            Handle { inertia: handle, stiffness: mass * omega * omega, damping: mass * omega * between(0.01, 0.06) };
        let friction = between(0.0, 3e-3);
        let rig = DeviceSpec {
            delay: between(0.0, 3e-3),
            lag: 1e-4 * 50f64.powf(between(0.0, 1.0)),
            damping: between(2e-3, 6e-3),
            friction: if i % 4 < 2 { friction } else { 0.0 },
            handle: Some(shaft),
            ..DeviceSpec::new(1e-3, inertia)
        };
        let (count, noise) = (TAU / (4000.0 * 10f64.powf(between(0.0, 1.0))).round(), between(0.5, 2.0));
        let mut now = 0;
        let time = |_| {
            now += if i % 2 == 1 { rng.u64(2 * PART / 5..=8 * PART / 5) } else { PART };
            now
        };
        let times = (0..SAMPLES).map(time).collect();
        let mut torques = vec![0.0; REST];
        while torques.len() < SAMPLES {
            let torque = 0.12 * (rng.f64() - 0.5);
            torques.extend(std::iter::repeat_n(torque, rng.usize(10..120)));
        }
        torques.truncate(SAMPLES);
        Trial { rig, times, torques, count, noise, rng }
    }

    /// The simulated device's, under torques that are held from sample to sample.
    fn record(&mut self) -> Result<Record> {
        let part = self.rig.period / PART as f64;
        let mut device = VirtualDevice::new(&DeviceSpec { period: part, ..self.rig });
        let mut positions = Vec::new();
        for (i, torque) in self.torques.iter().enumerate() {
            // Box and Muller.
            let normal = (-2.0 * (1.0 - self.rng.f64()).ln()).sqrt() * (TAU * self.rng.f64()).cos();
            positions.push((device.puck().0 / self.count + self.noise * normal).round() * self.count);
            for _ in self.times[i]..self.times.get(i + 1).copied().unwrap_or(self.times[i]) {
                device.command(*torque);
                device.travel();
            }
        }
        let times = self.times.iter().map(|k| *k as f64 * part).collect();
        Ok(Record::new(times, positions, self.torques.clone())?)
    }

    /// Whether each interval covers the truth; with a lag that is not distinguished, the delay is the sum of both.
    fn covers(&self, found: &WithHandle) -> Result<[bool; 9]> {
        let DeviceSpec { inertia, damping, friction, delay, lag, handle, .. } = self.rig;
        let handle = handle.context("no handle")?;
        let early = if found.lag.low > 0.0 { delay } else { delay + lag };
        let pairs: [(Interval, f64); 9] = [
            (found.inertia, inertia),
            (found.damping, damping),
            (found.friction, friction),
            (found.delay, early),
            (found.lag, lag),
            (found.late, delay + lag),
            (found.handle_inertia, handle.inertia),
            (found.stiffness, handle.stiffness),
            (found.shaft_damping, handle.damping),
        ];
        Ok(pairs.map(|(interval, truth)| interval.covers(truth)))
    }
}

fn outcome(seed: u64, i: u64) -> Result<Outcome> {
    let mut trial = Trial::new(seed, i);
    let is_uneven = i % 2 == 1;
    let refused = |why| Outcome { device: i, is_uneven, covers: Err(why), apart: false };
    match identify_handle(&trial.record()?) {
        Ok(found) => {
            Ok(Outcome { device: i, is_uneven, covers: Ok(trial.covers(&found)?), apart: found.lag.low > 0.0 })
        }
        Err(Error::Residual(_) | Error::Unexplained) => Ok(refused(Refused::Unexplained)),
        Err(Error::Rigid) => Ok(refused(Refused::Rigid)),
        Err(error) => Err(error.into()),
    }
}

/// Of `n` devices.
pub fn campaign(n: u64, seed: u64) -> Result<Vec<Outcome>> {
    let of = |i| outcome(seed, i).with_context(|| format!("handle: device {i} of seed {seed}"));
    (0..n).into_par_iter().map(of).collect()
}

pub fn table(outcomes: &[Outcome]) -> String {
    let mut text = "| found | intervals that cover the truth | of even samples | of uneven ones |\n\
         | --- | --- | --- | --- |\n"
        .to_string();
    for (i, name) in NAMES.into_iter().enumerate() {
        let of = |is_it: &dyn Fn(&Outcome) -> bool| {
            let covers = outcomes.iter().filter(|x| is_it(x)).filter_map(|x| Some(x.covers.ok()?[i]));
            let covers: Vec<bool> = covers.collect();
            share(covers.iter().filter(|covers| **covers).count(), covers.len())
        };
        text += &format!("| {name} | {} | {} | {} |\n", of(&|_| true), of(&|x| !x.is_uneven), of(&|x| x.is_uneven));
    }
    let found = outcomes.iter().filter(|outcome| outcome.covers.is_ok()).count();
    let apart = outcomes.iter().filter(|outcome| outcome.apart).count();
    text += &format!("\nA lag is distinguished from a delay in {}.", share(apart, found));
    let sentences = [
        (Refused::Unexplained, "No device was found that explains the record"),
        (Refused::Rigid, "A device without a handle explains the record as well"),
    ];
    for (why, sentence) in sentences {
        let these = outcomes.iter().filter(|outcome| outcome.covers == Err(why));
        let these: Vec<String> = these.map(|outcome| outcome.device.to_string()).collect();
        let named = if these.is_empty() { String::new() } else { format!(" (device {})", these.join(", ")) };
        text += &format!(" {sentence} in {} of {}{named}.", these.len(), outcomes.len());
    }
    text + "\n"
}
