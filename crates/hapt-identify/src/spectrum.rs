//! The strongest line in the spectrum of a fit's residuals.

use std::f64::consts::{PI, TAU};

use rayon::prelude::*;

/// The number of frequencies that are tried, in equal ratios.
const FREQUENCIES: usize = 1500;
/// The least number of periods of the lowest in the record, and of samples in a period of the highest.
const LOWEST: f64 = 4.0;
const HIGHEST: f64 = 2.5;
/// A clear line has this part of the whole power, and exceeds the median by this factor.
const PART: f64 = 0.1;
const ABOVE: f64 = 30.0;
/// At most this many samples are used.
const MAX_SAMPLES: usize = 8000;

/// A line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Line {
    pub hz: f64,
    /// The part of the squares that one sine of this frequency explains.
    part: f64,
    /// Over the median of all frequencies.
    above: f64,
}

impl Line {
    pub fn is_clear(&self) -> bool {
        self.part > PART && self.above > ABOVE
    }
}

/// The frequency whose velocity is largest in these values, each with its time in s; under Hann's window.
pub(crate) fn line(values: &[(f64, f64)]) -> Option<Line> {
    let values = &values[..values.len().min(MAX_SAMPLES)];
    let n = values.len() as f64;
    let (from, to) = (values.first()?.0, values.last()?.0);
    let period = (to - from) / (n - 1.0).max(1.0);
    let squares: f64 = values.iter().map(|(_, x)| x * x).sum();
    // Each value is weighted by the time around it, in periods: otherwise slow parts would leak to all frequencies of uneven samples.
    let time = |i: usize| values.get(i).map_or(to, |value| value.0);
    let weight = |i: usize| 0.5 * (time(i + 1) - time(i.saturating_sub(1))) / period;
    let window = |t: f64| (PI * ((t - from) / period + 0.5) / n).sin().powi(2);
    let windowed: Vec<(f64, f64)> =
        values.iter().enumerate().map(|(i, (t, x))| (*t, x * weight(i) * window(*t))).collect();
    let [low, high] = [LOWEST / (n * period), 1.0 / (HIGHEST * period)];
    let power = |hz: f64| {
        let (re, im) = windowed.iter().fold((0.0, 0.0), |(re, im), (t, x)| {
            let (sin, cos) = (TAU * hz * t).sin_cos();
            (re + x * cos, im + x * sin)
        });
        re * re + im * im
    };
    let hz = |i: usize| low * (high / low).powf(i as f64 / (FREQUENCIES - 1) as f64);
    let all: Vec<(f64, f64)> = (0..FREQUENCIES).into_par_iter().map(|i| (hz(i), power(hz(i)))).collect();
    let mut sorted: Vec<f64> = all.iter().map(|(_, power)| *power).collect();
    sorted.sort_by(f64::total_cmp);
    let median = sorted[FREQUENCIES / 2].max(f64::MIN_POSITIVE);
    // The velocity of noise is largest at the highest frequencies: a line that does not exceed it counts only where none does.
    let moving = |(hz, power): &(f64, f64)| (*power > ABOVE * median, power * hz * hz);
    let (hz, power) = *all.iter().max_by(|a, b| {
        let ((a_is_above, a), (b_is_above, b)) = (moving(a), moving(b));
        a_is_above.cmp(&b_is_above).then(a.total_cmp(&b))
    })?;
    // A sine of amplitude a has the sum a n/4 under the window, and the squares a² n/2.
    (power > 0.0 && squares > 0.0).then_some(Line { hz, part: 8.0 * power / (n * squares), above: power / median })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_is_found_and_noise_is_no_clear_line() {
        let noise = |k: usize| ((k * 7919 % 1009) as f64 / 1009.0) - 0.5;
        // At uneven times.
        let at = |k: usize| (k as f64 + 0.9 * noise(31 * k)) * 1e-3;
        let sine: Vec<(f64, f64)> = (0..3000).map(|k| (at(k), (TAU * 37.0 * at(k)).sin() + 0.3 * noise(k))).collect();
        let found = line(&sine).unwrap();
        assert!((found.hz - 37.0).abs() < 0.3 && found.is_clear() && found.part > 0.8, "{found:?}");
        let mut seed = 1u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let noise: Vec<(f64, f64)> = (0..3000).map(|k| (k as f64 * 1e-3, random())).collect();
        assert!(!line(&noise).unwrap().is_clear());
    }
}
