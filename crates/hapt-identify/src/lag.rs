//! The motor's lag, as a record determines it.
//!
//! A lag λ and a delay d both make the torque late. For slow changes only their sum has an effect, the mean time from a command to its
//! torque; the further effect of a lag is proportional to λ², the variance of that time: it moves the puck by α λ²/2 of the torque. So mean
//! and variance are fitted, and the record separates lag from delay where the variance is certainly above 0.

use crate::bound::Bounded;
use crate::fit::{Fit, SHORTEST_LAG, fit};
use crate::interval::Interval;
use crate::puck::{DELAY, LAG, Puck};
use crate::quantile::student;
use crate::record::{CancellableRecord, LONGEST_DELAY, Record};
use crate::remainder::{error_variance, is_right as explains};
use crate::start::{Begin, begins};

/// After this many lags a torque has reached its command.
const ARRIVED: f64 = 8.0;
/// The number of standard errors that counts as certain, for the time to the torque.
const SURELY: f64 = 5.0;
/// A lag is separated from a delay where λ² is this many half intervals, or 5 standard errors: a lower limit would find a lag where there
/// is none, once in a few thousand records, and a delay that is too short by it.
const TOLD: f64 = 2.6;
/// From this many half intervals on, one standard error, the other numbers are those of the fit with a lag: without it they would be
/// biased.
const SEEN: f64 = 0.5;

/// A fit whose motor lags.
#[derive(Clone, Debug)]
pub(crate) struct Lag {
    pub fit: Fit,
    late: Late,
}

/// The lateness of the torque: d + λ and λ², with their half intervals.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Late {
    /// λ² with its half interval, and the same of d + λ, in s.
    variance: [f64; 2],
    mean: [f64; 2],
    /// The slope of d + λ over λ², and the half interval of the rest.
    slope: f64,
    rest: f64,
}

impl Lag {
    /// The fit from the best one without a lag; `None` where there is no torque to lag. A fit that is right without one is near the best
    /// with one: a short lag first shows whether there is any. `likely`: a lag to start from before all others.
    pub fn new(record: &CancellableRecord<'_>, best: &Fit, is_right: bool, likely: Option<f64>) -> Option<Self> {
        if !record.is_driven() || !best.puck.delay.is_finite() {
            return None;
        }
        let mut found: Option<Lag> = None;
        let short = 0.5 * record.period();
        let longer = [0.5, 1.0].map(|part| part * best.puck.delay).into_iter().filter(|lag| !is_right && *lag > short);
        // The last start has a lag with next to no effect: no fit of more parameters is worse than the one without them.
        let least = SHORTEST_LAG * record.period();
        for lag in likely.into_iter().chain([short]).chain(longer).chain([least]) {
            let is_better = |lag: &Lag| lag.fit.factor.squares <= best.factor.squares;
            // With a fit that is wrong without a lag, a determined lag may still be shorter than the best.
            if found
                .as_ref()
                .is_some_and(|found| is_better(found) && (is_right && found.is_determined() || lag == least))
            {
                break;
            }
            let start = Puck { lag, delay: best.puck.delay - lag, ..best.puck };
            let more = fit(record, start, free(best), best.first).and_then(|fit| Lag::of(record, fit));
            found = match (found, more) {
                (Some(a), Some(b)) if b.fit.variance() < a.fit.variance() => Some(b),
                (a, b) => a.or(b),
            };
        }
        let found = found?;
        if is_right && !found.is_determined() {
            return Some(found);
        }
        // Torques from before the first sample of the fit still act through the lag, and are unknown.
        let arrives = found.fit.puck.delay.max(0.0) + ARRIVED * found.fit.puck.lag + SURELY * found.late.mean[1];
        let first = record.first_after(arrives.min(LONGEST_DELAY));
        if first <= found.fit.first {
            return Some(found);
        }
        let late = begins(record, first).into_iter().filter_map(|Begin { position, velocity }| {
            fit(record, Puck { position, velocity, ..found.fit.puck }, found.fit.free, first)
        });
        let late =
            late.min_by(|a, b| a.factor.squares.total_cmp(&b.factor.squares)).and_then(|fit| Lag::of(record, fit));
        // A fit that starts where the record is less clear may stop far from the best.
        late.filter(|late| explains(record, &late.fit) || !explains(record, &found.fit)).or(Some(found))
    }

    fn of(record: &Record, fit: Fit) -> Option<Self> {
        let factor = student(fit.freedom()) * error_variance(record, &fit).sqrt();
        let covariance = fit.covariance(record, factor * factor)?;
        let of = |i: usize| covariance[(i, i)].max(0.0).sqrt();
        let p = fit.puck.parameters();
        let is_least = fit.puck.lag < 2.0 * SHORTEST_LAG * record.period();
        let variance = [if is_least { 0.0 } else { p[LAG] }, factor * of(LAG)];
        let mean = [p[DELAY], factor * of(DELAY)];
        let late = Late::new(mean, variance, covariance[(DELAY, LAG)] / covariance[(LAG, LAG)])?;
        Some(Lag { fit, late })
    }

    /// The same fit within the bounds.
    pub fn bounded(&self, record: &CancellableRecord<'_>) -> Bounded {
        Bounded::new(record, self.fit)
    }
}

impl std::ops::Deref for Lag {
    type Target = Late;

    fn deref(&self) -> &Late {
        &self.late
    }
}

impl Late {
    /// d + λ and λ² with their half intervals, and the slope of the first over the second; `None`: they are not finite.
    pub fn new(mean: [f64; 2], variance: [f64; 2], slope: f64) -> Option<Self> {
        let rest = (mean[1].powi(2) - (slope * variance[1]).powi(2)).max(0.0).sqrt();
        let is_finite = [variance[1], mean[1], slope].iter().all(|x| x.is_finite());
        is_finite.then_some(Late { variance, mean, slope, rest })
    }

    /// Whether the record separates the lag from a delay.
    pub fn is_determined(&self) -> bool {
        self.variance[0] > TOLD * self.variance[1]
    }

    /// Whether the other numbers depend on it.
    pub fn is_seen(&self) -> bool {
        self.variance[0] > SEEN * self.variance[1]
    }

    /// λ; an interval from 0 where the record does not separate it from a delay.
    pub fn lag(&self) -> Interval {
        let [variance, half] = self.variance;
        let of = |x: f64| x.max(0.0).sqrt();
        let high = of(variance + half);
        match self.is_determined() {
            true => Interval { value: of(variance), low: of(variance - half), high },
            false => Interval { value: 0.0, low: 0.0, high },
        }
    }

    /// d + λ.
    pub fn late(&self) -> Interval {
        let [value, half] = self.mean;
        Interval { value, low: value - half, high: value + half }
    }

    /// d: its ends are those for the ends of λ², combined with the part of d + λ that is not correlated with λ².
    pub fn delay(&self) -> Interval {
        let [variance, half] = self.variance;
        let of = |by: f64| self.mean[0] + self.slope * by - (variance + by).max(0.0).sqrt();
        let value = of(0.0);
        let (one, other) = (of(-half) - value, of(half) - value);
        let up = one.max(other).max(0.0).hypot(self.rest);
        let down = one.min(other).min(0.0).hypot(self.rest);
        Interval { value, low: value - down, high: value + up }
    }
}

fn free(best: &Fit) -> crate::factor::Free {
    let mut free = best.free;
    free[LAG] = true;
    free
}
