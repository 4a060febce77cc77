//! The whole answer: values with intervals, and the fit that they come from.

use std::cmp::Ordering;

use crate::answer::Answer;
use crate::bound::Bounded;
use crate::counts::{Lattice, lattice};
use crate::explained::explained;
use crate::fit::{Fit, Free, fit};
use crate::position::{PositionTorque, of_position};
use crate::puck::{DELAY, FRICTION, OFFSET, Puck};
use crate::record::{LONGEST_DELAY, Record};
use crate::start::{Begin, begins, direction, starts};
use crate::{Error, Left};

/// Two estimates that go up and down together by more than this cannot be told apart.
pub(crate) const TWINS: f64 = 0.99;
/// What the fit leaves of the positions' variance, where it explains nothing.
const UNEXPLAINED: f64 = 0.25;
/// So many standard errors longer the delay is not, and so many of the constant torque are surely one.
const SURELY: f64 = 5.0;
/// What a fit over more samples leaves is no more than this times as much, where it is the same motion.
const ALIKE: f64 = 1.2;
/// A torque that goes with the position is to blame where it explains more than this part of what is left.
const MOST: f64 = 0.9;
/// Parts of the record that are fitted before all of it, where a fit of all of it goes wrong.
const BEGINNINGS: [f64; 3] = [0.125, 0.25, 0.5];
/// Where those go wrong too: so many starts around the best, each number off by up to this part of itself.
const HOPS: usize = 12;
const AROUND: [f64; 3] = [0.3, 0.1, 0.03];

/// What is known beforehand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Known {
    /// J in kg·m² (linear: kg): then the motor's gain is found in its place, and a coast-down gives damping and friction.
    pub inertia: Option<f64>,
    /// The positions are linear: their lattice is no part of a turn.
    pub is_linear: bool,
}

/// A value with its 95 % interval.
///
/// Damping, friction and delay are 0 or more, and so are their values and ends. An interval that begins at 0 says that there may be none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The likeliest.
    pub value: f64,
    /// From here
    pub low: f64,
    /// to here.
    pub high: f64,
}

/// Two parameters that the record cannot tell apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Twins {
    /// inertia, damping, friction or delay.
    pub names: [&'static str; 2],
    /// Of their estimates, from -1 to 1.
    pub correlation: f64,
}

/// What the fit leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Residual {
    /// Root mean square, in rad (linear: m).
    pub rms: f64,
    /// Correlation of neighbours: about 0 where only noise is left.
    pub correlation: f64,
}

/// What a record says about a device. `None`: nothing. Damping, friction and delay are also `None` where they are surely below 0, which no
/// device has.
#[derive(Clone, Debug, PartialEq)]
pub struct Identified {
    /// J in kg·m² (linear: kg).
    pub inertia: Option<Interval>,
    /// b in N·m·s/rad (N·s/m).
    pub damping: Option<Interval>,
    /// Coulomb's, in N·m (N).
    pub friction: Option<Interval>,
    /// From the sample to the change of the torque, in s.
    pub delay: Option<Interval>,
    /// 1 where a positive torque makes the position grow, else -1.
    pub sign: Option<Interval>,
    /// A constant torque on the puck that nobody asked for, in N·m (N): a motor's offset, a tilted table. `None` where the record does not
    /// tell it from friction.
    pub offset: Option<Interval>,
    /// The true torque per commanded torque, where the inertia is known beforehand.
    pub gain: Option<Interval>,
    /// The encoder's counts a revolution, a whole number; none for a linear device.
    pub counts: Option<Interval>,
    /// The lattice of the positions, in rad (m).
    pub lattice: Option<Lattice>,
    /// b/J in 1/s and f/J in rad/s² (m/s²): what a coast-down shows.
    pub rates: [Option<Interval>; 2],
    /// The fit itself, with damping, friction and delay of 0 or more wherever that explains the record.
    pub puck: Puck,
    /// The first sample that is fitted.
    pub first: usize,
    /// What it leaves.
    pub residual: Residual,
    /// A torque in what is left that goes with the position, which the equation has not.
    pub unmodelled: Option<PositionTorque>,
    /// The positions' standard deviation, in rad (m).
    pub spread: f64,
    /// Whether what is left is rounding: a simulation without noise.
    pub is_exact: bool,
    /// Largest over smallest eigenvalue of the estimates' correlations.
    pub condition: f64,
    /// Those that cannot be told apart.
    pub twins: Vec<Twins>,
}

/// Fits the puck to a record.
///
/// # Errors
/// [`Error::Unexplained`] where no puck explains the motion, [`Error::Left`] where one does, but not to within counts and noise.
pub fn identify(record: &Record, known: &Known) -> Result<Identified, Error> {
    let starts = starts(record);
    let first = best(record, &starts);
    let is_right = |fit: &Fit| explained(record, &left(record, fit), lattice(record.positions()), spread(record, fit));
    let better = |fit: Option<Fit>, starts: &dyn Fn() -> Vec<Puck>| match fit.filter(is_right) {
        None => fit.into_iter().chain(best(record, &starts())).min_by(by_variance),
        right => right,
    };
    // A long record holds a fit far from its best: what its beginning leads to, and then what lies around the best so far.
    let mut best = better(first, &|| again(record, &starts)).ok_or(Error::Unexplained)?;
    let blamed = |fit: &Fit| of_position(record, fit, known).filter(|x| (MOST..=1.0).contains(&x.explains));
    for part in AROUND {
        if is_right(&best) || blamed(&best).is_some() {
            break;
        }
        best = around(record, &best, part);
    }
    let rms = residual(&left(record, &best)).rms;
    let explains = rms.powi(2) < UNEXPLAINED * spread(record, &best).powi(2);
    let delay_is_inside = best.puck.delay < LONGEST_DELAY;
    if !(explains && delay_is_inside && best.puck.gain.is_finite()) {
        return Err(Error::Unexplained);
    }
    if !is_right(&best) {
        let counts = lattice(record.positions()).map(|lattice| rms / lattice.step);
        return Err(Error::Left(Left { rms, counts, position: blamed(&best) }));
    }
    let bounded = Bounded::new(record, best);
    let residual = residual(&left(record, &bounded.fit));
    let spread = spread(record, &bounded.fit);
    Ok(Answer::new(bounded, known).identified(record, residual, spread))
}

fn by_variance(a: &Fit, b: &Fit) -> Ordering {
    a.variance().total_cmp(&b.variance())
}

/// The standard deviation of the positions that are fitted.
fn spread(record: &Record, fit: &Fit) -> f64 {
    variance(&record.positions()[fit.first..]).sqrt()
}

/// Which parameters are fitted.
fn free(record: &Record, offset: bool) -> Free {
    let is_driven = record.is_driven();
    [is_driven, true, true, is_driven, offset, true, true]
}

/// What fits of longer and longer beginnings of the record lead to, from each start and from the same without friction.
fn again(record: &Record, starts: &[Puck]) -> Vec<Puck> {
    let beginnings: Vec<Record> = BEGINNINGS.iter().filter_map(|part| record.beginning(*part)).collect();
    let lead = |start: Puck| {
        beginnings.iter().fold(start, |puck, part| {
            let found = fit(part, puck, free(record, record.is_driven()), part.first()).map_or(puck, |fit| fit.puck);
            Puck { damping: found.damping.max(0.0), friction: found.friction.max(0.0), ..found }
        })
    };
    starts.iter().flat_map(|start| [lead(*start), lead(Puck { friction: 0.0, ..*start })]).collect()
}

/// The best of the fits that start around one, each of its numbers off by up to this part of itself.
fn around(record: &Record, best: &Fit, part: f64) -> Fit {
    // xorshift64 (Marsaglia 2003): the same places each time.
    let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
    let mut off = || {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        part * (2.0 * (seed >> 11) as f64 / (1u64 << 53) as f64 - 1.0)
    };
    let mut found = *best;
    for _ in 0..HOPS {
        let Puck { gain, damping, friction, delay, offset, position, velocity } = found.puck;
        let start = Puck {
            gain: gain * (1.0 + 0.1 * off()),
            damping: damping * (1.0 + off()),
            friction: friction * (1.0 + off()),
            delay: delay + 0.1 * LONGEST_DELAY * off(),
            offset: if found.free[OFFSET] { offset + friction.abs().max(offset.abs()) * off() } else { 0.0 },
            position,
            velocity: velocity * (1.0 + off()),
        };
        found = fit(record, start, found.free, found.first)
            .into_iter()
            .fold(found, |a, b| if b.variance() < a.variance() { b } else { a });
    }
    found
}

/// The fit over all of the record that can be used, with a constant torque where it shows.
fn best(record: &Record, starts: &[Puck]) -> Option<Fit> {
    let is_driven = record.is_driven();
    let with = |offset: bool| {
        let free = free(record, offset);
        let fits = starts.iter().filter_map(|start| {
            // Of a puck that goes one way a constant torque is friction, which may then be below 0.
            let friction = start.friction - direction(record) * start.offset;
            let start = if offset { *start } else { Puck { offset: 0.0, friction, ..*start } };
            fit(record, start, free, record.first())
        });
        let best = fits.min_by(|a, b| a.normal.squares.total_cmp(&b.normal.squares))?;
        // What no puck can have, the one loss below 0 and the other far too large, is where fits get stuck.
        let shared = shared(record, &best.puck).and_then(|start| fit(record, start, free, record.first()));
        Some(shared.filter(|fit| fit.normal.squares < best.normal.squares).unwrap_or(best))
    };
    // Of a puck that goes one way friction is a constant torque.
    let offset = if is_driven { with(true) } else { None };
    let late = match offset {
        Some(fit) if tells_offset(&fit) => fit,
        // Hardly told from friction, and yet there: without it the fit leaves surely more.
        Some(fit) => with(false)
            .filter(|none| none.normal.squares - fit.normal.squares < SURELY.powi(2) * fit.variance())
            .unwrap_or(fit),
        None => with(false)?,
    };
    Some(earlier(record, &late).unwrap_or(late))
}

/// The puck whose one loss is below 0, half of the other's work given to that one; `None` where neither is.
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

/// Whether the record tells the constant torque from friction.
pub(crate) fn tells_offset(fit: &Fit) -> bool {
    let Some(covariance) = fit.inverse() else { return false };
    let size = (covariance[(FRICTION, FRICTION)] * covariance[(OFFSET, OFFSET)]).sqrt();
    covariance[(FRICTION, OFFSET)].abs() <= TWINS * size
}

/// The same fit from the first sample on by which every torque of this delay has been recorded: what a rest before the first step says of
/// the first position counts as much as any motion. `None` where that is no earlier, or where those samples are of another motion.
fn earlier(record: &Record, late: &Fit) -> Option<Fit> {
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

/// The positions of a fit, from sample `first` on.
fn fitted(record: &Record, puck: &Puck, first: usize) -> Vec<f64> {
    let mut fitted = Vec::new();
    puck.follow(record.times(), record.torques(), first, |_, z, _| fitted.push(z));
    fitted
}

fn variance(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / values.len() as f64
}

/// What a fit leaves of the positions that are news.
fn left(record: &Record, fit: &Fit) -> Vec<f64> {
    let at = |(i, z): (usize, f64)| record.is_news(fit.first + i).then(|| record.positions()[fit.first + i] - z);
    fitted(record, &fit.puck, fit.first).into_iter().enumerate().filter_map(at).collect()
}

fn residual(left: &[f64]) -> Residual {
    let squares: f64 = left.iter().map(|r| r * r).sum();
    let neighbours: f64 = left.windows(2).map(|pair| pair[0] * pair[1]).sum();
    let correlation = if squares > 0.0 { neighbours / squares } else { 0.0 };
    Residual { rms: (squares / left.len() as f64).sqrt(), correlation }
}

impl Identified {
    /// The position errors that are left, with their times, from the first sample that is fitted on.
    pub fn residuals(&self, record: &Record) -> Vec<(f64, f64)> {
        let rows = self.fitted(record).into_iter().zip(&record.positions()[self.first..]);
        rows.map(|((t, z), y)| (t, y - z)).collect()
    }

    /// The positions that the fit gives, with their times.
    pub fn fitted(&self, record: &Record) -> Vec<(f64, f64)> {
        record.times()[self.first..].iter().copied().zip(fitted(record, &self.puck, self.first)).collect()
    }
}

impl Interval {
    /// Whether a value is in it.
    pub fn covers(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }
}
