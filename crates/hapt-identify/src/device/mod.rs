//! A device with end stops or Stribeck friction: its numbers from a record that its motion explains.

mod contact;
mod covariance;
mod fit;
mod motion;
mod pieces;
mod slopes;

pub(crate) use contact::{near, search};
use fit::{
    DAMPING, FAST, FRICTION, INERTIA, LATE, OFFSET, RISE, SHORTEST_LAG, STIFFNESS, STOP_DAMPING, STOPS, VARIANCE,
};
pub(crate) use fit::{Device, Fit};

use crate::identified::{CorrelatedPair, FoundStops, FoundStribeck, Identified, Interval, Known};
use crate::intervals::{CORRELATED, VAGUE, counts, no_longer, positive};
use crate::lag::Late;
use crate::puck::Puck;
use crate::record::{CancellableRecord, Record};
use crate::remainder::{RESOLUTION, residual, variance};

/// Names of the first parameters; delay and lag together have the place of the delay.
const NAMES: [(usize, &str); 4] = [(INERTIA, "inertia"), (DAMPING, "damping"), (FRICTION, "friction"), (LATE, "delay")];
/// A sign needs 99.9 %, an inertia 95 %: in parts of half a 95 % interval.
const SURELY: f64 = 3.29 / 1.96;

impl Fit {
    /// The numbers that the record determines, each with its 95 % interval.
    pub fn identified(&self, record: &CancellableRecord<'_>, known: &Known) -> Option<Identified> {
        let with_lag = if self.free[VARIANCE] { Some(self.clone()) } else { contact::lagging(record, self) };
        let late = with_lag.as_ref().and_then(|fit| fit.late(record));
        let is_determined = late.as_ref().is_some_and(Late::is_determined);
        let Some(with_lag) = with_lag else { return self.with_intervals(record, known, late) };
        if is_determined || self.free[VARIANCE] {
            return with_lag.with_intervals(record, known, late);
        }
        // A lag that the record allows moves the other numbers: their intervals cover those of both fits.
        let found = self.with_intervals(record, known, late)?;
        Some(match with_lag.with_intervals(record, known, late).filter(|_| late.as_ref().is_some_and(Late::is_seen)) {
            Some(other) => found.widened(&other),
            None => found,
        })
    }

    /// Delay and lag of a fit with both.
    fn late(&self, record: &Record) -> Option<Late> {
        let (covariance, p) = (self.covariance(record)?, &self.device.p);
        let half = |i: usize| covariance[(i, i)].max(0.0).sqrt();
        let slope = covariance[(LATE, VARIANCE)] / covariance[(VARIANCE, VARIANCE)];
        let is_least = p[VARIANCE].sqrt() < 2.0 * SHORTEST_LAG * record.period();
        Late::new([p[LATE], half(LATE)], [if is_least { 0.0 } else { p[VARIANCE] }, half(VARIANCE)], slope)
    }

    fn with_intervals(&self, record: &CancellableRecord<'_>, known: &Known, late: Option<Late>) -> Option<Identified> {
        let covariance = self.covariance(record)?;
        let device = &self.device;
        let p = &device.p;
        let half = |i: usize| covariance[(i, i)].max(0.0).sqrt();
        let plain = |i: usize| {
            let around = Interval { value: p[i], low: p[i] - half(i), high: p[i] + half(i) };
            self.sees(i).then_some(around)
        };
        let log = |i: usize| {
            let value = p[i].exp();
            self.sees(i).then(|| Interval { value, low: value * (-half(i)).exp(), high: value * half(i).exp() })
        };
        let is_determined = half(INERTIA) < 1.0;
        let is_sure = SURELY * half(INERTIA) < 1.0;
        let exactly = |value: f64| Interval { value, low: value, high: value };
        let (inertia, gain) = match known.inertia {
            Some(known) => (Some(exactly(known)), log(INERTIA).filter(|_| is_determined)),
            None => (log(INERTIA).filter(|_| is_determined), None),
        };
        let numbers = device.numbers([0.0; 2]);
        let lag = late.filter(Late::is_determined);
        let delay = plain(LATE).map(positive);
        // Without a lag that fits, the delay stands for both.
        let sum = late
            .map(|late| delay.filter(|_| lag.is_none()).into_iter().fold(positive(late.late()), Interval::with))
            .or(delay);
        let rate = |i: usize| {
            // Of b/J: the uncertainty of J is included.
            let (value, j) = (p[i] / device.inertia(), device.inertia());
            let spread = covariance[(i, i)] / (j * j) + (value * half(INERTIA)).powi(2)
                - 2.0 * value / j * covariance[(i, INERTIA)];
            let half = spread.max(0.0).sqrt();
            self.sees(i).then(|| positive(Interval { value, low: value - half, high: value + half }))
        };
        let correlation = |i: usize, j: usize| covariance[(i, j)] / (half(i) * half(j));
        let vague = |i: usize| half(i) > VAGUE * if i == INERTIA { 1.0 } else { p[i].abs() };
        let pairs = NAMES.iter().enumerate().flat_map(|(k, a)| NAMES[k + 1..].iter().map(move |b| (*a, *b)));
        let correlated = pairs.filter_map(|((i, one), (j, other))| {
            let correlation = correlation(i, j);
            let is_one = correlation.abs() > CORRELATED && (vague(i) || vague(j));
            is_one.then_some(CorrelatedPair { names: [one, other], correlation })
        });
        let separates = self.sees(OFFSET) && correlation(FRICTION, OFFSET).abs() <= CORRELATED;
        let residual = residual(&self.left);
        let spread = variance(&record.positions()[self.first()..]).sqrt();
        let lattice = record.lattice();
        Some(Identified {
            inertia,
            damping: plain(DAMPING).map(positive).map(|damping| known.own(damping)),
            friction: plain(FRICTION).map(positive).filter(|_| !self.free[OFFSET] || separates),
            delay: lag.map_or(delay, |lag| Some(positive(lag.delay()))),
            lag: late.zip(sum).map(|(late, sum)| no_longer(late.lag(), sum)),
            late: sum,
            sign: is_sure.then(|| exactly(device.sign)),
            offset: plain(OFFSET).filter(|_| separates),
            gain,
            counts: lattice.filter(|_| !known.is_linear).and_then(counts),
            lattice,
            rates: [DAMPING, FRICTION].map(rate),
            stops: self.stops(&plain, &log),
            stribeck: plain(RISE)
                .zip(log(FAST))
                .map(|(torque, velocity)| FoundStribeck { torque: positive(torque), velocity }),
            puck: Puck {
                gain: numbers.gain,
                damping: numbers.damping,
                friction: numbers.friction,
                delay: numbers.delay,
                offset: numbers.offset,
                position: numbers.position,
                velocity: numbers.velocity,
                lag: numbers.lag,
            },
            positions: Some(self.shots.iter().flat_map(|shot| shot.positions(record, &self.device).0).collect()),
            first: self.first(),
            residual,
            unmodelled: None,
            is_exact: lattice.is_none() && residual.rms < RESOLUTION * spread,
            spread,
            condition: f64::NAN,
            correlated: correlated.collect(),
        })
    }

    /// The stops that the record reaches.
    fn stops(
        &self,
        plain: &dyn Fn(usize) -> Option<Interval>,
        log: &dyn Fn(usize) -> Option<Interval>,
    ) -> Option<FoundStops> {
        let [low, high] = STOPS.map(plain);
        let stiffness = log(STIFFNESS)?;
        let damping = positive(plain(STOP_DAMPING)?);
        (low.is_some() || high.is_some()).then_some(FoundStops { low, high, stiffness, damping })
    }
}
