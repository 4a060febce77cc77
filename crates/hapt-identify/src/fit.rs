//! The steps of Levenberg and Marquardt to the best fit.

use nalgebra::SVector;

use crate::explained::NOTHING;
use crate::factor::{Factor, Free, Rows, Square, without};
use crate::long_run::long_run;
use crate::puck::{DAMPING, DELAY, FRICTION, LAG, PARAMETERS, Puck};
use crate::record::{CancellableRecord, EARLIEST, LONGEST_DELAY, Record};

/// Parameters that a fit may hold at 0.
const HELD: [usize; 3] = [DAMPING, FRICTION, DELAY];

const MOST_STEPS: usize = 30;
/// The end of a fit is at most this many steps without damping, and at most this many in a row that lower no squares.
const MOST_LAST: usize = 12;
const MOST_ASIDE: usize = 3;
/// A step of less than this many standard errors counts as none.
const SMALL: f64 = 1e-3;
/// The shortest lag of a fit in periods of the record: its sensitivity is a difference, which would lose its digits.
pub(crate) const SHORTEST_LAG: f64 = 0.02;

/// A puck that fits, and the factor of its position errors.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fit {
    pub puck: Puck,
    pub factor: Factor,
    pub free: Free,
    /// The first sample that is fitted.
    pub first: usize,
}

impl Fit {
    /// The residuals' variance.
    pub fn variance(&self) -> f64 {
        self.factor.squares / self.freedom()
    }

    pub fn freedom(&self) -> f64 {
        let fitted = self.factor.seen(self.free).iter().filter(|seen| **seen).count();
        self.factor.rows.saturating_sub(fitted).max(1) as f64
    }

    /// The covariance of the estimates over the residuals' variance.
    pub fn inverse(&self) -> Option<Square> {
        self.factor.inverse(self.free)
    }

    /// The covariance of the estimates in units of which `unit` is the square of half an interval. Residuals that are correlated widen it,
    /// and never narrow it. In a valley that bends, a fit ends before the least squares: half an interval is then at least as long as the
    /// step that is left.
    pub fn covariance(&self, record: &Record, unit: f64) -> Option<Square> {
        let inverse = self.inverse()?;
        let wider = self.wider(record, &inverse);
        let own = Square::from_fn(|i, j| wider[i] * inverse[(i, j)] * wider[j]);
        let whole = SVector::from(self.whole(record).unwrap_or([0.0; PARAMETERS]));
        Some(own + whole * whole.transpose() / unit)
    }

    /// The factors by which correlated residuals widen the estimates' standard errors.
    fn wider(&self, record: &Record, inverse: &Square) -> [f64; PARAMETERS] {
        let mut scores: [Vec<f64>; PARAMETERS] = Default::default();
        self.puck.follow(record.times(), record.torques(), self.first, |i, z, dz| {
            if record.is_news(i) {
                let moved = inverse * SVector::from(*dz) * (record.positions()[i] - z);
                scores.iter_mut().zip(&moved).for_each(|(scores, moved)| scores.push(*moved));
            }
        });
        std::array::from_fn(|i| {
            let plain = self.variance() * inverse[(i, i)];
            if plain > 0.0 { (long_run(&scores[i]) / plain).sqrt().max(1.0) } else { 1.0 }
        })
    }

    /// Whether a step is less than a small part of the standard errors.
    fn is_small(&self, step: &[f64; PARAMETERS]) -> bool {
        self.factor.size(step) < SMALL * SMALL * self.variance()
    }

    /// The fit a step away, within the range of delay and lag; `None` where its motion is not finite.
    fn after(&self, record: &Record, step: &[f64; PARAMETERS]) -> Option<Fit> {
        let mut p = self.puck.parameters();
        p.iter_mut().zip(step).for_each(|(p, step)| *p += step);
        p[DELAY] = p[DELAY].clamp(-EARLIEST, LONGEST_DELAY);
        if self.free[LAG] {
            p[LAG] = p[LAG].clamp(least_variance(record), LONGEST_DELAY.powi(2));
        }
        let puck = Puck::from_parameters(p);
        Some(Fit { puck, factor: factor(record, &puck, self.first)?, ..*self })
    }

    /// The step to the least squares, as far as the motion is linear in the parameters, without those that are held at 0.
    pub fn whole(&self, record: &Record) -> Option<[f64; PARAMETERS]> {
        let p = self.puck.parameters();
        let free = std::array::from_fn(|i| self.free[i] && !(HELD.contains(&i) && p[i] == 0.0));
        step(record, &Fit { free, ..*self }, 0.0)
    }

    /// Whether the lag is the shortest of a fit.
    fn has_least_lag(&self, record: &Record) -> bool {
        self.free[LAG] && self.puck.parameters()[LAG] <= least_variance(record) * (1.0 + 1e-9)
    }
}

/// The factor of the position errors at `puck` from sample `first` on; `None` where the motion is not finite.
fn factor(record: &Record, puck: &Puck, first: usize) -> Option<Factor> {
    let mut rows = Rows::new();
    puck.follow(record.times(), record.torques(), first, |i, z, dz| {
        if record.is_news(i) {
            rows.add(dz, record.positions()[i] - z);
        }
    });
    let factor = rows.factor();
    factor.squares.is_finite().then_some(factor)
}

/// The puck nearest to `start` whose positions from sample `first` on have the least squared error, delay and lag together
/// between -10 ms and [`LONGEST_DELAY`].
pub(crate) fn fit(record: &CancellableRecord<'_>, start: Puck, free: Free, first: usize) -> Option<Fit> {
    let mut best = Fit { puck: start, factor: factor(record, &start, first)?, free, first };
    let mut damping = 1e-3;
    for _ in 0..MOST_STEPS {
        if (record.stop)() {
            break;
        }
        let Some(step) = step(record, &best, damping) else {
            damping = (10.0 * damping).max(1e-9);
            continue;
        };
        let is_small = best.is_small(&step);
        match best.after(record, &step) {
            Some(next) if next.factor.squares < best.factor.squares => {
                let is_last = is_small && damping < 1e-3;
                best = next;
                damping *= 0.1;
                if is_last {
                    break;
                }
            }
            _ if is_small => break,
            _ => damping = (10.0 * damping).max(1e-9),
        }
    }
    Some(ended(record, best))
}

/// The fit of nearly exact positions after steps without damping: a damped step is short in a direction of little information, however far
/// the least squares are along it. Where the valley of the squares bends, such a step leaves it, and the next one returns to it farther
/// along.
fn ended(record: &CancellableRecord<'_>, mut best: Fit) -> Fit {
    let (mut at, mut aside) = (best, 0);
    if best.variance() > (NOTHING * record.spread()).powi(2) {
        return best;
    }
    for _ in 0..MOST_LAST {
        if (record.stop)() || aside > MOST_ASIDE {
            break;
        }
        let Some(step) = at.whole(record).filter(|step| !at.is_small(step)) else { break };
        let Some(next) = at.after(record, &step) else { break };
        at = next;
        aside += 1;
        if at.factor.squares < best.factor.squares {
            (best, aside) = (at, 0);
        }
    }
    best
}

/// The square of the shortest lag of a fit.
pub(crate) fn least_variance(record: &Record) -> f64 {
    (SHORTEST_LAG * record.period()).powi(2)
}

/// The next step of a fit; a lag that is the shortest already, and would be shorter, stays while the others move.
fn step(record: &Record, at: &Fit, damping: f64) -> Option<[f64; PARAMETERS]> {
    let step = at.factor.step(at.free, damping)?;
    if !(at.has_least_lag(record) && step[LAG] < 0.0) {
        return Some(step);
    }
    at.factor.step(without(at.free, LAG), damping)
}
