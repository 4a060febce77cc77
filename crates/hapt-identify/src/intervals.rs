//! From a fit to the physical parameters: inertia, damping and friction with their intervals, from α, β and γ.

use nalgebra::SMatrix;

use crate::bound::Bounded;
use crate::counts::Lattice;
use crate::factor::Square;
use crate::fit::Fit;
use crate::identified::{CorrelatedPair, Identified, Known, Residual};
use crate::interval::Interval;
use crate::lag::Lag;
use crate::position::position_torque;
use crate::puck::{DAMPING, DELAY, FRICTION, GAIN, OFFSET, Puck};
use crate::quantile::student;
use crate::record::Record;
use crate::remainder::{RESOLUTION, error_variance};

/// The correlation of two estimates above which the record does not separate them.
pub(crate) const CORRELATED: f64 = 0.99;
/// A correlated pair is reported where either of the two is as uncertain as this part of itself.
pub(crate) const VAGUE: f64 = 0.1;

/// The names of the first four parameters.
const NAMES: [&str; 4] = ["inertia", "damping", "friction", "delay"];

/// A fit with the quantities from which the intervals of its parameters are computed.
pub(crate) struct Intervals<'k> {
    best: Fit,
    /// Points that every interval must contain.
    ends: Vec<Puck>,
    lag: Option<&'k Lag>,
    known: &'k Known,
    /// The factor from standard errors, per unit of noise, to half intervals.
    factor: f64,
    covariance: Option<Square>,
}

impl<'k> Intervals<'k> {
    pub fn new(record: &Record, Bounded { fit: best, ends }: Bounded, lag: Option<&'k Lag>, known: &'k Known) -> Self {
        let factor = student(best.freedom()) * error_variance(record, &best).sqrt();
        let covariance = best.covariance(record, factor * factor);
        Intervals { best, ends, lag, known, factor, covariance }
    }

    pub fn identified(&self, record: &Record, residual: Residual, spread: f64) -> Identified {
        let Puck { gain, .. } = self.best.puck;
        let sign = if gain < 0.0 { -1.0 } else { 1.0 };
        let (seen, covariance) = (self.best.factor.seen(self.best.free), self.covariance);
        // The interval of a quantity of the puck, from its derivatives by the parameters that it depends on.
        let of = |quantity: &dyn Fn(&Puck) -> f64, slopes: &[(usize, f64)]| -> Option<Interval> {
            let covariance = covariance.as_ref()?;
            if slopes.iter().any(|(i, slope)| *slope != 0.0 && !seen[*i]) {
                return None;
            }
            let pairs = slopes.iter().flat_map(|a| slopes.iter().map(move |b| (a, b)));
            let variance: f64 = pairs.map(|((i, a), (j, b))| a * covariance[(*i, *j)] * b).sum();
            let (value, half) = (quantity(&self.best.puck), self.factor * variance.max(0.0).sqrt());
            let around = Interval { value, low: value - half, high: value + half };
            let reaches = |x: Interval, end: &Puck| {
                let there = quantity(end);
                Interval { low: x.low.min(there), high: x.high.max(there), ..x }
            };
            half.is_finite().then(|| self.ends.iter().fold(around, reaches))
        };
        // An interval wholly below 0 is not physical.
        let bounded = |interval: Option<Interval>| interval.filter(|x| x.high >= 0.0).map(positive);
        // Where a constant torque is certain and the record hardly separates it from friction, neither is determined.
        let tells = !self.best.free[OFFSET] || separates_offset(&self.best);
        let rate = |i: usize| of(&|puck| puck.parameters()[i], &[(i, 1.0)]);
        // An inertia as uncertain as its value is not determined, and neither is the sign.
        let gained = rate(GAIN).filter(|gain| gain.low * gain.high > 0.0);
        // A sign needs a level of 99.9 %, 3.29 standard errors and not 1.96.
        let sure = |gain: &Interval| gain.value.abs() > 3.29 / 1.96 * (gain.high - gain.low) / 2.0;
        let inertia_of = |puck: &Puck| self.known.inertia.unwrap_or(puck.gain.abs().recip());
        let j = inertia_of(&self.best.puck);
        // A rate times the inertia; with the inertia's own uncertainty where that is fitted too.
        let scaled = |i: usize| {
            let quantity = |puck: &Puck| inertia_of(puck) * puck.parameters()[i];
            match (self.known.inertia, gained) {
                (Some(_), _) => of(&quantity, &[(i, j)]),
                (None, Some(_)) => of(&quantity, &[(GAIN, -quantity(&self.best.puck) / gain), (i, j)]),
                (None, None) => None,
            }
        };
        let (inertia, motor) = match self.known.inertia {
            Some(_) => (
                Some(Interval { value: j, low: j, high: j }),
                of(&|puck| puck.gain.abs() * j, &[(GAIN, sign * j)]).filter(|_| gained.is_some()),
            ),
            None => (gained.and_then(|_| of(&inertia_of, &[(GAIN, -j / gain)])), None),
        };
        let lag = self.lag.filter(|_| gained.is_some());
        let determined = lag.filter(|lag| lag.is_determined());
        // Where the lag is not determined, the delay of a motor without one is as right.
        let instead = rate(DELAY).filter(|_| determined.is_none());
        let late = bounded(lag.map(|lag| instead.into_iter().fold(lag.late(), Interval::with)));
        let lattice = record.lattice();
        let is_exact = lattice.is_none() && residual.rms < RESOLUTION * spread;
        let (condition, correlated) = covariance.map_or((f64::INFINITY, Vec::new()), |c| self.correlations(&c));
        Identified {
            inertia: inertia.map(positive),
            damping: bounded(scaled(DAMPING)),
            // Friction wholly below 0 would be a constant torque along the motion.
            friction: bounded(scaled(FRICTION)).filter(|_| tells),
            delay: bounded(gained.and_then(|_| determined.map_or_else(|| rate(DELAY), |lag| Some(lag.delay())))),
            lag: lag.zip(late).map(|(lag, late)| no_longer(lag.lag(), late)),
            late,
            offset: scaled(OFFSET).filter(|_| tells),
            sign: gained.filter(sure).map(|_| Interval { value: sign, low: sign, high: sign }),
            gain: motor.map(positive),
            counts: lattice.filter(|_| !self.known.is_linear).and_then(counts),
            lattice,
            rates: [DAMPING, FRICTION].map(|i| bounded(rate(i))),
            stops: None,
            stribeck: None,
            terms: Vec::new(),
            waves: None,
            puck: self.best.puck,
            positions: None,
            first: self.best.first,
            residual,
            // Rounding correlates with any shape.
            unmodelled: if is_exact { None } else { position_torque(record, &self.best, self.known.is_linear) },
            is_exact,
            spread,
            condition,
            correlated,
        }
    }

    /// The condition of the correlations of the first four estimates, and the pairs that the record does not separate.
    fn correlations(&self, covariance: &Square) -> (f64, Vec<CorrelatedPair>) {
        let deviation = |i: usize| covariance[(i, i)].sqrt();
        let correlation = SMatrix::<f64, 4, 4>::from_fn(|i, j| match (deviation(i), deviation(j)) {
            _ if i == j => 1.0,
            (a, b) if a > 0.0 && b > 0.0 => covariance[(i, j)] / (a * b),
            _ => 0.0,
        });
        let eigenvalues = correlation.symmetric_eigenvalues();
        let parameters = self.best.puck.parameters();
        let vague = |i: usize| self.factor * deviation(i) > VAGUE * parameters[i].abs();
        let mut pairs = Vec::new();
        for i in 0..4 {
            for j in i + 1..4 {
                if correlation[(i, j)].abs() > CORRELATED && (vague(i) || vague(j)) {
                    pairs.push(CorrelatedPair { names: [NAMES[i], NAMES[j]], correlation: correlation[(i, j)] });
                }
            }
        }
        (eigenvalues.max() / eigenvalues.min().max(f64::MIN_POSITIVE), pairs)
    }
}

/// The part of an interval that is 0 or more.
pub(crate) fn positive(Interval { value, low, high }: Interval) -> Interval {
    Interval { value: value.max(0.0), low: low.max(0.0), high: high.max(0.0) }
}

/// No delay is below 0: a lag is no longer than delay and lag together.
pub(crate) fn no_longer(Interval { value, low, high }: Interval, late: Interval) -> Interval {
    Interval { value, low, high: high.min(late.high).max(value) }
}

/// The whole number of counts a revolution that a lattice corresponds to; `None` where it is not whole.
pub(crate) fn counts(lattice: Lattice) -> Option<Interval> {
    let counts = std::f64::consts::TAU / lattice.step;
    let doubt = 2.0 * counts * lattice.error / lattice.step;
    let whole = counts.round();
    let off = (counts - whole).abs();
    if doubt < 0.25 {
        // Positions printed with few digits may be off only by their rounding.
        return (off <= doubt + 1e-6 * counts).then_some(Interval { value: whole, low: whole, high: whole });
    }
    Some(Interval { value: whole, low: (counts - doubt).floor(), high: (counts + doubt).ceil() })
}

/// Whether the record separates the constant torque from friction.
pub(crate) fn separates_offset(fit: &Fit) -> bool {
    let Some(covariance) = fit.inverse() else { return false };
    let size = (covariance[(FRICTION, FRICTION)] * covariance[(OFFSET, OFFSET)]).sqrt();
    covariance[(FRICTION, OFFSET)].abs() <= CORRELATED * size
}
