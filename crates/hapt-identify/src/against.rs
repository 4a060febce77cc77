//! Whether a record agrees with the numbers of the device in a world's file.

use hapt_model::keys::Measure;
use hapt_model::{DeviceSpec, Handle, World};
use hapt_plant::spec::{DeviceTorque, FrictionByPosition, Stops, Stribeck};
use serde_json::{Value, json};

use crate::device::{self, Device};
use crate::estimate::{search_from, search_or_glimpse};
use crate::fit::Fit;
use crate::handle::{self, WithHandle};
use crate::identified::{FoundWaves, Harmonics, Identified, Known, Residual};
use crate::interval::Interval;
use crate::json::value;
use crate::misfit::Misfit;
use crate::puck::Puck;
use crate::record::{CancellableRecord, Record};
use crate::remainder::{RESOLUTION, left, residual};
use crate::start::{Begin, begins};
use crate::terms::TermKind;
use crate::torque::{TorqueFit, fit_torque_until};
use crate::{Error, Lattice};

/// An estimate this many standard errors outside contradicts the file. A lag that is too short to be separated from a delay can move the
/// other numbers by up to four of their standard errors.
const SURELY: f64 = 5.0;
/// The standard errors of half a 95 % interval.
const HALF: f64 = 1.959_964;
/// A record determines a number whose interval reaches no farther than this part of the number on either side, or than its tolerance.
const TOLD: f64 = 0.2;
/// A record whose sample period differs by this part from the world's belongs to another loop.
const PERIOD: f64 = 0.05;
/// A friction of 0 counts as this part of the record's largest torque, and so does a damping of 0 at the record's speeds.
const SMALL: f64 = 0.05;

/// The numbers of a device as a file has them: least and largest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Claims {
    /// J in kg·m² (linear: kg).
    pub inertia: [f64; 2],
    /// b in N·m·s/rad (N·s/m).
    pub damping: [f64; 2],
    /// Coulomb's, in N·m (N).
    pub friction: [f64; 2],
    /// Half of the difference between the friction toward smaller positions and that toward larger ones, in the same unit; the friction is
    /// then the mean of the two.
    pub lean: f64,
    /// The time constant of the motor, in s.
    pub lag: [f64; 2],
    /// The delay of the torque, in s.
    pub delay: [f64; 2],
    /// The loop's period in s.
    pub period: f64,
    /// On a flexible shaft; its numbers have no tolerance.
    pub handle: Option<Handle>,
    /// Friction that falls with the speed; its numbers have no tolerance.
    pub stribeck: Option<Stribeck>,
    /// End stops; their numbers have no tolerance.
    pub stops: Option<Stops>,
    /// Gravity and cogging; their numbers have no tolerance.
    pub torque: DeviceTorque,
    /// How friction changes with the position; its numbers have no tolerance.
    pub friction_by_position: Option<FrictionByPosition>,
}

/// The verdict of a record on a number of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The record determines the number, and it is within the file's range or less than five standard errors outside.
    Agrees,
    /// It is farther outside.
    Contradicts,
    /// The record allows so wide a range that its agreement would mean nothing.
    NotDetermined,
}

/// One number, of the record and of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    /// inertia, damping, friction, constant torque, lag, delay, delay and lag, sign; handle inertia, shaft stiffness, shaft damping;
    /// stribeck torque, stribeck velocity; low stop, high stop, stop stiffness, stop damping; gravity sine and cosine; cogging sine 1 and
    /// cosine 1, and so on for each harmonic of the file; friction sine 1 and cosine 1, and so on; spring.
    pub name: &'static str,
    /// The kind of its unit; `None`: it has no unit.
    pub measure: Option<Measure>,
    /// The estimate from the record.
    pub estimate: Option<Interval>,
    /// The least and the largest that the file allows; NaN: the file has none.
    pub file: [f64; 2],
    /// The distance of the estimate from that range, in standard errors; 0 inside.
    pub sigmas: Option<f64>,
    /// The conclusion.
    pub verdict: Verdict,
    /// Why the record does not determine it, or how it contradicts where there is no estimate.
    pub reason: Option<&'static str>,
}

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

impl Verdict {
    /// The word in the JSON: `agrees`, `contradicts`, or `not told`.
    pub fn word(self) -> &'static str {
        match self {
            Verdict::Agrees => "agrees",
            Verdict::Contradicts => "contradicts",
            Verdict::NotDetermined => "not told",
        }
    }
}

impl Claims {
    /// The claims of a world's file.
    pub fn of(world: &World) -> Self {
        let device = &world.device;
        let [forward, backward] = device.frictions_range();
        Claims {
            inertia: device.inertia_range(),
            damping: device.damping_range(),
            friction: [0, 1].map(|i| 0.5 * (forward[i] + backward[i])),
            lean: 0.5 * (device.frictions()[1] - device.frictions()[0]),
            lag: device.lag_range(),
            delay: [world.sampling.delay_s(), world.sampling.delay_max_s()],
            period: world.sampling.period,
            handle: device.handle,
            stribeck: device.stribeck.filter(|stribeck| stribeck.torque > 0.0),
            stops: device.stops,
            torque: device.torque,
            friction_by_position: device.friction_by_position,
        }
    }

    /// The median time between two samples of a record, in s, where it differs from the loop's: the record is then of another loop.
    pub fn other_period(&self, record: &Record) -> Option<f64> {
        let mut apart: Vec<f64> = record.times().windows(2).map(|pair| pair[1] - pair[0]).collect();
        apart.sort_by(f64::total_cmp);
        apart.get(apart.len() / 2).copied().filter(|own| (own / self.period - 1.0).abs() > PERIOD)
    }
}

fn middle([low, high]: [f64; 2]) -> f64 {
    0.5 * (low + high)
}

impl Claims {
    /// A puck with the middle of each range, and with the first position and velocity of the record.
    fn puck(&self, record: &Record) -> Puck {
        let gain = middle(self.inertia).recip();
        let Begin { position, velocity } = begins(record, record.first())[0];
        Puck {
            gain,
            damping: gain * middle(self.damping),
            friction: gain * middle(self.friction),
            delay: middle(self.delay) + middle(self.lag),
            offset: gain * self.lean,
            position,
            velocity,
            lag: 0.0,
        }
    }

    /// Whether friction changes with the position.
    fn changes(&self) -> bool {
        self.friction_by_position.is_some_and(|changes| changes.most() > 0.0)
    }

    /// The device with the middle of each range.
    fn device(&self) -> DeviceSpec {
        DeviceSpec {
            inertia: middle(self.inertia),
            damping: middle(self.damping),
            friction: middle(self.friction) - self.lean,
            friction_backward: Some(middle(self.friction) + self.lean).filter(|_| self.lean != 0.0),
            friction_by_position: self.friction_by_position,
            stribeck: self.stribeck,
            stops: self.stops,
            lag: middle(self.lag),
            delay: middle(self.delay),
            period: self.period,
            handle: self.handle,
            torque: self.torque,
        }
    }
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
    stop: &dyn Fn() -> bool,
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
    let near = |device: &Device| device::near(record, device)?.identified(record, &known);
    let with_stops = |fit: Option<device::Fit>| {
        let fit = fit?;
        // Harmonics are compared by the pitch and the phase of the file.
        let found = match fit.device.with_waves_of(&Device::of_spec(&claims.device())) {
            Some(device) => near(&device),
            None => fit.identified(record, &known),
        };
        found.filter(|x| x.stops.is_some_and(|stops| stops.are_sure()))
    };
    let own = || device_of(claims).and_then(|device| near(&device));
    if let Some(x) = own().or_else(|| with_stops(device::search(record, &known))) {
        return Ok(explained(record, claims, &x));
    }
    let mut found = search_or_glimpse(record, &known)?;
    if found.wrong.is_some()
        && let Some(near) = search_from(record, &known, claims.puck(record)).filter(|near| near.wrong.is_none())
    {
        // A search from elsewhere can miss the device of the file.
        found = near;
    }
    if found.wrong.is_some()
        && let Some(x) = with_stops(device::search_loaded(record, &known))
    {
        return Ok(explained(record, claims, &x));
    }
    let (numbers, puck, first, residual) = if found.wrong.is_none() {
        let x = found.identified(record, &known);
        let mut numbers = judged(&x, claims, &Scale::of(record));
        numbers.extend(judged_stribeck(&x, claims, &Scale::of(record)));
        numbers.extend(judged_stops(record, &x, claims));
        numbers.extend(judged_waves(claims, None, NO_WAVE));
        (numbers, x.puck, x.first, x.residual)
    } else {
        let Fit { puck, first, .. } = found.best;
        let mut numbers = judged_without(claims);
        numbers.extend(judged_waves(claims, None, UNEXPLAINED));
        (numbers, puck, first, residual(&left(record, &found.best)))
    };
    // For a device richer than the file's, the numbers are those of the torque's equation, whose intervals allow for the misfit.
    // That equation has no stops.
    let by_torque = found
        .wrong
        .as_ref()
        .filter(|_| claims.stops.is_none())
        .and_then(|_| fit_torque_until(record, &known, record.stop));
    let by_torque = by_torque.filter(|fit| fit.inertia.is_some() && !fit.is_moved_by_another);
    let of_torque = |fit: &TorqueFit| {
        let mut numbers = judged_by_torque(fit, claims, &Scale::of(record));
        numbers.extend(judged_waves(claims, None, LATE));
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
fn explained(record: &Record, claims: &Claims, x: &Identified) -> Comparison {
    let mut numbers = judged(x, claims, &Scale::of(record));
    numbers.extend(judged_stribeck(x, claims, &Scale::of(record)));
    numbers.extend(judged_stops(record, x, claims));
    numbers.extend(judged_waves(claims, x.waves.as_ref(), WIDE));
    numbers.extend(judged_spring(x));
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

/// A search for seven numbers and an initial state can miss the device: a record that it does not explain gives no verdict.
fn with_handle(record: &CancellableRecord<'_>, claims: &Claims, shaft: &Handle) -> Result<Comparison, Error> {
    let found = handle::search(record, Some(&claims.device()))?;
    let (fitted, residuals, residual) = (found.fitted(record), found.residuals(record), found.residual);
    let found = found.into_result()?;
    let mut numbers = judged_with_handle(&found, claims, shaft, &Scale::of(record));
    numbers.extend(judged_waves(claims, None, ON_SHAFT));
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

/// The sizes that count as large in a record.
struct Scale {
    torque: f64,
    /// Rms, over a fiftieth of a second.
    speed: f64,
}

impl Scale {
    fn of(record: &Record) -> Self {
        let (times, positions) = (record.times(), record.positions());
        let apart = ((0.02 / record.period()).round() as usize).clamp(1, times.len() - 1);
        let speeds =
            (apart..times.len()).map(|i| (positions[i] - positions[i - apart]) / (times[i] - times[i - apart]));
        let squares: f64 = speeds.map(|v| v * v).sum();
        Scale {
            torque: record.torques().iter().fold(0.0, |most, torque| torque.abs().max(most)),
            speed: (squares / (times.len() - apart) as f64).sqrt(),
        }
    }
}

/// The numbers of a record that a device explains.
fn judged(found: &Identified, claims: &Claims, scale: &Scale) -> Vec<Compared> {
    let friction = SMALL * scale.torque;
    let holds = claims.friction[1] + claims.lean.abs();
    let number = Compared::new;
    let mut numbers = vec![
        number("inertia", Some(Measure::Inertia), found.inertia, claims.inertia, 0.0),
        number("damping", Some(Measure::Damping), found.damping, claims.damping, friction / scale.speed),
        number("friction", Some(Measure::Torque), found.friction, claims.friction, friction),
        number("constant torque", Some(Measure::Torque), found.offset, [-holds, holds], friction),
    ];
    numbers.extend(lateness(found.lag, found.delay, found.late, claims));
    numbers.push(number("sign", None, found.sign, [1.0, 1.0], 0.0));
    numbers
}

/// The device of a file with Stribeck friction, end stops, torques of the position or friction that changes with it; `None` where it has none
/// of them.
fn device_of(claims: &Claims) -> Option<Device> {
    let is_plain = claims.stribeck.is_none() && claims.stops.is_none() && claims.torque.is_none();
    (!is_plain || claims.changes()).then(|| Device::of_spec(&claims.device()))
}

/// Names of the parts of a wave's harmonics.
type Names = [[&'static str; 2]; 4];
const OF_GRAVITY: Names = [["gravity sine", "gravity cosine"], [""; 2], [""; 2], [""; 2]];
const OF_COGGING: Names = [
    ["cogging sine 1", "cogging cosine 1"],
    ["cogging sine 2", "cogging cosine 2"],
    ["cogging sine 3", "cogging cosine 3"],
    ["cogging sine 4", "cogging cosine 4"],
];
const OF_FRICTION: Names = [
    ["friction sine 1", "friction cosine 1"],
    ["friction sine 2", "friction cosine 2"],
    ["friction sine 3", "friction cosine 3"],
    ["friction sine 4", "friction cosine 4"],
];

/// A spring to ground, which no file has.
fn judged_spring(found: &Identified) -> Option<Compared> {
    let term = found.terms.iter().find(|term| term.kind == TermKind::Stiffness)?;
    let number = Compared::new("spring", Some(Measure::Stiffness), Some(term.size), [0.0; 2], 0.0);
    Some(Compared { file: [f64::NAN; 2], reason: Some(NO_SPRING), ..number })
}

/// Each harmonic of the file's gravity, cogging and friction against that of a fit; `reason`: why the record does not determine it.
fn judged_waves(claims: &Claims, found: Option<&FoundWaves>, reason: &'static str) -> Vec<Compared> {
    let device = Device::of_spec(&claims.device());
    let waves = [
        (Measure::Torque, OF_GRAVITY, device.gravity(), found.map(|x| x.gravity)),
        (Measure::Torque, OF_COGGING, device.cogging(), found.map(|x| x.cogging)),
        (Measure::Ratio, OF_FRICTION, device.changes(), found.map(|x| x.changes)),
    ];
    let of = |(measure, names, file, found): (Measure, Names, [[f64; 2]; 4], Option<Harmonics>)| {
        let is_found = move |n: usize| found.is_some_and(|found| found[n][0].is_some());
        let stated = (0..4).filter(move |n| file[*n] != [0.0; 2] || is_found(*n));
        stated.flat_map(move |n| [(n, 0), (n, 1)]).map(move |(n, i)| {
            let estimate = found.and_then(|found| found[n][i]);
            // A part is small compared with the whole harmonic.
            let size = file[n][0].hypot(file[n][1]);
            let number = Compared::new(names[n][i], Some(measure), estimate, [file[n][i]; 2], size);
            if estimate.is_none() { Compared { reason: Some(reason), ..number } } else { number }
        })
    };
    waves.into_iter().flat_map(of).collect()
}

/// Stribeck friction of the file against that of a fit.
fn judged_stribeck(found: &Identified, claims: &Claims, scale: &Scale) -> Vec<Compared> {
    let Some(Stribeck { torque, velocity }) = claims.stribeck else { return Vec::new() };
    let number =
        |name, measure, estimate, file: f64, least| Compared::new(name, Some(measure), estimate, [file; 2], least);
    let seen = found.stribeck;
    let mut numbers = vec![
        number("stribeck torque", Measure::Torque, seen.map(|x| x.torque), torque, SMALL * scale.torque),
        number("stribeck velocity", Measure::Velocity, seen.map(|x| x.velocity), velocity, 0.0),
    ];
    if seen.is_none() && found.positions.is_none() {
        // A puck without it explains the record.
        numbers.iter_mut().for_each(|number| number.reason = Some(NO_FALL));
    }
    numbers
}

/// The stops of the file against those that the record runs into, or does not reach.
fn judged_stops(record: &Record, found: &Identified, claims: &Claims) -> Vec<Compared> {
    if claims.stops.is_none() && found.stops.is_none() {
        return Vec::new();
    }
    let (low, high) =
        record.positions().iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, z| (a.0.min(*z), a.1.max(*z)));
    let step = found.lattice.map_or(0.0, |lattice| lattice.step);
    // A stop acts where the puck is inside it by more than the positions' errors.
    let noise = SURELY * found.residual.rms.max(step).max(RESOLUTION * found.spread);
    let place = |name, side: f64, reached: f64, estimate: Option<Interval>, file: Option<f64>| {
        let range = [file.unwrap_or(f64::NAN); 2];
        let mut number = Compared::new(name, Some(Measure::Position), estimate, range, high - low);
        (number.verdict, number.reason) = match (estimate, file) {
            (Some(_), None) => (Verdict::Contradicts, Some(NO_STOP)),
            (None, Some(file)) if side * (reached - file) > noise => match found.positions {
                // A device with the file's own stops explains the record.
                Some(_) if found.stops.is_none() => (Verdict::NotDetermined, Some(WIDE)),
                _ => (Verdict::Contradicts, Some(PASSES)),
            },
            (None, _) => (Verdict::NotDetermined, Some(BEFORE)),
            (Some(_), Some(_)) => (number.verdict, number.reason),
        };
        number
    };
    let (file, seen) = (claims.stops, found.stops);
    let mut numbers = vec![
        place("low stop", -1.0, low, seen.and_then(|x| x.low), file.and_then(|x| x.low)),
        place("high stop", 1.0, high, seen.and_then(|x| x.high), file.and_then(|x| x.high)),
    ];
    // Where neither record nor file has a number of a stop, the row is left out.
    numbers.retain(|number| number.estimate.is_some() || !number.file[0].is_nan());
    let of = |name, measure, estimate, file: Option<f64>, least| {
        let mut number = Compared::new(name, Some(measure), estimate, [file.unwrap_or(f64::NAN); 2], least);
        if estimate.is_none() || file.is_none() {
            (number.verdict, number.reason) =
                (Verdict::NotDetermined, Some(if file.is_none() { NO_STOP } else { BEFORE }));
        }
        number
    };
    // A damping is small compared with twice the root of stiffness times inertia.
    let critical = file.map_or(0.0, |x| 2.0 * (x.stiffness * middle(claims.inertia)).sqrt());
    numbers.extend([
        of("stop stiffness", Measure::Stiffness, seen.map(|x| x.stiffness), file.map(|x| x.stiffness), 0.0),
        of("stop damping", Measure::Damping, seen.map(|x| x.damping), file.map(|x| x.damping), SMALL * critical),
    ]);
    numbers
}

/// Lag, delay, and both together.
fn lateness(lag: Option<Interval>, delay: Option<Interval>, late: Option<Interval>, claims: &Claims) -> [Compared; 3] {
    let number = |name, estimate, file, least| Compared::new(name, Some(Measure::Time), estimate, file, least);
    let is_determined = lag.is_some_and(|lag| lag.low > 0.0);
    let mut of_lag = number("lag", lag, claims.lag, claims.period);
    // The interval is one of λ², and so is the standard error.
    if let Some(Interval { value, low, high }) = lag {
        let squared = Interval { value: value * value, low: low * low, high: high * high };
        of_lag.sigmas = Some(sigmas(&squared, claims.lag.map(|lag| lag * lag)));
        of_lag.judge(lag, claims.period);
    }
    let both = [claims.delay[0] + claims.lag[0], claims.delay[1] + claims.lag[1]];
    // With a lag that is certainly short, the sum is the delay.
    let range = if is_determined { claims.delay } else { both };
    let mut of_delay = number("delay", delay, range, claims.period);
    if !is_determined && of_lag.verdict != Verdict::Agrees {
        if of_lag.verdict == Verdict::NotDetermined {
            of_lag.reason = Some(SLOW);
        }
        of_delay = Compared { reason: Some(SLOW), ..number("delay", None, claims.delay, 0.0) };
    }
    [of_lag, of_delay, number("delay and lag", late, both, claims.period)]
}

/// Why delay and lag show only as their sum.
const SLOW: &str = "the record tells only the sum of delay and lag: its torque changes too little, or too slowly, for the size of its noise";
const NONE: &str = "not in this record";
const WIDE: &str = "the record allows too much";
const BEFORE: &str = "the record does not reach it";
const PASSES: &str = "the record moves beyond it without a stop";
const NO_STOP: &str = "the file has no such stop";
const NO_FALL: &str = "a puck without it explains the record: the speeds are too high, or too low, to show it";
const NO_WAVE: &str = "a puck without it explains the record: its torque is too small to show, or the travel too short";
const NO_SPRING: &str = "no key: no file has a spring from the puck to the ground that is the device's own";
const ON_SHAFT: &str = "a fit with a handle does not have it";
const LATE: &str = "the torque's equation does not tell it";
const UNEXPLAINED: &str = "no interval is valid beside a motion that no device explains";

/// The numbers of a record by the torque's equation only, which does not determine the delay of the torque.
fn judged_by_torque(found: &TorqueFit, claims: &Claims, scale: &Scale) -> Vec<Compared> {
    let friction = SMALL * scale.torque;
    let holds = claims.friction[1] + claims.lean.abs();
    let number = |name, measure, estimate, file, least| Compared::new(name, measure, estimate, file, least);
    let late =
        |name, file| Compared { reason: Some(LATE), ..number(name, Some(Measure::Time), None, file, claims.period) };
    let sign = found.sign.map(|value| Interval { value, low: value, high: value });
    vec![
        number("inertia", Some(Measure::Inertia), found.inertia, claims.inertia, 0.0),
        number("damping", Some(Measure::Damping), found.damping, claims.damping, friction / scale.speed),
        number("friction", Some(Measure::Torque), found.friction, claims.friction, friction),
        number("constant torque", Some(Measure::Torque), found.offset, [-holds, holds], friction),
        late("lag", claims.lag),
        late("delay", claims.delay),
        number("sign", None, sign, [1.0, 1.0], 0.0),
    ]
}

/// The numbers of a record that no device explains.
fn judged_without(claims: &Claims) -> Vec<Compared> {
    let friction = claims.friction[1];
    let names: [(&'static str, Option<Measure>, [f64; 2]); 6] = [
        ("inertia", Some(Measure::Inertia), claims.inertia),
        ("damping", Some(Measure::Damping), claims.damping),
        ("friction", Some(Measure::Torque), claims.friction),
        ("constant torque", Some(Measure::Torque), [-friction, friction]),
        ("lag", Some(Measure::Time), claims.lag),
        ("delay", Some(Measure::Time), claims.delay),
    ];
    let number =
        |(name, measure, file)| Compared { reason: Some(UNEXPLAINED), ..Compared::new(name, measure, None, file, 0.0) };
    names.into_iter().map(number).collect()
}

/// The numbers of a device with a handle on a shaft. Its fit contains neither a constant torque nor a sign.
fn judged_with_handle(found: &WithHandle, claims: &Claims, shaft: &Handle, scale: &Scale) -> Vec<Compared> {
    let friction = SMALL * scale.torque;
    let number = |name, measure, estimate, file, least| Compared::new(name, Some(measure), Some(estimate), file, least);
    let exactly = |x: f64| [x, x];
    let mut numbers = vec![
        number("inertia", Measure::Inertia, found.inertia, claims.inertia, 0.0),
        number("damping", Measure::Damping, found.damping, claims.damping, friction / scale.speed),
        number("friction", Measure::Torque, found.friction, claims.friction, friction),
    ];
    numbers.extend(lateness(Some(found.lag), Some(found.delay), Some(found.late), claims));
    numbers.extend([
        number("handle inertia", Measure::Inertia, found.handle_inertia, exactly(shaft.inertia), 0.0),
        number("shaft stiffness", Measure::Stiffness, found.stiffness, exactly(shaft.stiffness), 0.0),
        number("shaft damping", Measure::Damping, found.shaft_damping, exactly(shaft.damping), 0.0),
    ]);
    numbers
}

/// The distance of an estimate from a range, in standard errors.
fn sigmas(x: &Interval, [low, high]: [f64; 2]) -> f64 {
    // Rounding of the file's own numbers is no contradiction.
    let rounding = 1e-9 * x.value.abs();
    let (out, half) = if x.value < low - rounding {
        (low - x.value, x.high - x.value)
    } else if x.value > high + rounding {
        (x.value - high, x.value - x.low)
    } else {
        return 0.0;
    };
    if half > 0.0 { HALF * out / half } else { f64::INFINITY }
}

impl Compared {
    /// `least`: a smaller number counts as this size.
    fn new(
        name: &'static str,
        measure: Option<Measure>,
        estimate: Option<Interval>,
        file: [f64; 2],
        least: f64,
    ) -> Self {
        let sigmas = estimate.map(|x| sigmas(&x, file));
        let mut compared =
            Compared { name, measure, estimate, file, sigmas, verdict: Verdict::NotDetermined, reason: None };
        compared.judge(estimate, least);
        compared
    }

    fn judge(&mut self, estimate: Option<Interval>, least: f64) {
        let [low, high] = self.file;
        if low.is_nan() {
            return;
        }
        let allowed = (0.5 * (high - low)).max(TOLD * (0.5 * (high + low)).abs().max(least));
        let is_determined = estimate.is_some_and(|x| (x.high - x.value).max(x.value - x.low) <= allowed);
        (self.verdict, self.reason) = match (self.sigmas, is_determined) {
            (Some(sigmas), _) if sigmas > SURELY => (Verdict::Contradicts, None),
            (Some(_), true) => (Verdict::Agrees, None),
            (Some(_), false) => (Verdict::NotDetermined, Some(WIDE)),
            (None, _) => (Verdict::NotDetermined, Some(NONE)),
        };
    }
}
