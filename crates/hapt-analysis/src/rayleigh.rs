//! A simple eigenvalue to more digits than a QR algorithm gives.
//!
//! The algorithm's errors are a few eps of the whole matrix. Where memory stands beside slow bodies that is too coarse: an
//! estimator's last sample has λ - 1 = -1, and at T = 1 µs an error of 1e-15 is a growth of 1e-9 1/s. With the left and right
//! vectors l and x the quotient lᵀDx/lᵀx errs by the product of both vectors' errors, and by eps Σ|l||D||x|/|lᵀx| from the sums and
//! entries: memory has little part in those vectors' product, and its rounding little in the quotient.

use nalgebra::{Complex, DMatrix, DVector};

use crate::matrix::{balance, scaled};

/// The eigenvalue of `a` near `mu`, and a bound of its rounding; `None` when the vectors are not found.
pub(crate) fn quotient(a: &DMatrix<f64>, mu: Complex<f64>) -> Option<(Complex<f64>, f64)> {
    let a = scaled(a, &balance(a));
    let n = a.nrows();
    // Not on the eigenvalue itself, where there is no inverse.
    let shift = mu * (1.0 + 1e-14) + f64::EPSILON * a.amax();
    let near = |a: &DMatrix<f64>| a.map(Complex::from) - DMatrix::from_diagonal_element(n, n, shift);
    let vector = |m: DMatrix<Complex<f64>>| {
        let lu = m.lu();
        let mut x =
            DVector::from_fn(n, |i, _| Complex::new(1.0 + 0.3 * (i as f64).sin(), 0.4 * (2.3 * i as f64).cos()));
        for _ in 0..3 {
            x = lu.solve(&x)?;
            x.unscale_mut(x.norm());
        }
        x.iter().all(|c| c.re.is_finite() && c.im.is_finite()).then_some(x)
    };
    let (x, l) = (vector(near(&a))?, vector(near(&a.transpose()))?);
    let (mut sum, mut size) = (Complex::new(0.0, 0.0), 0.0);
    for (column, x) in a.column_iter().zip(x.iter()) {
        for (entry, l) in column.iter().zip(l.iter()) {
            let term = l * x * *entry;
            sum += term;
            size += term.norm();
        }
    }
    let overlap = l.dot(&x);
    let found = sum / overlap;
    // A real eigenvalue stays one.
    let found = if mu.im == 0.0 { Complex::new(found.re, 0.0) } else { found };
    let error = 2.0 * f64::EPSILON * size / overlap.norm();
    (found.re.is_finite() && found.im.is_finite() && error.is_finite()).then_some((found, error))
}
