//! Intervals on devices that are richer than the model: by jackknife, sandwich and bootstrap, against the truth and against each other.
//!
//! The levers have a cable, gravity, cogging, friction by direction and Stribeck friction of random sizes, are driven in open loop or in a
//! loop that holds them to a moving target, and are integrated in small steps of their own equation.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use anyhow::{Context, Result};
use fastrand::Rng;
use hapt_identify::{Errors, Interval, Known, Record, fit_torque_by};
use rayon::prelude::*;

/// In s.
const PERIOD: f64 = 5e-4;
/// The length of each of a lever's two recorded stretches, in s, which are compared with each other.
const STRETCH: f64 = 2.0;
/// Steps of the lever's equation in a period.
const STEPS: usize = 20;
const COUNTS: f64 = 40_000.0;
const METHODS: [(Errors, &str); 4] = [
    (Errors::Larger, "the larger one of jackknife and least squares (hapt's)"),
    (Errors::Jackknife, "jackknife, eight blocks"),
    (Errors::Sandwich, "sandwich"),
    (Errors::Bootstrap, "bootstrap of blocks"),
];

struct Lever {
    inertia: f64,
    damping: f64,
    /// Toward larger positions, and toward smaller ones.
    friction: [f64; 2],
    stribeck: f64,
    cable: f64,
    gravity: f64,
    cogging: f64,
    /// Of a spring to a moving target; 0: the torque steps at random.
    loop_stiffness: f64,
    seed: u64,
}

impl Lever {
    /// `more` scales a lever's torques other than inertia, damping and friction.
    fn new(seed: u64, more: f64) -> Self {
        let mut rng = Rng::with_seed(seed);
        let mut between = |low: f64, high: f64| low + (high - low) * rng.f64();
        Lever {
            inertia: 1e-3 * between(0.5, 3.0),
            damping: 1e-3 * between(1.0, 8.0),
            friction: [between(0.01, 0.03), between(0.01, 0.03)],
            stribeck: between(0.0, 0.01),
            cable: more * between(0.0, 0.1),
            gravity: more * between(0.0, 0.02),
            cogging: more * between(0.0, 6e-3),
            loop_stiffness: if between(0.0, 1.0) < 0.5 { 0.0 } else { between(0.5, 2.0) },
            seed,
        }
    }

    /// Both stretches.
    fn records(&self) -> Result<[Record; 2]> {
        let mut rng = Rng::with_seed(!self.seed);
        let samples = (2.0 * STRETCH / PERIOD) as usize;
        let (mut z, mut v, mut before) = (0.1, 0.0, 0.1);
        let (mut level, mut left) = (0.0, 0);
        let (mut positions, mut torques) = (Vec::new(), Vec::new());
        let count = TAU / COUNTS;
        for _ in 0..samples {
            if left == 0 {
                left = rng.usize(20..400);
                level = 2.0 * rng.f64() - 1.0;
            }
            left -= 1;
            // Box and Muller.
            let noise = (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (TAU * rng.f64()).cos();
            let seen = (z / count + 0.7 * noise).round() * count;
            let torque: f64 = match self.loop_stiffness {
                0.0 => 0.1 * level,
                k => k * (0.6 * level - seen) - 0.02 * k * (z - before) / PERIOD,
            };
            let torque = torque.clamp(-0.25, 0.25);
            before = z;
            positions.push(seen);
            torques.push(torque);
            let h = PERIOD / STEPS as f64;
            for _ in 0..STEPS {
                let own = torque - self.cable * z - self.gravity * (z + 0.4).sin() - self.cogging * (21.0 * z).sin();
                let fall = self.stribeck * (-(v / 0.4_f64).powi(2)).exp();
                let holds = self.friction[usize::from(if v == 0.0 { own < 0.0 } else { v < 0.0 })] + fall;
                let next =
                    v + h * (own - self.damping * v - holds * if v == 0.0 { own } else { v }.signum()) / self.inertia;
                // Friction stops a slide, and does not turn it round.
                v = if v == 0.0 && own.abs() <= holds || v * next < 0.0 { 0.0 } else { next };
                z += h * v;
            }
        }
        let half = samples / 2;
        let record = |from: usize| {
            let times = (0..half).map(|k| k as f64 * PERIOD).collect();
            Record::new(times, positions[from..from + half].to_vec(), torques[from..from + half].to_vec())
        };
        Ok([record(0).context("the first stretch")?, record(half).context("the second stretch")?])
    }
}

/// The intervals of one method for the two stretches of a lever.
type Pair = [Option<Interval>; 2];

/// The scales of these torques for the groups of levers.
const MORE: [f64; 2] = [1.0, 5.0];

pub fn campaign(n: u64, seed: u64) -> Result<String> {
    let tables: Vec<String> = MORE.iter().map(|more| table(n, seed, *more)).collect::<Result<_>>()?;
    Ok(format!("{}\nCable, gravity and cogging of {} times that size:\n\n{}", tables[0], MORE[1], tables[1]))
}

fn table(n: u64, seed: u64, more: f64) -> Result<String> {
    let of = |i: u64| -> Result<(f64, [Pair; 4])> {
        let lever = Lever::new(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ i, more);
        let Ok(records) = lever.records() else { return Ok((lever.inertia, [[None; 2]; 4])) };
        let inertia_by = |errors: Errors, record: &Record| {
            fit_torque_by(record, &Known::default(), errors).and_then(|fit| fit.inertia)
        };
        Ok((lever.inertia, METHODS.map(|(errors, _)| [0, 1].map(|i| inertia_by(errors, &records[i])))))
    };
    let all: Vec<(f64, [Pair; 4])> = (0..n).into_par_iter().map(of).collect::<Result<_>>()?;
    let mut text = String::from(
        "| standard errors by | with an inertia | hold the true one | pairs of stretches that overlap | width over the value, median |\n\
         | --- | --- | --- | --- | --- |\n",
    );
    for (k, (_, name)) in METHODS.iter().enumerate() {
        let intervals = all.iter().flat_map(|(truth, methods)| methods[k].iter().flatten().map(move |x| (*truth, *x)));
        let intervals: Vec<(f64, Interval)> = intervals.collect();
        let hold = intervals.iter().filter(|(truth, x)| x.covers(*truth)).count();
        let pairs: Vec<(Interval, Interval)> =
            all.iter().filter_map(|(_, methods)| methods[k][0].zip(methods[k][1])).collect();
        let overlap = pairs.iter().filter(|(a, b)| a.low <= b.high && b.low <= a.high).count();
        let mut widths: Vec<f64> = intervals.iter().map(|(_, x)| (x.high - x.low) / x.value).collect();
        widths.sort_by(f64::total_cmp);
        let percent = |part: usize, of: usize| format!("{:.1} %", 100.0 * part as f64 / of.max(1) as f64);
        writeln!(
            text,
            "| {name} | {} of {} | {} | {} of {} | {:.3} |",
            intervals.len(),
            2 * all.len(),
            percent(hold, intervals.len()),
            percent(overlap, pairs.len()),
            pairs.len(),
            widths.get(widths.len() / 2).copied().unwrap_or(f64::NAN),
        )?;
    }
    Ok(text)
}
