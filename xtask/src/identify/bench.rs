//! Random devices, an experiment on each, and the least that any unbiased estimate of it can vary by.

use std::f64::consts::TAU;

use anyhow::{Context, Result};
use fastrand::Rng;
use hapt_plant::VirtualDevice;
use hapt_plant::spec::Rig;

/// How long an experiment takes, s.
const DURATION: f64 = 4.0;
/// Nothing is asked for at first, s.
const REST: f64 = 0.1;

/// A device, what is asked of its motor, and the noise on its positions.
#[derive(Clone, Debug)]
pub struct Trial {
    rig: Rig,
    /// 1 or -1.
    pub sign: f64,
    /// A revolution.
    pub counts: f64,
    /// Before they are counted, rms, in counts.
    noise: f64,
    /// The largest command.
    amplitude: f64,
    seed: u64,
}

impl Trial {
    pub fn new(seed: u64, i: u64) -> Self {
        let seed = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ i;
        let mut rng = Rng::with_seed(seed);
        let mut between = |low: f64, high: f64| low + (high - low) * rng.f64();
        let inertia = 1e-4 * 10f64.powf(between(0.0, 2.0));
        let period = 1e-3 * 2f64.powf(between(-1.0, 1.0));
        let delay = period * between(0.01, 5.0);
        let damping = inertia / (0.1 * 50f64.powf(between(0.0, 1.0)));
        let amplitude = inertia * 100.0 * 10f64.powf(between(0.0, 1.0));
        let friction = amplitude * between(0.02, 0.4);
        let counts = (500.0 * 40f64.powf(between(0.0, 1.0))).round();
        let noise = between(0.5, 2.0);
        let sign = if rng.bool() { 1.0 } else { -1.0 };
        Trial { rig: Rig { period, delay, inertia, damping, friction }, sign, counts, noise, amplitude, seed }
    }

    fn samples(&self) -> usize {
        (DURATION / self.rig.period) as usize
    }

    pub fn times(&self) -> Vec<f64> {
        (0..self.samples()).map(|k| k as f64 * self.rig.period).collect()
    }

    /// Inertia, damping, friction, delay.
    pub fn truth(&self) -> [f64; 4] {
        [self.rig.inertia, self.rig.damping, self.rig.friction, self.rig.delay]
    }

    /// Steps of random size and length in the first half, a chirp from 1 to 20 Hz in the second.
    pub fn commands(&self) -> Vec<f64> {
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

    /// The true positions.
    fn positions(&self, rig: &Rig) -> Vec<f64> {
        let mut device = VirtualDevice::new(rig);
        let commands = self.commands().into_iter();
        let step = |command: f64| {
            let position = device.puck().0;
            device.command(self.sign * command);
            device.travel();
            position
        };
        commands.map(step).collect()
    }

    /// What the encoder says.
    pub fn seen(&self) -> Vec<f64> {
        let mut rng = Rng::with_seed(self.seed.rotate_left(32));
        let count = TAU / self.counts;
        // Box and Muller.
        let mut noise = || (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (TAU * rng.f64()).cos();
        let seen = |z: f64| (z / count + self.noise * noise()).round() * count;
        self.positions(&self.rig).into_iter().map(seen).collect()
    }

    /// The Cramér-Rao bound on the standard errors of inertia, damping, friction and delay: for this noise before it is counted (counting
    /// only takes from what can be known) and a first position that is not known. The slopes are differences of the device's motion.
    pub fn bound(&self) -> Result<[f64; 4]> {
        let sizes = [self.rig.inertia, self.rig.damping, self.rig.friction, self.rig.period].map(|size| 1e-5 * size);
        let slope = |i: usize| -> Vec<f64> {
            let changed = |by: f64| {
                let mut rig = self.rig;
                *[&mut rig.inertia, &mut rig.damping, &mut rig.friction, &mut rig.delay][i] += by * sizes[i];
                self.positions(&rig)
            };
            changed(1.0).iter().zip(&changed(-1.0)).map(|(up, down)| (up - down) / (2.0 * sizes[i])).collect()
        };
        let mut rows: Vec<Vec<f64>> = (0..4).map(slope).collect();
        rows.push(vec![1.0; self.samples()]);
        let sigma = self.noise * TAU / self.counts;
        // Gram and Schmidt: what of a row no other row explains is what is known of its parameter.
        let mut bound = [0.0; 4];
        for (i, bound) in bound.iter_mut().enumerate() {
            let mut others: Vec<Vec<f64>> = Vec::new();
            let order = (0..5).filter(|j| *j != i).chain([i]);
            for j in order {
                let mut row = rows[j].clone();
                for _ in 0..2 {
                    for other in &others {
                        let along: f64 = other.iter().zip(&row).map(|(x, y)| x * y).sum();
                        row.iter_mut().zip(other).for_each(|(y, x)| *y -= along * x);
                    }
                }
                let size = row.iter().map(|x| x * x).sum::<f64>().sqrt();
                *bound = sigma / size;
                row.iter_mut().for_each(|x| *x /= size);
                others.push(row);
            }
        }
        bound.iter().all(|bound| bound.is_finite()).then_some(bound).context("a parameter without a trace")
    }
}
