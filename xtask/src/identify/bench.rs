//! Random devices, an experiment on each, and the least variance of any unbiased estimate of it.

use std::f64::consts::TAU;

use anyhow::{Context, Result};
use fastrand::Rng;
use hapt_identify::Bounds;
use hapt_plant::VirtualDevice;
use hapt_plant::spec::DeviceSpec;

/// How long an experiment takes, s.
const DURATION: f64 = 4.0;
/// The time without a command at the start, s.
const REST: f64 = 0.1;
/// The experiment on a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Random steps and then a chirp.
    Mixed,
    /// The same, with less than half a count of noise.
    Quiet,
    /// As `Mixed`, with a large constant torque in addition.
    Offset,
    /// As `Mixed`, with a torque that depends on the position in addition.
    Cogged,
    /// As `Mixed`, with a motor that lags.
    Lagging,
    /// The experiment that `hapt identify DEVICE` makes, on a device with a constant torque of its own.
    Guided,
}

/// A device, the experiment on its motor, and the noise on its positions. Every second one is linear.
#[derive(Clone, Debug)]
pub struct Trial {
    kind: Kind,
    rig: DeviceSpec,
    pub is_linear: bool,
    /// 1 or -1.
    pub sign: f64,
    /// The size of a count, in rad (m).
    pub count: f64,
    /// A constant torque on the puck.
    pub offset: f64,
    /// The periods in a turn of a torque, and its size; 0: none.
    cogging: (u32, f64),
    /// Before they are counted, rms, in counts.
    noise: f64,
    /// The largest command.
    amplitude: f64,
    seed: u64,
}

impl Trial {
    pub fn new(kind: Kind, seed: u64, i: u64) -> Self {
        let seed = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ i;
        let mut rng = Rng::with_seed(seed);
        let is_linear = i % 2 == 1 && kind != Kind::Cogged;
        let mut between = |low: f64, high: f64| low + (high - low) * rng.f64();
        let inertia = if is_linear { 0.03 } else { 1e-4 } * 10f64.powf(between(0.0, 2.0));
        let period = 1e-3 * 2f64.powf(between(-1.0, 1.0));
        let delay = period * between(0.01, 5.0);
        let damping = inertia / (0.1 * 50f64.powf(between(0.0, 1.0)));
        let amplitude = inertia * if is_linear { 2.0 } else { 100.0 } * 10f64.powf(between(0.0, 1.0));
        let friction = amplitude * between(0.02, 0.4);
        let fineness = 40f64.powf(between(0.0, 1.0));
        let count = if is_linear { 100e-6 / fineness } else { TAU / (500.0 * fineness).round() };
        let noise = if kind == Kind::Quiet { between(0.0, 0.5) } else { between(0.5, 2.0) };
        let offset = match kind {
            Kind::Guided => friction * between(-0.8, 0.8),
            Kind::Offset => amplitude * between(-0.6, 0.6),
            Kind::Mixed | Kind::Quiet | Kind::Cogged | Kind::Lagging => 0.0,
        };
        let cogging = match kind {
            Kind::Cogged => {
                (40f64.powf(between(0.0, 1.0)).round() as u32, friction * 0.02 * 25f64.powf(between(0.0, 1.0)))
            }
            Kind::Mixed | Kind::Quiet | Kind::Guided | Kind::Offset | Kind::Lagging => (0, 0.0),
        };
        let lag = if kind == Kind::Lagging { period * 0.1 * 50f64.powf(between(0.0, 1.0)) } else { 0.0 };
        let sign = if rng.bool() { 1.0 } else { -1.0 };
        let rig = DeviceSpec { delay, lag, damping, friction, ..DeviceSpec::new(period, inertia) };
        Trial { kind, rig, is_linear, sign, count, offset, cogging, noise, amplitude, seed }
    }

    fn samples(&self) -> usize {
        (DURATION / self.rig.period) as usize
    }

    pub fn times(&self) -> Vec<f64> {
        (0..self.samples()).map(|k| k as f64 * self.rig.period).collect()
    }

    /// Inertia, damping, friction, delay, constant torque, lag, delay and lag together.
    pub fn truth(&self) -> [f64; 7] {
        let DeviceSpec { inertia, damping, friction, delay, lag, .. } = self.rig;
        [inertia, damping, friction, delay, self.offset, lag, delay + lag]
    }

    /// The periods in a turn of a torque that depends on the position, where there is one.
    pub fn comes(&self) -> Option<u32> {
        (self.kind == Kind::Cogged).then_some(self.cogging.0)
    }

    pub fn commands(&self) -> Vec<f64> {
        if self.kind == Kind::Guided { self.guided() } else { self.mixed() }
    }

    /// Steps of random size and length in the first half, a chirp from 1 to 20 Hz in the second.
    fn mixed(&self) -> Vec<f64> {
        let mut rng = Rng::with_seed(!self.seed);
        let (mut level, mut until) = (0.0, REST);
        let half = 0.5 * DURATION;
        let command = |t: f64| {
            if t >= half {
                let s = t - half;
                return self.amplitude * (TAU * (s + 19.0 / (2.0 * half) * s * s)).sin();
            }
            while t >= until {
                until += 0.01 * 20f64.powf(rng.f64());
                level = self.amplitude * (rng.f64() * 2.0 - 1.0).signum() * (1.0 - 0.5 * rng.f64());
            }
            level
        };
        self.times().into_iter().map(command).collect()
    }

    /// Steps and a chirp as hapt makes them, each fading over to the next. The inertia in the world's file is half the true one, or up to
    /// twice as much.
    fn guided(&self) -> Vec<f64> {
        let inertia = self.rig.inertia * 2f64.powf(2.0 * Rng::with_seed(!self.seed).f64() - 1.0);
        let bounds = Bounds::new(self.amplitude, inertia, self.rig.period, self.is_linear);
        let mut pushes = bounds.pushes(DURATION - REST).into_iter();
        let (mut torque, mut output, mut part, mut until) = (0.0, 0.0, 0.0, REST);
        let command = |t: f64| {
            if t >= until {
                let push = pushes.next();
                torque = push.map_or(0.0, |push| push.torque);
                until += push.map_or(DURATION, |push| push.length);
                part = f64::abs(torque - output) / (bounds.fade / self.rig.period).ceil();
            }
            output += (torque - output).clamp(-part, part);
            output
        };
        self.times().into_iter().map(command).collect()
    }

    /// The true positions.
    pub fn positions(&self, commands: &[f64]) -> Vec<f64> {
        self.of(&self.rig, self.offset, commands)
    }

    /// Those of a slightly different device.
    fn of(&self, rig: &DeviceSpec, offset: f64, commands: &[f64]) -> Vec<f64> {
        let mut device = VirtualDevice::new(rig);
        let step = |command: &f64| {
            let position = device.puck().0;
            let cogging = self.cogging.1 * (f64::from(self.cogging.0) * position).sin();
            device.command(self.sign * command + offset + cogging);
            device.travel();
            position
        };
        commands.iter().map(step).collect()
    }

    /// The reading of the encoder.
    pub fn seen(&self, positions: &[f64]) -> Vec<f64> {
        let mut rng = Rng::with_seed(self.seed.rotate_left(32));
        // Box and Muller.
        let mut noise = || (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (TAU * rng.f64()).cos();
        let seen = |z: &f64| (z / self.count + self.noise * noise()).round() * self.count;
        positions.iter().map(seen).collect()
    }

    /// The Cramér-Rao bound on the standard errors of inertia, damping, friction, delay and, where that is not known to be 0, the constant
    /// torque: for this noise before quantisation (which only removes information) and an unknown first position. The slopes are
    /// differences of the device's motion.
    pub fn bound(&self, commands: &[f64], positions: &[f64], with_offset: bool) -> Result<Vec<f64>> {
        let mut sizes = [self.rig.inertia, self.rig.damping, self.rig.friction, self.rig.period, self.rig.friction];
        sizes = sizes.map(|size| 1e-5 * size);
        let slope = |i: usize| -> Vec<f64> {
            let (mut rig, mut offset) = (self.rig, self.offset);
            let places = [&mut rig.inertia, &mut rig.damping, &mut rig.friction, &mut rig.delay, &mut offset];
            *places.into_iter().nth(i).unwrap_or(&mut 0.0) += sizes[i];
            self.of(&rig, offset, commands).iter().zip(positions).map(|(to, from)| (to - from) / sizes[i]).collect()
        };
        let mut rows: Vec<Vec<f64>> = (0..if with_offset { 5 } else { 4 }).map(slope).collect();
        rows.push(vec![1.0; self.samples()]);
        let sigma = self.noise * self.count;
        // Gram and Schmidt: the part of a row that no other row explains is the information on its parameter.
        let of = |i: usize| {
            let mut others: Vec<Vec<f64>> = Vec::new();
            let mut left = 0.0;
            for j in (0..rows.len()).filter(|j| *j != i).chain([i]) {
                let mut row = rows[j].clone();
                for _ in 0..2 {
                    for other in &others {
                        let along: f64 = other.iter().zip(&row).map(|(x, y)| x * y).sum();
                        row.iter_mut().zip(other).for_each(|(y, x)| *y -= along * x);
                    }
                }
                left = row.iter().map(|x| x * x).sum::<f64>().sqrt();
                row.iter_mut().for_each(|x| *x /= left);
                others.push(row);
            }
            sigma / left
        };
        let bound: Vec<f64> = (0..rows.len() - 1).map(of).collect();
        bound.iter().all(|bound| bound.is_finite()).then_some(bound).context("a parameter without a trace")
    }
}
