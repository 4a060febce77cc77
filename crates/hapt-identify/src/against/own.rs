//! The squares that the file's own device leaves of a record.
//!
//! An interval by standard errors is right where the motion is linear in the numbers. Over a valley that bends, such as that of delay,
//! damping and inertia on a spring, it is not, and without noise it is a small part of the valley. The file's device has no such limit: its
//! motion from the best initial state, with each number within its range, leaves these squares.

use hapt_plant::spec::DeviceSpec;

use super::claims::Claims;
use crate::device::{
    ACCURACY, DAMPING, Device, FRICTION, Fit, Free, INERTIA, LATE, OFFSET, PARAMETERS, Shot, VARIANCE,
};
use crate::explained::NOTHING;
use crate::handle::{self, WithHandle};
use crate::identified::Identified;
use crate::record::CancellableRecord;
use crate::remainder::RESOLUTION;

/// Numbers that a file may give with a range.
const RANGED: [usize; 5] = [INERTIA, DAMPING, FRICTION, LATE, VARIANCE];
const MANY: usize = 60;

/// The squares that the file's device leaves more than a fit, in variances; `None`: its motion is not finite.
pub(super) fn excess(
    record: &CancellableRecord<'_>,
    claims: &Claims,
    found: &Identified,
    shots: Vec<Shot>,
) -> Option<f64> {
    let best: Vec<f64> = found
        .residuals(record)
        .into_iter()
        .zip(found.first..)
        .filter_map(|((_, left), i)| record.is_news(i).then_some(left))
        .collect();
    let own = of_file(record, claims, found, shots)?;
    // Under torques of the position the motion of a fit is as exact as printed numbers.
    let accuracy = if claims.moves_by_position() { NOTHING } else { ACCURACY };
    Some(beyond(own.squares, &best, accuracy * found.spread, found.spread))
}

/// The same of a device with a handle on a shaft.
pub(super) fn excess_with_handle(
    record: &CancellableRecord<'_>,
    claims: &Claims,
    found: &WithHandle,
    residuals: &[(f64, f64)],
) -> Option<f64> {
    let device = DeviceSpec {
        inertia: within(claims.inertia, found.inertia.value),
        damping: within(claims.damping, found.damping.value),
        friction: within(claims.friction, found.friction.value),
        lag: within(claims.lag, found.lag.value),
        delay: within(claims.delay, found.delay.value),
        ..claims.device()
    };
    let best: Vec<f64> = residuals.iter().map(|(_, left)| *left).collect();
    Some(beyond(handle::squares_of(record, &device)?, &best, ACCURACY * record.spread(), record.spread()))
}

/// The squares `own` beyond those of the best fit's residuals, in variances; motions are known to within `error`.
fn beyond(own: f64, best: &[f64], error: f64, spread: f64) -> f64 {
    let samples = best.len() as f64;
    let squares: f64 = best.iter().map(|left| left * left).sum();
    let variance = (squares / samples).max((RESOLUTION * spread).powi(2));
    let least = (own.sqrt() - error * samples.sqrt()).max(0.0).powi(2);
    (least - squares) / variance
}

/// The number of a range that is nearest to `x`.
fn within([low, high]: [f64; 2], x: f64) -> f64 {
    x.max(low).min(high)
}

/// The file's device with the best initial states, and with those numbers within their ranges that explain the record best.
fn of_file(record: &CancellableRecord<'_>, claims: &Claims, found: &Identified, shots: Vec<Shot>) -> Option<Fit> {
    let mut device = Device::of_spec(&claims.device());
    device.places.finely = true;
    let [low, high] = [0, 1].map(|end| Device::of_spec(&claims.device_at(|range| range[end])).p);
    let mut range: [[f64; 2]; PARAMETERS] = std::array::from_fn(|i| [low[i], high[i]]);
    let holds = claims.friction[1] - claims.lean.abs();
    if let Some(offset) = found.offset {
        range[OFFSET] = [range[OFFSET][0] - holds, range[OFFSET][1] + holds];
        device.p[OFFSET] = offset.value;
    }
    let seen = [
        (INERTIA, found.inertia.map(|x| x.value.ln())),
        (DAMPING, found.damping.map(|x| x.value)),
        (FRICTION, found.friction.map(|x| x.value)),
        (LATE, found.late.or(found.delay).map(|x| x.value)),
        (VARIANCE, found.lag.map(|x| x.value * x.value)),
    ];
    for (i, seen) in seen {
        device.p[i] = within(range[i], seen.unwrap_or(device.p[i]));
    }
    device.p[OFFSET] = within(range[OFFSET], device.p[OFFSET]);
    let mut free: Free = [false; PARAMETERS];
    for i in RANGED.into_iter().chain([OFFSET]) {
        free[i] = range[i][0] < range[i][1];
    }
    let mut fit = Fit::of(record, device, free, shots)?.improved(record, MANY)?;
    for _ in 0..=RANGED.len() {
        let outside = |i: &usize| free[*i] && !(range[*i][0]..=range[*i][1]).contains(&fit.device.p[*i]);
        let outside: Vec<usize> = (0..PARAMETERS).filter(outside).collect();
        if outside.is_empty() {
            break;
        }
        let mut device = fit.device;
        for i in outside {
            device.p[i] = within(range[i], device.p[i]);
            free[i] = false;
        }
        fit = Fit::of(record, device, free, fit.shots)?.improved(record, MANY)?;
    }
    Some(fit)
}
