//! Linear least squares by orthogonal factors (Golub and Van Loan, Matrix Computations, 5.3).
//!
//! Of rows s with right sides r, a triangle R is kept with |R p - R r|² = Σ (s p - r)² for every p. Its condition is the root of that of the
//! normal equations Σ sᵀs: a record without counts that follows a spring tells delay, damping and inertia apart by some millionths of
//! their effects, and sums of squares lose that to rounding.

use nalgebra::{SMatrix, SVector};

use crate::puck::PARAMETERS;

/// The parameters, then the right side.
const COLUMNS: usize = PARAMETERS + 1;
/// Rows that are factored at once.
const BLOCK: usize = 32;
/// The size of a step's stack: the triangle, and a row for each parameter.
const DAMPED: usize = COLUMNS + PARAMETERS;
/// The rows with columns of length 1 are known to this part: what differs by less is rounding.
const ROUNDING: f64 = 1e-11;

/// Which of the parameters are fitted.
pub(crate) type Free = [bool; PARAMETERS];

/// The same with this one held.
pub(crate) fn without(mut free: Free, held: usize) -> Free {
    free[held] = false;
    free
}

/// A matrix over all pairs of parameters.
pub(crate) type Square = SMatrix<f64, PARAMETERS, PARAMETERS>;

/// Rows with their right sides, as they are added.
pub(crate) struct Rows {
    /// The factor of the rows before those of the block.
    triangle: [[f64; COLUMNS]; COLUMNS],
    /// The columns of the last rows.
    block: [[f64; BLOCK]; COLUMNS],
    used: usize,
    squares: f64,
    rows: usize,
}

/// The triangular factor of all rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Factor {
    triangle: SMatrix<f64, COLUMNS, COLUMNS>,
    /// Σ r².
    pub squares: f64,
    pub rows: usize,
}

impl Rows {
    pub fn new() -> Self {
        Rows { triangle: [[0.0; COLUMNS]; COLUMNS], block: [[0.0; BLOCK]; COLUMNS], used: 0, squares: 0.0, rows: 0 }
    }

    pub fn add(&mut self, row: &[f64; PARAMETERS], right: f64) {
        if self.used == BLOCK {
            self.fold();
        }
        self.block.iter_mut().zip(row.iter().chain([&right])).for_each(|(column, x)| column[self.used] = *x);
        self.used += 1;
        self.squares += right * right;
        self.rows += 1;
    }

    /// Takes the rows of the block into the triangle, by a reflection for each column that leaves 0 below the triangle (Householder).
    fn fold(&mut self) {
        let (triangle, mut columns) = (&mut self.triangle, &mut self.block[..]);
        for (c, above) in triangle.iter_mut().enumerate() {
            let Some((column, others)) = columns.split_first_mut() else { break };
            let below: f64 = column.iter().map(|x| x * x).sum();
            let length = above[c].hypot(below.sqrt()).copysign(above[c]);
            let first = above[c] + length;
            let factor = 2.0 / (first * first + below);
            if below > 0.0 {
                for (j, other) in others.iter_mut().enumerate() {
                    let along: f64 = column.iter().zip(other.iter()).map(|(x, y)| x * y).sum();
                    let along = factor * (first * above[c + 1 + j] + along);
                    above[c + 1 + j] -= along * first;
                    other.iter_mut().zip(column.iter()).for_each(|(y, x)| *y -= along * x);
                }
                above[c] = -length;
            }
            columns = others;
        }
        self.block = [[0.0; BLOCK]; COLUMNS];
        self.used = 0;
    }

    pub fn factor(mut self) -> Factor {
        self.fold();
        let triangle = SMatrix::from_fn(|i, j| self.triangle[i][j]);
        Factor { triangle, squares: self.squares, rows: self.rows }
    }
}

impl Factor {
    /// The length of a parameter's column.
    fn length(&self, i: usize) -> f64 {
        self.triangle.column(i).norm()
    }

    /// The parameters of `free` on which the rows depend.
    pub fn seen(&self, free: Free) -> Free {
        std::array::from_fn(|i| free[i] && self.length(i) > 0.0)
    }

    /// The lengths of the columns of these parameters, and the triangle of the rows with such columns divided by their lengths, after as
    /// many rows that hold each parameter near 0 by this weight. The others have a length of 1, and a row that holds them at 0.
    fn scaled(&self, free: Free, weight: f64) -> (SVector<f64, PARAMETERS>, SMatrix<f64, COLUMNS, COLUMNS>) {
        let seen = self.seen(free);
        let lengths = SVector::from_fn(|i, _| if seen[i] { self.length(i) } else { 1.0 });
        let mut stack = SMatrix::<f64, DAMPED, COLUMNS>::zeros();
        stack.fixed_view_mut::<COLUMNS, 1>(0, PARAMETERS).copy_from(&self.triangle.column(PARAMETERS));
        for i in 0..PARAMETERS {
            if seen[i] {
                stack.fixed_view_mut::<COLUMNS, 1>(0, i).copy_from(&(self.triangle.column(i) / lengths[i]));
            }
            stack[(COLUMNS + i, i)] = if seen[i] { weight } else { 1.0 };
        }
        (lengths, stack.qr().unpack_r())
    }

    /// The step that solves the rows, damped by Marquardt's `more`; `None` where they have no solution.
    pub fn step(&self, free: Free, more: f64) -> Option<[f64; PARAMETERS]> {
        let (lengths, triangle) = self.scaled(free, more.sqrt());
        let right = triangle.fixed_view::<PARAMETERS, 1>(0, PARAMETERS);
        let step = triangle.fixed_view::<PARAMETERS, PARAMETERS>(0, 0).solve_upper_triangular(&right)?;
        let seen = self.seen(free);
        let step = SVector::<f64, PARAMETERS>::from_fn(|i, _| if seen[i] { step[i] / lengths[i] } else { 0.0 });
        step.iter().all(|x| x.is_finite()).then(|| step.into())
    }

    /// |s p|² summed over the rows.
    pub fn size(&self, p: &[f64; PARAMETERS]) -> f64 {
        (self.triangle.fixed_columns::<PARAMETERS>(0) * SVector::from(*p)).norm_squared()
    }

    /// Σ (r - s p)² at p.
    pub fn left(&self, p: &[f64; PARAMETERS]) -> f64 {
        let there = self.triangle.fixed_columns::<PARAMETERS>(0) * SVector::from(*p);
        (self.triangle.column(PARAMETERS) - there).norm_squared()
    }

    /// The inverse of Σ sᵀs, 0 in the rows of parameters that are not free; `None` where rounding hides what separates two of them. The
    /// rows are the least that rounding allows.
    pub fn inverse(&self, free: Free) -> Option<Square> {
        let (lengths, triangle) = self.scaled(free, 0.0);
        let seen = self.seen(free);
        let own = triangle.fixed_view::<PARAMETERS, PARAMETERS>(0, 0).into_owned();
        if !own.iter().all(|x| x.is_finite()) {
            return None;
        }
        let parts = own.svd(false, true);
        let directions = parts.v_t?;
        let mut inverse = Square::zeros();
        for (value, direction) in parts.singular_values.iter().zip(directions.row_iter()) {
            let least = value - ROUNDING;
            if least <= 0.0 {
                return None;
            }
            inverse += direction.transpose() * direction / (least * least);
        }
        let inverse = Square::from_fn(|i, j| match seen[i] && seen[j] {
            true => inverse[(i, j)] / (lengths[i] * lengths[j]),
            false => 0.0,
        });
        inverse.iter().all(|x| x.is_finite()).then_some(inverse)
    }
}
