//! The parts of the torque that the equation of motion does not explain, by kind.

use crate::equation::{CONSTANT, DAMPING, FORCE, FRICTION, INERTIA, Rows, Solved};
use crate::spectrum::line;

/// A kind with less than this part of the residual is not named.
const LEAST: f64 = 0.1;
/// The most periods in a turn of a torque and of friction that are searched.
const MOST_TIMES: u32 = 48;
const MOST_RUBS: u32 = 12;

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
    /// Its kinds, the largest first; each by itself, so that two of them may share a part.
    pub kinds: Vec<Part>,
    /// The part that depends on none of position, velocity and time, of the torque's variance. Friction that changes with the position
    /// counts here too: a hand that moves to and fro may push in that way.
    pub(crate) strange: f64,
}

impl Kind {
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
                "device.stribeck takes in friction that falls with the speed; more damping one way than the other has no key"
            }
            Kind::Resonance { .. } => {
                "device.handle takes in that of a free handle on a shaft, which hapt identify --handle fits"
            }
            Kind::Drift => "no key: warm the device up, or use a shorter part of the record (--from, --to)",
            Kind::Unexplained => "no key: a hand, a sensor's torque or play may be in the record",
        }
    }
}

pub(crate) fn misfit(rows: &Rows, plain: &Solved, duration: f64, is_linear: bool) -> Misfit {
    let n = rows.rows.len() as f64;
    let squares: f64 = plain.left.iter().map(|r| r * r).sum();
    let begin = rows.rows.first().map_or(0.0, |row| row.time);
    let speed = (rows.rows.iter().map(|row| row.velocity.powi(2)).sum::<f64>() / n).sqrt();
    let taken = |columns: &dyn Fn(usize) -> Vec<f64>| taken(&plain.left, rows, columns);
    let mut parts = Vec::new();
    let spring = taken(&|i| vec![rows.rows[i].position, rows.rows[i].position.powi(3)]);
    let times = if is_linear { 0 } else { MOST_TIMES };
    // A torque that repeats over the position, or one that does so against the motion.
    let turning = |times: u32, size: &dyn Fn(usize) -> f64| {
        let of = |i: usize| {
            let (sin, cos) = (f64::from(times) * rows.rows[i].position).sin_cos();
            vec![size(i) * sin, size(i) * cos]
        };
        (times, taken(&of))
    };
    let larger = |a: &(u32, f64), b: &(u32, f64)| a.1.total_cmp(&b.1);
    let position = std::iter::once((0, spring)).chain((1..=times).map(|times| turning(times, &|_| 1.0))).max_by(larger);
    if let Some((times_a_turn, part)) = position {
        parts.push((Kind::Position { times_a_turn }, part));
    }
    let rubbing =
        (1..=times.min(MOST_RUBS)).map(|times| turning(times, &|i| rows.rows[i].terms[FRICTION])).max_by(larger);
    if let Some((times_a_turn, part)) = rubbing {
        parts.push((Kind::FrictionByPosition { times_a_turn }, part));
    }
    parts.push((
        Kind::Velocity,
        taken(&|i| {
            let v = rows.rows[i].velocity / speed.max(f64::MIN_POSITIVE);
            vec![v.signum() * (-(4.0 * v).powi(2)).exp(), v * v.abs(), v.abs(), v]
        }),
    ));
    parts.push((
        Kind::Drift,
        taken(&|i| {
            let t = (rows.rows[i].time - begin) / duration;
            vec![t, t * t]
        }),
    ));
    let timed: Vec<(f64, f64)> = rows.rows.iter().zip(&plain.left).map(|(row, left)| (row.time, *left)).collect();
    if let Some(line) = line(&timed).filter(|line| line.is_clear()) {
        let of = |i: usize| {
            let (sin, cos) = (std::f64::consts::TAU * line.hz * rows.rows[i].time).sin_cos();
            vec![sin, cos]
        };
        parts.push((Kind::Resonance { hz: line.hz }, taken(&of)));
    }
    parts.sort_by(|a, b| b.1.total_cmp(&a.1));
    parts.retain(|part| part.1 > LEAST);
    let is_rubbing = |part: &&(Kind, f64)| matches!(part.0, Kind::FrictionByPosition { .. });
    let rubs: f64 = parts.iter().filter(is_rubbing).map(|part| part.1).sum();
    let beside = (1.0 - parts.iter().map(|part| part.1).sum::<f64>() + rubs).max(0.0);
    let strange = if beside > LEAST && squares > 0.0 { beside * plain.share } else { 0.0 };
    let rest = beside - rubs;
    if rest > LEAST && squares > 0.0 {
        parts.push((Kind::Unexplained, rest));
    }
    let kinds = parts.into_iter().map(|(kind, part)| Part { kind, share: part * plain.share }).collect();
    // Where the residual torque is not finite, nothing is explained.
    let share = if plain.share.is_finite() { plain.share } else { 1.0 };
    Misfit { share, kinds, strange }
}

/// The part of the residual that these columns explain, each made orthogonal to the ones before it.
fn taken(left: &[f64], rows: &Rows, columns: &dyn Fn(usize) -> Vec<f64>) -> f64 {
    let n = rows.rows.len();
    let all: Vec<Vec<f64>> = (0..n).map(columns).collect();
    let count = all.first().map_or(0, Vec::len);
    let squares: f64 = left.iter().map(|r| r * r).sum();
    // The part of a column in the span of the equation's own terms is left out.
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let mut part = 0.0;
    let terms = [INERTIA, DAMPING, FRICTION, CONSTANT, FORCE];
    let own = terms.into_iter().map(|term| rows.rows.iter().map(|row| row.terms[term]).collect::<Vec<f64>>());
    let extra = (0..count).map(|i| all.iter().map(|row| row[i]).collect::<Vec<f64>>());
    for (i, mut column) in own.chain(extra).enumerate() {
        let before: f64 = column.iter().map(|x| x * x).sum();
        for axis in &basis {
            let along: f64 = axis.iter().zip(&column).map(|(a, x)| a * x).sum();
            column.iter_mut().zip(axis).for_each(|(x, a)| *x -= along * a);
        }
        let size = column.iter().map(|x| x * x).sum::<f64>();
        if size <= 1e-9 * before || !size.is_finite() {
            continue;
        }
        column.iter_mut().for_each(|x| *x /= size.sqrt());
        if i >= terms.len() {
            part += column.iter().zip(left).map(|(a, r)| a * r).sum::<f64>().powi(2);
        }
        basis.push(column);
    }
    if squares > 0.0 { (part / squares).clamp(0.0, 1.0) } else { 0.0 }
}
