//! The best of the fits from several starts.

use crate::fit::{Fit, Free, fit};
use crate::intervals::separates_offset;
use crate::puck::{DELAY, Puck};
use crate::record::{CancellableRecord, Record};
use crate::remainder::fitted;
use crate::start::{Begin, begins, direction};

/// The number of standard errors that counts as certain, for the delay and for a constant torque.
const SURELY: f64 = 5.0;
/// A fit over more samples of the same motion has at most this times the residual variance.
const ALIKE: f64 = 1.2;

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
        let fits = starts.iter().filter_map(|start| {
            // For motion in one direction a constant torque is the same as friction, which may then be below 0.
            let friction = start.friction - direction(record) * start.offset;
            let start = if offset { *start } else { Puck { offset: 0.0, friction, ..*start } };
            fit(record, start, free, record.first())
        });
        let best = fits.min_by(|a, b| a.normal.squares.total_cmp(&b.normal.squares))?;
        // Fits tend to stop where one loss is below 0 and the other far too large, which is not physical.
        let shared = shared(record, &best.puck).and_then(|start| fit(record, start, free, record.first()));
        Some(shared.filter(|fit| fit.normal.squares < best.normal.squares).unwrap_or(best))
    };
    // For motion in one direction friction is the same as a constant torque.
    let offset = if is_driven { with(true) } else { None };
    let late = match offset {
        Some(fit) if separates_offset(&fit) => fit,
        // Hardly separated from friction, but present: without it the residuals are significantly larger.
        Some(fit) => with(false)
            .filter(|none| none.normal.squares - fit.normal.squares < SURELY.powi(2) * fit.variance())
            .unwrap_or(fit),
        None => with(false)?,
    };
    Some(earlier(record, &late).unwrap_or(late))
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
    let best = fits.min_by(|a, b| a.normal.squares.total_cmp(&b.normal.squares))?;
    (best.variance() < ALIKE * late.variance()).then_some(best)
}
