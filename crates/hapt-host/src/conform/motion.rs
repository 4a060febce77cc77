//! Torques from positions: weighted means of the acceleration over a short window.
//!
//! The second differences of positions are far too noisy by themselves. Their mean with the weight (1 - s²)², whose value and slope are 0 at
//! both ends of the window, is a mean of the positions with a smooth weight. By Newton's law it equals the same mean of all torques on the
//! wheel, divided by its inertia.

use super::meaning::WheelMotion;

/// The step of the even grid, in s.
pub const STEP: f64 = 2e-3;
/// Half of the window of a mean, and half of the window over which a motion is smoothed, in s.
const WINDOW: f64 = 0.1;
const NEAR: f64 = 0.04;
/// From one mean to the next, in steps.
const STRIDE: usize = 10;

/// The motion of a wheel on an even grid.
pub struct Course {
    /// The time of its beginning, in s.
    pub begin: f64,
    /// The smoothed motion at each step.
    pub motion: Vec<WheelMotion>,
    /// The acceleration by second differences.
    pub raw: Vec<f64>,
}

/// The weights of a mean over a window of `half` steps to either side.
fn weights(half: usize) -> Vec<f64> {
    let weights: Vec<f64> =
        (0..=2 * half).map(|i| i as f64 / half as f64 - 1.0).map(|s| (1.0 - s * s).powi(2)).collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| weight / sum).collect()
}

/// The mean about `at`, where the window lies inside.
fn mean(weights: &[f64], values: &[f64], at: usize) -> f64 {
    let half = weights.len() / 2;
    weights.iter().zip(&values[at - half..=at + half]).map(|(weight, value)| weight * value).sum()
}

impl Course {
    /// From positions at increasing times, straight between them. The first and the last 0.04 s are left out; `None` where nothing is left.
    pub fn of(trace: &[(f64, f64)]) -> Option<Self> {
        let (&(first, _), &(last, _)) = (trace.first()?, trace.last()?);
        let half = (NEAR / STEP) as usize;
        let count = ((last - first) / STEP) as usize + 1;
        let mut rest = trace.windows(2).peekable();
        let positions: Vec<f64> = (0..count)
            .map(|k| {
                let time = first + k as f64 * STEP;
                while rest.peek().is_some_and(|pair| pair[1].0 < time) {
                    rest.next();
                }
                rest.peek().map_or(trace[trace.len() - 1].1, |pair| {
                    let ((t0, z0), (t1, z1)) = (pair[0], pair[1]);
                    if t1 > t0 { z0 + (z1 - z0) * ((time - t0) / (t1 - t0)).clamp(0.0, 1.0) } else { z1 }
                })
            })
            .collect();
        let weights = weights(half);
        let inner = 1..count.saturating_sub(1);
        let velocity: Vec<f64> = inner.clone().map(|k| (positions[k + 1] - positions[k - 1]) / (2.0 * STEP)).collect();
        let raw: Vec<f64> =
            inner.map(|k| (positions[k + 1] - 2.0 * positions[k] + positions[k - 1]) / (STEP * STEP)).collect();
        // The differences begin a step later than the positions.
        let middles = half..raw.len().saturating_sub(half);
        let motion: Vec<WheelMotion> = middles
            .clone()
            .map(|at| WheelMotion {
                position: mean(&weights, &positions[1..], at),
                velocity: mean(&weights, &velocity, at),
                acceleration: mean(&weights, &raw, at),
            })
            .collect();
        let raw = raw.get(middles)?.to_vec();
        (!motion.is_empty()).then_some(Course { begin: first + (half + 1) as f64 * STEP, motion, raw })
    }

    /// The time of a step.
    pub fn time(&self, at: usize) -> f64 {
        self.begin + at as f64 * STEP
    }

    /// The steps at the middle of a window.
    pub fn middles(&self) -> impl Iterator<Item = usize> {
        let half = (WINDOW / STEP) as usize;
        (half..self.motion.len().saturating_sub(half)).step_by(STRIDE)
    }

    /// The weighted means of the values, given at each step, at each middle.
    pub fn means(&self, values: &[f64]) -> Vec<f64> {
        let weights = weights((WINDOW / STEP) as usize);
        self.middles().map(|at| mean(&weights, values, at)).collect()
    }
}
