//! A device with end stops, Stribeck friction, or torques and friction of the position: its numbers from a record that its motion explains.

mod along;
mod away;
mod contact;
mod covariance;
mod endless;
mod field;
mod fit;
mod hints;
mod motion;
mod parameters;
mod pieces;
mod slopes;

pub(crate) use contact::{near, search, search_loaded};
use field::HARMONICS;
use fit::SHORTEST_LAG;
pub(crate) use fit::{Fit, Shot};
pub(crate) use motion::ACCURACY;
use parameters::{CHANGES, COGGING, FAST, GRAVITY, RISE, SPRING, STIFFNESS, STOP_DAMPING, STOPS};
pub(crate) use parameters::{DAMPING, Device, FRICTION, Free, INERTIA, LATE, OFFSET, PARAMETERS, VARIANCE};
use slopes::Square;

use crate::identified::{CorrelatedPair, FoundStops, FoundStribeck, FoundWaves, Harmonics, Identified, Known};
use crate::interval::Interval;
use crate::intervals::{CORRELATED, VAGUE, counts, no_longer, positive};
use crate::lag::Late;
use crate::puck::Puck;
use crate::record::{CancellableRecord, Record};
use crate::remainder::{RESOLUTION, residual, variance};
use crate::terms::{Term, TermKind};

/// Names of the first parameters; delay and lag together have the place of the delay.
const NAMES: [(usize, &str); 4] = [(INERTIA, "inertia"), (DAMPING, "damping"), (FRICTION, "friction"), (LATE, "delay")];
/// A sign needs 99.9 %, an inertia 95 %: in parts of half a 95 % interval.
const SURELY: f64 = 3.29 / 1.96;

/// The intervals of a wave's parameters from one on.
fn harmonics(at: usize, count: usize, plain: &dyn Fn(usize) -> Option<Interval>) -> Harmonics {
    std::array::from_fn(|n| std::array::from_fn(|i| if n < count { plain(at + 2 * n + i) } else { None }))
}

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
            terms: self.terms(&covariance),
            waves: Some(FoundWaves {
                gravity: harmonics(GRAVITY, 1, &plain),
                cogging: harmonics(COGGING, HARMONICS, &plain),
                changes: harmonics(CHANGES, HARMONICS, &plain),
            }),
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

    /// The torques of the position, and the changes of friction.
    fn terms(&self, covariance: &Square) -> Vec<Term> {
        let (p, places) = (&self.device.p, &self.device.places);
        // A sum of parameters by these weights.
        let sized = |value: f64, weights: &[(usize, f64)]| {
            let squares = weights.iter().flat_map(|one| weights.iter().map(move |other| (one, other)));
            let half = squares.map(|((i, a), (j, b))| a * b * covariance[(*i, *j)]).sum::<f64>().max(0.0).sqrt();
            Interval { value, low: value - half, high: value + half }
        };
        let term = |kind, size| Term { kind, size, predicts: None };
        let spring = self.free[SPRING].then(|| term(TermKind::Stiffness, sized(p[SPRING], &[(SPRING, 1.0)])));
        // The term is against the torque on the puck; friction is against the puck already.
        let turn = |at: usize, rate: f64, offset: f64| {
            let (sine, cosine) = (-p[at], -p[at + 1]);
            let phase = cosine.atan2(sine);
            let size = sized(sine.hypot(cosine), &[(at, -phase.cos()), (at + 1, -phase.sin())]);
            self.free[at]
                .then(|| term(TermKind::Turn { times: rate.round() as u32, phase: phase - rate * offset }, size))
        };
        let rubs = |at: usize, rate: f64, offset: f64| {
            let phase = p[at + 1].atan2(p[at]);
            let (part, friction) = (p[at].hypot(p[at + 1]), p[FRICTION]);
            let weights = [(at, friction * phase.cos()), (at + 1, friction * phase.sin()), (FRICTION, part)];
            let kind = TermKind::FrictionByPosition { times: rate.round() as u32, phase: phase - rate * offset };
            self.free[at].then(|| term(kind, sized(friction * part, &weights)))
        };
        let all = |at: usize, [rate, offset]: [f64; 2], of: &dyn Fn(usize, f64, f64) -> Option<Term>| {
            (0..HARMONICS).filter_map(|n| of(at + 2 * n, (n + 1) as f64 * rate, offset)).collect::<Vec<Term>>()
        };
        let cogging = all(COGGING, places.cogging, &turn);
        let changes = all(CHANGES, places.changes, &rubs);
        let either = |size: Interval| {
            let Some(value) = self.gravity_by_direction() else { return size };
            let shift = value - size.value;
            size.with(Interval { value, low: size.low + shift, high: size.high + shift })
        };
        let gravity = turn(GRAVITY, 1.0, 0.0).map(|term| Term { size: either(term.size), ..term });
        spring.into_iter().chain(gravity).chain(cogging).chain(changes).collect()
    }

    /// The size of gravity if the constant torque is friction by direction: where friction changes once a turn, that is a torque of the same
    /// period.
    fn gravity_by_direction(&self) -> Option<f64> {
        let Device { p, places, .. } = &self.device;
        let part = |i: usize| p[GRAVITY + i] - p[OFFSET] * p[CHANGES + i];
        (places.changes[0] == 1.0 && !places.offset_is_friction).then(|| part(0).hypot(part(1)))
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
