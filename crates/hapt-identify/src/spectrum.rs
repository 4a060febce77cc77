//! The strongest line in the spectrum of what a fit leaves.

use std::f64::consts::{PI, TAU};

/// Frequencies that are looked at, in equal ratios.
const FREQUENCIES: usize = 1500;
/// Periods of the lowest in the record, and samples of the highest.
const LOWEST: f64 = 4.0;
const HIGHEST: f64 = 2.5;
/// A clear line holds this part of the whole, and is so far above the median.
const PART: f64 = 0.1;
const ABOVE: f64 = 30.0;
/// More samples than this are not looked at.
const MOST: usize = 8000;

/// A line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Line {
    pub hz: f64,
    /// The part of the squares that one sine of this frequency holds.
    part: f64,
    /// Over the median of all frequencies.
    above: f64,
}

impl Line {
    pub fn is_clear(&self) -> bool {
        self.part > PART && self.above > ABOVE
    }
}

/// The frequency whose velocity is largest in these values, `period` s apart; under Hann's window.
pub(crate) fn line(values: &[f64], period: f64) -> Option<Line> {
    let values = &values[..values.len().min(MOST)];
    let n = values.len() as f64;
    let squares: f64 = values.iter().map(|x| x * x).sum();
    let windowed: Vec<f64> =
        values.iter().enumerate().map(|(i, x)| x * (PI * (i as f64 + 0.5) / n).sin().powi(2)).collect();
    let [low, high] = [LOWEST / (n * period), 1.0 / (HIGHEST * period)];
    let power = |hz: f64| {
        // e^{-jωt} by rotation.
        let (sin, cos) = (TAU * hz * period).sin_cos();
        let (mut c, mut s, mut re, mut im) = (1.0, 0.0, 0.0, 0.0);
        for x in &windowed {
            (re, im) = (re + x * c, im + x * s);
            (c, s) = (c * cos - s * sin, s * cos + c * sin);
        }
        re * re + im * im
    };
    let hz = |i: usize| low * (high / low).powf(i as f64 / (FREQUENCIES - 1) as f64);
    let all: Vec<(f64, f64)> = (0..FREQUENCIES).map(|i| (hz(i), power(hz(i)))).collect();
    let moving = |(hz, power): &(f64, f64)| power * hz * hz;
    let (hz, power) = *all.iter().max_by(|a, b| moving(a).total_cmp(&moving(b)))?;
    let mut sorted: Vec<f64> = all.iter().map(|(_, power)| *power).collect();
    sorted.sort_by(f64::total_cmp);
    let median = sorted[FREQUENCIES / 2].max(f64::MIN_POSITIVE);
    // A sine of amplitude a has the sum a n/4 under the window, and the squares a² n/2.
    (power > 0.0 && squares > 0.0).then_some(Line { hz, part: 8.0 * power / (n * squares), above: power / median })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_is_found_and_noise_is_no_clear_line() {
        let noise = |k: usize| ((k * 7919 % 1009) as f64 / 1009.0) - 0.5;
        let sine: Vec<f64> = (0..3000).map(|k| (TAU * 37.0 * k as f64 * 1e-3).sin() + 0.3 * noise(k)).collect();
        let found = line(&sine, 1e-3).unwrap();
        assert!((found.hz - 37.0).abs() < 0.3 && found.is_clear() && found.part > 0.8, "{found:?}");
        let mut seed = 1u64;
        let mut random = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let noise: Vec<f64> = (0..3000).map(|_| random()).collect();
        assert!(!line(&noise, 1e-3).unwrap().is_clear());
    }
}
