//! The exponential and its φ functions without cancellation: of matrices, of complex and of real numbers.

use nalgebra::{Complex, DMatrix};

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

/// φ₁ = (1 - e^{-x})/x, for x ≥ 0.
pub(crate) fn phi1(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { -(-x).exp_m1() / x }
}

/// φ₂ = (x - 1 + e^{-x})/x², for x ≥ 0: below 1 by its series, whose 19th term is below the last bit.
pub(crate) fn phi2(x: f64) -> f64 {
    if x >= 1.0 {
        return ((-x).exp_m1() + x) / (x * x);
    }
    (3..=20).rev().fold(1.0, |sum, k| 1.0 - x * sum / f64::from(k)) * 0.5
}

/// (e^z - 1 - z)/z², which is e^z's share of a ramp.
pub(crate) fn complex_phi2(z: Complex<f64>, less_one: Complex<f64>) -> Complex<f64> {
    if z.norm() > 1.0 {
        return (less_one - z) / (z * z);
    }
    (3..=20).rev().fold(Complex::from(1.0), |sum, k| 1.0 + z / f64::from(k) * sum) * 0.5
}

/// e^x - 1.
pub(crate) fn exp_m1(x: Complex<f64>) -> Complex<f64> {
    let sin = (0.5 * x.im).sin();
    Complex::new(x.re.exp_m1() * x.im.cos() - 2.0 * sin * sin, x.re.exp() * x.im.sin())
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

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
        fn the_closed_forms_are_the_phi_functions(log in -12.0..2.0f64) {
            let x = 10f64.powf(log);
            let (one, two) = phi(&DMatrix::from_element(1, 1, -x));
            prop_assert!((phi1(x) / one[0] - 1.0).abs() < 1e-14);
            prop_assert!((phi2(x) / two[0] - 1.0).abs() < 2e-14);
        }
    }
}
