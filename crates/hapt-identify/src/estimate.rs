//! The whole answer: values with intervals, and what the record cannot tell.

use nalgebra::SMatrix;

use crate::Error;
use crate::counts::{Lattice, lattice};
use crate::fit::{Fit, Free, fit};
use crate::puck::Puck;
use crate::quantile::student;
use crate::record::{LONGEST_DELAY, Record};
use crate::start::starts;

/// Two estimates that go up and down together by more than this cannot be told apart,
const TWINS: f64 = 0.99;
/// where either is as uncertain as this part of itself.
const VAGUE: f64 = 0.1;
/// The residuals of a model that fits are independent up to this.
const INDEPENDENT: f64 = 0.1;
/// What half a count of noise leaves when it is counted, in counts: the root of 1/4 + 1/12, less a little.
const LEAST_NOISE: f64 = 0.55;
/// What the fit leaves of the positions' variance, where it explains nothing.
const UNEXPLAINED: f64 = 0.25;

/// What is known beforehand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Known {
    /// J in kg·m² (linear: kg): then the motor's gain is found in its place, and a coast-down gives damping and friction.
    pub inertia: Option<f64>,
    /// The positions are linear: their lattice is no part of a turn.
    pub is_linear: bool,
}

/// A value with its 95 % interval.
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

/// What a record says about a device. `None`: nothing.
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
    /// The true torque per commanded torque, where the inertia is known beforehand.
    pub gain: Option<Interval>,
    /// The encoder's counts a revolution, a whole number; none for a linear device.
    pub counts: Option<Interval>,
    /// The lattice of the positions, in rad (m).
    pub lattice: Option<Lattice>,
    /// b/J in 1/s and f/J in rad/s² (m/s²): what a coast-down shows.
    pub rates: [Option<Interval>; 2],
    /// The fit itself.
    pub puck: Puck,
    /// What it leaves.
    pub residual: Residual,
    /// The positions' standard deviation, in rad (m).
    pub spread: f64,
    /// Largest over smallest eigenvalue of the estimates' correlations.
    pub condition: f64,
    /// Those that cannot be told apart.
    pub twins: Vec<Twins>,
}

/// The names of the first four parameters.
const NAMES: [&str; 4] = ["inertia", "damping", "friction", "delay"];

/// Fits the puck to a record.
///
/// # Errors
/// [`Error::Unexplained`] where no puck explains the motion.
pub fn identify(record: &Record, known: &Known) -> Result<Identified, Error> {
    let is_driven = record.is_driven();
    let free: Free = [is_driven, true, true, is_driven, true, true];
    let best = starts(record)
        .into_iter()
        .filter_map(|start| fit(record, start, free))
        .min_by(|a, b| a.normal.squares.total_cmp(&b.normal.squares))
        .ok_or(Error::Unexplained)?;
    let fitted = fitted(record, &best.puck);
    let residual = residual(record, &fitted);
    let answer = Answer { best, free, known, factor: student(best.freedom(free)) * best.variance(free).sqrt() };
    let spread = variance(&record.positions()[record.first()..]).sqrt();
    let explains = residual.rms.powi(2) < UNEXPLAINED * spread * spread;
    let delay_is_inside = best.puck.delay < LONGEST_DELAY;
    if !(explains && delay_is_inside && best.puck.gain.is_finite()) {
        return Err(Error::Unexplained);
    }
    let lattice = lattice(record.positions());
    Ok(answer.identified(residual, spread, lattice))
}

/// The positions of a fit, from [`Record::first`] on.
fn fitted(record: &Record, puck: &Puck) -> Vec<f64> {
    let mut fitted = Vec::new();
    puck.follow(record.times(), record.torques(), record.first(), |_, z, _| fitted.push(z));
    fitted
}

fn variance(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / values.len() as f64
}

fn residual(record: &Record, fitted: &[f64]) -> Residual {
    let first = record.first();
    let at = |(i, z): (usize, &f64)| record.is_news(first + i).then(|| record.positions()[first + i] - z);
    let left: Vec<f64> = fitted.iter().enumerate().filter_map(at).collect();
    let squares: f64 = left.iter().map(|r| r * r).sum();
    let neighbours: f64 = left.windows(2).map(|pair| pair[0] * pair[1]).sum();
    let correlation = if squares > 0.0 { neighbours / squares } else { 0.0 };
    Residual { rms: (squares / left.len() as f64).sqrt(), correlation }
}

/// A fit on its way to what people ask for.
struct Answer<'k> {
    best: Fit,
    free: Free,
    known: &'k Known,
    /// Standard errors, per unit of noise, to half intervals.
    factor: f64,
}

impl Answer<'_> {
    fn identified(&self, residual: Residual, spread: f64, lattice: Option<Lattice>) -> Identified {
        let Puck { gain, damping, friction, delay, .. } = self.best.puck;
        let sign = if gain < 0.0 { -1.0 } else { 1.0 };
        let (seen, covariance) = (self.best.normal.seen(self.free), self.best.normal.inverse(self.free));
        let interval = |value: f64, slopes: [f64; 4]| -> Option<Interval> {
            let covariance = covariance.as_ref()?;
            if (0..4).any(|i| slopes[i] != 0.0 && !seen[i]) {
                return None;
            }
            let pairs = (0..4).flat_map(|i| (0..4).map(move |j| (i, j)));
            let variance: f64 = pairs.map(|(i, j)| slopes[i] * covariance[(i, j)] * slopes[j]).sum();
            let half = self.factor * variance.max(0.0).sqrt();
            half.is_finite().then_some(Interval { value, low: value - half, high: value + half })
        };
        let positive = |interval: Interval| {
            let Interval { value, low, high } = interval;
            Interval { value: value.max(0.0), low: low.max(0.0), high: high.max(0.0) }
        };
        let rates = [interval(damping, [0.0, 1.0, 0.0, 0.0]), interval(friction, [0.0, 0.0, 1.0, 0.0])];
        // An inertia as uncertain as itself is none; nor is the sign then.
        let gained = interval(gain, [1.0, 0.0, 0.0, 0.0]).filter(|gain| gain.low * gain.high > 0.0);
        let (inertia, b, f, motor) = match (self.known.inertia, gained) {
            (Some(j), _) => {
                let scaled = |rate: Option<Interval>| rate.map(|rate| rate.times(j));
                let motor = interval(gain.abs() * j, [sign * j, 0.0, 0.0, 0.0]).filter(|_| gained.is_some());
                (Some(Interval { value: j, low: j, high: j }), scaled(rates[0]), scaled(rates[1]), motor)
            }
            (None, Some(_)) => {
                let j = gain.abs().recip();
                let by_gain = -j / gain;
                let inertia = interval(j, [by_gain, 0.0, 0.0, 0.0]);
                let b = interval(j * damping, [by_gain * damping, j, 0.0, 0.0]);
                (inertia, b, interval(j * friction, [by_gain * friction, 0.0, j, 0.0]), None)
            }
            (None, None) => (None, None, None, None),
        };
        let (condition, twins) = covariance.map_or((f64::INFINITY, Vec::new()), |c| self.together(&c));
        Identified {
            inertia: inertia.map(positive),
            damping: b.map(positive),
            friction: f.map(positive),
            delay: gained.and_then(|_| interval(delay, [0.0, 0.0, 0.0, 1.0])).map(positive),
            sign: gained.map(|_| Interval { value: sign, low: sign, high: sign }),
            gain: motor.map(positive),
            counts: lattice.filter(|_| !self.known.is_linear).and_then(counts),
            lattice,
            rates: rates.map(|rate| rate.map(positive)),
            puck: self.best.puck,
            residual,
            spread,
            condition,
            twins,
        }
    }

    /// How far the first four estimates go together: the condition of their correlations, and the pairs that cannot be told apart.
    fn together(&self, covariance: &SMatrix<f64, 6, 6>) -> (f64, Vec<Twins>) {
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

impl Interval {
    fn times(self, factor: f64) -> Self {
        Interval { value: factor * self.value, low: factor * self.low, high: factor * self.high }
    }

    /// Whether a value is in it.
    pub fn covers(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }
}

impl Identified {
    /// The position errors that are left, with their times, from the first sample that is fitted on.
    pub fn residuals(&self, record: &Record) -> Vec<(f64, f64)> {
        let rows = self.fitted(record).into_iter().zip(&record.positions()[record.first()..]);
        rows.map(|((t, z), y)| (t, y - z)).collect()
    }

    /// The positions that the fit gives, with their times.
    pub fn fitted(&self, record: &Record) -> Vec<(f64, f64)> {
        record.times()[record.first()..].iter().copied().zip(fitted(record, &self.puck)).collect()
    }

    /// Whether what is left is rounding: a simulation without noise.
    fn is_exact(&self) -> bool {
        self.lattice.is_none() && self.residual.rms < 1e-9 * self.spread
    }

    /// What has to be said about it before anybody relies on it, a sentence each.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if self.is_exact() {
            return warnings;
        }
        for Twins { names: [one, other], correlation } in &self.twins {
            warnings.push(format!(
                "this record hardly tells {one} and {other} apart (their estimates are correlated by {correlation:.4}); one that goes through other speeds and accelerations would"
            ));
        }
        let step = self.lattice.map_or(0.0, |lattice| lattice.step);
        if self.residual.correlation.abs() > INDEPENDENT {
            warnings.push(format!(
                "what the fit leaves is no independent noise (neighbours are correlated by {:.2}): something else moves the device too, and the intervals are narrower than they should be",
                self.residual.correlation
            ));
        } else if self.residual.rms < LEAST_NOISE * step {
            warnings.push(
                "the positions carry less than half a count of noise: where the motion is slow, counts are no independent noise, and the intervals may be narrower than they should be"
                    .into(),
            );
        }
        let uncertain = |interval: Option<Interval>| interval.is_some_and(|x| x.low == 0.0 && x.high > 0.0);
        for (name, interval) in [("damping", self.damping), ("friction", self.friction)] {
            if uncertain(interval) {
                warnings.push(format!("the {name} may be none: its interval begins at 0"));
            }
        }
        warnings
    }
}
