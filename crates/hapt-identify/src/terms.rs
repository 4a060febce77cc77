//! Terms of a device in addition to inertia, damping, friction and a constant: a stiffness, gravity, cogging, friction by position,
//! Stribeck's friction, drag.
//!
//! They are added one at a time. The next term is the one that predicts most of the torque in parts of the record that were left out of its
//! fit, and it is added only while it predicts significantly more there than the equation without it. A term that merely fits more is not
//! added.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::equation::{BLOCKS, CONSTANT, DAMPING, FORCE, FRICTION, INERTIA, TorqueRows};
use crate::interval::Interval;
use crate::multiples::Multiples;
use crate::quantile::student;
use crate::record::CancellableRecord;
use crate::start::velocities;

/// The most periods in a turn that are tried.
pub(crate) const MOST_TIMES: u32 = 48;
/// The same of friction, of drums and bearings: the more are tried, the more often one of them fits something else.
pub(crate) const MOST_RUBS: u32 = 12;
/// The velocities that are tried for Stribeck's friction, in parts of the rms velocity.
const STRIBECK: [f64; 3] = [0.1, 0.2, 0.4];
/// A term predicts at least this part of the residual without any term, by this many standard errors of the blocks.
const LEAST: f64 = 0.05;
const SURELY: f64 = 3.0;
const LIKELY: f64 = 1.0;
/// The travel has at least this many periods of a torque that repeats.
const PERIODS: f64 = 1.0;
/// The most terms of one device.
const MAX_TERMS: usize = 4;
/// The same of a device whose motion shows which of them it has.
const MOST_LIKELY: usize = 8;
/// A sine of the position is separated from a stiffness over this travel, in rad.
pub(crate) const TRAVEL: f64 = 1.0;

/// The kind of a term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TermKind {
    /// k z, about the middle of the motion, k in N·m/rad (N/m): a cable, a spring, a tilt.
    Stiffness,
    /// A sin(n z + phase), A in N·m: gravity where n is 1, else cogging.
    Turn {
        /// Periods in a turn, n.
        times: u32,
        /// In rad.
        phase: f64,
    },
    /// A sign(v) sin(n z + phase), A in N·m: Coulomb friction that changes with the position.
    FrictionByPosition {
        /// Periods in a turn, n.
        times: u32,
        /// In rad.
        phase: f64,
    },
    /// F sign(v) exp(-(v/velocity)²), F in N·m (N): Stribeck's addition to Coulomb's friction.
    Stribeck {
        /// The velocity of the exponential, in rad/s (m/s).
        velocity: f64,
        /// The damping and the Coulomb friction of the same fit, in N·m·s/rad and N·m (N·s/m, N): less than those of a fit without it.
        beside: [f64; 2],
    },
    /// c v |v|, c in N·m·s²/rad² (N·s²/m²): drag beyond the linear one.
    Drag,
}

/// A term with its size, as a torque against the motion's direction: the part of the motor's torque that it takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Term {
    /// Its kind.
    pub kind: TermKind,
    /// Its factor with a 95 % interval, see the kind.
    pub size: Interval,
    /// The part of the residual of the torque's equation without any of these terms that it predicts; `None`: it is one of a fit of the
    /// motion.
    pub predicts: Option<f64>,
}

/// The terms of a record, with the numbers of the same solution, in the order of the equation: inertia, damping, friction, constant.
#[derive(Default)]
pub(crate) struct Terms {
    pub terms: Vec<Term>,
    pub own: [f64; 4],
}

impl TermKind {
    /// The word of `--json`.
    pub fn word(&self) -> &'static str {
        match self {
            TermKind::Stiffness => "stiffness",
            TermKind::Turn { times: 1, .. } => "gravity",
            TermKind::Turn { .. } => "cogging",
            TermKind::FrictionByPosition { .. } => "friction_by_position",
            TermKind::Stribeck { .. } => "stribeck",
            TermKind::Drag => "drag",
        }
    }
}

/// The size of a term in a solution.
type Size<'a> = Box<dyn Fn(&DVector<f64>) -> f64 + 'a>;

/// Which terms are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Choice {
    /// Of each kind one, and several torques of the position, where each predicts a large part of the residual.
    Sure,
    /// Torques and friction of the position with the harmonics of each, however small a part they predict: a fit of the motion shows which
    /// of them the device has.
    Likely {
        /// The most harmonics of a period.
        harmonics: u32,
        /// Whether a spring is among them.
        spring: bool,
    },
}

impl Choice {
    fn has_spring(self) -> bool {
        !matches!(self, Choice::Likely { spring: false, .. })
    }
}

/// Columns that are added together.
struct Group {
    kind: TermKind,
    columns: Vec<usize>,
}

/// The sums of one block: products of columns, with the torque, and its squares.
struct Block {
    gram: DMatrix<f64>,
    torque: DVector<f64>,
    squares: f64,
}

struct Table {
    blocks: Vec<Block>,
}

impl Table {
    fn new(columns: &[Vec<f64>], torque: &[f64]) -> Self {
        let n = torque.len();
        let of = |block: usize| {
            let rows = block * n / BLOCKS..(block + 1) * n / BLOCKS;
            let x = DMatrix::from_fn(rows.len(), columns.len(), |i, j| columns[j][rows.start + i]);
            let y = DVector::from_column_slice(&torque[rows]);
            Block { gram: x.tr_mul(&x), torque: x.tr_mul(&y), squares: y.norm_squared() }
        };
        Table { blocks: (0..BLOCKS).map(of).collect() }
    }

    /// The least squares with these columns over all blocks but one.
    fn solved(&self, columns: &[usize], without: Option<usize>) -> Option<DVector<f64>> {
        let k = columns.len();
        let (mut gram, mut right) = (DMatrix::zeros(k, k), DVector::zeros(k));
        for (_, block) in self.blocks.iter().enumerate().filter(|(i, _)| Some(*i) != without) {
            gram += DMatrix::from_fn(k, k, |i, j| block.gram[(columns[i], columns[j])]);
            right += DVector::from_fn(k, |i, _| block.torque[columns[i]]);
        }
        let scale = DVector::from_fn(k, |i, _| gram[(i, i)].sqrt().recip());
        let scaled = DMatrix::from_fn(k, k, |i, j| gram[(i, j)] * scale[i] * scale[j]);
        let solution = scaled.cholesky()?.solve(&right.component_mul(&scale)).component_mul(&scale);
        solution.iter().all(|x| x.is_finite()).then_some(solution)
    }

    /// The residual of each block's torque where it was left out of the fit.
    fn predicted(&self, columns: &[usize]) -> Option<Vec<f64>> {
        let of = |(out, block): (usize, &Block)| {
            let values = self.solved(columns, Some(out))?;
            let k = columns.len();
            let gram = DMatrix::from_fn(k, k, |i, j| block.gram[(columns[i], columns[j])]);
            let right = DVector::from_fn(k, |i, _| block.torque[columns[i]]);
            Some(block.squares - 2.0 * values.dot(&right) + values.dot(&(&gram * &values)))
        };
        self.blocks.iter().enumerate().map(of).collect()
    }
}

/// The terms of a record, the one first that predicts most; `sign` is the motor's sign.
pub(crate) fn terms(
    record: &CancellableRecord<'_>,
    rows: &TorqueRows,
    sign: f64,
    is_linear: bool,
    choice: Choice,
) -> Terms {
    let positions = record.positions();
    let (low, high) = positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, z| (a.0.min(*z), a.1.max(*z)));
    let middle = positions.iter().sum::<f64>() / positions.len() as f64;
    let speeds = velocities(record);
    let rms = (speeds.iter().map(|v| v * v).sum::<f64>() / speeds.len() as f64).sqrt();
    if rows.rows.len() < 8 * BLOCKS || rms <= 0.0 || rms.is_nan() {
        return Terms::default();
    }
    let own: Vec<usize> =
        [INERTIA, DAMPING, FRICTION, CONSTANT].into_iter().chain(record.forces().map(|_| FORCE)).collect();
    let mut columns: Vec<Vec<f64>> =
        own.iter().map(|term| rows.rows.iter().map(|row| row.terms[*term]).collect()).collect();
    let mut groups: Vec<Group> = Vec::new();
    let weights = rows.weights(record);
    let mut add = |kind: TermKind, values: &[&(dyn Fn(usize) -> f64 + Sync)]| {
        if (record.stop)() {
            return;
        }
        groups.push(Group { kind, columns: (columns.len()..columns.len() + values.len()).collect() });
        // A list of values at every sample is large in a long record: only those of one term at a time.
        columns.par_extend(values.par_iter().map(|value| {
            let values: Vec<f64> = (0..positions.len()).map(value).collect();
            rows.means(&weights, &values)
        }));
    };
    if choice.has_spring() {
        add(TermKind::Stiffness, &[&|i| positions[i] - middle]);
    }
    if choice == Choice::Sure {
        add(TermKind::Drag, &[&|i| speeds[i] * speeds[i].abs()]);
    }
    for part in STRIBECK.into_iter().filter(|_| choice == Choice::Sure) {
        let velocity = part * rms;
        let of = |i: usize| speeds[i].signum() * (-(speeds[i] / velocity).powi(2)).exp();
        add(TermKind::Stribeck { velocity, beside: [0.0; 2] }, &[&of]);
    }
    // From this number of periods on, the torque repeats within the travel.
    let least = (PERIODS * std::f64::consts::TAU / (high - low).max(f64::MIN_POSITIVE)).ceil().max(2.0) as u32;
    let gravity = (high - low > TRAVEL).then_some(1);
    let mut turned = Multiples::new(if is_linear { &[] } else { positions });
    for times in gravity.into_iter().chain(least..=MOST_TIMES).filter(|_| !is_linear) {
        let n = f64::from(times);
        let waves = turned.of(times);
        add(TermKind::Turn { times, phase: 0.0 }, &[&|i| waves[i].x, &|i| waves[i].y]);
        // Over less than a period its number of periods is not determined.
        if times <= MOST_RUBS && n * (high - low) >= PERIODS * std::f64::consts::TAU {
            let against = |i: usize| speeds[i].signum();
            add(
                TermKind::FrictionByPosition { times, phase: 0.0 },
                &[&|i| against(i) * waves[i].x, &|i| against(i) * waves[i].y],
            );
        }
    }
    let torque: Vec<f64> = rows.rows.iter().map(|row| row.torque).collect();
    let table = Table::new(&columns, &torque);
    chosen(&table, (0..own.len()).collect(), &groups, sign, least, choice)
}

/// The greatest common divisor.
fn divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { divisor(b, a % b) }
}

/// The rate of which all of these are among the first harmonics; 0 of none, and `None` where there is no such rate.
pub(crate) fn common_rate(rates: impl Iterator<Item = u32> + Clone, harmonics: u32) -> Option<u32> {
    let common = rates.clone().fold(0, divisor);
    rates.into_iter().all(|rate| rate <= harmonics * common).then_some(common)
}

fn chosen(table: &Table, mut kept: Vec<usize>, groups: &[Group], sign: f64, apart: u32, choice: Choice) -> Terms {
    let Some(mut left) = table.predicted(&kept) else { return Terms::default() };
    let mut taken: Vec<(&Group, f64)> = Vec::new();
    let all: f64 = left.iter().sum();
    let most = match choice {
        Choice::Sure => MAX_TERMS,
        Choice::Likely { .. } => MOST_LIKELY,
    };
    while taken.len() < most {
        let same = |a: TermKind, b: TermKind| std::mem::discriminant(&a) == std::mem::discriminant(&b);
        let is_new = |group: &&Group| {
            let is_apart = taken.iter().all(|(old, _)| match (old.kind, group.kind) {
                (TermKind::Turn { times: a, .. }, TermKind::Turn { times: b, .. }) => a.abs_diff(b) >= apart,
                (TermKind::FrictionByPosition { times: a, .. }, TermKind::FrictionByPosition { times: b, .. })
                    if choice != Choice::Sure =>
                {
                    a.abs_diff(b) >= apart
                }
                (a, b) => !same(a, b),
            });
            let harmonics = match choice {
                Choice::Sure => return is_apart,
                Choice::Likely { harmonics, .. } => harmonics,
            };
            // Gravity is no harmonic of cogging.
            let rate = |kind: TermKind| match kind {
                TermKind::Turn { times: times @ 2.., .. } | TermKind::FrictionByPosition { times, .. } => Some(times),
                TermKind::Turn { .. } | TermKind::Stiffness | TermKind::Stribeck { .. } | TermKind::Drag => None,
            };
            let alike = taken.iter().filter(|(old, _)| same(old.kind, group.kind)).map(|(old, _)| old.kind);
            let is_of_one = common_rate(alike.chain([group.kind]).filter_map(rate), harmonics).is_some();
            // Friction by direction that changes with the position is a torque of its period too.
            let is_of_friction = |(old, _): &(&Group, f64)| match (old.kind, group.kind) {
                (TermKind::FrictionByPosition { times: a, .. }, TermKind::Turn { times: b @ 2.., .. }) => a == b,
                _ => false,
            };
            is_apart && is_of_one && !taken.iter().any(is_of_friction)
        };
        let tried = groups.iter().filter(is_new).filter_map(|group| {
            let columns: Vec<usize> = kept.iter().chain(&group.columns).copied().collect();
            let then = table.predicted(&columns)?;
            // Friction that falls towards rest, drag that drives, and friction below 0 at some positions are not physical.
            let values = table.solved(&columns, None)?;
            // Inertia, damping and friction are the first columns.
            let last = columns.len() - 1;
            let drives = match group.kind {
                TermKind::Stribeck { .. } | TermKind::Drag => sign * values[last] <= 0.0,
                TermKind::FrictionByPosition { .. } => values[last].hypot(values[last - 1]) > sign * values[FRICTION],
                TermKind::Stiffness | TermKind::Turn { .. } => false,
            };
            if drives {
                return None;
            }
            let gains: Vec<f64> = left.iter().zip(&then).map(|(before, after)| before - after).collect();
            let mean = gains.iter().sum::<f64>() / gains.len() as f64;
            let spread =
                gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / (gains.len() * (gains.len() - 1)) as f64;
            // The error of Stribeck's friction, whose velocity is one of three, depends on the direction too.
            let times = if matches!(group.kind, TermKind::FrictionByPosition { .. }) { 2.0 } else { 1.0 };
            let (sure, of) = match choice {
                Choice::Sure => (SURELY, times * all),
                Choice::Likely { .. } => (LIKELY, left.iter().sum()),
            };
            let is_sure = mean > sure * spread.sqrt() && mean * gains.len() as f64 > LEAST * of;
            is_sure.then_some((group, columns, then, mean))
        });
        let Some((group, columns, then, mean)) = tried.max_by(|a, b| a.3.total_cmp(&b.3)) else { break };
        taken.push((group, mean * left.len() as f64 / all));
        (kept, left) = (columns, then);
    }
    let Some(whole) = table.solved(&kept, None) else { return Terms::default() };
    let others: Option<Vec<DVector<f64>>> = (0..BLOCKS).map(|out| table.solved(&kept, Some(out))).collect();
    let Some(others) = others else { return Terms::default() };
    let of = |(group, predicts): (&Group, f64)| {
        let at = |values: &DVector<f64>, column: usize| {
            kept.iter().position(|kept| *kept == column).map_or(0.0, |i| sign * values[i])
        };
        let (kind, size): (TermKind, Size<'_>) = match (group.kind, &group.columns[..]) {
            (kind @ (TermKind::Turn { times, .. } | TermKind::FrictionByPosition { times, .. }), [sine, cosine]) => {
                let (p, q) = (at(&whole, *sine), at(&whole, *cosine));
                let phase = q.atan2(p);
                // The projection on the phase that was found: near 0 for an absent term, where an amplitude would be biased upwards.
                let size =
                    move |values: &DVector<f64>| at(values, *sine) * phase.cos() + at(values, *cosine) * phase.sin();
                let is_friction = matches!(kind, TermKind::FrictionByPosition { .. });
                let of_friction = TermKind::FrictionByPosition { times, phase };
                (if is_friction { of_friction } else { TermKind::Turn { times, phase } }, Box::new(size))
            }
            (kind, columns) => {
                let column = columns[0];
                // Inertia, damping and friction are the first columns.
                let kind = match kind {
                    TermKind::Stribeck { velocity, .. } => {
                        TermKind::Stribeck { velocity, beside: [1, 2].map(|own| at(&whole, own).max(0.0)) }
                    }
                    TermKind::Stiffness
                    | TermKind::Turn { .. }
                    | TermKind::FrictionByPosition { .. }
                    | TermKind::Drag => kind,
                };
                (kind, Box::new(move |values: &DVector<f64>| at(values, column)))
            }
        };
        let value = size(&whole);
        let count = others.len() as f64;
        let jack = others.iter().map(|other| (size(other) - value).powi(2)).sum::<f64>() * (count - 1.0) / count;
        let half = student(count - 1.0) * jack.sqrt();
        Term { kind, size: Interval { value, low: value - half, high: value + half }, predicts: Some(predicts) }
    };
    // The equation's own columns are the first ones.
    Terms { terms: taken.into_iter().map(of).collect(), own: std::array::from_fn(|i| whole[i]) }
}
