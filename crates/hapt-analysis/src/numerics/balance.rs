//! Balancing of square matrices.

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

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    proptest! {
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
