//! The parts of the torque that the equation of motion does not explain, by kind.

use std::f64::consts::TAU;

use rayon::prelude::*;

use crate::equation::{CONSTANT, DAMPING, FORCE, FRICTION, INERTIA, Solved, TorqueRows};
use crate::multiples::Multiples;
use crate::record::CancellableRecord;
use crate::spectrum::line;
use crate::start::velocities;

/// A kind with less than this part of the residual is not named.
const NAMED: f64 = 0.03;
/// Less than this part of the residual beyond position, velocity and time is no other torque.
const LEAST: f64 = 0.1;
/// The most periods in a turn of a torque and of friction that are searched.
const MOST_TIMES: u32 = 48;
const MOST_RUBS: u32 = 12;
/// Gravity is separated from a spring over this travel, in rad.
const TRAVEL: f64 = 1.0;
/// The velocities that are tried for Stribeck's friction, in parts of the rms velocity.
const STRIBECK: [f64; 3] = [0.12, 0.25, 0.5];
/// The damping ratios of a handle on a shaft that are tried, the least number of periods in the record, and the highest frequency in Hz: the
/// windows contain no higher one.
const RATIOS: [f64; 2] = [0.03, 0.1];
const PERIODS: f64 = 10.0;
const HIGHEST: f64 = 50.0;
/// A column with less than this part of its squares beyond the span of others is in it.
const SAME: f64 = 1e-9;
/// Windows that are this far apart are independent, s.
const INDEPENDENT: f64 = 0.03;

/// The kind of a part of the misfit, by the variable that it depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// The position: a cable, a spring, gravity, `times_a_turn` from 1 on a torque that repeats (1: gravity; more: cogging), 0: one that
    /// grows.
    Position {
        /// Periods in a turn.
        times_a_turn: u32,
    },
    /// The position and the direction of the motion: friction that changes this many times a turn.
    FrictionByPosition {
        /// Periods in a turn.
        times_a_turn: u32,
    },
    /// The velocity: Stribeck's friction, friction by direction, damping that is not linear.
    Velocity,
    /// A line in the spectrum: a flexible shaft or mount.
    Resonance {
        /// Its frequency.
        hz: f64,
    },
    /// Time: warming, an amplifier's drift.
    Drift,
    /// None of them.
    Unexplained,
}

/// A kind with its size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// The variable that it depends on.
    pub kind: Kind,
    /// The part of the torque's variance that it explains.
    pub share: f64,
}

/// The residual of the equation.
#[derive(Clone, Debug, PartialEq)]
pub struct Misfit {
    /// The part of the torque's variance that the equation leaves.
    pub share: f64,
    /// Its kinds, the largest first, and last what no kind explains; together they are the whole.
    pub kinds: Vec<Part>,
    /// The part that depends on none of position, velocity and time, of the torque's variance: what no kind explains, or more. Friction that
    /// changes with the position may count here too: a hand that moves to and fro may push like that.
    pub(crate) strange: f64,
}

impl Kind {
    /// Whether both are of one cause: a torque of the position that is no sine has several periods.
    fn is_alike(&self, other: &Kind) -> bool {
        match (self, other) {
            (Kind::Position { times_a_turn: a }, Kind::Position { times_a_turn: b }) => a.min(&2) == b.min(&2),
            (a, b) => std::mem::discriminant(a) == std::mem::discriminant(b),
        }
    }

    /// The word of the contract.
    pub fn word(&self) -> &'static str {
        match self {
            Kind::Position { .. } | Kind::FrictionByPosition { .. } => "position",
            Kind::Velocity => "velocity",
            Kind::Resonance { .. } => "resonance",
            Kind::Drift => "drift",
            Kind::Unexplained => "unexplained",
        }
    }

    /// The key of a world's file that models it, or its possible cause and a remedy.
    pub fn remedy(&self) -> &'static str {
        match self {
            Kind::Position { times_a_turn: 0 } => "a spring from puck to ground takes it in",
            Kind::Position { times_a_turn: 1 } => "device.gravity takes it in, or balance the handle",
            Kind::Position { .. } => "device.cogging takes it in, unless it is the motor's commutation",
            Kind::FrictionByPosition { .. } => "device.friction_by_position takes it in",
            Kind::Velocity => {
                "device.stribeck takes in friction that falls with the speed; more damping in one direction than in the other has no key"
            }
            Kind::Resonance { .. } => {
                "device.handle takes in that of a free handle on a shaft, which hapt identify --handle fits"
            }
            Kind::Drift => "no key: warm the device up, or use a shorter part of the record (--from, --to)",
            Kind::Unexplained => "no key: a hand, a sensor's torque or play may be in the record",
        }
    }
}

/// A group of columns over the rows that models one kind.
struct Candidate {
    kind: Kind,
    columns: Vec<Vec<f64>>,
    /// The number of candidates of which it is one.
    searched: f64,
    /// The sign that its factor has; a physical one has the sign of the inertia.
    sign: Option<f64>,
}

/// Parts of the residual that kinds explain, none of them twice. The kind that explains most for its numbers is taken out first, and the
/// next is of what is left then.
pub(crate) fn misfit(
    record: &CancellableRecord<'_>,
    signs: &[f64],
    rows: &TorqueRows,
    plain: &Solved,
    duration: f64,
    is_linear: bool,
) -> Misfit {
    let squares: f64 = plain.left.iter().map(|r| r * r).sum();
    let all = candidates(record, signs, rows, plain.values[INERTIA].signum(), duration, is_linear);
    let mut parts: Vec<(Kind, f64)> = Vec::new();
    let mut take = |kind: Kind, part: f64| match parts.iter_mut().find(|old| old.0.is_alike(&kind)) {
        Some(old) => old.1 += part,
        None => parts.push((kind, part)),
    };
    let mut rest = Rest::new(plain.left.clone(), rows, all);
    let other = (1.0 - rest.separate_gains(rows, LEAST * squares) / squares).max(0.0);
    while let Some((kind, part)) = rest.take_best(NAMED * squares, duration) {
        take(kind, part / squares);
    }
    if let Some((kind, part)) = rest.line(rows).filter(|line| line.1 > NAMED * squares) {
        take(kind, part / squares);
    }
    parts.sort_by(|a, b| b.1.total_cmp(&a.1));
    let unexplained = (1.0 - parts.iter().map(|part| part.1).sum::<f64>()).max(0.0);
    let surely = if other > LEAST { other } else { 0.0 };
    let strange = if squares > 0.0 { plain.share * surely.max(unexplained) } else { 0.0 };
    if unexplained > 0.0 && squares > 0.0 {
        parts.push((Kind::Unexplained, unexplained));
    }
    let kinds = parts.into_iter().map(|(kind, part)| Part { kind, share: part * plain.share }).collect();
    // Where the residual torque is not finite, nothing is explained.
    let share = if plain.share.is_finite() { plain.share } else { 1.0 };
    Misfit { share, kinds, strange }
}

/// The models of all kinds but lines, over the rows.
fn candidates(
    record: &CancellableRecord<'_>,
    signs: &[f64],
    rows: &TorqueRows,
    inertia_sign: f64,
    duration: f64,
    is_linear: bool,
) -> Vec<Candidate> {
    let (positions, speeds) = (record.positions(), velocities(record));
    let (low, high) = positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, z| (a.0.min(*z), a.1.max(*z)));
    let (middle, travel) = (0.5 * (low + high), (high - low).max(f64::MIN_POSITIVE));
    let rms = (speeds.iter().map(|v| v * v).sum::<f64>() / speeds.len() as f64).sqrt().max(f64::MIN_POSITIVE);
    let begin = record.times()[0];
    let mut all: Vec<Candidate> = Vec::new();
    let weights = rows.weights(record);
    // A list of values at every sample is large in a long record: only those of one candidate at a time.
    let column = |value: &&(dyn Fn(usize) -> f64 + Sync)| {
        let values: Vec<f64> = (0..positions.len()).map(value).collect();
        rows.means(&weights, &values)
    };
    let mut add = |kind: Kind, searched: f64, values: &[&(dyn Fn(usize) -> f64 + Sync)]| {
        if (record.stop)() {
            return;
        }
        all.push(Candidate { kind, columns: values.par_iter().map(column).collect(), searched, sign: None });
    };
    let place = |i: usize| (positions[i] - middle) / travel;
    let gravity = (!is_linear && travel > TRAVEL).then_some(1);
    let spring: [&(dyn Fn(usize) -> f64 + Sync); 3] = [&place, &|i| place(i).powi(2), &|i| place(i).powi(3)];
    add(Kind::Position { times_a_turn: 0 }, 1.0, &spring[..if gravity.is_some() { 1 } else { 3 }]);
    // Over less than a period the number of periods is not determined, and the polynomial takes it in.
    let least = (TAU / travel).ceil().max(2.0) as u32;
    let mut turned = Multiples::new(if is_linear { &[] } else { positions });
    for times in gravity.into_iter().chain(least..=MOST_TIMES).filter(|_| !is_linear) {
        let waves = turned.of(times);
        let searched = if times == 1 { 1.0 } else { f64::from(MOST_TIMES) };
        add(Kind::Position { times_a_turn: times }, searched, &[&|i| waves[i].x, &|i| waves[i].y]);
        if times <= MOST_RUBS && times >= least.min((TAU / travel).ceil() as u32) {
            let against: [&(dyn Fn(usize) -> f64 + Sync); 2] = [&|i| signs[i] * waves[i].x, &|i| signs[i] * waves[i].y];
            add(Kind::FrictionByPosition { times_a_turn: times }, f64::from(MOST_RUBS), &against);
        }
    }
    for part in STRIBECK {
        let slow = |i: usize| signs[i] * (-(speeds[i] / (part * rms)).powi(2)).exp();
        let drag = |i: usize| speeds[i] * speeds[i].abs();
        add(Kind::Velocity, STRIBECK.len() as f64, &[&slow, &drag, &|i| speeds[i].abs()]);
    }
    let time = |i: usize| (record.times()[i] - begin) / duration;
    // A warm device has another offset, and another friction.
    add(Kind::Drift, 1.0, &[&time, &|i| time(i).powi(2), &|i| time(i) * signs[i]]);
    let mut shafts = Vec::new();
    for ratio in RATIOS {
        let mut hz = PERIODS / duration;
        while hz < HIGHEST {
            shafts.push((hz, ratio));
            hz *= 1.0 + 2.0 * ratio;
        }
    }
    let searched = shafts.len() as f64;
    shafts.retain(|_| !(record.stop)());
    all.extend(rows.swung(record, &shafts).into_iter().zip(&shafts).map(|(column, (hz, _))| Candidate {
        kind: Kind::Resonance { hz: *hz },
        columns: vec![column],
        searched,
        sign: Some(inertia_sign),
    }));
    all
}

/// What is left of the torque, and the candidates without the parts in the span of what was taken.
struct Rest {
    left: Vec<f64>,
    candidates: Vec<Candidate>,
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Takes the parts along an axis of length 1 out of a column.
fn without(column: &mut [f64], axis: &[f64]) {
    let along = dot(axis, column);
    column.iter_mut().zip(axis).for_each(|(x, a)| *x -= along * a);
}

/// Axes of length 1 in the span of these columns; one in the span of those before it is left out.
fn axes(columns: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut axes: Vec<Vec<f64>> = Vec::new();
    for column in columns {
        let mut column = column.clone();
        let before = dot(&column, &column);
        axes.iter().for_each(|axis| without(&mut column, axis));
        let size = dot(&column, &column);
        if size > SAME * before && size.is_finite() {
            column.iter_mut().for_each(|x| *x /= size.sqrt());
            axes.push(column);
        }
    }
    axes
}

impl Rest {
    /// The equation's own terms are taken out of all candidates.
    fn new(left: Vec<f64>, rows: &TorqueRows, candidates: Vec<Candidate>) -> Rest {
        let own = [INERTIA, DAMPING, FRICTION, CONSTANT, FORCE];
        let own: Vec<Vec<f64>> =
            own.iter().map(|term| rows.rows.iter().map(|row| row.terms[*term]).collect()).collect();
        let mut rest = Rest { left, candidates };
        rest.reduce(&axes(&own));
        rest
    }

    /// Takes the span of these axes out of all candidates.
    fn reduce(&mut self, taken: &[Vec<f64>]) {
        for candidate in &mut self.candidates {
            candidate.columns.retain_mut(|column| {
                let before = dot(column, column);
                taken.iter().for_each(|axis| without(column, axis));
                dot(column, column) > SAME * before
            });
        }
    }

    /// The squares that a candidate takes.
    fn gain(&self, candidate: &Candidate) -> f64 {
        if let (Some(sign), [column]) = (candidate.sign, &candidate.columns[..])
            && dot(column, &self.left) * sign < 0.0
        {
            return 0.0;
        }
        axes(&candidate.columns).iter().map(|axis| dot(axis, &self.left).powi(2)).sum()
    }

    /// The squares that torques of position, velocity and time explain, each by itself: shared ones count more than once, so that what is
    /// beyond them surely is another torque. Kinds below `least` do not count, nor does friction by position.
    fn separate_gains(&self, rows: &TorqueRows, least: f64) -> f64 {
        let counted: [fn(&Kind) -> bool; 3] =
            [|kind| matches!(kind, Kind::Position { .. }), |kind| *kind == Kind::Velocity, |kind| *kind == Kind::Drift];
        let most = |is: &fn(&Kind) -> bool| {
            self.candidates.iter().filter(|one| is(&one.kind)).map(|one| self.gain(one)).fold(0.0, f64::max)
        };
        let line = self.line(rows).map_or(0.0, |line| line.1);
        counted.iter().map(most).chain([line]).filter(|gain| *gain > least).sum()
    }

    /// Takes out the candidate that explains most for its numbers, by Schwarz's criterion (Ann. Stat. 6 (1978) 461), where it explains at
    /// least these squares.
    fn take_best(&mut self, least: f64, duration: f64) -> Option<(Kind, f64)> {
        let before = dot(&self.left, &self.left);
        let count = (duration / INDEPENDENT).max(16.0);
        let score = |candidate: &Candidate| {
            let gain = self.gain(candidate);
            let after = (before - gain).max(f64::EPSILON * before);
            let numbers = candidate.columns.len() as f64 * count.ln() + 2.0 * candidate.searched.ln();
            (gain > least).then(|| (gain, count * (before / after).ln() - numbers))
        };
        let scores = self.candidates.iter().enumerate().filter_map(|(i, candidate)| Some((i, score(candidate)?)));
        let (i, (gain, score)) = scores.max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
        if score <= 0.0 || !gain.is_finite() {
            return None;
        }
        let best = self.candidates.swap_remove(i);
        let axes = axes(&best.columns);
        axes.iter().for_each(|axis| without(&mut self.left, axis));
        self.reduce(&axes);
        Some((best.kind, gain))
    }

    /// A clear sine of time, and the squares that it takes.
    fn line(&self, rows: &TorqueRows) -> Option<(Kind, f64)> {
        let timed: Vec<(f64, f64)> = rows.rows.iter().zip(&self.left).map(|(row, left)| (row.time, *left)).collect();
        let hz = line(&timed).filter(|line| line.is_clear())?.hz;
        let wave = |wave: fn(f64) -> f64| rows.rows.iter().map(|row| wave(TAU * hz * row.time)).collect::<Vec<f64>>();
        let axes = axes(&[wave(f64::sin), wave(f64::cos)]);
        Some((Kind::Resonance { hz }, axes.iter().map(|axis| dot(axis, &self.left).powi(2)).sum()))
    }
}
