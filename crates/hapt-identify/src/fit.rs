//! Least squares: the normal equations, and the steps of Levenberg and Marquardt.

use nalgebra::{SMatrix, SVector};

use crate::puck::{DAMPING, DELAY, FRICTION, LAG, PARAMETERS, Puck};
use crate::record::{CancellableRecord, LONGEST_DELAY, Record};

/// Parameters that a fit may hold at 0.
const HELD: [usize; 3] = [DAMPING, FRICTION, DELAY];

/// Which of the parameters are fitted.
pub(crate) type Free = [bool; PARAMETERS];

/// A matrix over all pairs of parameters.
pub(crate) type Square = SMatrix<f64, PARAMETERS, PARAMETERS>;
type Column = SVector<f64, PARAMETERS>;

const MOST_STEPS: usize = 60;
/// Of these at most so many are small ones.
const MOST_AFTER: usize = 12;
/// A step of less than this many standard errors counts as none.
const SMALL: f64 = 1e-3;
/// The information with ones on its diagonal is known to this part: what it has less in a direction is rounding.
const ROUNDING: f64 = 1e-12;
/// The shortest lag of a fit in periods of the record: its sensitivity is a difference, which would lose its digits.
pub(crate) const SHORTEST_LAG: f64 = 0.02;

/// Σ sᵀs and Σ sᵀr over rows s with right sides r.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Normal {
    pub information: Square,
    right: Column,
    /// Σ r².
    pub squares: f64,
    pub rows: usize,
}

impl Normal {
    pub fn new() -> Self {
        Normal { information: Square::zeros(), right: Column::zeros(), squares: 0.0, rows: 0 }
    }

    pub fn add(&mut self, row: &[f64; PARAMETERS], right: f64) {
        for i in 0..PARAMETERS {
            for j in 0..=i {
                self.information[(i, j)] += row[i] * row[j];
            }
            self.right[i] += row[i] * right;
        }
        self.squares += right * right;
        self.rows += 1;
    }

    /// The parameters of `free` on which the rows depend.
    pub fn seen(&self, free: Free) -> Free {
        std::array::from_fn(|i| free[i] && self.information[(i, i)] > 0.0)
    }

    /// The information with ones on its diagonal, ρ more there, and the scale of each parameter.
    fn scaled(&self, free: Free, more: f64) -> (Square, Column) {
        let scale = SVector::from_fn(|i, _| if free[i] { self.information[(i, i)].sqrt().recip() } else { 0.0 });
        let matrix = SMatrix::from_fn(|i, j| match i == j {
            true => 1.0 + more,
            false => self.information[(i.max(j), i.min(j))] * scale[i] * scale[j],
        });
        (matrix, scale)
    }

    /// The step that solves them, damped by Marquardt's `more`; `None` where they have no solution.
    pub fn step(&self, free: Free, more: f64) -> Option<[f64; PARAMETERS]> {
        let (matrix, scale) = self.scaled(self.seen(free), more);
        let step = matrix.cholesky()?.solve(&self.right.component_mul(&scale)).component_mul(&scale);
        step.iter().all(|x| x.is_finite()).then(|| step.into())
    }

    /// Σ (r - s p)² at a solution p.
    pub fn left(&self, p: &[f64; PARAMETERS]) -> f64 {
        self.squares - p.iter().zip(&self.right).map(|(p, right)| p * right).sum::<f64>()
    }

    /// The inverse of the information, 0 in the rows of parameters that are not free; `None` where two parameters cannot be separated at
    /// all. The information is the least that rounding allows, where that separates them still.
    pub fn inverse(&self, free: Free) -> Option<Square> {
        let of = |least: f64| {
            let (matrix, scale) = self.scaled(self.seen(free), least);
            Some((matrix.cholesky()?.inverse(), scale))
        };
        let (inverse, scale) = of(-ROUNDING).or_else(|| of(0.0))?;
        let inverse = Square::from_fn(|i, j| inverse[(i, j)] * scale[i] * scale[j]);
        inverse.iter().all(|x| x.is_finite()).then_some(inverse)
    }

    /// stepᵀ information step.
    fn size(&self, step: &[f64; PARAMETERS]) -> f64 {
        let at = |i: usize, j: usize| self.information[(i.max(j), i.min(j))];
        (0..PARAMETERS)
            .flat_map(|i| (0..PARAMETERS).map(move |j| (i, j)))
            .map(|(i, j)| step[i] * at(i, j) * step[j])
            .sum()
    }
}

/// A puck that fits, and the normal equations there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fit {
    pub puck: Puck,
    pub normal: Normal,
    pub free: Free,
    /// The first sample that is fitted.
    pub first: usize,
}

impl Fit {
    /// The residuals' variance.
    pub fn variance(&self) -> f64 {
        self.normal.squares / self.freedom()
    }

    pub fn freedom(&self) -> f64 {
        let fitted = self.normal.seen(self.free).iter().filter(|seen| **seen).count();
        self.normal.rows.saturating_sub(fitted).max(1) as f64
    }

    /// The covariance of the estimates over the residuals' variance.
    pub fn inverse(&self) -> Option<Square> {
        self.normal.inverse(self.free)
    }

    /// The covariance of the estimates in units of which `unit` is the square of half an interval. In a valley that bends, a fit ends before
    /// the least squares: half an interval is then at least as long as the step that is left.
    pub fn covariance(&self, least: f64, unit: f64) -> Option<Square> {
        let own = self.inverse()?;
        let whole = SVector::from(self.whole(least).unwrap_or([0.0; PARAMETERS]));
        Some(own + whole * whole.transpose() / unit)
    }

    /// The step to the least squares, as far as the motion is linear in the parameters, without those that are held at 0.
    fn whole(&self, least: f64) -> Option<[f64; PARAMETERS]> {
        let p = self.puck.parameters();
        let free = std::array::from_fn(|i| self.free[i] && !(HELD.contains(&i) && p[i] == 0.0));
        step(&Fit { free, ..*self }, least, ROUNDING)
    }
}

/// The normal equations of the position errors at `puck` from sample `first` on; `None` where the motion is not finite.
fn normal(record: &Record, puck: &Puck, first: usize) -> Option<Normal> {
    let mut normal = Normal::new();
    puck.follow(record.times(), record.torques(), first, |i, z, dz| {
        if record.is_news(i) {
            normal.add(dz, record.positions()[i] - z);
        }
    });
    normal.squares.is_finite().then_some(normal)
}

/// The puck nearest to `start` whose positions from sample `first` on have the least squared error, delay and lag together
/// between -10 ms and [`LONGEST_DELAY`].
pub(crate) fn fit(record: &CancellableRecord<'_>, start: Puck, free: Free, first: usize) -> Option<Fit> {
    let mut best = Fit { puck: start, normal: normal(record, &start, first)?, free, first };
    let least = least_variance(record);
    let (mut damping, mut after) = (1e-3, 0);
    for _ in 0..MOST_STEPS {
        if (record.stop)() {
            break;
        }
        let Some(step) = step(&best, least, damping) else {
            damping = (10.0 * damping).max(1e-9);
            continue;
        };
        let mut p = best.puck.parameters();
        p.iter_mut().zip(step).for_each(|(p, step)| *p += step);
        p[DELAY] = p[DELAY].clamp(-0.2 * LONGEST_DELAY, LONGEST_DELAY);
        if free[LAG] {
            p[LAG] = p[LAG].clamp(least, LONGEST_DELAY.powi(2));
        }
        let puck = Puck::from_parameters(p);
        let is_small = |step: &[f64; PARAMETERS]| best.normal.size(step) < SMALL * SMALL * best.variance();
        let is_last = is_small(&step) && damping < 1e-3 && {
            // A damped step is short in a direction of little information, however far the best is along it.
            after += 1;
            after > MOST_AFTER || best.whole(least).is_none_or(|whole| is_small(&whole))
        };
        let is_small = is_small(&step);
        match normal(record, &puck, first) {
            Some(normal) if normal.squares < best.normal.squares => {
                best = Fit { puck, normal, free, first };
                damping *= 0.1;
                if is_last {
                    break;
                }
            }
            _ if is_small => break,
            _ => damping = (10.0 * damping).max(1e-9),
        }
    }
    Some(best)
}

/// The square of the shortest lag of a fit.
pub(crate) fn least_variance(record: &Record) -> f64 {
    (SHORTEST_LAG * record.period()).powi(2)
}

/// The next step of a fit; a lag that is the shortest already, and would be shorter, stays while the others move.
fn step(at: &Fit, least: f64, damping: f64) -> Option<[f64; PARAMETERS]> {
    let step = at.normal.step(at.free, damping)?;
    let is_least = at.free[LAG] && at.puck.parameters()[LAG] <= least * (1.0 + 1e-9);
    if !(is_least && step[LAG] < 0.0) {
        return Some(step);
    }
    let mut others = at.free;
    others[LAG] = false;
    at.normal.step(others, damping)
}
