//! The equation of motion compared with the torque, for devices that are richer than the puck of [`crate::Puck`].
//!
//! With a bump w(t) that vanishes with its slopes at both ends of a window, every term of
//!
//! ```text
//! τ(t - d) = J z̈ + b ż + f sign ż + c + ...
//! ```
//!
//! is weighted by the same w (order 0) or by ẇ (order 1, which is blind to constants), and the derivatives of the position pass to the
//! bump: ∫ w z̈ = ∫ ẅ z. So no position is differentiated, and all terms have the same filter. Each window gives one row.

use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

use crate::record::Record;

/// Terms of the equation, in the order of the columns.
pub(crate) const TERMS: usize = 9;
pub(crate) const INERTIA: usize = 0;
pub(crate) const DAMPING: usize = 1;
pub(crate) const FRICTION: usize = 2;
pub(crate) const CONSTANT: usize = 3;
pub(crate) const STIFFNESS: usize = 4;
pub(crate) const DIRECTION: usize = 5;
pub(crate) const SINE: usize = 6;
pub(crate) const COSINE: usize = 7;
/// A second torque, measured.
pub(crate) const FORCE: usize = 8;

pub(crate) type Mask = [bool; TERMS];
type Square = SMatrix<f64, TERMS, TERMS>;
type Column = SVector<f64, TERMS>;

/// Sums of products over rows.
#[derive(Clone, Copy, Debug)]
struct Sums {
    terms: Square,
    torque: Column,
    squares: f64,
}

impl std::ops::Add<&Sums> for Sums {
    type Output = Sums;

    fn add(self, other: &Sums) -> Sums {
        Sums {
            terms: self.terms + other.terms,
            torque: self.torque + other.torque,
            squares: self.squares + other.squares,
        }
    }
}

/// The bump is (1 - u²)^POWER.
const POWER: i32 = 5;
/// Windows overlap: this many begin within half of one.
const OVERLAP: usize = 6;
/// A window with fewer samples to a side does not determine a second derivative.
pub(crate) const FEWEST: usize = 6;
/// A gap of this many periods is in no window.
const GAP: f64 = 4.0;
/// A window in which the puck moves less than this part of the time is left out: at rest friction balances any torque.
const MOVES: f64 = 0.7;
/// No real spring is linear and lossless to better than this part: this much of its torque may be correlated with the acceleration.
const BENT: f64 = 0.05;
/// The number of resampled records of a bootstrap.
const RESAMPLES: usize = 100;
/// Parts of a record that are left out in turn (the jackknife).
pub(crate) const BLOCKS: usize = 8;

/// The weight of the rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Band {
    /// The length of a window, s.
    pub length: f64,
    /// Whether the weight is the bump's slope.
    pub slope: bool,
}

/// One window.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub time: f64,
    pub terms: [f64; TERMS],
    pub torque: f64,
    /// Means under the bump.
    pub position: f64,
    pub velocity: f64,
    /// The first and the last sample, and the bump's integral over half of the window's length.
    span: (usize, usize),
    area: f64,
}

/// The method for the standard errors of the equation's terms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Errors {
    /// The larger of the jackknife's and that of least squares with the number of independent residuals.
    #[default]
    Larger,
    /// By leaving out one of eight blocks of the record in turn.
    Jackknife,
    /// By the sandwich of Newey and West (Econometrica 55 (1987) 703) with Andrews's lag for an autoregression (Econometrica 59 (1991)
    /// 817).
    Sandwich,
    /// By the moving blocks bootstrap (Künsch, Ann. Stat. 17 (1989) 1217), with blocks of twice the correlation time of the residuals.
    Bootstrap,
}

/// The equation of the torque over all windows of a record.
pub(crate) struct TorqueRows {
    errors: Errors,
    pub rows: Vec<Row>,
    /// The contribution of the positions' noise to the squares of a row's terms.
    noise: Square,
}

/// The bump and its slopes up to the third.
fn bump(u: f64) -> [f64; 4] {
    let (q, p) = (1.0 - u * u, f64::from(POWER));
    let power = |less: i32| q.powi(POWER - less);
    [
        power(0),
        -2.0 * p * u * power(1),
        -2.0 * p * power(1) + 4.0 * p * (p - 1.0) * u * u * power(2),
        12.0 * p * (p - 1.0) * u * power(2) - 8.0 * p * (p - 1.0) * (p - 2.0) * u.powi(3) * power(3),
    ]
}

impl TorqueRows {
    /// `signs`: of the velocity at each sample, from -1 to 1; `torques`: those that act at each sample.
    pub fn new(record: &Record, signs: &[f64], torques: &[f64], band: Band) -> Self {
        let (times, positions) = (record.times(), record.positions());
        let half = (0.5 * band.length / record.period()).round() as usize;
        let mut all = TorqueRows { errors: Errors::default(), rows: Vec::new(), noise: Square::zeros() };
        if half < FEWEST {
            return all;
        }
        let middle = positions.iter().sum::<f64>() / positions.len() as f64;
        let variance = record.noise().powi(2);
        let forces = record.forces();
        let turned: Vec<(f64, f64)> = positions.iter().map(|z| z.sin_cos()).collect();
        let mut centre = half;
        while centre + half < times.len() {
            let (low, high) = (centre - half, centre + half);
            centre += (half / OVERLAP).max(1);
            let is_far = |pair: &[f64]| pair[1] - pair[0] > GAP * record.period();
            let unmeasured = (low..=high).scan(0, |run, i| {
                *run = if record.is_measured(i) { 0 } else { *run + 1 };
                Some(*run)
            });
            if times[low..=high].windows(2).any(is_far) || unmeasured.max() > Some(GAP as usize) {
                continue;
            }
            let (c, mid) = (0.5 * (times[high] - times[low]), 0.5 * (times[high] + times[low]));
            let near = positions[(low + high) / 2];
            let mut row = Row {
                time: mid,
                terms: [0.0; TERMS],
                torque: 0.0,
                position: 0.0,
                velocity: 0.0,
                span: (low, high),
                area: 0.0,
            };
            let (mut area, mut moving) = (0.0, 0.0);
            let mut noisy = Square::zeros();
            for i in low + 1..high {
                let dt = 0.5 * (times[i + 1] - times[i - 1]) / c;
                let w = bump((times[i] - mid) / c);
                let z = positions[i];
                area += w[0] * dt;
                moving += w[0] * dt * signs[i].abs();
                row.position += w[0] * dt * z;
                row.velocity -= w[1] * dt / c * (z - near);
                let o = usize::from(band.slope);
                let (w0, w1, w2) = (w[o] * dt, w[o + 1] * dt / c, w[o + 2] * dt / (c * c));
                row.torque += w0 * torques[i];
                row.terms[INERTIA] += w2 * (z - near);
                row.terms[DAMPING] -= w1 * (z - near);
                row.terms[FRICTION] += w0 * signs[i];
                row.terms[CONSTANT] += if band.slope { 0.0 } else { w0 };
                row.terms[STIFFNESS] += w0 * (z - middle);
                row.terms[DIRECTION] += w0 * signs[i].abs();
                row.terms[SINE] += w0 * turned[i].0;
                row.terms[COSINE] += w0 * turned[i].1;
                row.terms[FORCE] += forces.map_or(0.0, |forces| w0 * forces[i]);
                noisy[(INERTIA, INERTIA)] += w2 * w2;
                noisy[(DAMPING, DAMPING)] += w1 * w1;
            }
            if moving < MOVES * area {
                continue;
            }
            row.terms.iter_mut().for_each(|term| *term /= area);
            row.torque /= area;
            row.position /= area;
            row.velocity /= area;
            row.area = area;
            all.noise += noisy * (variance / (area * area));
            all.rows.push(row);
        }
        all
    }

    /// The weights of the samples under each row's bump.
    pub fn weights(&self, record: &Record) -> Vec<Vec<f64>> {
        let times = record.times();
        let of_row = |row: &Row| {
            let (low, high) = row.span;
            let (c, mid) = (0.5 * (times[high] - times[low]), 0.5 * (times[high] + times[low]));
            let weight =
                |i: usize| bump((times[i] - mid) / c)[0] * 0.5 * (times[i + 1] - times[i - 1]) / (c * row.area);
            (low + 1..high).map(weight).collect()
        };
        self.rows.iter().map(of_row).collect()
    }

    /// Means of values at the samples by these weights, one for each row.
    pub fn means(&self, weights: &[Vec<f64>], values: &[f64]) -> Vec<f64> {
        let mean = |(row, weights): (&Row, &Vec<f64>)| {
            let values = &values[row.span.0 + 1..row.span.1];
            weights.iter().zip(values).map(|(w, x)| w * x).sum()
        };
        self.rows.iter().zip(weights).map(mean).collect()
    }

    /// The torques, per inertia, of bodies on the puck by shafts of these frequencies, in Hz, and damping ratios, under each row's bump.
    ///
    /// θ̈ + 2 ζ ω θ̇ + ω² θ = -z̈ for the angle θ by which the body is ahead; its torque against the motor's is -ω² θ - 2 ζ ω θ̇. No position
    /// is differentiated: y = z + θ and p = ẏ + 2 ζ ω θ have ẏ = p - 2 ζ ω θ and ṗ = -ω² θ.
    pub fn swung(&self, record: &Record, shafts: &[(f64, f64)]) -> Vec<Vec<f64>> {
        let (times, positions) = (record.times(), record.positions());
        let weights = |row: &Row| {
            let (low, high) = row.span;
            let (c, mid) = (0.5 * (times[high] - times[low]), 0.5 * (times[high] + times[low]));
            let of = |i: usize| {
                let w = bump((times[i] - mid) / c);
                let dt = 0.5 * (times[i + 1] - times[i - 1]) / (c * row.area);
                (w[0] * dt, w[1] * dt / c)
            };
            (low + 1..high).map(of).collect::<Vec<_>>()
        };
        let weights: Vec<Vec<(f64, f64)>> = self.rows.iter().map(weights).collect();
        let of = |(hz, ratio): &(f64, f64)| {
            let omega = std::f64::consts::TAU * hz;
            let (damped, stiff) = (2.0 * ratio * omega, omega * omega);
            let (mut y, mut p) = (positions[0], 0.0);
            let mut angles = vec![0.0];
            // By the trapezoidal rule, from rest.
            for (time, place) in times.windows(2).zip(positions.windows(2)) {
                let h = 0.5 * (time[1] - time[0]);
                let theta = y - place[0];
                let next = y + h * (2.0 * p - damped * (theta - place[1])) - h * h * stiff * (theta - place[1]);
                y = next / (1.0 + h * damped + h * h * stiff);
                p -= h * stiff * (theta + y - place[1]);
                angles.push(y - place[1]);
            }
            let row = |(row, weights): (&Row, &Vec<(f64, f64)>)| {
                let angles = &angles[row.span.0 + 1..row.span.1];
                weights.iter().zip(angles).map(|((w0, w1), theta)| (damped * w1 - stiff * w0) * theta).sum()
            };
            self.rows.iter().zip(&weights).map(row).collect()
        };
        shafts.par_iter().map(of).collect()
    }

    /// The same rows with other torques at the samples, by these weights.
    pub fn under(&self, weights: &[Vec<f64>], torques: &[f64]) -> TorqueRows {
        let torques = self.means(weights, torques);
        let rows = self.rows.iter().zip(torques).map(|(row, torque)| Row { torque, ..*row }).collect();
        TorqueRows { errors: self.errors, rows, noise: self.noise }
    }

    /// The same rows, with standard errors by another method.
    pub fn with_errors(self, errors: Errors) -> TorqueRows {
        TorqueRows { errors, ..self }
    }

    /// The rows whose positions are all between two places.
    pub fn between(&self, record: &Record, [low, high]: [f64; 2]) -> TorqueRows {
        let is_inside =
            |row: &&Row| record.positions()[row.span.0..=row.span.1].iter().all(|z| (low..=high).contains(z));
        let rows: Vec<Row> = self.rows.iter().filter(is_inside).copied().collect();
        let noise = self.noise * (rows.len() as f64 / self.rows.len().max(1) as f64);
        TorqueRows { errors: self.errors, rows, noise }
    }

    /// The sums over each of the blocks.
    fn sums(&self) -> Vec<Sums> {
        let n = self.rows.len();
        let blocks = BLOCKS.min(n.max(1));
        let of = |block: usize| {
            let rows = &self.rows[block * n / blocks..(block + 1) * n / blocks];
            let part = rows.len() as f64 / n.max(1) as f64;
            let mut sums = Sums { terms: -self.noise * part, torque: Column::zeros(), squares: 0.0 };
            for row in rows {
                let x = Column::from(row.terms);
                sums.terms += x * x.transpose();
                sums.torque += x * row.torque;
                sums.squares += row.torque * row.torque;
            }
            sums
        };
        (0..blocks).map(of).collect()
    }

    /// The part of the squared accelerations that is noise.
    pub fn noise_part(&self) -> f64 {
        let all: f64 = self.rows.iter().map(|row| row.terms[INERTIA].powi(2)).sum();
        if all > 0.0 { self.noise[(INERTIA, INERTIA)] / all } else { 1.0 }
    }

    /// The part of the torques' variance that remains in the residuals of a solution, and that the positions' noise does not explain.
    pub fn unexplained(&self, solved: &Solved) -> f64 {
        let values = Column::from(solved.values);
        let noise = (values.transpose() * self.noise * values)[(0, 0)] / self.rows.len().max(1) as f64;
        solved.share - noise / self.variance().max(f64::MIN_POSITIVE)
    }

    /// The mean square of the torques about their mean.
    pub fn variance(&self) -> f64 {
        let n = self.rows.len() as f64;
        let mean = self.rows.iter().map(|row| row.torque).sum::<f64>() / n;
        self.rows.iter().map(|row| (row.torque - mean).powi(2)).sum::<f64>() / n
    }
}

/// A solution over all windows.
#[derive(Clone, Debug)]
pub(crate) struct Solved {
    pub values: [f64; TERMS],
    /// Standard errors that hold where the residuals are correlated with each other and with the motion.
    pub errors: [f64; TERMS],
    /// The inertia by the regression of the acceleration on the torque, and its standard error.
    pub by_motion: (f64, f64),
    pub left: Vec<f64>,
    /// The mean square of the residuals over that of the torques.
    pub share: f64,
    /// The number of independent values among the residuals.
    pub independent: f64,
    /// Whether a constant is determined: motion in one direction does not distinguish it from friction, nor do both from a friction by
    /// direction.
    pub has_constant: bool,
}

fn solve(sums: &Sums, mask: Mask) -> Option<(Column, Square)> {
    let seen: Mask = std::array::from_fn(|i| mask[i] && sums.terms[(i, i)] > 0.0);
    let scale = Column::from_fn(|i, _| if seen[i] { sums.terms[(i, i)].sqrt().recip() } else { 0.0 });
    let matrix = Square::from_fn(|i, j| if i == j { 1.0 } else { sums.terms[(i, j)] * scale[i] * scale[j] });
    let cholesky = matrix.cholesky()?;
    let values = cholesky.solve(&sums.torque.component_mul(&scale)).component_mul(&scale);
    let inverse = cholesky.inverse();
    let inverse = Square::from_fn(|i, j| inverse[(i, j)] * scale[i] * scale[j]);
    values.iter().chain(inverse.iter()).all(|x| x.is_finite()).then_some((values, inverse))
}

impl TorqueRows {
    /// The least squares with these terms, with damping and friction of the inertia's sign; `duration` of the record in s.
    pub fn solved(&self, mask: Mask, duration: f64) -> Option<Solved> {
        let mut mask = mask;
        // The variance of a damping or friction that is held at 0, because its estimate would be below.
        let mut at_bound = Column::zeros();
        let blocks = self.sums();
        let all = total(&blocks, None);
        loop {
            let solution = solve(&all, mask);
            let without = |out: usize| {
                let sums = total(&blocks, Some(out));
                solve(&sums, mask).map(|(values, inverse)| (values, by_motion(&sums, &values, &inverse)))
            };
            let others: Option<Vec<(Column, f64)>> = (0..blocks.len()).map(without).collect();
            let (Some((values, inverse)), Some(others)) = (solution, others) else {
                // For motion in one direction, these are the same as friction.
                let same = [DIRECTION, CONSTANT].into_iter().find(|i| mask[*i])?;
                mask[same] = false;
                continue;
            };
            // A torque that drives the puck along its motion is neither damping nor friction.
            let wrong = |i: usize| mask[i] && values[i] * values[INERTIA] < 0.0;
            let count = blocks.len() as f64;
            if let Some(i) = [DAMPING, FRICTION].into_iter().find(|i| wrong(*i)) {
                mask[i] = false;
                let jack: f64 = others.iter().map(|other| (other.0[i] - values[i]).powi(2)).sum();
                at_bound[i] = (jack * (count - 1.0) / count).sqrt();
                continue;
            }
            let left: Vec<f64> =
                self.rows.iter().map(|row| row.torque - values.dot(&Column::from(row.terms))).collect();
            let terms = mask.iter().filter(|is_free| **is_free).count() as f64;
            let n = left.len() as f64;
            let square = left.iter().map(|r| r * r).sum::<f64>() / n;
            let independent = independent(&left).clamp(1.0, most_independent(duration));
            let freedom = (independent - terms).max(1.0);
            let jack = others.iter().fold(Column::zeros(), |sum, other| sum + (other.0 - values).map(|x| x * x));
            let sum = |term: usize| self.rows.iter().map(|row| row.terms[term].powi(2)).sum::<f64>();
            let curved = BENT * values[STIFFNESS].abs() * (sum(STIFFNESS) / sum(INERTIA).max(f64::MIN_POSITIVE)).sqrt();
            let is_sandwich = self.errors == Errors::Sandwich;
            let sandwich = if is_sandwich { self.sandwich(&inverse, &left) } else { Column::zeros() };
            let is_bootstrap = self.errors == Errors::Bootstrap;
            let bootstrap = if is_bootstrap { self.bootstrap(mask, n / independent) } else { Column::zeros() };
            let errors = Column::from_fn(|i, _| {
                let jackknife = jack[i] * (count - 1.0) / count;
                let plain = inverse[(i, i)].max(0.0) * square * n / freedom;
                let variance = match self.errors {
                    Errors::Larger => jackknife.max(plain),
                    Errors::Jackknife => jackknife,
                    Errors::Sandwich => sandwich[i],
                    Errors::Bootstrap => bootstrap[i],
                };
                let spring = if i == INERTIA { curved * curved } else { 0.0 };
                (variance + spring).sqrt().max(at_bound[i])
            });
            let motion = by_motion(&all, &values, &inverse);
            let jack = others.iter().map(|other| (other.1 - motion).powi(2)).sum::<f64>() * (count - 1.0) / count;
            let plain = errors[INERTIA] * motion / values[INERTIA];
            let by_motion = (motion, jack.sqrt().max(plain.abs()));
            let share = square / self.variance().max(f64::MIN_POSITIVE);
            let has_constant = mask[CONSTANT] && !mask[DIRECTION];
            return Some(Solved {
                values: values.into(),
                errors: errors.into(),
                by_motion,
                left,
                share,
                independent,
                has_constant,
            });
        }
    }
}

impl TorqueRows {
    /// The variances of the estimates by the sandwich: residuals of neighbouring windows are correlated up to a lag that the data give.
    fn sandwich(&self, inverse: &Square, left: &[f64]) -> Column {
        let scores: Vec<Column> =
            self.rows.iter().zip(left).map(|(row, left)| inverse * Column::from(row.terms) * *left).collect();
        let n = scores.len();
        let of = |i: usize| {
            let at = |lag: usize| scores.iter().zip(&scores[lag..]).map(|(a, b)| a[i] * b[i]).sum::<f64>();
            let own = at(0);
            if own <= 0.0 {
                return 0.0;
            }
            let next = (at(1) / own).clamp(-0.97, 0.97);
            let alpha = 4.0 * next * next / ((1.0 - next).powi(2) * (1.0 + next).powi(2));
            let lag = (1.1447 * (alpha * n as f64).cbrt()).clamp(1.0, 0.5 * n as f64) as usize;
            let more = (1..=lag).map(|k| 2.0 * (1.0 - k as f64 / (lag + 1) as f64) * at(k)).sum::<f64>();
            (own + more).max(0.0)
        };
        Column::from_fn(|i, _| of(i))
    }

    /// The variances of the estimates over records that are assembled from blocks of this one.
    fn bootstrap(&self, mask: Mask, correlated: f64) -> Column {
        let n = self.rows.len();
        let length = ((2.0 * correlated).ceil() as usize).clamp(1, n.div_ceil(4));
        let noise = self.noise * (n as f64).recip();
        // The sums up to each row.
        let none = Sums { terms: Square::zeros(), torque: Column::zeros(), squares: 0.0 };
        let mut sums = vec![none];
        let mut sum = none;
        for row in &self.rows {
            let x = Column::from(row.terms);
            sum.terms += x * x.transpose() - noise;
            sum.torque += x * row.torque;
            sums.push(sum);
        }
        // xorshift64 (Marsaglia 2003): the same blocks each time.
        let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
        let mut draw = |below: usize| {
            seed ^= seed << 13;
            seed ^= seed >> 7;
            seed ^= seed << 17;
            (seed >> 11) as usize % below
        };
        let mut values = Vec::with_capacity(RESAMPLES);
        for _ in 0..RESAMPLES {
            let mut all = none;
            for _ in 0..n.div_ceil(length) {
                let from = draw(n - length + 1);
                all.terms += sums[from + length].terms - sums[from].terms;
                all.torque += sums[from + length].torque - sums[from].torque;
            }
            values.extend(solve(&all, mask).map(|(values, _)| values));
        }
        let count = values.len().max(2) as f64;
        let mean = values.iter().fold(Column::zeros(), |sum, value| sum + value) / count;
        values.iter().fold(Column::zeros(), |sum, value| sum + (value - mean).map(|x| x * x)) / (count - 1.0)
    }
}

fn total(blocks: &[Sums], without: Option<usize>) -> Sums {
    let kept = blocks.iter().enumerate().filter(|(i, _)| Some(*i) != without);
    let none = Sums { terms: Square::zeros(), torque: Column::zeros(), squares: 0.0 };
    kept.fold(none, |sum, (_, block)| sum + block)
}

/// The inertia that the same rows give where the motion, not the torque, has the errors: the regression of the acceleration on the torque.
/// Other torques on the puck bias the inertia by regression of the torque towards 0, and this one away from it, where the torque does not
/// follow the motion.
fn by_motion(sums: &Sums, values: &Column, inverse: &Square) -> f64 {
    let left = (sums.squares - values.dot(&sums.torque)).max(0.0);
    values[INERTIA] + left * inverse[(INERTIA, INERTIA)] / values[INERTIA]
}

/// The most independent values: the residual of a device beyond the model is correlated with its motion, however long its correlation time
/// is found.
fn most_independent(duration: f64) -> f64 {
    (3.0 * duration).max(16.0)
}

/// The number of values over the sum of their correlations up to the lag where these end (Geyer, Statist. Sci. 7 (1992) 473).
fn independent(left: &[f64]) -> f64 {
    let n = left.len();
    let all: f64 = left.iter().map(|r| r * r).sum();
    let mut sum = 1.0;
    for lag in 1..n / 2 {
        let at = left.iter().zip(&left[lag..]).map(|(a, b)| a * b).sum::<f64>() / all.max(f64::MIN_POSITIVE);
        if at < 0.05 {
            break;
        }
        sum += 2.0 * at;
    }
    n as f64 / sum
}
