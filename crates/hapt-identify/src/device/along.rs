//! The search along the valley of delay, damping and inertia.
//!
//! In a loop with a spring these explain each other, over a valley of the squares that bends and is rough where the puck turns round. With
//! the delay held the others are found in a few steps, so the delay alone is searched.

use super::fit::{Fit, NOT_BELOW_0, least_variance};
use super::parameters::LATE;
use super::slopes::{Column, Normal, scaled};
use crate::record::{CancellableRecord, LONGEST_DELAY};

/// A fit is far from the least squares where the step to them is more than this part of the standard errors; then at most this many delays
/// are tried, each with so many steps.
const FAR: f64 = 0.1;
const MOST: usize = 10;
const STEPS: usize = 2;

/// The fit of another delay, where that has less squares, after at most this many steps at the end.
pub(super) fn along_delays(record: &CancellableRecord<'_>, found: Fit, most: usize) -> Option<Fit> {
    let normal = Normal::of(&found.slopes, 0.0, [0.0; 2]);
    let whole = found.step(&normal.information, &normal.right, 0.0, least_variance(record));
    let Some(whole) = whole.filter(|_| found.free[LATE]) else { return Some(found) };
    if whole.dot(&(normal.information * whole)) < FAR * FAR * found.variance() {
        return Some(found);
    }
    let (mut best, mut step) = (found, whole[LATE]);
    for _ in 0..MOST {
        let Some(error) = tangent(&best).map(|tangent| (tangent[LATE] * best.variance()).sqrt()) else { break };
        if (record.stop)() || step.abs() < FAR * error {
            break;
        }
        match moved(record, &best, step) {
            Some(better) => (best, step) = (better, 2.0 * step),
            None => step *= -0.5,
        }
    }
    best.improved(record, most)
}

/// The covariance of the numbers with the delay, over the residuals' variance: their changes as the delay changes by its own row.
fn tangent(fit: &Fit) -> Option<Column> {
    let normal = Normal::of(&fit.slopes, 0.0, [0.0; 2]);
    let (matrix, scale) = scaled(&normal.information, fit.free, 0.0);
    let inverse = matrix.cholesky()?.inverse();
    Some(Column::from_fn(|i, _| inverse[(i, LATE)] * scale[i] * scale[LATE]))
}

/// The fit of a delay that is longer by `step`, in s; `None`: it has no less squares.
fn moved(record: &CancellableRecord<'_>, fit: &Fit, step: f64) -> Option<Fit> {
    let tangent = tangent(fit)?;
    let mut device = fit.device;
    let part = ((device.p[LATE] + step).clamp(0.0, LONGEST_DELAY) - device.p[LATE]) / tangent[LATE];
    device.p.iter_mut().zip(&tangent).for_each(|(p, tangent)| *p += part * tangent);
    NOT_BELOW_0.into_iter().for_each(|i| device.p[i] = device.p[i].max(0.0));
    let mut held = fit.free;
    held[LATE] = false;
    let there = Fit::of(record, device, held, fit.shots.clone())?.improved(record, STEPS)?;
    if there.squares >= fit.squares {
        return None;
    }
    Fit::of(record, there.device, fit.free, there.shots)?.improved(record, 0)
}
