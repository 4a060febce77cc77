//! A device whose handle is on a flexible shaft: both inertias, the shaft's stiffness and damping, and the losses, delay and lag of the
//! motor's side.
//!
//! The model is solved exactly under the recorded torques at their times ([`Shafted`]). Its derivatives are differences of such runs. The
//! encoder is at the motor, the handle is free.

mod fit;
mod intervals;

use std::cmp::Ordering;
use std::iter;

use hapt_model::Handle;
use hapt_plant::spec::DeviceSpec;

use self::fit::{FEW_ITERATIONS, Fit, Free, MAX_ITERATIONS, POSITION, Parameters, SOON, VARIANCE, measured, positions};
use crate::best::best;
use crate::error::{Error, LargeResidual};
use crate::explained::explained;
use crate::identified::{CorrelatedPair, Residual};
use crate::interval::Interval;
use crate::record::{CancellableRecord, LONGEST_DELAY, Record};
use crate::remainder::residual;
use crate::ringing::{Ringing, ringing};
use crate::spectrum::{Line, line};
use crate::start::{Begin, begins, starts};

/// Factors of the ratio J_h / J that the record suggests, from which fits start, and the least and the largest ratio.
const PARTS: [f64; 3] = [1.0, 0.4, 2.5];
const RATIOS: [f64; 2] = [0.03, 30.0];
/// Other frequencies from which fits start.
const OTHERS: usize = 2;
/// The most fits that are followed to their end.
const FOLLOWED: usize = 4;
/// The part of the squares of a rigid device's fit below which a fit with a handle is followed to its end.
const RINGS: f64 = 0.5;
/// A record does not show a handle of less than this part of the motor's inertia.
const LEAST_HANDLE: f64 = 1e-3;
/// Steps of a fit that is compared with others, at first without a lag.
const FEW: usize = 10;

/// A device with a handle, as the record determines it; each value with its 95 % interval, in SI.
#[derive(Clone, Debug, PartialEq)]
pub struct WithHandle {
    /// J of the motor's side.
    pub inertia: Interval,
    /// Viscous, of the motor's side.
    pub damping: Interval,
    /// Coulomb's, of the motor's side.
    pub friction: Interval,
    /// From the sample to the change of the torque, in s. Where the interval of the lag begins at 0, the record does not separate them, and
    /// this is both together.
    pub delay: Interval,
    /// The motor's, in s.
    pub lag: Interval,
    /// Delay and lag together, in s.
    pub late: Interval,
    /// J_h of the handle beyond the shaft.
    pub handle_inertia: Interval,
    /// The stiffness of the shaft.
    pub stiffness: Interval,
    /// The damping of the shaft.
    pub shaft_damping: Interval,
    /// The resonance of both inertias on the shaft, hands-off, in Hz.
    pub resonance_hz: f64,
    /// Two of delay, lag, shaft damping, ... that the record hardly separates.
    pub correlated: Vec<CorrelatedPair>,
    /// The residuals of the fit.
    pub residual: Residual,
}

/// Fits a device with a handle to a record that begins at rest or in motion.
///
/// # Errors
/// [`Error::Unexplained`] and [`Error::Residual`] where no such device explains it, [`Error::Rigid`] where one without a handle does too.
pub fn identify_handle(record: &Record) -> Result<WithHandle, Error> {
    identify_handle_until(record, &|| false)
}

/// The same, until `stop` returns true; then the result is the fit at that moment.
///
/// # Errors
/// As [`identify_handle`].
pub fn identify_handle_until(record: &Record, stop: &(dyn Fn() -> bool + Sync)) -> Result<WithHandle, Error> {
    let found = search(&CancellableRecord { record, stop }, None)?.into_result()?;
    let shows = found.handle_inertia.low >= LEAST_HANDLE * found.inertia.value;
    if shows { Ok(found) } else { Err(Error::Rigid) }
}

/// The best fit of a search.
pub(crate) struct HandleSearch {
    fit: Fit,
    /// Devices that explain the record as well, far from it.
    others: Vec<Parameters>,
    /// Why it does not explain the record.
    wrong: Option<Error>,
    pub residual: Residual,
}

impl HandleSearch {
    /// The numbers, or why there are none.
    pub fn into_result(self) -> Result<WithHandle, Error> {
        match self.wrong {
            Some(error) => Err(error),
            None => self.fit.with_intervals(&self.others, self.residual).ok_or(Error::Unexplained),
        }
    }

    /// The positions of the fit, with their times.
    pub fn fitted(&self, record: &Record) -> Vec<(f64, f64)> {
        measured(record).map(|i| record.times()[i]).zip(positions(record, &self.fit.p).unwrap_or_default()).collect()
    }

    /// The residuals of the record's positions.
    pub fn residuals(&self, record: &Record) -> Vec<(f64, f64)> {
        measured(record).map(|i| record.times()[i]).zip(self.fit.left.iter().copied()).collect()
    }
}

/// The search for the device that explains a record. A search that begins near a device ends with it where it explains the record.
pub(crate) fn search(watched: &CancellableRecord<'_>, near: Option<&DeviceSpec>) -> Result<HandleSearch, Error> {
    let CancellableRecord { record, stop } = *watched;
    let (lattice, spread) = (record.lattice(), record.spread());
    let explains = |fit: &Fit| explained(record, &fit.left, lattice, spread);
    let own = near.and_then(|device| begun(watched, device)).filter(explains);
    let mut best = own.and_then(|own| own.fitting(Free::All).improved(record, MAX_ITERATIONS, &|_, _| stop()));
    // The best after a few steps need not be the best in the end, and with much noise more than one may explain the record.
    let mut seen: Vec<Fit> = Vec::new();
    let near = near.map(|device| Starts { at: around(record, device), rigid: f64::INFINITY });
    let all = near.into_iter().chain(iter::once_with(|| starts_of(watched)).flatten());
    let mut rings = true;
    for Starts { at, rigid } in all {
        if best.as_ref().is_some_and(explains) {
            break;
        }
        let fits = with_lags(watched, at, &explains);
        // A handle that rings explains most of the residuals of a rigid device.
        rings = fits.first().is_some_and(|fit| fit.squares < RINGS * rigid);
        for fit in fits {
            if stop() || best.as_ref().is_some_and(|best| !rings || explains(best)) {
                seen.push(fit);
                continue;
            }
            best = best.into_iter().chain(fit.improved(record, MAX_ITERATIONS, &|_, _| stop())).min_by(by_squares);
        }
    }
    let best = best.ok_or(Error::Unexplained)?;
    let (fit, mut others) = match rings || explains(&best) {
        true => best
            .at_rest(record, stop)
            .settled(record, &explains, stop)
            .profiled(record, stop)
            .ok_or(Error::Unexplained)?,
        false => (best, Vec::new()),
    };
    let as_well = |seen: &&Fit| seen.rests == fit.rests && seen.squares < fit.enough();
    others.extend(seen.iter().filter(as_well).map(|seen| seen.p));
    let residual = residual(&fit.left);
    let counts = lattice.map(|lattice| residual.rms / lattice.step);
    let wrong = LargeResidual { rms: residual.rms, counts, position: None, resonance_hz: None, puck: None };
    let wrong = (!explains(&fit)).then_some(Error::Residual(wrong));
    Ok(HandleSearch { fit, others, wrong, residual })
}

/// A known device from its best initial state.
fn begun(watched: &CancellableRecord<'_>, device: &DeviceSpec) -> Option<Fit> {
    let CancellableRecord { record, stop } = *watched;
    let starts = around(record, device).into_iter().flat_map(|start| [(true, start), (false, moving(record, start))]);
    let fits = starts.filter_map(|(rests, start)| {
        Fit::of(record, start, rests)?.fitting(Free::Beginning).improved(record, FEW_ITERATIONS, &|_, _| stop())
    });
    fits.min_by(by_squares)
}

/// The squares that it leaves.
pub(crate) fn squares_of(watched: &CancellableRecord<'_>, device: &DeviceSpec) -> Option<f64> {
    begun(watched, device).map(|fit| fit.squares)
}

fn by_squares(a: &Fit, b: &Fit) -> Ordering {
    a.squares.total_cmp(&b.squares)
}

/// The fits with a lag from these starts, the best first.
fn with_lags(watched: &CancellableRecord<'_>, at: Vec<Parameters>, explains: &dyn Fn(&Fit) -> bool) -> Vec<Fit> {
    let CancellableRecord { record, stop } = *watched;
    // `known`: the squares of a fit that explains the record.
    let improved = |fit: Fit, most: usize, known: Option<f64>| {
        fit.improved(record, most, &|fit, steps| stop() || (steps >= SOON && fit.leads_elsewhere(known)))
    };
    let from = |rests: bool, p: Parameters, known: Option<f64>| {
        let mut fit = Fit::of(record, p, rests)?;
        if !rests {
            // A wrong initial state of a fast motion would first distort every other number.
            fit = improved(fit.fitting(Free::Beginning), FEW, None)?;
        }
        // Far from the device the lag would stand for the error of another parameter.
        improved(fit.fitting(Free::But(VARIANCE)), FEW, known)
    };
    let lagging = |fit: Fit, known: Option<f64>| improved(fit.lagging(record), FEW_ITERATIONS, known);
    let first = at.first().and_then(|start| from(true, *start, None));
    let mut fits: Vec<Fit> = first.clone().and_then(|fit| lagging(fit, None)).into_iter().collect();
    // Where the most likely start leads to a device that explains the record, the others only have to be compared with it, and one in
    // motion is near it.
    let found = fits.first().filter(|fit| explains(fit)).map(|fit| (fit.p, fit.squares));
    let known = found.map(|(_, squares)| squares);
    let mut others: Vec<Fit> = at.iter().skip(1).filter_map(|start| from(true, *start, known)).collect();
    let begins = found.map_or(at, |(p, _)| vec![p]);
    others.extend(begins.into_iter().filter_map(|start| from(false, moving(record, start), known)));
    let competes = |fit: &Fit| {
        let shows = known.is_none_or(|known| fit.rests || fit.shows_motion(known));
        shows && !fit.leads_elsewhere(known)
    };
    others.retain(|fit| competes(fit) && !first.as_ref().is_some_and(|first| fit.is_near(first)));
    others.sort_by(by_squares);
    others.truncate(FOLLOWED);
    others.dedup_by(|a, b| a.is_near(b));
    fits.extend(others.into_iter().filter_map(|fit| lagging(fit, known)).filter(competes));
    fits.sort_by(by_squares);
    fits
}

/// Where fits start.
struct Starts {
    /// The parameters at rest.
    at: Vec<Parameters>,
    /// The sum of squares that a rigid device leaves.
    rigid: f64,
}

/// Starts at a given device.
fn around(record: &Record, device: &DeviceSpec) -> Vec<Parameters> {
    let handle = device.handle.unwrap_or(Handle { inertia: device.inertia, stiffness: 0.0, damping: 0.0 });
    let whole = device.inertia + handle.inertia;
    let mass = device.inertia * handle.inertia / whole;
    let start: Parameters = [
        whole.ln(),
        device.damping,
        device.friction,
        (device.delay + device.lag).clamp(0.0, LONGEST_DELAY),
        (handle.inertia / device.inertia).ln(),
        (handle.stiffness / mass).ln(),
        handle.damping / mass,
        device.lag.min(LONGEST_DELAY).powi(2),
        record.positions()[0],
        0.0,
        0.0,
        0.0,
    ];
    vec![start]
}

/// The same start with an initial motion. A small velocity that friction ends within some samples hardly shows that it should be 0.
fn moving(record: &Record, mut start: Parameters) -> Parameters {
    let Begin { position, velocity } = begins(record, 0)[0];
    (start[POSITION], start[POSITION + 1]) = (position, velocity);
    start
}

/// The frequencies at which the handle seems to ring in the record of a rigid device; `None` where there is none.
fn starts_of(watched: &CancellableRecord<'_>) -> Option<Starts> {
    let record = watched.record;
    let rigid = best(watched, &starts(watched))?;
    let whole = rigid.puck.gain.recip();
    if !(whole.is_finite() && whole > 0.0) {
        return None;
    }
    let start = |ringing: &Ringing, part: f64| -> Parameters {
        [
            whole.ln(),
            (rigid.puck.damping * whole).max(0.0),
            (rigid.puck.friction * whole).max(0.0),
            (rigid.puck.delay + rigid.puck.lag).clamp(0.0, LONGEST_DELAY),
            (part * ringing.ratio).clamp(RATIOS[0], RATIOS[1]).ln(),
            2.0 * ringing.omega.ln(),
            0.02 * ringing.omega,
            0.0,
            record.positions()[0],
            0.0,
            0.0,
            0.0,
        ]
    };
    let ringing = ringing(watched, &rigid);
    let (first, others) = ringing.split_first()?;
    let others = others.iter().take(OTHERS).map(|other| (other, 1.0));
    let first = PARTS.map(|part| (first, part)).into_iter();
    let at = first.chain(others).map(|(ringing, part)| start(ringing, part)).collect();
    Some(Starts { at, rigid: rigid.factor.squares })
}
impl WithHandle {
    /// The numbers under their names, in the order of `hapt identify --handle --json`.
    pub fn named(&self) -> [(&'static str, Interval); 9] {
        [
            ("inertia", self.inertia),
            ("damping", self.damping),
            ("friction", self.friction),
            ("delay_s", self.delay),
            ("lag_s", self.lag),
            ("late_s", self.late),
            ("handle_inertia", self.handle_inertia),
            ("stiffness", self.stiffness),
            ("shaft_damping", self.shaft_damping),
        ]
    }
}

/// The line of a shaft in the residuals of a rigid device, in Hz; `None` where no line stands out.
pub(crate) fn resonance(left: &[(f64, f64)]) -> Option<f64> {
    line(left).filter(Line::is_clear).map(|line| line.hz)
}
