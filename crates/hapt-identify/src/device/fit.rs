//! Fits of a puck with end stops or Stribeck friction to a record, by differences of its exact motion.
//!
//! Each turn at a stop multiplies the error before it, and after some turns the squares of one long run are no guide. So the motion begins
//! anew every [`SHOT`] s, from a position and a velocity of its own (multiple shooting; Bock 1983); the numbers of the device are common to
//! all shots.

use std::collections::VecDeque;

use rayon::prelude::*;

use super::parameters::{
    CHANGES, DAMPING, Device, FAST, FRICTION, Free, INERTIA, LATE, PARAMETERS, Parameters, RISE, STIFFNESS,
    STOP_DAMPING, STOPS, VARIANCE,
};
use super::slopes::{Column, Normal, OfShot, Slopes, Square, scaled};
use crate::explained::{NOTHING, explained, explained_by_choice};
use crate::record::{CancellableRecord, LONGEST_DELAY, Record};
use crate::start::{Begin, begins};

/// The length of a shot at first, in s, its least number of samples, and its final length.
const BEGINNING: f64 = 0.1;
const FEWEST: f64 = 50.0;
const SHOT: f64 = 0.4;

/// Shots begin where the mean velocities over this time before and after differ least for their size, in s.
const FLIGHT: f64 = 0.012;

const LOGARITHMS: [usize; 3] = [INERTIA, FAST, STIFFNESS];
pub(super) const NOT_BELOW_0: [usize; 6] = [DAMPING, FRICTION, LATE, VARIANCE, RISE, STOP_DAMPING];
/// The fit ends after this many steps that lower the squares by less than this part of their variance.
const FEW: usize = 2;
const SLOW: f64 = 0.01;
/// The largest mean number of tries per step.
const MOST_TRIES: usize = 4;
/// The next step is damped less where the squares fell by more than this part of what was predicted.
const PREDICTED: f64 = 0.5;
/// A step of less than this many standard errors counts as none.
const SMALL: f64 = 1e-3;
/// The shortest lag of a fit, in periods: a shorter one is a delay.
pub(crate) const SHORTEST_LAG: f64 = 0.1;
/// The fastest rate of a device that is followed, per period of the record.
const FASTEST: f64 = 60.0;
/// A shot with this many times the usual mean square begins at the wrong state; it begins anew by lines through this many more samples.
const ODD: f64 = 1.5;
const GLIMPSES: [usize; 3] = [2, 5, 12];
/// χ²'s quantile of 1 - 10⁻⁶ with two degrees of freedom, in variances: a shot that leaves more than its two parts and this is split again.
const PARTED: f64 = 27.6;
/// After this many lags a motor's torque no longer depends on an earlier one.
const MEMORY: f64 = 40.0;
/// Shots are joined where that leaves at most this many times the mean square of the others, before all are fitted anew.
const FAR: f64 = 1e4;
/// Shots may be this much longer; of those that are joined one in this many may diverge, and one more.
const LONGEST: f64 = 1.5;
const ASTRAY: usize = 4;
/// Shots are joined while an initial error grows by less than this: beyond, the motion is not linear in the error.
const MOST_GROWTH: f64 = 30.0;
/// Steps of a fit before the shots have their final length: the numbers are already close.
const STEPS_BETWEEN: usize = 4;
/// Steps of the fit of one beginning.
const OWN: usize = 25;
/// A derivative is a difference over this part of a number's size.
const DIFFERENCE: f64 = 1e-5;

/// A motion from an initial state of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Shot {
    /// Its samples, from the first to before the second.
    pub from: usize,
    pub to: usize,
    /// Position and velocity at the first of them.
    pub state: [f64; 2],
}

impl Shot {
    pub fn new(record: &Record, from: usize, to: usize) -> Self {
        let Begin { position, velocity } = begins(record, from)[1];
        Shot { from, to, state: [position, velocity] }
    }

    /// Its samples, from the first to before the second.
    pub fn span(&self) -> (usize, usize) {
        (self.from, self.to)
    }

    /// All of a record, from a sample on.
    pub fn all(record: &Record, first: usize) -> Vec<Shot> {
        let n = record.times().len();
        let length = BEGINNING.max(FEWEST * record.period());
        let count = (((n - first) as f64 * record.period() / length).round() as usize).max(1);
        let even = |k: usize| first + k * (n - first) / count;
        let around = (n - first) / count / 4;
        let at = |k: usize| match k {
            0 => first,
            k if k == count => n,
            k => steadiest(record, even(k) - around, even(k) + around),
        };
        let places: Vec<usize> = (0..=count).map(at).collect();
        places.windows(2).map(|pair| Shot::new(record, pair[0], pair[1])).collect()
    }

    /// The positions of the device at its samples, and which of its stops it runs into.
    pub fn positions(&self, record: &Record, device: &Device) -> (Vec<f64>, [bool; 2]) {
        let remembered = (device.p[LATE] + MEMORY * device.p[VARIANCE].max(0.0).sqrt()).min(LONGEST_DELAY);
        let before = self.from.saturating_sub((remembered / record.period()).ceil() as usize + 1);
        let mut all = Vec::with_capacity(self.to - self.from);
        let (times, torques) = (&record.times()[before..self.to], &record.torques()[before..self.to]);
        let touched = device.numbers(self.state).follow(times, torques, self.from - before, |_, z| all.push(z));
        (all, touched)
    }

    /// The number of its positions that are measurements.
    fn news(&self, record: &Record) -> usize {
        (self.from..self.to).filter(|i| record.is_news(*i)).count()
    }

    /// Its final state, which is the initial state of the next one.
    fn end(&self, record: &Record, device: &Device) -> Option<[f64; 2]> {
        let to = self.to.min(record.times().len() - 1);
        let (positions, _) = Shot { to: to + 1, ..*self }.positions(record, device);
        let [.., before, last] = positions[..] else { return None };
        Some([last, (last - before) / (record.times()[to] - record.times()[to - 1])])
    }

    /// Estimates of its initial state, by lines through more and more of its positions.
    fn glimpses(&self, record: &Record) -> impl Iterator<Item = [f64; 2]> {
        let of = |samples: usize| {
            let (from, to) = (self.from, (self.from + samples).min(self.to - 1));
            let (t, z) = (&record.times()[from..=to], &record.positions()[from..=to]);
            [z[0], (z[z.len() - 1] - z[0]) / (t[t.len() - 1] - t[0])]
        };
        GLIMPSES.map(of).into_iter()
    }

    /// The residuals of the positions that are measurements, and which of the stops it runs into.
    fn left(&self, record: &Record, device: &Device) -> (Vec<f64>, [bool; 2]) {
        let (positions, touched) = self.positions(record, device);
        let rows = positions.into_iter().zip(self.from..);
        (rows.filter(|(_, i)| record.is_news(*i)).map(|(z, i)| record.positions()[i] - z).collect(), touched)
    }
}

/// The square of the shortest lag of a fit.
pub(super) fn least_variance(record: &Record) -> f64 {
    (SHORTEST_LAG * record.period()).powi(2)
}

/// The sample between two where the velocity changes least for its size: in flight, and not in a stop or at rest, where an initial state is
/// hard to find.
fn steadiest(record: &Record, low: usize, high: usize) -> usize {
    let (times, positions) = (record.times(), record.positions());
    let half = ((FLIGHT / record.period()).round() as usize).max(2);
    let slope = |from: usize, to: usize| (positions[to] - positions[from]) / (times[to] - times[from]);
    let change = |i: usize| {
        let [before, after] = [slope(i - half, i), slope(i, i + half)];
        (after - before).abs() / (after + before).abs().max(f64::MIN_POSITIVE)
    };
    let inside = low.max(half)..high.min(positions.len() - half);
    inside.min_by(|a, b| change(*a).total_cmp(&change(*b))).unwrap_or(low)
}

/// A device, its motions, their residuals, and the derivatives.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    pub device: Device,
    pub free: Free,
    pub shots: Vec<Shot>,
    pub left: Vec<f64>,
    pub squares: f64,
    /// Which of the stops each shot runs into.
    touched: Vec<[bool; 2]>,
    /// The derivatives of each shot.
    pub(super) slopes: Vec<Slopes>,
}

impl Fit {
    pub fn of(record: &Record, device: Device, free: Free, shots: Vec<Shot>) -> Option<Fit> {
        // No record shows faster or larger numbers.
        let fastest = device.numbers([0.0; 2]).fastest();
        if fastest * record.period() >= FASTEST {
            return None;
        }
        let all: Vec<(Vec<f64>, [bool; 2])> = shots.par_iter().map(|shot| shot.left(record, &device)).collect();
        let left: Vec<f64> = all.iter().flat_map(|(left, _)| left.iter().copied()).collect();
        let touched = all.into_iter().map(|(_, touched)| touched).collect();
        let squares: f64 = left.iter().map(|r| r * r).sum();
        squares.is_finite().then_some(Fit { device, free, shots, left, squares, touched, slopes: Vec::new() })
    }

    /// The number of parameters that are fitted.
    fn fitted(&self) -> usize {
        self.free.iter().filter(|free| **free).count() + 2 * self.shots.len()
    }

    /// The first sample that is fitted.
    pub fn first(&self) -> usize {
        self.shots.first().map_or(0, |shot| shot.from)
    }

    pub fn freedom(&self) -> f64 {
        self.left.len().saturating_sub(self.fitted()).max(1) as f64
    }

    /// The residuals' variance.
    pub fn variance(&self) -> f64 {
        self.squares / self.freedom()
    }

    /// Whether counts and noise explain its residuals.
    pub fn is_right(&self, record: &Record) -> bool {
        explained(record, &self.left, record.lattice(), record.spread())
    }

    /// The same where its terms were chosen by its residuals.
    pub fn is_right_by_choice(&self, record: &Record) -> bool {
        explained_by_choice(record, &self.left, record.lattice(), record.spread())
    }

    /// The change of each parameter over which a derivative is taken.
    fn steps(&self, record: &Record) -> (Parameters, [f64; 2]) {
        let p = &self.device.p;
        let (spread, period) = (record.spread(), record.period());
        let torque = self.device.gain() * record.effort();
        let speed = (torque * spread / self.device.inertia()).sqrt();
        let [torque, speed] = [torque, speed].map(|x| x.max(f64::MIN_POSITIVE));
        let stop = (p[STIFFNESS].exp() * self.device.inertia()).sqrt();
        let mut sizes: Parameters = [torque; PARAMETERS];
        let first = [
            1.0,
            p[DAMPING].max(0.01 * torque / speed),
            p[FRICTION].max(0.01 * torque),
            torque,
            period,
            p[VARIANCE].max(period * period),
            p[RISE].max(0.01 * torque),
            1.0,
            0.1 * spread,
            0.1 * spread,
            1.0,
            p[STOP_DAMPING].max(0.1 * stop),
            torque / spread,
        ];
        sizes[..first.len()].copy_from_slice(&first);
        sizes[CHANGES..].fill(1.0);
        (sizes.map(|size| DIFFERENCE * size), [0.1 * spread, speed].map(|size| DIFFERENCE * size))
    }

    /// The same with better initial states of the shots whose residuals are far larger than the others': one that begins in a stop can end
    /// in a local minimum. `None`: there is none.
    pub fn mended(&self, record: &CancellableRecord<'_>) -> Option<Fit> {
        let squares = self.mean_squares(record);
        let usual = median(&squares);
        let mut shots = self.shots.clone();
        for (i, _) in squares.iter().enumerate().filter(|(_, square)| **square > ODD * usual) {
            let before = i.checked_sub(1).map(|before| shots[before]);
            let starts =
                before.and_then(|before| before.end(record, &self.device)).into_iter().chain(shots[i].glimpses(record));
            let fit = |state| {
                let shot = Shot { state, ..shots[i] };
                Fit::of(record, self.device, [false; PARAMETERS], vec![shot])?.improved(record, OWN)
            };
            let fits: Vec<Fit> = starts.collect::<Vec<_>>().into_par_iter().filter_map(fit).collect();
            if let Some(best) = fits.into_iter().min_by(|a, b| a.squares.total_cmp(&b.squares)) {
                shots[i] = best.shots[0];
            }
        }
        let mended = Fit::of(record, self.device, self.free, shots)?;
        (mended.squares < self.squares * (1.0 - SMALL)).then_some(mended)
    }

    /// The mean square of each shot's residuals.
    pub fn mean_squares(&self, record: &Record) -> Vec<f64> {
        let mut rest = &self.left[..];
        let of = |shot: &Shot| {
            let (own, after) = rest.split_at(shot.news(record));
            rest = after;
            own.iter().map(|r| r * r).sum::<f64>() / own.len().max(1) as f64
        };
        self.shots.iter().map(of).collect()
    }

    /// The factor by which an initial error grows in a shot, in the position, or in the velocity times the shot's length.
    fn growth(&self, record: &Record) -> f64 {
        let of = |(shot, slopes): (&Shot, &Slopes)| {
            let length = (shot.to - shot.from) as f64 * record.period();
            slopes.largest(PARAMETERS).max(slopes.largest(PARAMETERS + 1) / length)
        };
        self.shots.iter().zip(&self.slopes).map(of).fold(0.0, f64::max)
    }

    /// The fit of the longest shots over which the device is followed; `None`: many diverge, so that the device is another one, or none
    /// fits.
    pub fn lengthened(self, record: &CancellableRecord<'_>, most: usize) -> Option<Fit> {
        let mut fit = self;
        loop {
            match fit.joined(record)? {
                longer if longer.shots.len() < fit.shots.len() => fit = longer,
                _ => return fit.improved(record, most),
            }
        }
    }

    /// The fit of longer shots: each joins two, where the device explains both from one initial state. A long motion determines more, but
    /// its fit needs a close start. `None`: many diverge.
    fn joined(&self, record: &CancellableRecord<'_>) -> Option<Fit> {
        let squares = self.mean_squares(record);
        let usual = median(&squares);
        // Counts without noise give residuals of this size, and so small ones without counts are rounding, which grows with the length.
        let step = record.lattice().map_or(0.0, |lattice| lattice.step);
        let least = usual.max(step * step / 6.0).max((NOTHING * record.spread()).powi(2));
        let longest = (LONGEST * SHOT / record.period()) as usize;
        // Shots with the squares that they may leave, and the shots that they join.
        let (mut shots, mut parts) = (Vec::new(), Vec::new());
        let (mut at, mut tried, mut astray) = (0, 0, 0);
        let pair = |at: usize| {
            let one = self.shots.get(at)?;
            let other = self.shots.get(at + 1)?;
            (other.from == one.to && other.to - one.from <= longest).then_some((one, other))
        };
        let fit_of = |at: usize| {
            let (one, other) = pair(at)?;
            let starts = std::iter::once(one.state).chain(one.glimpses(record));
            let mut fits = starts.filter_map(|state| {
                let shot = Shot { to: other.to, state, ..*one };
                Fit::of(record, self.device, [false; PARAMETERS], vec![shot])?.improved(record, OWN)
            });
            fits.find(|fit| fit.squares <= FAR * least * fit.left.len() as f64)
        };
        let mut ahead: VecDeque<(usize, Option<Fit>)> = VecDeque::new();
        while let Some(one) = self.shots.get(at) {
            let other = pair(at);
            tried += usize::from(other.is_some());
            let fit = other.and_then(|_| {
                if ahead.front().is_none_or(|front| front.0 != at) {
                    // Most pairs are joined: as many at once as there are threads.
                    let next = (at..self.shots.len()).step_by(2).take(rayon::current_num_threads());
                    let next: Vec<usize> = next.collect();
                    ahead = next.into_par_iter().map(|at| (at, fit_of(at))).collect();
                }
                ahead.pop_front()?.1
            });
            astray += usize::from(other.is_some() && fit.is_none());
            let joined = fit.filter(|fit| fit.growth(record) < MOST_GROWTH).map(|fit| fit.shots[0]);
            let all = at..at + 1 + usize::from(joined.is_some());
            at = all.end;
            shots.push(joined.unwrap_or(*one));
            let of_parts = self.shots[all.clone()].iter().zip(&squares[all.clone()]);
            let sum = of_parts.map(|(shot, square)| square * shot.news(record) as f64).sum::<f64>();
            let largest = squares[all.clone()].iter().fold(least, |a, b| a.max(*b));
            parts.push((&self.shots[all], ODD * largest, sum + PARTED * least));
        }
        if shots.len() == self.shots.len() {
            return Some(self.clone()).filter(|_| astray <= tried / ASTRAY + 1);
        }
        let fit = Fit::of(record, self.device, self.free, shots)?.improved(record, STEPS_BETWEEN)?;
        let (squares, most) = (fit.mean_squares(record), tried / ASTRAY + 1);
        let all = || squares.iter().zip(&fit.shots).zip(&parts);
        let mut odd: Vec<bool> = all().map(|((square, _), (_, limit, _))| square > limit).collect();
        astray += odd.iter().filter(|odd| **odd).count();
        if astray > most {
            return None;
        }
        if !odd.contains(&true) && !fit.is_right(record) {
            // A few may be wrong by less.
            let of =
                |((square, shot), (_, _, sum)): ((&f64, &Shot), &(_, _, f64))| square * shot.news(record) as f64 > *sum;
            odd = all().map(of).collect();
            if odd.iter().filter(|odd| **odd).count() > most {
                return Some(fit);
            }
        }
        if !odd.contains(&true) {
            return Some(fit);
        }
        // Shots that diverged are split again.
        let kept = fit.shots.iter().zip(&parts).zip(&odd);
        let shots: Vec<Shot> =
            kept.flat_map(|((shot, (parts, ..)), odd)| if *odd { parts.to_vec() } else { vec![*shot] }).collect();
        Fit::of(record, self.device, self.free, shots)?.improved(record, STEPS_BETWEEN)
    }

    /// The fit with its derivatives.
    fn differentiated(mut self, record: &Record) -> Option<Fit> {
        let (steps, of_state) = self.steps(record);
        let mut rest = &self.left[..];
        let of_shots = self.shots.iter().zip(&self.touched).map(|(shot, touched)| {
            let (left, after) = rest.split_at(shot.news(record));
            rest = after;
            (shot, touched, left)
        });
        let of_shots: Vec<_> = of_shots.collect();
        let slopes = |(shot, touched, left): &(&Shot, &[bool; 2], &[f64])| {
            let mut rows = vec![[0.0; PARAMETERS + 2]; left.len()];
            let mut differ = |i: usize, shot: &Shot, device: &Device, step: f64| {
                for (row, (a, b)) in rows.iter_mut().zip(left.iter().zip(shot.left(record, device).0)) {
                    row[i] = (a - b) / step;
                }
            };
            // The numbers of a stop that it does not run into have no effect.
            let matters = |i: usize| match i {
                STIFFNESS | STOP_DAMPING => touched[0] || touched[1],
                i => STOPS.iter().zip(touched.iter()).all(|(stop, touched)| *stop != i || *touched),
            };
            for i in (0..PARAMETERS).filter(|i| self.free[*i] && matters(*i)) {
                let mut moved = self.device;
                moved.p[i] += steps[i];
                differ(i, shot, &moved, steps[i]);
            }
            for (i, step) in of_state.into_iter().enumerate() {
                let mut moved = **shot;
                moved.state[i] += step;
                differ(PARAMETERS + i, &moved, &self.device, step);
            }
            Slopes::new(rows, left)
        };
        let all = of_shots.par_iter().map(slopes).collect::<Option<_>>()?;
        self.slopes = all;
        Some(self)
    }

    /// The steps of Levenberg and Marquardt from here, this many at most.
    pub fn improved(self, record: &CancellableRecord<'_>, most: usize) -> Option<Fit> {
        let least = least_variance(record);
        let mut at = if self.slopes.is_empty() { self.differentiated(record)? } else { self };
        let scales = at.steps(record).1.map(|step| step / DIFFERENCE);
        let mut damping = 1e-3;
        let (mut steps, mut slow) = (0, 0);
        for _ in 0..MOST_TRIES * most {
            if (record.stop)() || steps == most {
                break;
            }
            // An initial state whose effect friction ends before it shows is not moved far.
            let held = scales.map(|scale| at.variance() / (scale * scale));
            let normal = Normal::of(&at.slopes, damping, held);
            let Some(step) = at.step(&normal.information, &normal.right, damping, least) else { break };
            let (mut size, mut predicted) = (step.dot(&(normal.information * step)), step.dot(&normal.right));
            let (mut device, mut shots) = (at.device, at.shots.clone());
            for (shot, OfShot { inverse, right, across }) in shots.iter_mut().zip(&normal.shots) {
                let own = inverse * (right - across * step);
                shot.state.iter_mut().zip(own.iter()).for_each(|(x, step)| *x += step);
                size += own.dot(right).abs();
                predicted += right.dot(&(inverse * right));
            }
            for (i, p) in device.p.iter_mut().enumerate() {
                // Large steps of the parameters that enter by logarithms lead nowhere.
                *p += if LOGARITHMS.contains(&i) { step[i].clamp(-1.0, 1.0) } else { step[i] };
            }
            NOT_BELOW_0.into_iter().for_each(|i| device.p[i] = device.p[i].max(0.0));
            device.p[LATE] = device.p[LATE].min(LONGEST_DELAY);
            if at.free[VARIANCE] {
                device.p[VARIANCE] = device.p[VARIANCE].clamp(least, LONGEST_DELAY.powi(2));
            }
            let is_small = size < SMALL * SMALL * at.variance();
            match Fit::of(record, device, at.free, shots) {
                Some(next) if next.squares < at.squares => {
                    slow = if at.squares - next.squares < SLOW * at.variance() { slow + 1 } else { 0 };
                    let is_as_predicted = at.squares - next.squares > PREDICTED * predicted;
                    at = next.differentiated(record)?;
                    steps += 1;
                    if is_as_predicted {
                        damping = (0.1 * damping).max(1e-12);
                    }
                    if is_small && damping < 1e-4 || slow == FEW {
                        break;
                    }
                }
                _ if is_small || damping > 1e9 => break,
                _ => damping *= 10.0,
            }
        }
        Some(at)
    }

    /// The next step, damped by Marquardt's `more`. A parameter that is at its least already, and would go below, stays while the others
    /// move.
    pub fn step(&self, information: &Square, right: &Column, more: f64, least: f64) -> Option<Column> {
        let mut free = self.free;
        let is_least = |i: usize| self.device.p[i] <= if i == VARIANCE { least } else { 0.0 };
        loop {
            let (matrix, scale) = scaled(information, free, more);
            let step = matrix.cholesky()?.solve(&right.component_mul(&scale)).component_mul(&scale);
            match NOT_BELOW_0.into_iter().find(|i| free[*i] && is_least(*i) && step[*i] < 0.0) {
                Some(i) => free[i] = false,
                None => return Some(step),
            }
        }
    }

    /// Whether the record depends on a parameter.
    pub fn sees(&self, i: usize) -> bool {
        self.free[i] && self.slopes.iter().any(|slopes| slopes.sees(i))
    }
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}
