//! Rayleigh quotients: a simple eigenvalue to more digits than the QR algorithm.
//!
//! The error of the QR algorithm is a few eps of the norm of the matrix. That is too coarse for slow bodies together with delays and
//! estimator memory: the memory has λ - 1 = -1, and at T = 1 µs an error of 1e-15 is a growth of 1e-9 1/s. With the left and right
//! eigenvectors l and x, the error of the quotient lᵀDx/lᵀx is the product of the errors of both vectors, plus eps Σ|l||D||x|/|lᵀx| from
//! rounding. The memory contributes little to that sum.
//!
//! The vectors are computed by inverse iteration in Hessenberg form, D = Q H Qᵀ: O(n²) per eigenvalue.

use nalgebra::linalg::Hessenberg;
use nalgebra::{Complex, DMatrix, DVector};

use crate::numerics::balance::{balance, scaled};

type C = Complex<f64>;

/// A matrix in Hessenberg form, for the refinement of its eigenvalues.
pub(crate) struct Quotients {
    /// Balanced.
    a: DMatrix<f64>,
    q: DMatrix<f64>,
    h: DMatrix<f64>,
}

impl Quotients {
    pub fn new(a: &DMatrix<f64>) -> Self {
        let a = scaled(a, &balance(a));
        let n = a.nrows();
        let (q, h) = if n > 2 { Hessenberg::new(a.clone()).unpack() } else { (DMatrix::identity(n, n), a.clone()) };
        Quotients { a, q, h }
    }

    /// The eigenvalue near `mu`, and a bound of its rounding; `None` when the vectors are not found.
    pub fn at(&self, mu: C) -> Option<(C, f64)> {
        let n = self.a.nrows();
        // The shift differs from the eigenvalue, where the matrix is singular.
        let factors = Factors::new(&self.h, mu * (1.0 + 1e-14) + f64::EPSILON * self.a.amax());
        let start = DVector::from_fn(n, |i, _| C::new(1.0 + 0.3 * (i as f64).sin(), 0.4 * (2.3 * i as f64).cos()));
        let vector = |solve: &dyn Fn(&mut DVector<C>)| {
            let mut x = start.clone();
            for _ in 0..3 {
                solve(&mut x);
                x.unscale_mut(x.norm());
            }
            // Back from H's coordinates.
            let [re, im] = [x.map(|c| c.re), x.map(|c| c.im)].map(|part| &self.q * part);
            let x = re.zip_map(&im, C::new);
            x.iter().all(|c| c.re.is_finite() && c.im.is_finite()).then_some(x)
        };
        let (x, l) = (vector(&|x| factors.solve(x))?, vector(&|x| factors.solve_transposed(x))?);
        let (mut sum, mut size) = (C::new(0.0, 0.0), 0.0);
        let [sizes, l_sizes] = [&x, &l].map(|vector| vector.map(|c| c.norm()));
        for ((column, x), size_of_x) in self.a.column_iter().zip(x.iter()).zip(sizes.iter()) {
            for ((entry, l), size_of_l) in column.iter().zip(l.iter()).zip(l_sizes.iter()) {
                if *entry != 0.0 {
                    sum += l * x * *entry;
                    size += size_of_l * size_of_x * entry.abs();
                }
            }
        }
        let overlap = l.dot(&x);
        let found = sum / overlap;
        // A real eigenvalue remains real.
        let found = if mu.im == 0.0 { C::new(found.re, 0.0) } else { found };
        let error = 2.0 * f64::EPSILON * size / overlap.norm();
        (found.re.is_finite() && found.im.is_finite() && error.is_finite()).then_some((found, error))
    }
}

/// The LU factors of H - shift, with partial pivoting between neighbouring rows.
struct Factors {
    upper: DMatrix<C>,
    /// For each row except the last: whether it was exchanged with the next, and the multiple of it that was then subtracted.
    steps: Vec<(bool, C)>,
}

impl Factors {
    fn new(h: &DMatrix<f64>, shift: C) -> Self {
        let n = h.nrows();
        let mut upper = h.map(C::from);
        (0..n).for_each(|i| upper[(i, i)] -= shift);
        let mut steps = Vec::with_capacity(n);
        for k in 0..n.saturating_sub(1) {
            let exchanged = upper[(k, k)].norm_sqr() < upper[(k + 1, k)].norm_sqr();
            if exchanged {
                upper.swap_rows(k, k + 1);
            }
            let pivot = upper[(k, k)];
            let part = if pivot == C::new(0.0, 0.0) { pivot } else { upper[(k + 1, k)] / pivot };
            for mut column in upper.columns_mut(k, n - k).column_iter_mut() {
                let above = column[k];
                column[k + 1] -= part * above;
            }
            steps.push((exchanged, part));
        }
        Factors { upper, steps }
    }

    fn solve(&self, x: &mut DVector<C>) {
        for (k, (exchanged, part)) in self.steps.iter().enumerate() {
            if *exchanged {
                x.swap_rows(k, k + 1);
            }
            let above = x[k];
            x[k + 1] -= part * above;
        }
        for (j, column) in self.upper.column_iter().enumerate().rev() {
            x[j] /= column[j];
            let here = x[j];
            (0..j).for_each(|i| x[i] -= column[i] * here);
        }
    }

    fn solve_transposed(&self, x: &mut DVector<C>) {
        for (j, column) in self.upper.column_iter().enumerate() {
            let before: C = (0..j).map(|i| column[i] * x[i]).sum();
            x[j] = (x[j] - before) / column[j];
        }
        for (k, (exchanged, part)) in self.steps.iter().enumerate().rev() {
            let below = x[k + 1];
            x[k] -= part * below;
            if *exchanged {
                x.swap_rows(k, k + 1);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    proptest! {
        #[test]
        fn a_factored_matrix_is_solved_both_ways(n in 1..9usize, numbers in prop::collection::vec(-1.0..1.0f64, 81), re in -1.0..1.0f64, im in -1.0..1.0f64) {
            let h = DMatrix::from_fn(n, n, |i, j| if i > j + 1 { 0.0 } else { numbers[9 * i + j] });
            let shift = C::new(re, im);
            let shifted = h.map(C::from) - DMatrix::from_diagonal_element(n, n, shift);
            prop_assume!(shifted.clone().try_inverse().is_some_and(|inverse| inverse.norm() < 1e3));
            let factors = Factors::new(&h, shift);
            let b = DVector::from_fn(n, |i, _| C::new(1.0 + i as f64, 0.5 - i as f64));
            let (mut x, mut l) = (b.clone(), b.clone());
            factors.solve(&mut x);
            factors.solve_transposed(&mut l);
            prop_assert!((&shifted * x - &b).norm() < 1e-10);
            prop_assert!((shifted.transpose() * l - &b).norm() < 1e-10);
        }
    }
}
