//! The numbers of a file against those of a fit.

use hapt_model::Handle;
use hapt_model::keys::Measure;
use hapt_plant::spec::Stribeck;

use super::claims::{Claims, middle};
use super::number::{Compared, SURELY, Verdict, WIDE, sigmas};
use crate::device::Device;
use crate::handle::WithHandle;
use crate::identified::{FoundWaves, Harmonics, Identified};
use crate::interval::Interval;
use crate::record::Record;
use crate::remainder::RESOLUTION;
use crate::terms::TermKind;
use crate::torque::TorqueFit;

/// A friction of 0 counts as this part of the record's largest torque, and so does a damping of 0 at the record's speeds.
const SMALL: f64 = 0.05;

/// The sizes that count as large in a record.
pub struct Scale {
    torque: f64,
    /// Rms, over a fiftieth of a second.
    speed: f64,
}

impl Scale {
    pub fn of(record: &Record) -> Self {
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
pub fn plain(found: &Identified, claims: &Claims, scale: &Scale) -> Vec<Compared> {
    let friction = SMALL * scale.torque;
    let holds = claims.friction[1] + claims.lean.abs();
    let number = Compared::new;
    let mut numbers = vec![
        number("inertia", Some(Measure::Inertia), found.inertia, claims.inertia, 0.0),
        number("damping", Some(Measure::Damping), found.damping, claims.damping, friction / scale.speed),
        number("friction", Some(Measure::Torque), found.friction, claims.friction, friction),
        number("constant torque", Some(Measure::Torque), found.offset, [-holds, holds], friction),
    ];
    if found.inertia.is_none() {
        numbers.extend(over_inertia(found, claims));
    }
    numbers.extend(lateness(found.lag, found.delay, found.late, claims));
    numbers.push(number("sign", None, found.sign, [1.0, 1.0], 0.0));
    numbers
}

/// Damping and friction over the inertia, which a record tells without a torque too.
fn over_inertia(found: &Identified, claims: &Claims) -> impl Iterator<Item = Compared> {
    let [least, most] = claims.inertia;
    let of = [
        ("damping over inertia", Measure::Damping, found.rates[0], claims.damping),
        ("friction over inertia", Measure::Torque, found.rates[1], claims.friction),
    ];
    of.into_iter().filter(|(_, _, found, _)| found.is_some()).map(move |(name, measure, found, [low, high])| {
        Compared::new(name, Some(measure), found, [low / most, high / least], 0.0)
    })
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
pub fn spring(found: &Identified) -> Option<Compared> {
    let term = found.terms.iter().find(|term| term.kind == TermKind::Stiffness)?;
    let number = Compared::new("spring", Some(Measure::Stiffness), Some(term.size), [0.0; 2], 0.0);
    Some(Compared { file: [f64::NAN; 2], reason: Some(NO_SPRING), ..number })
}

/// Each harmonic of the file's gravity, cogging and friction against that of a fit; `reason`: why the record does not determine it.
pub fn waves(claims: &Claims, found: Option<&FoundWaves>, reason: &'static str) -> Vec<Compared> {
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
pub fn stribeck(found: &Identified, claims: &Claims, scale: &Scale) -> Vec<Compared> {
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
pub fn stops(record: &Record, found: &Identified, claims: &Claims) -> Vec<Compared> {
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
        of_lag.judge(lag);
    }
    let both = [claims.delay[0] + claims.lag[0], claims.delay[1] + claims.lag[1]];
    // With a lag that is certainly short, the sum is the delay.
    let range = if is_determined { claims.delay } else { both };
    let mut of_delay = number("delay", delay, range, claims.period);
    if late.is_some() && !is_determined && of_lag.verdict != Verdict::Agrees {
        if of_lag.verdict == Verdict::NotDetermined {
            of_lag.reason = Some(SLOW);
        }
        of_delay = Compared { reason: Some(SLOW), ..number("delay", None, claims.delay, 0.0) };
    }
    [of_lag, of_delay, number("delay and lag", late, both, claims.period)]
}

/// Why delay and lag show only as their sum.
const SLOW: &str = "the record tells only the sum of delay and lag: its torque changes too little, or too slowly, for the size of its noise";
const BEFORE: &str = "the record does not reach it";
const PASSES: &str = "the record moves beyond it without a stop";
const NO_STOP: &str = "the file has no such stop";
const NO_FALL: &str = "a puck without it explains the record: the speeds are too high, or too low, to show it";
pub const NO_WAVE: &str =
    "a puck without it explains the record: its torque is too small to show, or the travel too short";
const NO_SPRING: &str = "no key: no file has a spring from the puck to the ground that is the device's own";
pub const ON_SHAFT: &str = "a fit with a handle does not have it";
pub const LATE: &str = "the torque's equation does not tell it";
pub const UNEXPLAINED: &str = "no interval is valid beside a motion that no device explains";

/// The numbers of a record by the torque's equation only, which does not determine the delay of the torque.
pub fn by_torque(found: &TorqueFit, claims: &Claims, scale: &Scale) -> Vec<Compared> {
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
pub fn without(claims: &Claims) -> Vec<Compared> {
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
pub fn with_handle(found: &WithHandle, claims: &Claims, shaft: &Handle, scale: &Scale) -> Vec<Compared> {
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
