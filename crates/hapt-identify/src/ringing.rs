//! The frequencies at which a handle rings in a record: the shafts from which fits start.
//!
//! The motion of a rigid puck, z, is nearly that of the whole. A handle of frequency ω that follows it on a shaft lags behind by q,
//!
//! ```text
//! q̈ + 2 ζ ω q̇ + ω² q = z̈,
//! ```
//!
//! and the motor is ahead of the rigid puck by (J_h / J) q. So for each of many frequencies q is a known signal, and its share of the rigid
//! fit's residuals is found by linear least squares: a matched filter, which detects a shaft far below the noise that hides its line in the
//! spectrum.

use nalgebra::DVector;
use rayon::prelude::*;

use crate::fit::Fit;
use crate::puck::{PARAMETERS, Sensitivity};
use crate::record::CancellableRecord;

/// The number of frequencies that are tried, in equal ratios.
const FREQUENCIES: usize = 240;
/// Frequencies that are tried together, between two looks at whether the search is stopped.
const TOGETHER: usize = 24;
/// The least number of periods of the lowest in the record, and of samples in a period of the highest.
const LOWEST: f64 = 4.0;
const HIGHEST: f64 = 2.5;
/// ζ: between that of steel and of rubber.
const RATIO: f64 = 0.04;
/// Times between samples that differ by less than this part are equal.
const EQUAL: f64 = 1e-9;
/// A column with less than this part orthogonal to the others is rounding.
const ROUNDING: f64 = 1e-6;

/// A possible shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ringing {
    /// Its angular frequency, in rad/s.
    pub omega: f64,
    /// J_h / J.
    pub ratio: f64,
    /// The part of the squares that it explains.
    explains: f64,
}

/// The most likely shafts, the best first: each explains more than the neighbouring frequencies do. Empty where the search is stopped.
pub(crate) fn ringing(watched: &CancellableRecord<'_>, rigid: &Fit) -> Vec<Ringing> {
    let CancellableRecord { record, stop } = *watched;
    let mut motion: Vec<(f64, f64)> = Vec::new();
    let mut rows: Vec<(usize, f64, Sensitivity)> = Vec::new();
    rigid.puck.follow(record.times(), record.torques(), rigid.first, |i, z, dz| {
        if record.is_news(i) {
            rows.push((motion.len(), record.positions()[i] - z, *dz));
        }
        motion.push((record.times()[i], z));
    });
    let left: Vec<f64> = rows.iter().map(|(_, left, _)| *left).collect();
    let correlation = correlation(&left);
    let column = |signal: &dyn Fn(usize) -> f64| whitened(rows.len(), correlation, signal);
    let mut basis = OrthonormalColumns::default();
    for parameter in 0..PARAMETERS {
        basis.add(column(&|row| rows[row].2[parameter]));
    }
    let left = basis.of(column(&|row| left[row]));
    let seen = |signal: &[f64]| column(&|row| signal[rows[row].0]);
    let of = |omega: f64| {
        let [at, moving, q] = behind(&motion, omega).map(|signal| seen(&signal));
        // It may ring from the start.
        let mut basis = basis.clone();
        basis.add(at);
        basis.add(moving);
        let (q, left) = (basis.of(q), basis.of(left.clone()));
        let squares = q.norm_squared();
        let ratio = if squares > 0.0 { q.dot(&left) / squares } else { 0.0 };
        Ringing { omega, ratio, explains: ratio * ratio * squares }
    };
    let (Some(from), Some(to)) = (motion.first(), motion.last()) else { return Vec::new() };
    let [low, high] =
        [LOWEST / (to.0 - from.0), 1.0 / (HIGHEST * record.period())].map(|hz| std::f64::consts::TAU * hz);
    if low >= high {
        return Vec::new();
    }
    let omega = |i: usize| low * (high / low).powf(i as f64 / (FREQUENCIES - 1) as f64);
    let mut all: Vec<Ringing> = Vec::new();
    while all.len() < FREQUENCIES {
        if stop() {
            return Vec::new();
        }
        let next: Vec<usize> = (all.len()..FREQUENCIES).take(TOGETHER).collect();
        all.par_extend(next.into_par_iter().map(|i| of(omega(i))));
    }
    let explains = |i: usize| all.get(i).map_or(0.0, |one| one.explains);
    let is_peak = |i: usize| explains(i) > explains(i + 1) && (i == 0 || explains(i) >= explains(i - 1));
    let mut peaks: Vec<Ringing> =
        (0..all.len()).filter(|i| all[*i].ratio > 0.0 && is_peak(*i)).map(|i| all[i]).collect();
    peaks.sort_by(|a, b| b.explains.total_cmp(&a.explains));
    peaks
}

/// The correlation of neighbouring residuals.
fn correlation(left: &[f64]) -> f64 {
    let products: f64 = left.iter().zip(left.iter().skip(1)).map(|(a, b)| a * b).sum();
    let squares: f64 = left.iter().map(|x| x * x).sum();
    if squares > 0.0 { (products / squares).clamp(0.0, 1.0) } else { 0.0 }
}

/// A signal less the part of each sample that its neighbour predicts. A rigid fit that ends with a wrong friction leaves slow residuals
/// that are larger than the ringing; without the predicted part they are not.
fn whitened(length: usize, correlation: f64, signal: &dyn Fn(usize) -> f64) -> DVector<f64> {
    DVector::from_fn(length, |row, _| signal(row) - if row > 0 { correlation * signal(row - 1) } else { 0.0 })
}

/// q of a handle at these times: that rings out from q = 1 and from q̇ = ω, and that follows the motion from rest. Between two samples the
/// motion is linear in time.
fn behind(motion: &[(f64, f64)], omega: f64) -> [Vec<f64>; 3] {
    let (decay, swing) = (RATIO * omega, omega * (1.0 - RATIO * RATIO).sqrt());
    let mut states = [[1.0, 0.0], [0.0, omega], [0.0, 0.0]];
    let mut all = states.map(|[q, _]| {
        let mut signal = Vec::with_capacity(motion.len());
        signal.push(q);
        signal
    });
    let mut slope = None;
    let (mut length, mut change) = (0.0, [[1.0, 0.0], [0.0, 1.0]]);
    for pair in motion.windows(2) {
        let time = pair[1].0 - pair[0].0;
        let next = (pair[1].1 - pair[0].1) / time;
        states[2][1] += next - slope.unwrap_or(next);
        slope = Some(next);
        // The times of even samples differ by rounding.
        if (time - length).abs() > EQUAL * time {
            let ((sin, cos), left) = ((swing * time).sin_cos(), (-decay * time).exp());
            let (own, other) = (decay / swing * sin, left / swing * sin);
            change = [[left * (cos + own), other], [-omega * omega * other, left * (cos - own)]];
            length = time;
        }
        for (state, signal) in states.iter_mut().zip(&mut all) {
            let [q, rate] = *state;
            *state = [change[0][0] * q + change[0][1] * rate, change[1][0] * q + change[1][1] * rate];
            signal.push(state[0]);
        }
    }
    all
}

/// Orthonormal columns. Other columns count by their part orthogonal to these.
#[derive(Clone, Default)]
struct OrthonormalColumns {
    columns: Vec<DVector<f64>>,
}

impl OrthonormalColumns {
    /// The part of a column orthogonal to these, projected twice because of rounding.
    fn of(&self, mut column: DVector<f64>) -> DVector<f64> {
        for own in self.columns.iter().chain(&self.columns) {
            let along = own.dot(&column);
            column.axpy(-along, own, 1.0);
        }
        column
    }

    /// Adds a column, unless it is in their span.
    fn add(&mut self, column: DVector<f64>) {
        let size = column.norm();
        let left = self.of(column);
        let own = left.norm();
        if own > ROUNDING * size {
            self.columns.push(left / own);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use hapt_model::Handle;
    use hapt_testing::prelude::*;

    use super::*;
    use crate::best::best;
    use crate::record::Record;
    use crate::shaft::Shafted;
    use crate::start::starts;

    /// The most likely shafts of a random record. Noise and a slow motion that is not the rigid device's are in parts of the ringing after
    /// a step of a fifth of the largest torque.
    fn found(hz: f64, own: f64, share: f64, [noise, slow]: [f64; 2], seed: u64) -> Vec<Ringing> {
        let mut rng = fastrand::Rng::with_seed(seed);
        let (omega, handle) = (TAU * hz, share * own);
        let mass = own * handle / (own + handle);
        let handle = Handle { inertia: handle, stiffness: mass * omega * omega, damping: 0.06 * mass * omega };
        let device = Shafted { inertia: own, damping: 3e-3, friction: 0.0, delay: 1e-3, lag: 0.0, handle };
        let mut torque = 0.0;
        let mut next = |k: usize| {
            if k > 60 && rng.u8(..50) == 0 {
                torque = 0.1 * (rng.f64() - 0.5);
            }
            torque
        };
        let torques: Vec<f64> = (0..2000).map(&mut next).collect();
        let times: Vec<f64> = (0..2000).map(|k| k as f64 * 1e-3).collect();
        let mut clean = Vec::new();
        device.follow(&times, &torques, [0.0; 4], |_, z| clean.push(z));
        let rings = 0.02 * 2.0 * handle.inertia / own / (own + handle.inertia) / (omega * omega);
        let noisy = |(z, t): (&f64, &f64)| {
            z + rings * (noise * (rng.f64() + rng.f64() + rng.f64() - 1.5) * 2.0 + slow * (1.5 * TAU * t).sin())
        };
        let positions = clean.iter().zip(&times).map(noisy).collect();
        let record = Record::new(times, positions, torques).unwrap();
        let watched = CancellableRecord { record: &record, stop: &|| false };
        let rigid = best(&watched, &starts(&watched)).unwrap();
        ringing(&watched, &rigid)
    }

    fn is_found(found: &[Ringing], hz: f64, share: f64) -> bool {
        let near = found.iter().take(3).find(|one| (one.omega / (TAU * hz) - 1.0).abs() < 0.1);
        near.is_some_and(|one| (0.2..5.0).contains(&(one.ratio / share)))
    }

    proptest! {
        #![proptest_config(hapt_testing::cases(8))]
        // Noise is half to four times as large as the ringing.
        #[test]
        fn a_handle_is_seen_below_the_noise(
            hz in 15.0..80.0f64, own in 3e-4..1e-3f64, share in 0.5..2.0f64, noise in 0.5..4.0f64, seed in any::<u64>(),
        ) {
            let found = found(hz, own, share, [noise, 0.0], seed);
            prop_assert!(is_found(&found, hz, share), "{hz} {share}: {:?}", &found[..found.len().min(4)]);
        }
    }

    #[test]
    fn most_handles_are_seen_below_a_slow_motion() {
        let seen = |seed: &u64| {
            let mut rng = fastrand::Rng::with_seed(*seed);
            let mut between = |low: f64, high: f64| low + (high - low) * rng.f64();
            let (hz, own, share) = (between(30.0, 80.0), between(3e-4, 1e-3), between(0.5, 2.0));
            let found = found(hz, own, share, [between(0.5, 4.0), between(10.0, 30.0)], *seed);
            is_found(&found, hz, share)
        };
        let count = (0..40).filter(seen).count();
        assert!(count >= 34, "{count} of 40");
    }
}
