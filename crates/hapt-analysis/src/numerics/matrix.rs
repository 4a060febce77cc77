//! Two tools for square matrices: balancing, and the φ functions of the exponential.

use nalgebra::{DMatrix, DVector};

/// Powers of two s with which S⁻¹ A S, S = diag(s), has rows and columns of like size (Parlett and Reinsch, Numerische
/// Mathematik 13, 1969). Powers of two, so that scaling there and back rounds nothing. The sweeps are bounded; a matrix that
/// is not finite comes back unscaled.
pub(crate) fn balance(a: &DMatrix<f64>) -> DVector<f64> {
    let n = a.nrows();
    let mut a = a.clone();
    let mut s = DVector::from_element(n, 1.0);
    if !a.iter().all(|x| x.is_finite()) {
        return s;
    }
    for _ in 0..100 {
        let mut settled = true;
        for i in 0..n {
            let off = |j: &usize| *j != i;
            let column: f64 = (0..n).filter(off).map(|j| a[(j, i)].abs()).sum();
            let row: f64 = (0..n).filter(off).map(|j| a[(i, j)].abs()).sum();
            let ratio = row / column;
            if !(ratio.is_normal() && ratio > 0.0) {
                continue;
            }
            let f = (0.5 * ratio.log2()).round().clamp(-300.0, 300.0).exp2();
            if column * f + row / f < 0.95 * (column + row) {
                settled = false;
                s[i] *= f;
                a.column_mut(i).scale_mut(f);
                a.row_mut(i).scale_mut(1.0 / f);
            }
        }
        if settled {
            break;
        }
    }
    if s.iter().all(|x: &f64| x.is_normal()) { s } else { DVector::from_element(n, 1.0) }
}

/// S⁻¹ A S.
pub(crate) fn scaled(a: &DMatrix<f64>, s: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(a.nrows(), a.ncols(), |i, j| a[(i, j)] * (s[j] / s[i]))
}

/// S A S⁻¹.
pub(crate) fn unscaled(a: &DMatrix<f64>, s: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(a.nrows(), a.ncols(), |i, j| a[(i, j)] * (s[i] / s[j]))
}

/// φ₁(X) = (e^X - 1)/X and φ₂(X) = (e^X - 1 - X)/X², without the subtractions: a series for X/2^n, of norm at most 1/2, then
/// n doublings, with e = e^X - 1 carried along (Higham, Functions of Matrices, 2008, section 10.7.4):
///
/// ```text
/// φ₂(2X) = (φ₁(X)² + 2 φ₂(X))/4      φ₁(2X) = φ₁(X) (1 + e/2)      e' = e (2 + e)
/// ```
pub(crate) fn phi(x: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let n = x.nrows();
    let one = DMatrix::<f64>::identity(n, n);
    let norm = x.column_iter().map(|c| c.iter().map(|v| v.abs()).sum::<f64>()).fold(0.0, f64::max);
    let doublings = if norm > 0.5 { (2.0 * norm).log2().ceil().min(1000.0) as i32 } else { 0 };
    let y = x * 2f64.powi(-doublings);
    // Σ Y^k/(k+2)! from its tail: the first term left out is below 0.5^15/17! = 1e-19.
    let mut phi2 = one.clone();
    for k in (3..=16).rev() {
        phi2 = &one + &y * phi2 / f64::from(k);
    }
    phi2 *= 0.5;
    let mut phi1 = &one + &y * &phi2;
    let mut e = &y * &phi1;
    for _ in 0..doublings {
        phi2 = (&phi1 * &phi1 + 2.0 * phi2) * 0.25;
        phi1 = &phi1 + &phi1 * &e * 0.5;
        e = 2.0 * &e + &e * &e;
    }
    (phi1, phi2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn phi_are_the_blocks_of_an_augmented_exponential(entries in prop::collection::vec(-3.0..3.0f64, 9), size in -3.0..0.5f64) {
            let x = DMatrix::from_vec(3, 3, entries) * 10f64.powf(size);
            // exp [[X, 1, 0], [0, 0, 1], [0, 0, 0]] = [[e^X, φ₁, φ₂], ...] (Van Loan, IEEE TAC 23(3), 1978).
            let mut m = DMatrix::zeros(9, 9);
            m.view_mut((0, 0), (3, 3)).copy_from(&x);
            m.view_mut((0, 3), (6, 6)).fill_with_identity();
            let exp = m.exp();
            let (phi1, phi2) = phi(&x);
            let size = exp.norm();
            prop_assert!((exp.view((0, 3), (3, 3)) - phi1).norm() < 1e-13 * size);
            prop_assert!((exp.view((0, 6), (3, 3)) - phi2).norm() < 1e-13 * size);
        }

        #[test]
        fn balancing_undoes_a_bad_choice_of_units(units in prop::collection::vec(-40..40i32, 4)) {
            let good = DMatrix::from_fn(4, 4, |i, j| 1.0 + 0.1 * (i as f64) - 0.2 * (j as f64));
            let units = DVector::from_iterator(4, units.into_iter().map(|p| 2f64.powi(p)));
            let bad = unscaled(&good, &units);
            let s = balance(&bad);
            let back = scaled(&bad, &s);
            prop_assert!(back.norm() < 2.0 * good.norm());
            prop_assert_eq!(unscaled(&back, &s), bad);
        }
    }
}
