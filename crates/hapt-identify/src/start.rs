//! The starting values of the fit: linear regression by modulating functions (Shinbrot 1957).
//!
//! With a bump w(t) that vanishes with its slope at both ends of a window, z̈ = α τ - β ż - γ s becomes
//!
//! ```text
//! ∫ ẅ z = α ∫ w τ + β ∫ ẇ z - γ ∫ w s
//! ```
//!
//! in which no measured position is differentiated except for the sign s of the velocity. Each window gives one row, for each delay on a
//! grid; the delay with the least squares is taken.

use rayon::prelude::*;

use crate::factor::{Factor, Rows};
use crate::puck::{DAMPING, FRICTION, GAIN, OFFSET, PARAMETERS, Puck};
use crate::record::{CancellableRecord, LONGEST_DELAY, Record};

/// Lengths of the windows, s: each gives a start.
const WINDOWS: [f64; 3] = [0.05, 0.15, 0.5];
/// The velocity is estimated over this time, s.
const GLANCE: f64 = 6e-3;
/// A velocity below this many standard errors may be 0.
const DOUBT: f64 = 3.0;
/// The other sign of the torque is a start where it leaves less than this many times the squares.
const RIVAL: f64 = 4.0;

/// The signs of the velocity and the initial state, estimated before any fit.
struct Glance {
    /// From -1 to 1: the sign of the velocity, 0 where the puck may rest.
    sign: Vec<f64>,
    begins: Begin,
}

/// The position of the puck at a sample, and its velocity.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Begin {
    pub position: f64,
    pub velocity: f64,
}

/// Pucks from which a fit may find the best one: for each window the best of all delays, and the one without. On a spring the torque is
/// correlated with the position, a delay looks like damping and inertia together, and a fit that starts at a long one stays there. Also the
/// best with a constant torque: without it, one that nearly overcomes friction looks like other friction, and a fit may stay there too. And the
/// best with the other sign: in a swing the opposite torque half a period later is as good.
pub(crate) fn starts(record: &CancellableRecord<'_>) -> Vec<Puck> {
    let glance = glance(record);
    let duration = record.period() * record.times().len() as f64;
    let mut windows: Vec<f64> = WINDOWS.iter().map(|window| window.min(0.2 * duration)).collect();
    windows.dedup();
    windows.iter().flat_map(|window| of_window(record, &glance, *window)).collect()
}

/// Half the number of samples in a window of this length.
fn half(record: &Record, length: f64) -> usize {
    ((0.5 * length / record.period()).round() as usize).max(2)
}

/// The slope of the straight line through the positions from `low` to `high`, its standard error per unit of noise, and their mean.
fn slope(record: &Record, low: usize, high: usize) -> (f64, f64, f64) {
    let (times, positions) = (&record.times()[low..=high], &record.positions()[low..=high]);
    let n = times.len() as f64;
    let (t, z) = (times.iter().sum::<f64>() / n, positions.iter().sum::<f64>() / n);
    let tt: f64 = times.iter().map(|at| (at - t).powi(2)).sum();
    let tz: f64 = times.iter().zip(positions).map(|(at, x)| (at - t) * (x - z)).sum();
    (tz / tt, tt.sqrt().recip(), z)
}

fn glance(record: &Record) -> Glance {
    let n = record.positions().len();
    let (noise, half) = (record.noise(), half(record, GLANCE));
    let sign = (0..n).map(|i| {
        let (v, error, _) = slope(record, i.saturating_sub(half), (i + half).min(n - 1));
        let doubt = DOUBT * noise * error;
        if v.abs() < doubt {
            v / doubt
        } else if v == 0.0 {
            0.0
        } else {
            v.signum()
        }
    });
    Glance { sign: sign.collect(), begins: begins(record, record.first())[0] }
}

/// The velocity at each sample, by a straight line through the positions around it.
pub(crate) fn velocities(record: &Record) -> Vec<f64> {
    let (n, half) = (record.positions().len(), half(record, GLANCE));
    (0..n).map(|i| slope(record, i.saturating_sub(half), (i + half).min(n - 1)).0).collect()
}

/// Their standard error by the positions' noise, in the middle of the record.
pub(crate) fn noise_of_velocities(record: &Record) -> f64 {
    let (n, half) = (record.positions().len(), half(record, GLANCE));
    record.noise() * slope(record, (n / 2).saturating_sub(half), (n / 2 + half).min(n - 1)).1
}

/// The sign of the velocity at each sample, 0 where the puck may rest.
pub(crate) fn signs(record: &Record) -> Vec<f64> {
    glance(record).sign
}

/// The direction of motion, from -1 to 1: the displacement from beginning to end over the sum of the distances, each over a fiftieth of the
/// record.
pub(crate) fn direction(record: &Record) -> f64 {
    let places: Vec<f64> = record.positions().iter().step_by(record.positions().len().div_ceil(50)).copied().collect();
    let all: f64 = places.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum();
    match places.first().zip(places.last()) {
        Some((first, last)) if all > 0.0 => (last - first) / all,
        Some(_) | None => 0.0,
    }
}

/// The state of the puck at the sample `first`: at rest, where it may be, or else moving; and the moving one in any case.
pub(crate) fn begins(record: &Record, first: usize) -> [Begin; 2] {
    let noise = record.noise();
    let last = (first + 2 * half(record, GLANCE)).min(record.positions().len() - 1);
    let (v, error, z) = slope(record, first, last);
    let ago = 0.5 * (record.times()[last] - record.times()[first]);
    let moving = Begin { position: z - v * ago, velocity: v };
    let is_slow = v.abs() < 2.0 * DOUBT * noise * error;
    [if is_slow { Begin { position: z, velocity: 0.0 } } else { moving }, moving]
}

/// The starts by windows of one length.
fn of_window(record: &CancellableRecord<'_>, glance: &Glance, length: f64) -> Vec<Puck> {
    let is_driven = record.is_driven();
    let step = (0.5 * record.period()).max(1e-3);
    let delays = if is_driven { (LONGEST_DELAY / step) as usize } else { 0 };
    if (record.stop)() {
        return Vec::new();
    }
    let samples = record.record;
    let of_delay = |i: usize| (i as f64 * step, regression(samples, glance, length, i as f64 * step));
    let factors: Vec<(f64, Factor)> = (0..=delays).into_par_iter().map(of_delay).collect();
    let solved = |(delay, factor): &(f64, Factor), offset: bool| {
        let p = factor.step([is_driven, true, true, false, offset, false, false, false], 0.0)?;
        let Begin { position, velocity } = glance.begins;
        let (damping, friction) = (p[DAMPING].max(0.0), p[FRICTION].max(0.0));
        // Friction below 0 is a constant torque in the direction of motion.
        let offset = p[OFFSET] - p[FRICTION].min(0.0) * direction(record);
        let puck = Puck { gain: p[GAIN], damping, friction, delay: *delay, offset, position, velocity, lag: 0.0 };
        // Σ (r - p s)² at the solution.
        Some((factor.left(&p), puck))
    };
    let pucks = |offset: bool| -> Vec<(f64, Puck)> { factors.iter().filter_map(|at| solved(at, offset)).collect() };
    let best = |pucks: &[(f64, Puck)], of: &dyn Fn(&Puck) -> bool| {
        pucks.iter().filter(|(_, puck)| of(puck)).copied().min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let (without, with) = (pucks(false), if is_driven { pucks(true) } else { Vec::new() });
    let soon = best(&without, &|puck| puck.delay == 0.0);
    let late = best(&without, &|puck| puck.delay > 0.0);
    let opposed = late.and_then(|(left, late)| {
        best(&without, &|puck| puck.gain * late.gain < 0.0).filter(|opposed| opposed.0 < RIVAL * left)
    });
    [soon, late, opposed, best(&with, &|_| true)].into_iter().flatten().map(|(_, puck)| puck).collect()
}

/// One row a window.
fn regression(record: &Record, glance: &Glance, length: f64, delay: f64) -> Factor {
    let (times, positions) = (record.times(), record.positions());
    let torques = delayed(record, delay);
    let half = half(record, length);
    let mut rows = Rows::new();
    let mut centre = record.first() + half;
    while centre + half < times.len() {
        let (low, high) = (centre - half, centre + half);
        let c = 0.5 * (times[high] - times[low]);
        let middle = 0.5 * (times[high] + times[low]);
        let (mut row, mut right) = ([0.0; PARAMETERS], 0.0);
        for i in low + 1..high {
            let dt = 0.5 * (times[i + 1] - times[i - 1]);
            let u = (times[i] - middle) / c;
            let q = 1.0 - u * u;
            let (w, w1) = (q * q * q * dt, -6.0 * u * q * q / c * dt);
            let w2 = (24.0 * u * u * q - 6.0 * q * q) / (c * c) * dt;
            let (z, s) = (positions[i] - positions[centre], glance.sign[i]);
            right += w2 * z;
            // At rest friction balances any torque.
            row[GAIN] += w * torques[i] * s.abs();
            row[DAMPING] += w1 * z;
            row[FRICTION] -= w * s;
            row[OFFSET] += w * s.abs();
        }
        rows.add(&row, right);
        centre += (half / 2).max(1);
    }
    rows.factor()
}

/// The mean torque around each sample, from half way to the one before to half way to the next.
pub(crate) fn delayed(record: &Record, delay: f64) -> Vec<f64> {
    let (times, torques) = (record.times(), record.torques());
    // The held torque's integral up to each sample.
    let mut sum = 0.0;
    let mut impulse = vec![0.0];
    impulse.extend(times.windows(2).zip(torques).map(|(pair, torque)| {
        sum += torque * (pair[1] - pair[0]);
        sum
    }));
    let n = times.len();
    let at = |t: f64, from: &mut usize| {
        while *from + 1 < n && times[*from + 1] <= t {
            *from += 1;
        }
        impulse[*from] + torques[*from] * (t - times[*from])
    };
    let (mut low, mut high) = (0, 0);
    let middle = |i: usize| match (times.get(i.wrapping_sub(1)), times.get(i)) {
        (Some(before), Some(now)) => 0.5 * (before + now),
        (None, Some(now)) => now - 0.5 * record.period(),
        _ => times[n - 1] + 0.5 * record.period(),
    };
    (0..n)
        .map(|i| {
            let (from, to) = (middle(i) - delay, middle(i + 1) - delay);
            (at(to, &mut high) - at(from, &mut low)) / (to - from)
        })
        .collect()
}
