//! Whether a record agrees with the numbers of the device in a world's file.

mod claims;
mod judged;
mod number;
mod own;

use hapt_model::Handle;
use serde_json::{Value, json};

pub use claims::Claims;
pub use number::{Compared, Verdict};

use crate::device::{self, Device, Shot};
use crate::estimate::{search_from, search_or_glimpse};
use crate::fit::Fit;
use crate::handle;
use crate::identified::{Identified, Known, Residual};
use crate::json::value;
use crate::misfit::Misfit;
use crate::record::{CancellableRecord, Record};
use crate::remainder::{left, residual};
use crate::torque::{TorqueFit, fit_torque_until};
use crate::{Error, Lattice};
use claims::{device_of, middle};
use judged::Scale;
use number::WIDE;

/// A record against a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Every number of the device.
    pub numbers: Vec<Compared>,
    /// Why no device explains the record: that contradicts the file, whatever its numbers are.
    pub wrong: Option<Error>,
    /// The misfit of the torque's equation, where no device explains the whole motion but this equation determines an inertia: the numbers
    /// are then those of the equation.
    pub misfit: Option<Misfit>,
    /// The positions of the best fit, with their times.
    pub fitted: Vec<(f64, f64)>,
    /// The residuals of the positions, with their times.
    pub residuals: Vec<(f64, f64)>,
    /// The size of the residuals.
    pub residual: Residual,
    /// The positions' noise, rms, estimated without a fit, in rad (m).
    pub noise: f64,
    /// The lattice of the positions.
    pub lattice: Option<Lattice>,
}

impl Comparison {
    /// The output of `hapt identify --against --json`.
    pub fn json(&self) -> Value {
        let number = |number: &Compared| {
            json!({
                "name": number.name,
                "estimate": value(number.estimate),
                "file": { "low": number.file[0], "high": number.file[1] },
                "sigmas": number.sigmas.filter(|x| x.is_finite()),
                "verdict": number.verdict.word(),
                "reason": number.reason,
            })
        };
        json!({
            "agrees": self.agrees(),
            "numbers": self.numbers.iter().map(number).collect::<Vec<Value>>(),
            "unexplained": self.wrong.as_ref().map(Error::to_string),
            "misfit": self.misfit.as_ref().map(Misfit::json),
            "residual": {
                "rms": self.residual.rms,
                "noise_rms": self.noise,
                "correlation": self.residual.correlation,
                "counts": self.lattice.map(|lattice| self.residual.rms / lattice.step),
            },
        })
    }

    /// Whether nothing in the record contradicts the file.
    pub fn agrees(&self) -> bool {
        self.wrong.is_none() && self.numbers.iter().all(|number| number.verdict != Verdict::Contradicts)
    }
}

/// Compares a record with a file's numbers; `is_linear`: the puck moves along a line.
///
/// # Errors
/// [`Error::Unexplained`] where no start for a fit is found.
pub fn against(record: &Record, claims: &Claims, is_linear: bool) -> Result<Comparison, Error> {
    compared(&CancellableRecord { record, stop: &|| false }, claims, is_linear)
}

/// The same, or `None` once `stop` is true.
pub fn against_until(
    record: &Record,
    claims: &Claims,
    is_linear: bool,
    stop: &(dyn Fn() -> bool + Sync),
) -> Option<Result<Comparison, Error>> {
    let result = compared(&CancellableRecord { record, stop }, claims, is_linear);
    (!stop()).then_some(result)
}

fn compared(record: &CancellableRecord<'_>, claims: &Claims, is_linear: bool) -> Result<Comparison, Error> {
    match &claims.handle {
        Some(handle) => with_handle(record, claims, handle),
        None => rigid(record, claims, is_linear),
    }
}

fn rigid(record: &CancellableRecord<'_>, claims: &Claims, is_linear: bool) -> Result<Comparison, Error> {
    let lag = middle(claims.lag);
    let known = Known { is_linear, lag: (lag > 0.0).then_some(lag), ..Known::default() };
    // A fit near the file's own device comes first, where that device is more than a puck.
    let near = |device: &Device| device::near(record, device);
    let identified = |fit: device::Fit| fit.identified(record, &known).map(|x| (x, fit.shots));
    let with_stops = |fit: Option<device::Fit>| {
        let fit = fit?;
        // Harmonics are compared by the pitch and the phase of the file.
        let found = match fit.device.with_waves_of(&Device::of_spec(&claims.device())) {
            Some(device) => near(&device),
            None => Some(fit),
        };
        found.and_then(identified).filter(|(x, _)| x.stops.is_some_and(|stops| stops.are_sure()))
    };
    let own = || device_of(claims).and_then(|device| near(&device)).and_then(identified);
    if let Some((x, shots)) = own().or_else(|| with_stops(device::search(record, &known))) {
        return Ok(explained(record, claims, &x, shots));
    }
    let by_torque = fit_torque_until(record, &known, record.stop);
    let mut found = search_or_glimpse(record, &known, by_torque.as_ref())?;
    if found.wrong.is_some()
        && let Some(near) = search_from(record, &known, claims.puck(record)).filter(|near| near.wrong.is_none())
    {
        // A search from elsewhere can miss the device of the file.
        found = near;
    }
    if found.wrong.is_some()
        && let Some((x, shots)) = with_stops(device::search_loaded(record, &known))
    {
        return Ok(explained(record, claims, &x, shots));
    }
    let (numbers, puck, first, residual) = if found.wrong.is_none() {
        let x = found.identified(record, &known);
        let mut numbers = judged::plain(&x, claims, &Scale::of(record));
        numbers.extend(judged::stribeck(&x, claims, &Scale::of(record)));
        numbers.extend(judged::stops(record, &x, claims));
        numbers.extend(judged::waves(claims, None, judged::NO_WAVE));
        let shot = Shot { from: x.first, to: record.times().len(), state: [x.puck.position, x.puck.velocity] };
        limit(&mut numbers, || own::excess(record, claims, &x, vec![shot]));
        (numbers, x.puck, x.first, x.residual)
    } else {
        let Fit { puck, first, .. } = found.best;
        let mut numbers = judged::without(claims);
        numbers.extend(judged::waves(claims, None, judged::UNEXPLAINED));
        (numbers, puck, first, residual(&left(record, &found.best)))
    };
    // For a device richer than the file's, the numbers are those of the torque's equation, whose intervals allow for the misfit.
    // That equation has no stops.
    let is_richer = found.wrong.is_some() && claims.stops.is_none();
    let by_torque = by_torque.filter(|fit| is_richer && fit.inertia.is_some() && !fit.is_moved_by_another);
    let of_torque = |fit: &TorqueFit| {
        let mut numbers = judged::by_torque(fit, claims, &Scale::of(record));
        numbers.extend(judged::waves(claims, None, judged::LATE));
        numbers
    };
    Ok(Comparison {
        numbers: by_torque.as_ref().map_or(numbers, of_torque),
        misfit: by_torque.map(|fit| fit.misfit),
        wrong: found.wrong,
        fitted: puck.positions_from(record, first),
        residuals: puck.left_from_sample(record, first),
        residual,
        noise: record.noise(),
        lattice: record.lattice(),
    })
}

/// The comparison with a fit of the motion that is more than a puck.
fn explained(record: &CancellableRecord<'_>, claims: &Claims, x: &Identified, shots: Vec<Shot>) -> Comparison {
    let mut numbers = judged::plain(x, claims, &Scale::of(record));
    numbers.extend(judged::stribeck(x, claims, &Scale::of(record)));
    numbers.extend(judged::stops(record, x, claims));
    numbers.extend(judged::waves(claims, x.waves.as_ref(), WIDE));
    numbers.extend(judged::spring(x));
    limit(&mut numbers, || own::excess(record, claims, x, shots));
    Comparison {
        numbers,
        wrong: None,
        misfit: None,
        fitted: x.fitted(record),
        residuals: x.residuals(record),
        residual: x.residual,
        noise: record.noise(),
        lattice: x.lattice,
    }
}

/// No number is farther outside of the file's range than the squares that the file's own device leaves in excess allow.
fn limit(numbers: &mut [Compared], excess: impl FnOnce() -> Option<f64>) {
    if numbers.iter().any(|number| number.verdict == Verdict::Contradicts)
        && let Some(excess) = excess()
    {
        numbers.iter_mut().for_each(|number| number.no_farther(excess.max(0.0).sqrt()));
    }
}

/// A search for seven numbers and an initial state can miss the device: a record that it does not explain gives no verdict.
fn with_handle(record: &CancellableRecord<'_>, claims: &Claims, shaft: &Handle) -> Result<Comparison, Error> {
    let found = handle::search(record, Some(&claims.device()))?;
    let (fitted, residuals, residual) = (found.fitted(record), found.residuals(record), found.residual);
    let found = found.into_result()?;
    let mut numbers = judged::with_handle(&found, claims, shaft, &Scale::of(record));
    numbers.extend(judged::waves(claims, None, judged::ON_SHAFT));
    limit(&mut numbers, || own::excess_with_handle(record, claims, &found, &residuals));
    Ok(Comparison {
        numbers,
        wrong: None,
        misfit: None,
        fitted,
        residuals,
        residual,
        noise: record.noise(),
        lattice: record.lattice(),
    })
}
