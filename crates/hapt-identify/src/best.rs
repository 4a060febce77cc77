//! The best of the fits from several starts.

use rayon::prelude::*;

use crate::explained::NOTHING;
use crate::factor::{Free, without};
use crate::fit::{Fit, fit};
use crate::intervals::separates_offset;
use crate::puck::{DELAY, Puck};
use crate::record::{CancellableRecord, EARLIEST, LONGEST_DELAY, Record};
use crate::remainder::{RESOLUTION, error_variance, fitted, spread};
use crate::start::{Begin, begins, direction, starts};

/// The number of standard errors that counts as certain, for the delay and for a constant torque.
const SURELY: f64 = 5.0;
/// The same for the sign of the torque: 99.9 %.
const SIGN: f64 = 3.29;
/// A fit over more samples of the same motion has at most this times the residual variance.
const ALIKE: f64 = 1.2;
/// Delays around that of a fit, on each side, their distances in periods, and the number of those with the least squares that lead to a fit.
const DELAYS: i32 = 24;
const DELAY_STEPS: [f64; 2] = [1.0 / 8.0, 1.0 / 64.0];
const LEADS: usize = 3;
/// A fit is far from the least squares where the step to them is more than this part of the standard errors; then at most this many delays
/// are tried.
const FAR: f64 = 0.1;
const MOST_ALONG: usize = 12;

/// Which parameters are fitted.
pub(crate) fn free(record: &Record, offset: bool) -> Free {
    let is_driven = record.is_driven();
    [is_driven, true, true, is_driven, offset, true, true, false]
}

/// The fit over all of the record that can be used, with a constant torque where the record shows one.
pub(crate) fn best(record: &CancellableRecord<'_>, starts: &[Puck]) -> Option<Fit> {
    let is_driven = record.is_driven();
    let with = |offset: bool| {
        let free = free(record, offset);
        let fits = starts.par_iter().filter_map(|start| {
            // For motion in one direction a constant torque is the same as friction, which may then be below 0.
            let friction = start.friction - direction(record) * start.offset;
            let start = if offset { *start } else { Puck { offset: 0.0, friction, ..*start } };
            fit(record, start, free, record.first())
        });
        let fits: Vec<Fit> = fits.collect();
        let least = fits.iter().min_by(|a, b| a.factor.squares.total_cmp(&b.factor.squares))?;
        // Of two signs that explain the record as well, that of the shorter delay.
        let is_rival = |fit: &&Fit| explains_as_well(record, fit, least);
        let rivals = fits.iter().filter(is_rival).chain([least]);
        let best = rivals.min_by(|a, b| a.puck.delay.abs().total_cmp(&b.puck.delay.abs()))?;
        // Fits tend to stop where one loss is below 0 and the other far too large, which is not physical.
        let shared = shared(record, &best.puck).and_then(|start| fit(record, start, free, record.first()));
        Some(shared.filter(|fit| fit.factor.squares < best.factor.squares).unwrap_or(*best))
    };
    // For motion in one direction friction is the same as a constant torque.
    let offset = if is_driven { with(true) } else { None };
    let late = match offset {
        Some(fit) if separates_offset(&fit) => fit,
        // Hardly separated from friction, but present: without it the residuals are significantly larger.
        Some(fit) => with(false)
            .filter(|none| none.factor.squares - fit.factor.squares < SURELY.powi(2) * fit.variance())
            .unwrap_or(fit),
        None => with(false)?,
    };
    let found = earlier(record, &late).unwrap_or(late);
    let found = along_delays(record, &found).unwrap_or(found);
    let finer = |found: Fit, step: &f64| among_delays(record, &found, *step).unwrap_or(found);
    Some(DELAY_STEPS.iter().fold(found, finer))
}

/// The best fit with the other sign of the torque, where the record does not decide between the two.
pub(crate) fn rival(record: &CancellableRecord<'_>, found: &Fit) -> Option<Fit> {
    let starts = starts(record).into_par_iter().filter(|start| start.gain * found.puck.gain < 0.0);
    let fits = starts.filter_map(|start| fit(record, start, found.free, found.first));
    let fits: Vec<Fit> = fits.filter(|fit| explains_as_well(record, fit, found)).collect();
    fits.into_iter().min_by(|a, b| a.factor.squares.total_cmp(&b.factor.squares))
}

/// Whether a fit has the other sign, and its squares are not certainly more.
fn explains_as_well(record: &Record, fit: &Fit, best: &Fit) -> bool {
    let more = fit.factor.squares - best.factor.squares;
    fit.puck.gain * best.puck.gain < 0.0 && more < SIGN.powi(2) * error_variance(record, best)
}

/// The fit of another delay, where that of all parameters ended far from the least squares: on a spring delay, damping and inertia explain
/// each other over a valley that bends. With the delay held the others are found in a few steps, so the delay alone is searched. `None`:
/// the fit is at the least squares already.
fn along_delays(record: &CancellableRecord<'_>, found: &Fit) -> Option<Fit> {
    let whole = found.whole(record).filter(|_| found.free[DELAY])?;
    if found.factor.size(&whole) < FAR.powi(2) * found.variance() {
        return None;
    }
    let (mut best, mut step) = (*found, whole[DELAY]);
    for _ in 0..MOST_ALONG {
        let inverse = best.inverse()?;
        if (record.stop)() || step.abs() < FAR * (inverse[(DELAY, DELAY)] * best.variance()).sqrt() {
            break;
        }
        let mut p = best.puck.parameters();
        let delay = (p[DELAY] + step).clamp(-EARLIEST, LONGEST_DELAY);
        let part = (delay - p[DELAY]) / inverse[(DELAY, DELAY)];
        p.iter_mut().enumerate().for_each(|(i, p)| *p += part * inverse[(i, DELAY)]);
        let there = fit(record, Puck::from_parameters(p), without(found.free, DELAY), found.first);
        match there.filter(|there| there.factor.squares < best.factor.squares) {
            Some(there) => (best, step) = (Fit { free: found.free, ..there }, 2.0 * step),
            None => step *= -0.5,
        }
    }
    let ends = fit(record, best.puck, found.free, found.first).unwrap_or(best);
    (ends.factor.squares < found.factor.squares).then_some(ends)
}

/// The same fit of nearly exact positions from delays around its own, this many periods apart. Without noise the squares over the delay have
/// a minimum wherever a turn of the puck passes a change of the torque, and only the delay of the device leaves nothing. `None`: counts or
/// noise hide that, or the fit is exact already.
fn among_delays(record: &CancellableRecord<'_>, found: &Fit, step: f64) -> Option<Fit> {
    let size = spread(record, found);
    let rms = found.variance().sqrt();
    if record.lattice().is_some() || !found.free[DELAY] || !(RESOLUTION * size..NOTHING * size).contains(&rms) {
        return None;
    }
    let squares = |fit: &Fit| fit.factor.squares;
    let of_delay = |delay: f64| fit(record, Puck { delay, ..found.puck }, without(found.free, DELAY), found.first);
    let delays = (-DELAYS..=DELAYS).into_par_iter().map(|i| found.puck.delay + f64::from(i) * step * record.period());
    let mut around: Vec<Fit> = delays.filter_map(of_delay).collect();
    around.sort_by(|a, b| squares(a).total_cmp(&squares(b)));
    let fits = around.iter().take(LEADS).filter_map(|lead| fit(record, lead.puck, found.free, found.first));
    fits.min_by(|a, b| squares(a).total_cmp(&squares(b))).filter(|fit| squares(fit) < squares(found))
}

/// The puck with a loss below 0, half of the other's work given to that one; `None` where neither is below 0.
fn shared(record: &Record, puck: &Puck) -> Option<Puck> {
    let positions = fitted(record, puck, record.first());
    let speeds = positions.windows(2).map(|pair| ((pair[1] - pair[0]) / record.period()).powi(2));
    let speed = (speeds.sum::<f64>() / positions.len() as f64).sqrt();
    let (damping, friction) = (0.5 * puck.damping, 0.5 * puck.friction);
    if puck.friction < 0.0 {
        Some(Puck { damping, friction: damping * speed, ..*puck })
    } else if puck.damping < 0.0 && speed > 0.0 {
        Some(Puck { damping: friction / speed, friction, ..*puck })
    } else {
        None
    }
}

/// The same fit from the first sample by which every torque of this delay has been recorded: a rest before the first step determines the
/// first position as well as any motion does. `None` where that sample is no earlier, or where the added samples are of another motion.
fn earlier(record: &CancellableRecord<'_>, late: &Fit) -> Option<Fit> {
    let error = (late.inverse()?[(DELAY, DELAY)] * late.variance()).sqrt();
    let first = record.first_after(late.puck.delay + SURELY * error);
    if first >= late.first {
        return None;
    }
    let fits = begins(record, first).into_iter().filter_map(|Begin { position, velocity }| {
        fit(record, Puck { position, velocity, ..late.puck }, late.free, first)
    });
    let best = fits.min_by(|a, b| a.factor.squares.total_cmp(&b.factor.squares))?;
    (best.variance() < ALIKE * late.variance()).then_some(best)
}
