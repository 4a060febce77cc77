//! The term that the residuals of a fit point to.
//!
//! A torque of the position moves each shot in its own way, which the linear equation about the fitted motion gives. The residuals are
//! projected onto that motion, beyond what the fitted numbers and the initial states can take (the score test; Rao 1948).

use nalgebra::{Matrix2, SMatrix, Vector2};
use rayon::prelude::*;

use super::field::HARMONICS;
use super::fit::{Fit, Shot};
use super::parameters::{
    CHANGES, COGGING, Device, FRICTION, Free, GRAVITY, LATE, OFFSET, PARAMETERS, SPRING, VARIANCE,
};
use super::slopes::{self, Normal, Slopes, scaled};
use crate::multiples::multiples;
use crate::record::CancellableRecord;
use crate::terms::{MOST_RUBS, MOST_TIMES, TRAVEL, common_rate};

/// χ²'s quantile of 1 - 10⁻⁶ with two degrees of freedom, in variances: a term that takes less is none.
pub(super) const SURELY: f64 = 27.6;
/// The same of 1 - 10⁻³, for a harmonic of a wave that the device has.
pub(super) const LIKELY: f64 = 13.8;
/// Fewer numbers that take this part of the squares are preferred.
const AS_MUCH: f64 = 0.8;
/// The lag of which the effect is tried, in periods.
const TRIED: f64 = 0.5;
/// A constant torque is friction by direction where this part of it, or more, changes with the position as friction does.
const BY_DIRECTION: f64 = 0.5;

type Across = SMatrix<f64, PARAMETERS, 2>;

/// A term that a device may have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Hint {
    Spring,
    /// A torque of this many periods a turn.
    Torque(u32),
    /// The same of friction.
    FrictionByPosition(u32),
    Lag,
    /// The constant torque is friction by direction, which changes with the position as friction does.
    FrictionByDirection,
}

/// Which terms are tried.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tried {
    /// The puck moves along a line: there are no turns.
    pub is_linear: bool,
    /// A spring of the device.
    pub spring: bool,
}

/// The sums of products of the motion that a unit of a term adds over one shot: with itself, with what the fitted numbers and the initial
/// state move, and with the residuals.
#[derive(Clone, Copy, Default)]
struct OfShot {
    own: Matrix2<f64>,
    across: Across,
    states: Matrix2<f64>,
    right: Vector2<f64>,
}

/// The same sums over all shots, beyond what the initial states take.
struct Candidate {
    hint: Hint,
    own: Matrix2<f64>,
    across: Across,
    right: Vector2<f64>,
}

/// The rates of the harmonics that a wave of a device has.
fn rates(device: &Device, at: usize, base: f64) -> Vec<u32> {
    let has = |n: &usize| device.p[at + 2 * n] != 0.0 || device.p[at + 2 * n + 1] != 0.0;
    (0..HARMONICS).filter(has).map(|n| (n + 1) as u32 * base.round() as u32).collect()
}

/// Whether a wave of this rate has such a harmonic.
fn is_multiple(n: u32, rate: f64) -> bool {
    rate >= 1.0 && n.is_multiple_of(rate.round() as u32)
}

/// The terms that a device may have in addition to its own, over a travel.
fn possible(device: &Device, free: Free, travel: f64, tried: Tried) -> Vec<Hint> {
    let mut hints = Vec::new();
    if !free[VARIANCE] {
        hints.push(Hint::Lag);
    }
    if tried.spring && !free[SPRING] {
        hints.push(Hint::Spring);
    }
    if tried.is_linear {
        return hints;
    }
    let least = (std::f64::consts::TAU / travel.max(f64::MIN_POSITIVE)).ceil().max(1.0) as u32;
    let [turns, rubs] = [(COGGING, device.places.cogging[0]), (CHANGES, device.places.changes[0])]
        .map(|(at, rate)| rates(device, at, rate));
    let is_new = |old: &[u32], n: u32| {
        old.iter().all(|old| old.abs_diff(n) >= least)
            && common_rate(old.iter().copied().chain([n]), HARMONICS as u32).is_some()
    };
    if travel > TRAVEL && !free[GRAVITY] {
        hints.push(Hint::Torque(1));
    }
    // Harmonics of a wave may be faster than the fastest wave that is looked for.
    let tried = |from: u32, most: u32, rate: f64| {
        let rate = rate.round() as u32;
        (from..=most).chain((1..=HARMONICS as u32).map(move |n| n * rate).filter(move |n| *n > most))
    };
    let turning = tried(least.max(2), MOST_TIMES, device.places.cogging[0]);
    hints.extend(turning.filter(|n| is_new(&turns, *n)).map(Hint::Torque));
    if device.p[FRICTION] > 0.0 {
        let rubbing = tried(least, MOST_RUBS, device.places.changes[0]);
        hints.extend(rubbing.filter(|n| is_new(&rubs, *n)).map(Hint::FrictionByPosition));
    }
    if !rubs.is_empty() && !device.places.offset_is_friction && device.p[OFFSET] != 0.0 {
        hints.push(Hint::FrictionByDirection);
    }
    hints
}

/// The device with one more term, of these amplitudes.
pub(super) fn with(
    mut device: Device,
    mut free: Free,
    hint: Hint,
    amplitudes: [f64; 2],
    period: f64,
) -> (Device, Free) {
    let mut wave = |device: &mut Device, at: usize, place: fn(&mut Device) -> &mut [f64; 2], n: u32| {
        let rate = place(device)[0];
        let (old, was) = (rates(device, at, rate), rate.round() as u32);
        let Some(base) = common_rate(old.iter().copied().chain([n]), HARMONICS as u32) else { return };
        let parts: Vec<(u32, [f64; 2])> = old
            .iter()
            .map(|rate| {
                let from = at + 2 * (rate / was - 1) as usize;
                (*rate, [device.p[from], device.p[from + 1]])
            })
            .chain([(n, amplitudes)])
            .collect();
        device.p[at..at + 2 * HARMONICS].fill(0.0);
        free[at..at + 2 * HARMONICS].fill(false);
        for (rate, part) in parts {
            let to = at + 2 * (rate / base - 1) as usize;
            (device.p[to], device.p[to + 1]) = (part[0], part[1]);
            (free[to], free[to + 1]) = (true, true);
        }
        *place(device) = [f64::from(base), 0.0];
    };
    match hint {
        Hint::Torque(1) => {
            (device.p[GRAVITY], device.p[GRAVITY + 1]) = (amplitudes[0], amplitudes[1]);
            (free[GRAVITY], free[GRAVITY + 1]) = (true, true);
        }
        Hint::Torque(n) => wave(&mut device, COGGING, |device| &mut device.places.cogging, n),
        Hint::FrictionByPosition(n) => wave(&mut device, CHANGES, |device| &mut device.places.changes, n),
        Hint::Spring => (device.p[SPRING], free[SPRING]) = (amplitudes[0], true),
        Hint::Lag => {
            let least = (TRIED * period).powi(2);
            (device.p[VARIANCE], free[VARIANCE]) =
                (amplitudes[0].clamp(least, device.p[LATE].powi(2).max(least)), true);
        }
        Hint::FrictionByDirection => device.places.offset_is_friction = true,
    }
    (device, free)
}

/// The term that takes most of the squares, with its amplitudes and these squares; `None`: none takes enough.
pub(super) fn best(record: &CancellableRecord<'_>, fit: &Fit, tried: Tried) -> Option<(Hint, [f64; 2], f64)> {
    let positions = record.positions();
    let (low, high) = positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, z| (a.0.min(*z), a.1.max(*z)));
    let device = &fit.device;
    let hints = possible(device, fit.free, high - low, tried);
    let mut lagged = *device;
    lagged.p[VARIANCE] = (TRIED * record.period()).powi(2);
    let fastest = hints.iter().map(|hint| match *hint {
        Hint::Torque(n) | Hint::FrictionByPosition(n) => n,
        Hint::Spring | Hint::Lag | Hint::FrictionByDirection => 0,
    });
    let fastest = fastest.max().unwrap_or(0);
    let normal = Normal::of(&fit.slopes, 0.0, [0.0; 2]);
    let mut rest = &fit.left[..];
    let of_shots = fit.shots.iter().zip(&fit.slopes).zip(&normal.shots).map(|((shot, slopes), own)| {
        let (left, after) = rest.split_at(slopes.rows.len());
        rest = after;
        (shot, slopes, own, left)
    });
    let of_shots: Vec<_> = of_shots.collect();
    // What each candidate takes of a shot beyond what the shot's initial state takes.
    let taken = |&(shot, slopes, own, left): &(&Shot, &Slopes, &slopes::OfShot, &[f64])| -> Vec<_> {
        let path = Path {
            from: shot.span().0,
            places: shot.positions(record, device).0,
            late: hints.contains(&Hint::Lag).then(|| shot.positions(record, &lagged).0),
            fastest,
        };
        let beyond = |OfShot { own: product, across, states, right }: OfShot| {
            let taken = own.inverse * states;
            let across = across - own.across.tr_mul(&taken);
            (product - states.tr_mul(&taken), across, right - taken.tr_mul(&own.right))
        };
        path.moves(record, fit, slopes.rows.iter().zip(left), &hints).into_iter().map(beyond).collect()
    };
    let taken: Vec<Vec<_>> = of_shots.par_iter().map(taken).collect();
    let none = |hint: &Hint| Candidate {
        hint: *hint,
        own: Matrix2::zeros(),
        across: Across::zeros(),
        right: Vector2::zeros(),
    };
    let mut all: Vec<Candidate> = hints.iter().map(none).collect();
    for taken in taken {
        for (candidate, (own, across, right)) in all.iter_mut().zip(taken) {
            candidate.own += own;
            candidate.across += across;
            candidate.right += right;
        }
    }
    let (matrix, scale) = scaled(&normal.information, fit.free, 0.0);
    let inverse = matrix.cholesky()?;
    let of = |candidate: &Candidate| {
        let mut across = candidate.across;
        across.column_iter_mut().for_each(|mut column| column.component_mul_assign(&scale));
        let taken = inverse.solve(&across);
        let marginal = candidate.own - across.tr_mul(&taken);
        let right = candidate.right - taken.tr_mul(&normal.right.component_mul(&scale));
        let eigen = marginal.symmetric_eigen();
        let (mut squares, mut amplitudes) = (0.0, Vector2::zeros());
        for (i, value) in eigen.eigenvalues.iter().enumerate() {
            // What the numbers and the states do too is left out.
            if *value > 1e-4 * candidate.own.trace() {
                let along = eigen.eigenvectors.column(i).dot(&right);
                squares += along * along / value;
                amplitudes += eigen.eigenvectors.column(i) * (along / value);
            }
        }
        (candidate.hint, [amplitudes.x, amplitudes.y], squares)
    };
    let is_physical = |(hint, amplitudes, _): &(Hint, [f64; 2], f64)| match hint {
        Hint::Lag => amplitudes[0] > 0.0,
        Hint::FrictionByDirection => amplitudes[0] > BY_DIRECTION,
        Hint::Spring | Hint::Torque(_) | Hint::FrictionByPosition(_) => true,
    };
    // The harmonics of a wave are few.
    let is_harmonic = |hint: Hint| match hint {
        Hint::Torque(n) => n > 1 && is_multiple(n, device.places.cogging[0]),
        Hint::FrictionByPosition(n) => is_multiple(n, device.places.changes[0]),
        Hint::Lag | Hint::FrictionByDirection => true,
        Hint::Spring => false,
    };
    let enough = |hint: Hint| if is_harmonic(hint) { LIKELY } else { SURELY } * fit.variance();
    let found: Vec<_> = all.iter().map(of).filter(|x| is_physical(x) && x.2 > enough(x.0)).collect();
    let best = found.iter().max_by(|a, b| a.2.total_cmp(&b.2))?;
    // Of those that take nearly as much, the one with the fewest numbers: friction by direction moves the puck as a torque with the period
    // of its changes does. Then the slowest of the same kind: counts and noise hide the period of fast ones.
    let alike = found.iter().filter(|x| x.2 > AS_MUCH * best.2);
    let order = |hint: Hint| match (best.0, hint) {
        (_, Hint::FrictionByDirection) => 0,
        (Hint::Torque(_), Hint::Torque(n)) | (Hint::FrictionByPosition(_), Hint::FrictionByPosition(n)) => n,
        _ => u32::MAX,
    };
    alike.min_by_key(|x| (order(x.0), x.0 != best.0)).copied()
}

/// The fitted motion of one shot.
struct Path {
    /// Its first sample.
    from: usize,
    /// The positions at its samples.
    places: Vec<f64>,
    /// The same with the lag that is tried.
    late: Option<Vec<f64>>,
    /// The most periods in a turn of a term.
    fastest: u32,
}

impl Path {
    /// The motion that a unit of each term adds along this path, as its sums; `news` are the derivatives of the fitted numbers at the measured
    /// samples, and the residuals there.
    fn moves<'a>(
        &self,
        record: &CancellableRecord<'_>,
        fit: &Fit,
        mut news: impl Iterator<Item = (&'a [f64; PARAMETERS + 2], &'a f64)>,
        hints: &[Hint],
    ) -> Vec<OfShot> {
        let device = &fit.device;
        let numbers = device.numbers([0.0; 2]);
        let per = device.inertia().recip();
        let square = (TRIED * record.period()).powi(2);
        let mut sums = vec![OfShot::default(); hints.len()];
        // The added position and velocity.
        let mut added = vec![[Vector2::zeros(); 2]; hints.len()];
        for (k, z) in self.places.iter().enumerate() {
            if let Some(before) = k.checked_sub(1).map(|before| self.places[before]) {
                let h = record.times()[self.from + k] - record.times()[self.from + k - 1];
                let middle = 0.5 * (before + z);
                let direction = if *z == before { 0.0 } else { (z - before).signum() };
                let slope = numbers.waves.field(middle, -numbers.friction * direction).slope - numbers.waves.spring;
                let decay = (-numbers.damping * h).exp();
                let turns = multiples(middle, self.fastest);
                let by_direction = per * device.p[OFFSET] * numbers.waves.changes_at(middle);
                for (hint, [place, speed]) in hints.iter().zip(&mut added) {
                    let push = match *hint {
                        Hint::Spring => Vector2::new(-per * (middle - device.places.middle), 0.0),
                        Hint::Torque(n) => per * turns[n as usize],
                        Hint::FrictionByPosition(n) => -numbers.friction * direction * turns[n as usize],
                        Hint::FrictionByDirection => Vector2::new(by_direction, 0.0),
                        Hint::Lag => {
                            if let Some(late) = &self.late {
                                *place = Vector2::new((late[k] - z) / square, 0.0);
                            }
                            continue;
                        }
                    };
                    if direction == 0.0 {
                        *speed = Vector2::zeros();
                        continue;
                    }
                    let before = *speed;
                    *speed = decay * (before + h * (push + slope * (*place + 0.5 * h * before)));
                    *place += 0.5 * h * (before + *speed);
                }
            }
            if record.is_news(self.from + k)
                && let Some((row, left)) = news.next()
            {
                for (sum, [place, _]) in sums.iter_mut().zip(&added) {
                    sum.own += *place * place.transpose();
                    sum.right += *place * *left;
                    for i in (0..PARAMETERS).filter(|i| fit.free[*i]) {
                        sum.across[(i, 0)] += row[i] * place.x;
                        sum.across[(i, 1)] += row[i] * place.y;
                    }
                    for i in 0..2 {
                        sum.states[(i, 0)] += row[PARAMETERS + i] * place.x;
                        sum.states[(i, 1)] += row[PARAMETERS + i] * place.y;
                    }
                }
            }
        }
        sums
    }
}
