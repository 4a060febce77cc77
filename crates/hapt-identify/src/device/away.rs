//! The device that the torque's equation shows away from the ends of its travel.

use rayon::prelude::*;

use super::field::HARMONICS;
use super::parameters::{
    CHANGES, COGGING, DAMPING, Device, FRICTION, Free, GRAVITY, INERTIA, LATE, OFFSET, PARAMETERS, Parameters, Places,
    SPRING, STOPS, VARIANCE,
};
use crate::equation::{self, Band, Mask, Solved, TorqueRows};
use crate::identified::Known;
use crate::record::CancellableRecord;
use crate::start::{delayed, signs};
use crate::terms::{Choice, Term, TermKind, Terms, common_rate, terms};
use crate::torque::{BENT, PLAIN};

/// Windows of the equation, s, and the delays that are tried, in s.
const WINDOWS: [f64; 2] = [0.06, 0.03];
const DELAYS: usize = 21;
const DELAY_STEP: f64 = 5e-4;
/// The terms leave at most this part of the torque's variance away from the ends; otherwise something else moves the device, such as a hand.
const MOST_LEFT: f64 = 0.05;

/// The numbers of the device away from the ends.
pub(super) struct Away {
    pub device: Device,
    pub limits: [f64; 2],
    /// The standard error of the inertia, as a part of it.
    pub error: f64,
    /// The parameters of its torques of the position.
    pub more: Free,
}

/// The windows of a record that keep away from the ends, at the delay with the least residual of an equation.
struct Inside {
    limits: [f64; 2],
    delay: f64,
    rows: TorqueRows,
    solved: Solved,
}

fn inside(record: &CancellableRecord<'_>, part: f64, model: Mask) -> Option<Inside> {
    let positions = record.positions();
    let (low, high) = positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, z| (a.0.min(*z), a.1.max(*z)));
    let margin = part * (high - low);
    let limits = [low + margin, high - margin];
    let signs = signs(record);
    let duration = record.period() * record.times().len() as f64;
    let window = |length: f64| {
        let rows =
            TorqueRows::new(record, &signs, record.torques(), Band { length, slope: false }).between(record, limits);
        let weights = rows.weights(record);
        (rows, weights)
    };
    let windows: Vec<_> = WINDOWS.into_par_iter().map(window).collect();
    let solved = |delay: f64| {
        let torques = delayed(record, delay);
        windows.iter().find_map(|(rows, weights)| {
            let rows = rows.under(weights, &torques);
            let solved = rows.solved(model, duration).filter(|solved| solved.share < 0.5)?;
            Some((rows, solved))
        })
    };
    let of_delay = |i: usize| {
        let delay = i as f64 * DELAY_STEP;
        if (record.stop)() { None } else { Some((delay, solved(delay)?)) }
    };
    let all: Vec<_> = (0..DELAYS).into_par_iter().filter_map(of_delay).collect();
    let (delay, (rows, solved)) = all.into_iter().min_by(|a, b| a.1.1.share.total_cmp(&b.1.1.share))?;
    Some(Inside { limits, delay, rows, solved })
}

/// The equation of motion over the windows that keep away from the ends.
pub(super) fn away(record: &CancellableRecord<'_>, known: &Known, part: f64) -> Option<Away> {
    let inside = inside(record, part, PLAIN)?;
    let values = [equation::INERTIA, equation::DAMPING, equation::FRICTION, equation::CONSTANT];
    Some(of_equation(known, &inside, values.map(|i| inside.solved.values[i])))
}

/// The same with the terms that the torque shows there; `None`: it shows none.
pub(super) fn loaded(record: &CancellableRecord<'_>, known: &Known, part: f64) -> Option<Away> {
    let inside = inside(record, part, BENT)?;
    let sign = inside.solved.values[equation::INERTIA].signum();
    let found = terms(record, &inside.rows, sign, known.is_linear, Choice::Sure);
    let left = inside.solved.share * (1.0 - found.terms.iter().filter_map(|term| term.predicts).sum::<f64>());
    let found = (left <= MOST_LEFT).then(|| with_terms(record, known, &inside, &found));
    found.filter(|away| away.more.contains(&true))
}

/// The same of a device without stops, with all terms that its torque may show, a spring among them or not: in a loop with a spring the
/// torque follows the position, and a spring alone, without any inertia, satisfies the equation.
pub(super) fn endless(record: &CancellableRecord<'_>, known: &Known, spring: bool) -> Option<Away> {
    let inside = inside(record, 0.0, if spring { BENT } else { PLAIN })?;
    let sign = inside.solved.values[equation::INERTIA].signum();
    let found =
        terms(record, &inside.rows, sign, known.is_linear, Choice::Likely { harmonics: HARMONICS as u32, spring });
    let left = inside.rows.unexplained(&inside.solved)
        - inside.solved.share * found.terms.iter().filter_map(|term| term.predicts).sum::<f64>();
    (left <= MOST_LEFT).then(|| with_terms(record, known, &inside, &found))
}

/// The device of a solution with its terms.
fn with_terms(record: &CancellableRecord<'_>, known: &Known, inside: &Inside, found: &Terms) -> Away {
    let mut away = of_equation(known, inside, found.own);
    let (p, places, more) = (&mut away.device.p, &mut away.device.places, &mut away.more);
    let ratio = known.inertia.map_or(1.0, |known| known / found.own[0].abs());
    let rates = |is: fn(&TermKind) -> bool| {
        let rate = move |term: &Term| match term.kind {
            TermKind::Turn { times, .. } | TermKind::FrictionByPosition { times, .. } => {
                is(&term.kind).then_some(times)
            }
            TermKind::Stiffness | TermKind::Stribeck { .. } | TermKind::Drag => None,
        };
        found.terms.iter().filter_map(rate)
    };
    // Several waves of a torque are harmonics of one, where it has so few.
    let base = |rates: &mut dyn Iterator<Item = u32>| {
        let rates: Vec<u32> = rates.collect();
        common_rate(rates.iter().copied(), HARMONICS as u32).unwrap_or_else(|| rates[0])
    };
    let cogging = base(&mut rates(|kind| matches!(kind, TermKind::Turn { times: 2.., .. })));
    let changes = base(&mut rates(|kind| matches!(kind, TermKind::FrictionByPosition { .. })));
    places.middle = record.positions().iter().sum::<f64>() / record.positions().len() as f64;
    (places.cogging, places.changes) = ([f64::from(cogging), 0.0], [f64::from(changes), 0.0]);
    if let Some(spring) = found.terms.iter().find(|term| term.kind == TermKind::Stiffness) {
        (p[SPRING], more[SPRING]) = (ratio * spring.size.value, true);
    }
    let friction = p[FRICTION];
    for term in &found.terms {
        let mut wave = |at: usize, size: f64, phase: f64| {
            (p[at], p[at + 1]) = (size * phase.cos(), size * phase.sin());
            (more[at], more[at + 1]) = (true, true);
        };
        let size = ratio * term.size.value;
        // The harmonic of a base, 0 for the first.
        let harmonic = |times: u32, base: u32| {
            let n = times / base;
            (times.is_multiple_of(base) && n as usize <= HARMONICS).then(|| 2 * (n as usize - 1))
        };
        match term.kind {
            TermKind::Turn { times: 1, phase } => wave(GRAVITY, -size, phase),
            TermKind::Turn { times, phase } => {
                if let Some(n) = harmonic(times, cogging) {
                    wave(COGGING + n, -size, phase);
                }
            }
            TermKind::FrictionByPosition { times, phase } if friction > 0.0 => {
                if let Some(n) = harmonic(times, changes) {
                    wave(CHANGES + n, size / friction, phase);
                }
            }
            TermKind::FrictionByPosition { .. } | TermKind::Stiffness | TermKind::Stribeck { .. } | TermKind::Drag => {}
        }
    }
    away
}

/// The device of a solution: inertia, damping, friction, constant.
fn of_equation(known: &Known, inside: &Inside, [inertia, damping, friction, constant]: [f64; 4]) -> Away {
    let sign = inertia.signum();
    let ratio = known.inertia.map_or(1.0, |known| known / inertia.abs());
    let mut p: Parameters = [0.0; PARAMETERS];
    p[INERTIA] = known.inertia.map_or(inertia.abs(), |_| ratio).ln();
    p[DAMPING] = (ratio * sign * damping).max(0.0);
    p[FRICTION] = (ratio * sign * friction).max(0.0);
    p[OFFSET] = -ratio * sign * constant;
    p[LATE] = inside.delay;
    p[VARIANCE] = known.lag.map_or(0.0, |lag| lag * lag);
    p[STOPS[0]] = f64::NEG_INFINITY;
    p[STOPS[1]] = f64::INFINITY;
    let error = (inside.solved.errors[equation::INERTIA] / inertia).abs();
    let device = Device { p, sign, inertia: known.inertia, places: Places::default() };
    Away { device, limits: inside.limits, error, more: [false; PARAMETERS] }
}
