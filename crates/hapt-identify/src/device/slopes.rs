//! The derivatives of a shot's positions by the device's numbers and by the shot's initial state, and the normal equations.

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

use super::parameters::{Free, PARAMETERS};

/// The device's numbers, then position and velocity at the shot's beginning.
const ALL: usize = PARAMETERS + 2;

pub(super) type Square = SMatrix<f64, PARAMETERS, PARAMETERS>;
pub(super) type Column = SVector<f64, PARAMETERS>;
pub(super) type Across = SMatrix<f64, 2, PARAMETERS>;

/// The derivatives of a shot's positions, a row a position, and the sums of their products.
#[derive(Clone, Debug)]
pub(super) struct Slopes {
    pub rows: Vec<[f64; ALL]>,
    products: SMatrix<f64, ALL, ALL>,
    right: SVector<f64, ALL>,
}

/// The normal equations of a step: of the device's numbers with the shots' states eliminated, and the terms that give those.
pub(super) struct Normal {
    pub information: Square,
    pub right: Column,
    pub shots: Vec<OfShot>,
}

/// The inverse of a shot's own information, its right side, and its products with the device's.
pub(super) struct OfShot {
    pub inverse: Matrix2<f64>,
    pub right: Vector2<f64>,
    pub across: Across,
}

impl Slopes {
    /// The slopes from their rows and residuals; `None`: some are not finite.
    pub fn new(rows: Vec<[f64; ALL]>, left: &[f64]) -> Option<Self> {
        let (mut products, mut right) = (SMatrix::<f64, ALL, ALL>::zeros(), SVector::<f64, ALL>::zeros());
        // Most numbers are those of terms that the device does not have.
        let has: Vec<usize> = (0..ALL).filter(|i| rows.iter().any(|row| row[*i] != 0.0)).collect();
        let columns: Vec<Vec<f64>> = has.iter().map(|i| rows.iter().map(|row| row[*i]).collect()).collect();
        let product = |one: &[f64], other: &[f64]| one.iter().zip(other).map(|(x, y)| x * y).sum::<f64>();
        for (k, (i, one)) in has.iter().zip(&columns).enumerate() {
            right[*i] = product(one, left);
            for (j, other) in has[..=k].iter().zip(&columns) {
                let sum = product(one, other);
                (products[(*i, *j)], products[(*j, *i)]) = (sum, sum);
            }
        }
        let is_finite = |products: &SMatrix<f64, ALL, ALL>| products.iter().all(|x| x.is_finite());
        is_finite(&products).then_some(Slopes { rows, products, right })
    }

    /// The largest change of a position by a change of a number.
    pub fn largest(&self, i: usize) -> f64 {
        self.rows.iter().map(|row| row[i].abs()).fold(0.0, f64::max)
    }

    /// Whether the positions depend on a number.
    pub fn sees(&self, i: usize) -> bool {
        self.products[(i, i)] > 0.0
    }

    /// The shot's part, damped by Marquardt's `more`, with this much more information on its position and velocity.
    fn of_shot(&self, more: f64, held: [f64; 2]) -> OfShot {
        let at = |i: usize, j: usize| {
            let own = self.products[(PARAMETERS + i, PARAMETERS + j)];
            if i == j { own * (1.0 + more) + held[i].max(f64::MIN_POSITIVE) } else { own }
        };
        let inverse = Matrix2::new(at(0, 0), at(0, 1), at(1, 0), at(1, 1)).try_inverse();
        OfShot {
            inverse: inverse.filter(|inverse| inverse.iter().all(|x| x.is_finite())).unwrap_or_else(Matrix2::zeros),
            right: self.right.fixed_rows::<2>(PARAMETERS).into(),
            across: self.products.fixed_view::<2, PARAMETERS>(PARAMETERS, 0).into(),
        }
    }
}

impl Normal {
    /// The normal equations of all shots together.
    pub fn of(slopes: &[Slopes], more: f64, held: [f64; 2]) -> Self {
        let shots = slopes.iter().map(|slopes| slopes.of_shot(more, held)).collect();
        let mut normal = Normal { information: Square::zeros(), right: Column::zeros(), shots };
        for (slopes, OfShot { inverse, right, across }) in slopes.iter().zip(&normal.shots) {
            let own = slopes.products.fixed_view::<PARAMETERS, PARAMETERS>(0, 0);
            normal.information += own - across.tr_mul(&(inverse * across));
            normal.right += slopes.right.fixed_rows::<PARAMETERS>(0) - across.tr_mul(&(inverse * right));
        }
        normal
    }
}

/// The information with ones on its diagonal, `more` there, and the scale of each parameter.
pub(super) fn scaled(information: &Square, free: Free, more: f64) -> (Square, Column) {
    let scale = Column::from_fn(|i, _| {
        let own = information[(i, i)];
        if free[i] && own > 0.0 { own.sqrt().recip() } else { 0.0 }
    });
    let matrix = Square::from_fn(|i, j| match i == j {
        true => 1.0 + more,
        false => information[(i, j)] * scale[i] * scale[j],
    });
    (matrix, scale)
}
