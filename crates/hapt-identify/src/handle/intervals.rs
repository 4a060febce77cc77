//! The numbers that a record determines of a device with a handle, with their intervals.

use nalgebra::{DMatrix, DVector};

use super::WithHandle;
use super::fit::{
    AT_REST, FEW_ITERATIONS, FRICTION, Fit, Free, LATE, LOGARITHMS, NOT_BELOW_0, POSITION, Parameters, SHARE, VARIANCE,
    inertias,
};
use crate::identified::{CorrelatedPair, Residual};
use crate::interval::Interval;
use crate::intervals::{CORRELATED, VAGUE, no_longer, positive};
use crate::lag::Late;
use crate::record::Record;

/// The names of the parameters of the device, for those that a record does not separate.
const NAMES: [&str; POSITION] =
    ["inertia", "damping", "friction", "delay", "share of the handle", "shaft stiffness", "shaft damping", "lag"];
/// The largest sizes of the last three parameters, in rad/s, rad and rad/s (linear: m).
const FIRST: [f64; 3] = [100.0, 1.0, 100.0];
/// The parameters along which other devices are searched that explain the record as well: along these the valley of good fits is most
/// curved.
const PROFILED: [usize; 3] = [SHARE, VARIANCE, FRICTION];
/// Steps of a fit with one of them held, the distance of the first, in half intervals, the growth of the distance, and the last distance.
const BRIEFLY: usize = 4;
const FIRST_REACH: f64 = 1.0;
const FURTHER: f64 = 1.6;
const LAST_REACH: f64 = 30.0;
/// A part of the interval's squares by which a fit is better than another.
const NOTICEABLE: f64 = 0.1;

impl Fit {
    /// The devices whose squares are within a 95 % interval of the least, as far out as they are: the profile of the likelihood along
    /// single parameters. Where the valley of good fits is curved, the covariance at its lowest point is too small. `None`: a device next to
    /// the best moves too fast.
    pub fn profiled(self, record: &Record, stop: &(dyn Fn() -> bool + Sync)) -> Option<(Fit, Vec<Parameters>)> {
        let mut best = self;
        for _ in 0..PROFILED.len() {
            let mut others = Vec::new();
            let mut better: Option<Fit> = None;
            best.differentiate(record)?;
            let Some(spread) = Spread::of(&best) else { break };
            for (i, sign) in PROFILED.into_iter().flat_map(|i| [(i, 1.0), (i, -1.0)]) {
                let Some(direction) = spread.along(i) else { continue };
                let mut reach = FIRST_REACH;
                while reach < LAST_REACH && !stop() {
                    let mut p = best.p;
                    p.iter_mut().zip(&direction).for_each(|(p, step)| *p += sign * reach * step);
                    NOT_BELOW_0.into_iter().for_each(|i| p[i] = p[i].max(0.0));
                    let beside = Fit::near(record, p, &best)
                        .and_then(|fit| fit.fitting(Free::But(i)).improved(record, BRIEFLY, &|_, _| stop()));
                    let Some(beside) = beside.filter(|fit| fit.squares < best.enough()) else { break };
                    others.push(beside.p);
                    if beside.squares < better.as_ref().map_or(best.squares, |better| better.squares) {
                        better = Some(beside);
                    }
                    reach *= FURTHER;
                }
            }
            let better = better.and_then(|fit| fit.fitting(Free::All).improved(record, FEW_ITERATIONS, &|_, _| stop()));
            match better {
                Some(better) if better.squares < best.squares - NOTICEABLE * best.unit() => best = better,
                _ => return Some((best, others)),
            }
        }
        best.differentiate(record)?;
        Some((best, Vec::new()))
    }

    /// The numbers with their intervals, from the covariance and from `others` that explain the record as well.
    pub fn with_intervals(&self, others: &[Parameters], residual: Residual) -> Option<WithHandle> {
        let spread = Spread::of(self)?;
        let around = |i: Interval, quantity: &dyn Fn(&Parameters) -> f64| {
            others.iter().map(quantity).fold(i, |Interval { value, low, high }, other| Interval {
                value,
                low: low.min(other),
                high: high.max(other),
            })
        };
        let plain = |quantity: &dyn Fn(&Parameters) -> f64, gradient: &[(usize, f64)]| {
            let (value, error) = (quantity(&self.p), spread.half(gradient));
            around(Interval { value, low: (value - error).max(0.0), high: value + error }, quantity)
        };
        let log = |quantity: &dyn Fn(&Parameters) -> f64, gradient: &[(usize, f64)]| {
            let (value, error) = (quantity(&self.p), spread.half(gradient));
            around(Interval { value, low: value * (-error).exp(), high: value * error.exp() }, quantity)
        };
        let [inertia, handle, mass] = inertias(&self.p);
        let share = handle / (inertia + handle);
        let damping = mass * self.p[6];
        let half = |i: usize| spread.half(&[(i, 1.0)]);
        // The interval of the time to the torque and of its variance, over all these fits.
        let widest = |i: usize| others.iter().fold(half(i), |half, other| half.max((other[i] - self.p[i]).abs()));
        let late = Late::new([self.p[LATE], widest(LATE)], [self.p[VARIANCE], widest(VARIANCE)], spread.slope())?;
        let found = WithHandle {
            inertia: log(&|p| inertias(p)[0], &[(0, 1.0), (SHARE, -share)]),
            damping: plain(&|p| p[1], &[(1, 1.0)]),
            friction: plain(&|p| p[FRICTION], &[(FRICTION, 1.0)]),
            delay: positive(if late.is_determined() { late.delay() } else { late.late() }),
            lag: no_longer(late.lag(), late.late()),
            late: positive(late.late()),
            handle_inertia: log(&|p| inertias(p)[1], &[(0, 1.0), (SHARE, 1.0 - share)]),
            stiffness: log(&|p| inertias(p)[2] * p[5].exp(), &[(0, 1.0), (SHARE, 1.0 - 2.0 * share), (5, 1.0)]),
            shaft_damping: plain(
                &|p| inertias(p)[2] * p[6],
                &[(0, damping), (SHARE, damping * (1.0 - 2.0 * share)), (6, mass)],
            ),
            resonance_hz: (0.5 * self.p[5]).exp() / std::f64::consts::TAU,
            correlated: self.correlated(&spread.inverse, half),
            residual,
        };
        let finite = found.named().iter().all(|(_, of)| [of.value, of.low, of.high].iter().all(|x| x.is_finite()));
        finite.then_some(found)
    }

    /// Pairs of the device's parameters that the record does not separate, by their normalised covariance and half intervals.
    fn correlated(&self, inverse: &DMatrix<f64>, half: impl Fn(usize) -> f64) -> Vec<CorrelatedPair> {
        let vague = |i: usize| half(i) > VAGUE * if LOGARITHMS.contains(&i) { 1.0 } else { self.p[i].abs() };
        let pairs = (0..POSITION).flat_map(|i| (i + 1..POSITION).map(move |j| (i, j)));
        let of = |(i, j): (usize, usize)| {
            let correlation = inverse[(i, j)] / (inverse[(i, i)] * inverse[(j, j)]).sqrt();
            let is_one = correlation.abs() > CORRELATED && (vague(i) || vague(j));
            is_one.then_some(CorrelatedPair { names: [NAMES[i], NAMES[j]], correlation })
        };
        pairs.filter_map(of).collect()
    }
}

/// The uncertainty of the parameters of a fit, to first order.
struct Spread {
    /// The inverse information of the parameters over their scales, with which the information has ones on its diagonal.
    inverse: DMatrix<f64>,
    scale: DVector<f64>,
    /// [`Fit::unit`].
    unit: f64,
}

impl Spread {
    fn of(fit: &Fit) -> Option<Spread> {
        let (information, _) = fit.normal()?;
        let parameters = fit.parameters();
        let freedom = fit.left.len().saturating_sub(parameters).max(1) as f64;
        // Friction can end an initial motion before it shows. Then its bound is this, and the other numbers are determined all the same.
        let known =
            |i: usize| FIRST.get(i.wrapping_sub(AT_REST)).map_or(0.0, |size| fit.squares / freedom / (size * size));
        let own = DVector::from_fn(parameters, |i, _| information[(i, i)] + known(i));
        let scale = own.map(|x| x.sqrt().recip());
        let matrix = DMatrix::from_fn(parameters, parameters, |i, j| match i == j {
            true => 1.0,
            false => information[(i, j)] * scale[i] * scale[j],
        });
        let inverse = matrix.cholesky()?.inverse();
        Some(Spread { inverse, scale, unit: fit.unit() })
    }

    fn covariance(&self, i: usize, j: usize) -> f64 {
        self.inverse[(i, j)] * self.scale[i] * self.scale[j]
    }

    /// Half of the 95 % interval of a quantity with this gradient in the parameters.
    fn half(&self, gradient: &[(usize, f64)]) -> f64 {
        let of = |&(i, a): &(usize, f64), &(j, b): &(usize, f64)| a * b * self.covariance(i, j);
        let sum: f64 = gradient.iter().flat_map(|row| gradient.iter().map(move |column| of(row, column))).sum();
        (self.unit * sum).sqrt()
    }

    /// The change of the best fits with one parameter, over half of its interval.
    fn along(&self, i: usize) -> Option<Vec<f64>> {
        let own = self.covariance(i, i);
        let all: Vec<f64> = (0..self.scale.len()).map(|j| self.covariance(j, i) * (self.unit / own).sqrt()).collect();
        all.iter().all(|step| step.is_finite()).then_some(all)
    }

    /// The slope of the time to the torque over its variance.
    fn slope(&self) -> f64 {
        self.covariance(LATE, VARIANCE) / self.covariance(VARIANCE, VARIANCE)
    }
}
