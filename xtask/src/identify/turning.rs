//! Devices without stops whose torque, and whose friction, go with the position.

use std::f64::consts::TAU;

use anyhow::{Context, Result};
use fastrand::Rng;
use hapt_identify::{Claims, Error, Identified, Interval, Known, Record, TermKind, against, fit_torque, identify};
use hapt_model::Waveform;
use hapt_plant::spec::{Cogging, DeviceSpec, DeviceTorque, FrictionByPosition, Gravity};
use rayon::prelude::*;

use super::share;
use super::stops::{claims, motion};

/// The numbers with an interval.
const NAMES: [&str; 11] = [
    "inertia",
    "damping",
    "friction",
    "constant torque",
    "delay",
    "lag",
    "delay and lag",
    "gravity",
    "cogging",
    "cogging's second harmonic",
    "friction by position",
];
/// Those that the torque's equation gives too.
const OF_TORQUE: usize = 4;

/// The result of one device.
struct Outcome {
    rig: DeviceSpec,
    /// Each interval with its truth; `None`: no motion explains the record.
    found: Option<[Option<(Interval, f64)>; NAMES.len()]>,
    /// The same of the torque's equation.
    by_torque: [Option<(Interval, f64)>; OF_TORQUE],
    /// Terms that the device does not have.
    strange: usize,
    /// Whether the record agrees with its own device's file.
    agrees: bool,
}

/// A random device of this kind and its commands.
fn trial(rng: &mut Rng) -> (DeviceSpec, Vec<f64>) {
    let mut between = |low: f64, high: f64| low * (high / low).powf(rng.f64());
    let inertia = between(1e-5, 2e-3);
    let largest = inertia * between(100.0, 1000.0);
    let (damping, friction) = (inertia * between(1.0, 8.0), largest * between(0.05, 0.2));
    let (period, delay, lag) = (between(0.5e-3, 1e-3), between(0.05e-3, 4e-3), between(0.3e-3, 3e-3));
    let gravity = Gravity { torque: largest * between(0.1, 0.4), phase: between(0.1, TAU) };
    let second = between(0.2, 1.0);
    let turned = between(0.1, TAU).sin_cos();
    let pitch = TAU / between(6.0, 37.0).floor();
    let cogging = Cogging {
        torque: largest * between(0.03, 0.3),
        pitch,
        phase: pitch * between(0.1, 1.0),
        waveform: Waveform { sine: [1.0, 0.0, 0.0, 0.0], cosine: [0.0; 4] },
    };
    let pitch = TAU / between(1.0, 7.0).floor();
    let changes = FrictionByPosition {
        share: between(0.2, 0.8),
        pitch,
        phase: pitch * between(0.1, 1.0),
        waveform: cogging.waveform,
    };
    let lean = between(0.1, 0.4);
    let samples = (between(2.0, 4.0) / period) as usize;
    let [has_gravity, has_cogging] = [[true, true], [true, false], [false, true]][rng.usize(0..3)];
    let [two, lags, rubs, leans] = std::array::from_fn(|_| rng.bool());
    let mut waveform = cogging.waveform;
    if two {
        (waveform.sine[1], waveform.cosine[1]) = ((second * turned.0) as f32, (second * turned.1) as f32);
    }
    let rig = DeviceSpec {
        delay,
        damping,
        friction,
        lag: if lags { lag } else { 0.0 },
        friction_backward: leans.then_some(friction * (1.0 - lean)),
        friction_by_position: rubs.then_some(changes),
        torque: DeviceTorque {
            gravity: has_gravity.then_some(gravity),
            cogging: has_cogging.then_some(Cogging { waveform, ..cogging }),
        },
        ..DeviceSpec::new(period, inertia)
    };
    let mut torques = vec![0.0];
    while torques.len() < samples {
        let level = largest * (2.0 * rng.f64() - 1.0);
        torques.extend(std::iter::repeat_n(level, (0.15 * rng.f64() / period) as usize + 5));
    }
    torques.truncate(samples);
    (rig, torques)
}

fn outcome(seed: u64, i: u64) -> Result<Outcome> {
    let mut rng = Rng::with_seed(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ i);
    let (rig, torques) = trial(&mut rng);
    let count = TAU / (500.0 * 40f64.powf(rng.f64())).round();
    let noise = 0.5 + 1.5 * rng.f64();
    let counted = |z: f64| {
        // Box and Muller.
        let normal = (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (TAU * rng.f64()).cos();
        (z / count + noise * normal).round() * count
    };
    let seen = motion(&rig, &torques).into_iter().map(counted).collect();
    let record = Record::new((0..torques.len()).map(|k| k as f64 * rig.period).collect(), seen, torques)?;
    let lean = 0.5 * (rig.friction_backward.unwrap_or(rig.friction) - rig.friction);
    let own = Claims { lean, friction: [rig.friction + lean; 2], ..claims(&rig) };
    let agrees = against(&record, &own, false)?.agrees();
    let answer = identify(&record, &Known::default());
    let torque = fit_torque(&record, &Known::default());
    let truths = [rig.inertia, rig.damping, rig.friction + lean, lean];
    let by_torque = torque.map_or([None; OF_TORQUE], |fit| [fit.inertia, fit.damping, fit.friction, fit.offset]);
    let by_torque = std::array::from_fn(|i| by_torque[i].map(|interval| (interval, truths[i])));
    let (found, strange) = match answer {
        Err(Error::Residual(_) | Error::Unexplained) => (None, 0),
        answer => {
            let (found, strange) = numbers(&answer?, &rig, truths);
            (Some(found), strange)
        }
    };
    Ok(Outcome { rig, found, by_torque, strange, agrees })
}

/// The intervals with their truths, and the number of terms that the device does not have.
fn numbers(
    found: &Identified,
    rig: &DeviceSpec,
    truths: [f64; OF_TORQUE],
) -> ([Option<(Interval, f64)>; NAMES.len()], usize) {
    let teeth = |pitch: f64| (TAU / pitch).round() as u32;
    let (cogging, rubs) = (rig.torque.cogging, rig.friction_by_position);
    let second = cogging.map_or(0.0, |x| x.torque * f64::from(x.waveform.sine[1]).hypot(x.waveform.cosine[1].into()));
    let mut strange = 0;
    let mut terms = [None; 4];
    for term in &found.terms {
        let (at, truth) = match term.kind {
            TermKind::Turn { times: 1, .. } => (0, rig.torque.gravity.map_or(0.0, |x| x.torque)),
            TermKind::Turn { times, .. } => match cogging {
                Some(x) if times == teeth(x.pitch) => (1, x.torque),
                Some(x) if times == 2 * teeth(x.pitch) => (2, second),
                _ => (1, 0.0),
            },
            TermKind::FrictionByPosition { times, .. } => match rubs {
                Some(x) if times == teeth(x.pitch) => (3, x.share * truths[2]),
                _ => (3, 0.0),
            },
            TermKind::Stiffness | TermKind::Stribeck { .. } | TermKind::Drag => (0, 0.0),
        };
        if truth == 0.0 {
            strange += 1;
        } else {
            terms[at] = Some((term.size, truth));
        }
    }
    // Else it is the delay with the lag.
    let is_apart = rig.lag == 0.0 || found.lag.is_some_and(|lag| lag.low > 0.0);
    let of = |interval: Option<Interval>, truth: f64| interval.map(|interval| (interval, truth));
    let own = [
        of(found.inertia, truths[0]),
        of(found.damping, truths[1]),
        of(found.friction, truths[2]),
        of(found.offset, truths[3]),
        of(found.delay.filter(|_| is_apart), rig.delay),
        of(found.lag, rig.lag),
        of(found.late, rig.delay + rig.lag),
    ];
    (std::array::from_fn(|i| if i < own.len() { own[i] } else { terms[i - own.len()] }), strange)
}

/// Which devices a column of the table is of.
type Column = (&'static str, fn(&DeviceSpec) -> bool);
const COLUMNS: [Column; 6] = [
    ("all", |_| true),
    ("gravity", |x| x.torque.cogging.is_none()),
    ("cogging", |x| x.torque.gravity.is_none()),
    ("both", |x| x.torque.cogging.is_some() && x.torque.gravity.is_some()),
    ("with friction by position", |x| x.friction_by_position.is_some()),
    ("with a lag", |x| x.lag > 0.0),
];

pub fn campaign(n: u64, seed: u64) -> Result<String> {
    let of = |i| outcome(seed, i).with_context(|| format!("turning: device {i} of seed {seed}"));
    let outcomes = (0..n).into_par_iter().map(of).collect::<Result<Vec<Outcome>>>()?;
    let of = |column: &Column| outcomes.iter().filter(|x| (column.1)(&x.rig)).collect::<Vec<_>>();
    let columns = COLUMNS.map(|column| of(&column));
    let heads: String =
        COLUMNS.iter().zip(&columns).map(|((name, _), of)| format!(" {name}: {} |", of.len())).collect();
    let mut text = format!("| |{heads}\n|{}\n", " --- |".repeat(COLUMNS.len() + 1));
    let mut row = |name: &str, cell: &dyn Fn(&[&Outcome]) -> String| {
        let cells: String = columns.iter().map(|of| format!(" {} |", cell(of))).collect();
        text += &format!("| {name} |{cells}\n");
    };
    let part = |is: &dyn Fn(&Outcome) -> Option<bool>, of: &[&Outcome]| {
        let answers: Vec<bool> = of.iter().filter_map(|x| is(x)).collect();
        if answers.is_empty() { String::new() } else { share(answers.iter().filter(|is| **is).count(), answers.len()) }
    };
    row("a motion explains the record", &|of| part(&|x| Some(x.found.is_some()), of));
    row("of these have a term that the device has not", &|of| {
        part(&|x| x.found.is_some().then_some(x.strange > 0), of)
    });
    row("nothing in the device's own file is contradicted", &|of| part(&|x| Some(x.agrees), of));
    for (i, name) in NAMES.into_iter().enumerate() {
        let covers = |x: &Outcome| x.found?[i].map(|(interval, truth)| interval.covers(truth));
        row(&format!("the interval covers {name}"), &|of| part(&covers, of));
    }
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).map_or(String::new(), |x| format!("{x:.3}"))
    };
    let width = |(interval, truth): (Interval, f64)| (interval.high - interval.low) / truth;
    for (i, name) in NAMES.into_iter().enumerate().filter(|(i, _)| *i < OF_TORQUE - 1) {
        let by_motion = |of: &[&Outcome]| of.iter().filter_map(|x| x.found?[i]).map(width).collect();
        row(&format!("width over the true {name}, median"), &|of| median(by_motion(of)));
        let by_torque = |of: &[&Outcome]| of.iter().filter_map(|x| x.found.and(x.by_torque[i])).map(width).collect();
        row("by the torque's equation", &|of| median(by_torque(of)));
    }
    Ok(text)
}
