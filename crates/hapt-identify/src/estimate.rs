//! The search for the best fit, and the result with its intervals.

use std::cell::LazyCell;
use std::cmp::Ordering;

use rayon::prelude::*;

use crate::best::{best, free, rival};
use crate::bound::Bounded;
use crate::device;
use crate::fit::{Fit, fit};
use crate::handle::resonance;
use crate::identified::{FoundStops, Identified, Known, PositionTorque};
use crate::interval::Interval;
use crate::intervals::Intervals;
use crate::lag::Lag;
use crate::position::position_torque;
use crate::puck::{OFFSET, Puck};
use crate::record::{CancellableRecord, LONGEST_DELAY, Record};
use crate::remainder::{fitted, is_right, left, residual, spread};
use crate::start::starts;
use crate::torque::{TorqueFit, fit_torque};
use crate::{Error, LargeResidual};

/// The residual variance, as a part of the positions' variance, above which the fit explains nothing.
const UNEXPLAINED: f64 = 0.25;
/// A torque that depends on the position is the cause where it explains more than this part of the residuals.
const MIN_EXPLAINED: f64 = 0.9;
/// Terms of the position take at least this part of the squares, or of what the torque's equation leaves.
const TERMS_TAKE: f64 = 1.0 / 3.0;
/// A record longer than this, in s, is fitted from its beginning on.
const LONG: f64 = 8.0;
/// The shortest stretch that is searched for a puck that explains it, s.
const BRIEF: f64 = 0.6;
/// Parts of the record that are fitted before all of it, where a fit of all of it fails.
const BEGINNINGS: [f64; 3] = [0.125, 0.25, 0.5];
/// If those fail too: the number of starts around the best, and the largest offset of each number, as a part of itself.
const HOPS: usize = 12;
const AROUND: [f64; 3] = [0.3, 0.1, 0.03];

/// Fits the puck to a record.
///
/// # Errors
/// [`Error::Unexplained`] where no puck explains the motion, [`Error::Residual`] where one does, but not to within counts and noise.
pub fn identify(record: &Record, known: &Known) -> Result<Identified, Error> {
    identify_with(record, known, fit_torque(record, known).as_ref())
}

/// The same with the fit of the torque, where that exists already.
///
/// # Errors
/// As [`identify`].
pub fn identify_with(record: &Record, known: &Known, by_torque: Option<&TorqueFit>) -> Result<Identified, Error> {
    identified(&CancellableRecord { record, stop: &|| false }, known, by_torque)
}

/// The same, or `None` once `stop` is true: it is called at every step of a fit, which reads each sample.
pub fn identify_until(
    record: &Record,
    known: &Known,
    by_torque: Option<&TorqueFit>,
    stop: &(dyn Fn() -> bool + Sync),
) -> Option<Result<Identified, Error>> {
    let result = identified(&CancellableRecord { record, stop }, known, by_torque);
    (!stop()).then_some(result)
}

fn identified(
    record: &CancellableRecord<'_>,
    known: &Known,
    by_torque: Option<&TorqueFit>,
) -> Result<Identified, Error> {
    // Where the puck turns round near the ends of its travel, a search without stops is long and fails.
    let stopped = device::search(record, known).and_then(|fit| fit.identified(record, known));
    let has = |is: fn(&FoundStops) -> bool| move |found: &Identified| found.stops.as_ref().is_some_and(is);
    if let Some(found) = stopped.clone().filter(has(FoundStops::are_sure)) {
        return Ok(found);
    }
    // Stops that explain a record that nothing else explains are the device's, if the record determines them at all.
    let stopped = stopped.filter(has(FoundStops::are_determined));
    let loaded = LazyCell::new(|| {
        let found = device::search_loaded(record, known)?.identified(record, known)?;
        found.stops.as_ref().is_none_or(FoundStops::are_determined).then_some(found)
    });
    let loaded = |is_sure: &dyn Fn(&Identified) -> bool| {
        loaded.as_ref().filter(|found| found.stops.is_some() || is_sure(found)).cloned()
    };
    // The search for a puck is long too. Where much of the torque depends on the position, a device with such torques comes first.
    if stopped.is_none()
        && by_torque.is_some_and(|fit| fit.of_position() > TERMS_TAKE)
        && let Some(found) = loaded(&|found| !found.terms.is_empty())
    {
        return Ok(found);
    }
    match search_or_glimpse(record, known, by_torque) {
        Err(wrong) | Ok(BestFit { wrong: Some(wrong), .. }) => {
            let is_sure = |found: &Identified| found.terms.is_empty() || takes_much(found, &wrong);
            stopped.or_else(|| loaded(&is_sure)).ok_or(wrong)
        }
        Ok(found) => {
            let found = found.identified(record, known);
            Ok(match by_torque.filter(|_| breaks_a_bound(&found)) {
                Some(equation) => up_to(found, equation),
                None => found,
            })
        }
    }
}

/// Whether terms of the position take a large part of the squares that the best fit without them leaves. Those that take little may stand for
/// something else that moves little, such as a handle that rings.
fn takes_much(found: &Identified, wrong: &Error) -> bool {
    let Error::Residual(LargeResidual { rms, .. }) = wrong else { return true };
    found.residual.rms.powi(2) < (1.0 - TERMS_TAKE) * rms.powi(2)
}

/// Whether the best fit has a number significantly below 0, and does not explain the record with it at 0: then the device is not of the
/// kind that was fitted.
fn breaks_a_bound(found: &Identified) -> bool {
    let puck = &found.puck;
    found.sign.is_some() && (puck.delay < 0.0 || puck.damping < 0.0 || puck.friction < 0.0)
}

/// With intervals that cover those of the torque's equation, which allow for another kind of device.
fn up_to(found: Identified, equation: &TorqueFit) -> Identified {
    let both = |here: Option<Interval>, there: Option<Interval>| {
        let (x, y) = (here?, there.or(here)?);
        Some(Interval { value: x.value, low: x.low.min(y.low), high: x.high.max(y.high) })
    };
    // An inertia that is given has no interval to widen.
    let inertia = if found.gain.is_some() { found.inertia } else { both(found.inertia, equation.inertia) };
    Identified {
        inertia,
        gain: both(found.gain, equation.gain),
        damping: both(found.damping, equation.damping),
        friction: both(found.friction, equation.friction),
        offset: both(found.offset, equation.offset),
        ..found
    }
}

/// The best fit that was found, whether or not it explains the record.
pub(crate) struct BestFit {
    pub best: Fit,
    /// The same with a lag.
    pub lag: Option<Lag>,
    /// Why it does not explain the record.
    pub wrong: Option<Error>,
}

impl BestFit {
    /// The start of a fit of more of the record; it finds its own lag.
    fn lead(&self) -> Puck {
        let puck = self.lag.as_ref().filter(|lag| lag.is_determined()).map_or(self.best.puck, |lag| lag.fit.puck);
        Puck { delay: puck.delay + puck.lag, lag: 0.0, ..puck }
    }

    /// The numbers with their intervals.
    pub fn identified(&self, record: &CancellableRecord<'_>, known: &Known) -> Identified {
        let lag = self.lag.as_ref().filter(|lag| known.lag.is_some() || lag.is_seen() || !is_right(record, &self.best));
        let mut bounded = lag.map_or_else(|| Bounded::new(record, self.best), |lag| lag.bounded(record));
        // The intervals reach to it by its size; the sign is not determined.
        let rival = rival(record, &bounded.fit).map(|fit| fit.puck);
        bounded.ends.extend(rival.map(|puck| Puck { gain: -puck.gain, ..puck }));
        let residual = residual(&left(record, &bounded.fit));
        let spread = spread(record, &bounded.fit);
        let found = Intervals::new(record, bounded, self.lag.as_ref(), known).identified(record, residual, spread);
        let sign = found.sign.filter(|_| rival.is_none());
        Identified { damping: found.damping.map(|damping| known.own(damping)), sign, ..found }
    }
}

/// The search for the best fit, or a single fit where the device is richer than the puck.
pub(crate) fn search_or_glimpse(
    record: &CancellableRecord<'_>,
    known: &Known,
    by_torque: Option<&TorqueFit>,
) -> Result<BestFit, Error> {
    if by_torque.is_some_and(TorqueFit::leaves_more_than_noise) && is_richer(record, known) {
        glimpse(record, known)
    } else {
        search(record, known)
    }
}

/// Whether a device whose equation of motion leaves more of the torque than the positions' noise explains is richer than the puck: a search
/// finds no puck that explains the stretch of the record that moves most.
fn is_richer(record: &CancellableRecord<'_>, known: &Known) -> bool {
    let Some(stretch) = record.liveliest(BRIEF) else { return false };
    let stretch = CancellableRecord { record: &stretch, ..*record };
    let starts = starts(&stretch);
    let explains =
        |starts: &[Puck]| best(&stretch, starts).is_some_and(|fit| judged(&stretch, known, fit).wrong.is_none());
    !explains(&starts) && !explains(&again(&stretch, &starts))
}

/// A single fit, for its residuals, where none explains the record.
fn glimpse(record: &CancellableRecord<'_>, known: &Known) -> Result<BestFit, Error> {
    let squares = |puck: &Puck| {
        let at = |(z, seen): (f64, &f64)| (seen - z).powi(2);
        let seen = &record.positions()[record.first()..];
        fitted(record, puck, record.first()).into_iter().zip(seen).map(at).sum::<f64>()
    };
    let starts = starts(record).into_iter().map(|puck| (squares(&puck), puck));
    let start = starts.filter(|start| start.0.is_finite()).min_by(|a, b| a.0.total_cmp(&b.0));
    let start = start.ok_or(Error::Unexplained)?.1;
    let best = fit(record, start, free(record, record.is_driven()), record.first()).ok_or(Error::Unexplained)?;
    let wrong = Some(unexplained(record, &best).unwrap_or_else(|| large(record, known, &best)));
    Ok(BestFit { best, lag: None, wrong })
}

/// The search for the best fit. A long record is fitted from its beginning on: the fit of a part leads to that of one twice as long, and a
/// part that nothing explains ends the search.
pub(crate) fn search(record: &CancellableRecord<'_>, known: &Known) -> Result<BestFit, Error> {
    let duration = record.period() * record.times().len() as f64;
    let beginning = || BEGINNINGS.into_iter().find_map(|part| Some((part, record.beginning(part)?)));
    let Some((mut part, beginning)) = (duration > LONG).then(beginning).flatten() else { return whole(record, known) };
    let mut found = search(&CancellableRecord { record: &beginning, ..*record }, known)?;
    while found.wrong.is_none() && part < 1.0 && !(record.stop)() {
        part *= 2.0;
        let longer = if part < 1.0 { record.beginning(part) } else { None };
        let longer = CancellableRecord { record: longer.as_ref().unwrap_or(record), ..*record };
        found = best(&longer, &[found.lead()]).map(|fit| judged(&longer, known, fit)).ok_or(Error::Unexplained)?;
    }
    if part < 1.0
        && let Some(fit) = fit(record, found.lead(), found.best.free, found.best.first)
    {
        found.best = fit;
    }
    Ok(found)
}

/// The same from one puck, which is near the best one.
pub(crate) fn search_from(record: &CancellableRecord<'_>, known: &Known, start: Puck) -> Option<BestFit> {
    best(record, &[start]).map(|fit| judged(record, known, fit))
}

/// The search over all of a record at once.
fn whole(record: &CancellableRecord<'_>, known: &Known) -> Result<BestFit, Error> {
    let starts = starts(record);
    let first = best(record, &starts);
    if let Some(found) = first.map(|fit| judged(record, known, fit)).filter(|found| found.wrong.is_none()) {
        return Ok(found);
    }
    // A fit can stop far from the best. Then fits of the beginning give new starts, and so do points around the best.
    let mut best =
        first.into_iter().chain(best(record, &again(record, &starts))).min_by(by_variance).ok_or(Error::Unexplained)?;
    for part in AROUND {
        if is_right(record, &best) || blamed(record, known, &best).is_some() {
            break;
        }
        best = around(record, &best, part);
    }
    Ok(judged(record, known, best))
}

/// A fit, also with a lag where the record determines one or a lag explains more than the fit without, and whether it explains the record.
fn judged(record: &CancellableRecord<'_>, known: &Known, best: Fit) -> BestFit {
    let explains = is_right(record, &best);
    let lag = Lag::new(record, &best, explains, known.lag).filter(|lag| explains || is_right(record, &lag.fit));
    let wrong = match explains || lag.is_some() {
        true => unexplained(record, lag.as_ref().filter(|_| !explains).map_or(&best, |lag| &lag.fit)),
        false => Some(unexplained(record, &best).unwrap_or_else(|| large(record, known, &best))),
    };
    BestFit { best, lag, wrong }
}

/// The torque that depends on the position, where it explains most of a fit's residuals.
fn blamed(record: &Record, known: &Known, fit: &Fit) -> Option<PositionTorque> {
    position_torque(record, fit, known.is_linear).filter(|x| (MIN_EXPLAINED..=1.0).contains(&x.explains))
}

fn large(record: &Record, known: &Known, best: &Fit) -> Error {
    let left = left(record, best);
    let rms = residual(&left).rms;
    let counts = record.lattice().map(|lattice| rms / lattice.step);
    let resonance_hz = resonance(&best.puck.left_from_sample(record, best.first));
    let position = blamed(record, known, best);
    Error::Residual(LargeResidual { rms, counts, position, resonance_hz, puck: Some(Box::new(best.puck)) })
}

/// The error of a fit that explains nothing of the motion; else `None`.
fn unexplained(record: &Record, best: &Fit) -> Option<Error> {
    let rms = residual(&left(record, best)).rms;
    let explains = rms.powi(2) < UNEXPLAINED * spread(record, best).powi(2);
    let delay_is_inside = best.puck.delay < LONGEST_DELAY;
    (!(explains && delay_is_inside && best.puck.gain.is_finite())).then_some(Error::Unexplained)
}

fn by_variance(a: &Fit, b: &Fit) -> Ordering {
    a.variance().total_cmp(&b.variance())
}

/// The results of fits to longer and longer beginnings of the record, from each start and from the same without friction.
fn again(record: &CancellableRecord<'_>, starts: &[Puck]) -> Vec<Puck> {
    let beginnings: Vec<Record> = BEGINNINGS.iter().filter_map(|part| record.beginning(*part)).collect();
    let lead = |start: Puck| {
        beginnings.iter().fold(start, |puck, part| {
            let part = CancellableRecord { record: part, ..*record };
            let found = fit(&part, puck, free(record, record.is_driven()), part.first()).map_or(puck, |fit| fit.puck);
            Puck { damping: found.damping.max(0.0), friction: found.friction.max(0.0), ..found }
        })
    };
    let both: Vec<Puck> = starts.iter().flat_map(|start| [*start, Puck { friction: 0.0, ..*start }]).collect();
    both.into_par_iter().map(lead).collect()
}

/// The best of the fits that start around one, with each number changed by up to this part of itself.
fn around(record: &CancellableRecord<'_>, best: &Fit, part: f64) -> Fit {
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
        let Puck { gain, damping, friction, delay, offset, position, velocity, lag } = found.puck;
        let start = Puck {
            gain: gain * (1.0 + 0.1 * off()),
            damping: damping * (1.0 + off()),
            friction: friction * (1.0 + off()),
            delay: delay + 0.1 * LONGEST_DELAY * off(),
            offset: if found.free[OFFSET] { offset + friction.abs().max(offset.abs()) * off() } else { 0.0 },
            position,
            velocity: velocity * (1.0 + off()),
            lag,
        };
        found = fit(record, start, found.free, found.first)
            .into_iter()
            .fold(found, |a, b| if b.variance() < a.variance() { b } else { a });
    }
    found
}

impl Identified {
    /// The fields of `hapt identify --json`, in its order: the contract's six, the lag, the time to the torque, and the constant torque.
    pub fn named(&self) -> [(&'static str, Option<crate::Interval>); 9] {
        [
            ("inertia", self.inertia),
            ("damping", self.damping),
            ("friction", self.friction),
            ("delay_s", self.delay),
            ("lag_s", self.lag),
            ("late_s", self.late),
            ("offset", self.offset),
            ("sign", self.sign),
            ("counts_per_rev", self.counts),
        ]
    }

    /// The residuals with their times, from the first sample that is fitted on.
    pub fn residuals(&self, record: &Record) -> Vec<(f64, f64)> {
        let rows = self.fitted(record).into_iter().zip(&record.positions()[self.first..]);
        rows.map(|((t, z), y)| (t, y - z)).collect()
    }

    /// The positions that the fit gives, with their times.
    pub fn fitted(&self, record: &Record) -> Vec<(f64, f64)> {
        match &self.positions {
            Some(positions) => record.times()[self.first..].iter().copied().zip(positions.iter().copied()).collect(),
            None => self.puck.positions_from(record, self.first),
        }
    }
}
