//! The device without stops, with torques and friction of the position, that explains a record.
//!
//! The torque's equation shows the large terms. A fit of the motion with these leaves more than noise where others are left; the one that
//! its residuals point to is added, until the fit explains the record or no term takes enough. Terms that the record does not need are
//! taken out at the end.

use super::along::along_delays;
use super::away::{Away, endless};
use super::contact::{free, is_hopeless};
use super::fit::{Fit, SHORTEST_LAG, Shot};
use super::hints::{self, LIKELY, SURELY, Tried};
use super::parameters::{CHANGES, COGGING, GRAVITY, LATE, PARAMETERS, SPRING, VARIANCE};
use super::slopes::{Normal, scaled};
use crate::identified::Known;
use crate::record::{CancellableRecord, Record};

/// The most terms of a device: a fit with more than these takes the place of another device.
const MOST_TERMS: usize = 5;
/// The most terms that are added, and the steps of the fit with each.
const MOST_ADDED: usize = 6;
const STEPS: usize = 12;
const MANY: usize = 60;
/// Of this many shots or more one in some is fitted first, and of a long record at most so many are searched for terms.
const MANY_SHOTS: usize = 16;
const ONE_IN: usize = 4;
const MOST_SHOTS: usize = 64;
/// A term that takes less than this part of the squares beyond noise leads nowhere: of a few terms that are left the largest takes more.
const LEAST: f64 = 0.1;
/// And one with which they fall by less than this part of what was expected.
const TAKES: f64 = 0.2;
/// The torque follows the position where this part of its variance goes with it.
const FOLLOWS: f64 = 0.999;
/// Over a shorter travel, in rad, gravity is hardly more than a spring.
const SHORT_TRAVEL: f64 = 2.0;
/// A lag takes at least this part of the squares.
const LAG_TAKES: f64 = 0.01;
/// The lags from which fits start, as parts of the delay with the lag.
const LAGS: [f64; 2] = [0.5, 1.0];

/// The device without stops that explains a record by the terms that torque and motion show.
pub(super) fn search(record: &CancellableRecord<'_>, known: &Known) -> Option<Fit> {
    if !record.is_driven() || record.forces().is_some() {
        return None;
    }
    let springs = if follows_position(record) { &[false][..] } else { &[true, false] };
    let found = |spring: &bool| from_equation(record, known, endless(record, known, *spring)?, *spring);
    springs.iter().find_map(|spring| found(spring).filter(|fit| *spring || has_scale(record, fit)))
}

/// Whether a device without a spring has a scale: over a short travel gravity is a spring, and other terms stand for the rest of it.
fn has_scale(record: &Record, fit: &Fit) -> bool {
    let (low, high) =
        record.positions().iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, z| (a.0.min(*z), a.1.max(*z)));
    fit.free[GRAVITY] || high - low > SHORT_TRAVEL
}

/// Whether the torque is that of a spring of the loop: then inertia, losses and a spring of the device's own have one scale, which no record
/// tells, and the device has no spring.
fn follows_position(record: &Record) -> bool {
    let (positions, torques) = (record.positions(), record.torques());
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (z, torque) = (mean(positions), mean(torques));
    let sums = positions.iter().zip(torques).fold([0.0; 3], |[zz, zt, tt], (x, y)| {
        let (x, y) = (x - z, y - torque);
        [zz + x * x, zt + x * y, tt + y * y]
    });
    sums[1] * sums[1] > FOLLOWS * sums[0] * sums[2]
}

/// The same, from the device that the torque's equation shows.
fn from_equation(record: &CancellableRecord<'_>, known: &Known, away: Away, spring: bool) -> Option<Fit> {
    let tried = Tried { is_linear: known.is_linear, spring };
    let mut free = free(true, known.lag.is_some(), [false; 2]);
    free.iter_mut().zip(&away.more).for_each(|(free, more)| *free |= more);
    let all = Shot::all(record, record.first());
    let one_in = |n: usize| -> Vec<Shot> { all.iter().step_by(n).copied().collect() };
    let searched = all.len().div_ceil(MOST_SHOTS).max(1);
    let few = one_in(searched * if all.len() < MANY_SHOTS { 1 } else { ONE_IN });
    let begun = Fit::of(record, away.device, free, few)?.improved(record, STEPS)?;
    if is_hopeless(record, &begun) {
        return None;
    }
    let begun = Fit::of(record, begun.device, free, one_in(searched))?;
    let first = begun.mended(record).unwrap_or(begun).improved(record, STEPS)?;
    let mut short = added(record, tried, along_delays(record, settled(record, first, STEPS)?, STEPS)?)?;
    if searched > 1 {
        short = Fit::of(record, short.device, short.free, all)?.improved(record, STEPS)?;
    }
    // A longer lag makes a long motion nonlinear in the parameters, and is found from short ones.
    let long = short.clone().lengthened(record, MANY).or_else(|| late(record, &short)?.lengthened(record, MANY))?;
    let long = added(record, tried, long)?;
    let terms =
        |fit: &Fit| usize::from(fit.free[SPRING]) + fit.free[GRAVITY..].iter().step_by(2).filter(|is| **is).count();
    let long = along_delays(record, long, MANY)?;
    settled(record, long, MANY).filter(|fit| fit.is_right_by_choice(record) && terms(fit) <= MOST_TERMS)
}

/// The fit that explains the record, with the terms that its residuals point to; `None`: there is none.
fn added(record: &CancellableRecord<'_>, tried: Tried, fit: Fit) -> Option<Fit> {
    let mut at = fit;
    for _ in 0..MOST_ADDED {
        let is_right = at.is_right_by_choice(record);
        // A lag of some periods shows only in a fit with it.
        let found = next(record, tried, &at, is_right).or_else(|| if is_right { None } else { late(record, &at) });
        let Some(found) = found else { break };
        at = found;
    }
    let at = if at.is_right_by_choice(record) { at } else { at.improved(record, MANY)? };
    at.is_right_by_choice(record).then_some(at)
}

/// The fit with a lag, from a fit without one; `None`: it takes nothing.
fn late(record: &CancellableRecord<'_>, fit: &Fit) -> Option<Fit> {
    let mut free = fit.free;
    if std::mem::replace(&mut free[VARIANCE], true) {
        return None;
    }
    let start = |part: f64| {
        let mut device = fit.device;
        device.p[VARIANCE] = (part * device.p[LATE]).max(SHORTEST_LAG * record.period()).powi(2);
        Fit::of(record, device, free, fit.shots.clone())?.improved(record, STEPS)
    };
    let fits = LAGS.into_iter().filter_map(start).filter(|late| late.squares < (1.0 - LAG_TAKES) * fit.squares);
    fits.min_by(|a, b| a.squares.total_cmp(&b.squares))
}

/// The fit with one more term; `None`: none takes enough.
fn next(record: &CancellableRecord<'_>, tried: Tried, at: &Fit, is_right: bool) -> Option<Fit> {
    let (hint, amplitudes, squares) = hints::best(record, at, tried)?;
    let beyond = at.squares - at.left.len() as f64 * record.noise().powi(2);
    let least = (TAKES * squares).max(if is_right { 0.0 } else { LEAST * beyond });
    if squares < least {
        return None;
    }
    let (device, free) = hints::with(at.device, at.free, hint, amplitudes, record.period());
    let next = Fit::of(record, device, free, at.shots.clone())?;
    let takes = |next: &Fit| next.squares < at.squares - least;
    let next = next.mended(record).unwrap_or(next).improved(record, STEPS)?;
    if takes(&next) {
        return Some(next);
    }
    next.improved(record, MANY).filter(takes)
}

/// The fit without the terms that the record does not need.
fn settled(record: &CancellableRecord<'_>, fit: Fit, steps: usize) -> Option<Fit> {
    let mut at = fit.improved(record, steps)?;
    loop {
        let Some((least, part)) = weakest(&at) else { return Some(at) };
        if part > 1.0 {
            return Some(at);
        }
        let most = enough(&at, least) * at.variance();
        let (mut device, mut free) = (at.device, at.free);
        let end = if [SPRING, VARIANCE].contains(&least) { least } else { least + 1 };
        device.p[least..=end].fill(0.0);
        free[least..=end].fill(false);
        let next = Fit::of(record, device, free, at.shots.clone())?.improved(record, steps)?;
        if at.is_right_by_choice(record) && !next.is_right_by_choice(record) || next.squares - at.squares > most {
            return Some(at);
        }
        at = next;
    }
}

/// The squares that a term takes at least, in variances.
fn enough(fit: &Fit, term: usize) -> f64 {
    // Of a wave some harmonic has to be sure.
    let wave = if term >= CHANGES { CHANGES..PARAMETERS } else { COGGING..CHANGES };
    let has_others = term >= COGGING && wave.step_by(2).any(|i| i != term && fit.free[i]);
    if has_others || term == VARIANCE { LIKELY } else { SURELY }
}

/// The term without which the squares grow least, by their curvature, and by how much, as a part of what is enough.
fn weakest(fit: &Fit) -> Option<(usize, f64)> {
    let normal = Normal::of(&fit.slopes, 0.0, [0.0; 2]);
    let (matrix, scale) = scaled(&normal.information, fit.free, 0.0);
    let inverse = matrix.cholesky()?.inverse();
    let p = &fit.device.p;
    let at = |i: usize, j: usize| inverse[(i, j)] * scale[i] * scale[j];
    let single = |i: usize| p[i] * p[i] / at(i, i);
    let pair = |i: usize| {
        let (a, b, c) = (at(i, i), at(i, i + 1), at(i + 1, i + 1));
        (p[i] * p[i] * c - 2.0 * p[i] * p[i + 1] * b + p[i + 1] * p[i + 1] * a) / (a * c - b * b)
    };
    let singles = [SPRING, VARIANCE].into_iter().filter(|i| fit.free[*i]).map(|i| (i, single(i)));
    let waves = (GRAVITY..PARAMETERS).step_by(2);
    let pairs = waves.filter(|i| fit.free[*i]).map(|i| (i, pair(i)));
    let parts = singles.chain(pairs).map(|(i, squares)| (i, squares / (enough(fit, i) * fit.variance())));
    parts.min_by(|a, b| a.1.total_cmp(&b.1))
}
