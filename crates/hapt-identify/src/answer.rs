//! From a fit to what people ask for: inertia, damping and friction with their intervals, out of α, β and γ.

use nalgebra::SMatrix;

use crate::bound::Bounded;
use crate::counts::{Lattice, lattice};
use crate::estimate::{Identified, Interval, Known, Residual, TWINS, Twins, tells_offset};
use crate::fit::{Fit, Square};
use crate::position::of_position;
use crate::puck::{DAMPING, DELAY, FRICTION, GAIN, OFFSET, Puck};
use crate::quantile::student;
use crate::record::Record;

/// Positions without counts from which the fit leaves no more than this part are a simulation's without noise.
const EXACT: f64 = 1e-9;
/// Twins cannot be told apart where either is as uncertain as this part of itself.
const VAGUE: f64 = 0.1;

/// The names of the first four parameters.
const NAMES: [&str; 4] = ["inertia", "damping", "friction", "delay"];

/// A fit on its way to what people ask for.
pub(crate) struct Answer<'k> {
    best: Fit,
    /// What every interval reaches.
    ends: Vec<Puck>,
    known: &'k Known,
    /// Standard errors, per unit of noise, to half intervals.
    factor: f64,
}

impl<'k> Answer<'k> {
    pub fn new(Bounded { fit: best, ends }: Bounded, known: &'k Known) -> Self {
        Answer { best, ends, known, factor: student(best.freedom()) * best.variance().sqrt() }
    }

    pub fn identified(&self, record: &Record, residual: Residual, spread: f64) -> Identified {
        let Puck { gain, .. } = self.best.puck;
        let sign = if gain < 0.0 { -1.0 } else { 1.0 };
        let (seen, covariance) = (self.best.normal.seen(self.best.free), self.best.inverse());
        // Of a quantity of the puck with its slopes by some parameters alone.
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
        let positive = |interval: Interval| {
            let Interval { value, low, high } = interval;
            Interval { value: value.max(0.0), low: low.max(0.0), high: high.max(0.0) }
        };
        // Surely below 0 it is none of what a puck has.
        let bounded = |interval: Option<Interval>| interval.filter(|x| x.high >= 0.0).map(positive);
        // Where a constant torque is surely there, and the record hardly tells it from friction, it says nothing of either.
        let tells = !self.best.free[OFFSET] || tells_offset(&self.best);
        let rate = |i: usize| of(&|puck| puck.parameters()[i], &[(i, 1.0)]);
        // An inertia as uncertain as itself is none; nor is the sign then.
        let gained = rate(GAIN).filter(|gain| gain.low * gain.high > 0.0);
        let inertia_of = |puck: &Puck| self.known.inertia.unwrap_or(puck.gain.abs().recip());
        let j = inertia_of(&self.best.puck);
        // What a rate is as a torque, or per velocity; of an inertia that is found itself, with its part in the doubt.
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
        let lattice = lattice(record.positions());
        let is_exact = lattice.is_none() && residual.rms < EXACT * spread;
        let (condition, twins) = covariance.map_or((f64::INFINITY, Vec::new()), |c| self.together(&c));
        Identified {
            inertia: inertia.map(positive),
            damping: bounded(scaled(DAMPING)),
            // Friction surely below 0 is a constant torque that pushes the way the puck goes.
            friction: bounded(scaled(FRICTION)).filter(|_| tells),
            delay: bounded(gained.and_then(|_| rate(DELAY))),
            offset: scaled(OFFSET).filter(|_| tells),
            sign: gained.map(|_| Interval { value: sign, low: sign, high: sign }),
            gain: motor.map(positive),
            counts: lattice.filter(|_| !self.known.is_linear).and_then(counts),
            lattice,
            rates: [DAMPING, FRICTION].map(|i| bounded(rate(i))),
            puck: self.best.puck,
            first: self.best.first,
            residual,
            // Rounding goes with anything.
            unmodelled: if is_exact { None } else { of_position(record, &self.best, self.known) },
            is_exact,
            spread,
            condition,
            twins,
        }
    }

    /// How far the first four estimates go together: the condition of their correlations, and the pairs that cannot be told apart.
    fn together(&self, covariance: &Square) -> (f64, Vec<Twins>) {
        let deviation = |i: usize| covariance[(i, i)].sqrt();
        let correlation = SMatrix::<f64, 4, 4>::from_fn(|i, j| match (deviation(i), deviation(j)) {
            _ if i == j => 1.0,
            (a, b) if a > 0.0 && b > 0.0 => covariance[(i, j)] / (a * b),
            _ => 0.0,
        });
        let eigenvalues = correlation.symmetric_eigenvalues();
        let parameters = self.best.puck.parameters();
        let vague = |i: usize| self.factor * deviation(i) > VAGUE * parameters[i].abs();
        let mut twins = Vec::new();
        for i in 0..4 {
            for j in i + 1..4 {
                if correlation[(i, j)].abs() > TWINS && (vague(i) || vague(j)) {
                    twins.push(Twins { names: [NAMES[i], NAMES[j]], correlation: correlation[(i, j)] });
                }
            }
        }
        (eigenvalues.max() / eigenvalues.min().max(f64::MIN_POSITIVE), twins)
    }
}

/// The whole number of counts a revolution that a lattice means; none where it means no whole number.
fn counts(lattice: Lattice) -> Option<Interval> {
    let counts = std::f64::consts::TAU / lattice.step;
    let doubt = 2.0 * counts * lattice.error / lattice.step;
    let whole = counts.round();
    let off = (counts - whole).abs();
    if doubt < 0.25 {
        // Counts in print are off by what the print rounds; nothing else is.
        return (off <= doubt + 1e-6 * counts).then_some(Interval { value: whole, low: whole, high: whole });
    }
    Some(Interval { value: whole, low: (counts - doubt).floor(), high: (counts + doubt).ceil() })
}
