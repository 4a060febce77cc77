//! Eigenvalues of real matrices: balancing, then the QR algorithm.

use nalgebra::{Complex, DMatrix};

use crate::error::Error;
use crate::numerics::balance::{balance, scaled};
use crate::numerics::hessenberg;
use crate::until::is_over;

/// The eigenvalues of a square matrix, complex ones as exact conjugates: balancing, then the QR algorithm with bounded
/// iterations. They err by a few eps of the balanced matrix's norm, times their condition.
///
/// # Errors
/// [`Error::Eigenvalues`] when an entry is not finite or the iteration does not converge; [`Error::Stopped`].
pub fn eigenvalues(a: &DMatrix<f64>) -> Result<Vec<Complex<f64>>, Error> {
    Ok(eigenvalues_and_scale(a)?.0)
}

/// The same, with the largest entry of the balanced matrix, of which they err by a few eps.
pub(crate) fn eigenvalues_and_scale(a: &DMatrix<f64>) -> Result<(Vec<Complex<f64>>, f64), Error> {
    let n = a.nrows();
    let failed = Error::Eigenvalues { order: n };
    if n == 0 {
        return Ok((Vec::new(), 0.0));
    }
    if is_over() {
        return Err(Error::Stopped);
    }
    let a = scaled(a, &balance(a));
    // To norm 1: the solver squares entries.
    let size = a.amax();
    if !size.is_finite() {
        return Err(failed);
    }
    if size == 0.0 {
        return Ok((vec![Complex::new(0.0, 0.0); n], 0.0));
    }
    let a = a / size;
    let found = hessenberg::eigenvalues(a).ok_or(failed.clone())?;
    if found.iter().all(|s| s.re.is_finite() && s.im.is_finite()) {
        Ok((found.into_iter().map(|s| s * size).collect(), size))
    } else {
        Err(failed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    proptest! {
        #[test]
        fn skew_matrices_have_imaginary_eigenvalues_and_always_converge(n in 1..24usize, seed in prop::collection::vec(-1.0..1.0f64, 24 * 24)) {
            let skew = DMatrix::from_fn(n, n, |i, j| seed[i * 24 + j] - seed[j * 24 + i]);
            for s in eigenvalues(&skew).unwrap() {
                prop_assert!(s.re.abs() < 1e-13 * (n as f64));
            }
        }

        #[test]
        fn eigenvalues_of_a_companion_matrix_are_the_roots(roots in prop::collection::vec(-2.0..2.0f64, 1..6)) {
            // ∏ (x - r), coefficients upwards.
            let mut p = vec![1.0];
            for r in &roots {
                let mut next = vec![0.0; p.len() + 1];
                for (i, c) in p.iter().enumerate() {
                    next[i + 1] += c;
                    next[i] -= r * c;
                }
                p = next;
            }
            let n = roots.len();
            let m = DMatrix::from_fn(n, n, |i, j| if j + 1 == n { -p[i] } else if i == j + 1 { 1.0 } else { 0.0 });
            for s in eigenvalues(&m).unwrap() {
                let at = p.iter().rev().fold(Complex::new(0.0, 0.0), |sum, c| sum * s + c);
                prop_assert!(at.norm() < 1e-11, "p({s}) = {at}");
            }
        }
    }

    #[test]
    fn a_cyclic_permutation_has_the_roots_of_one() {
        // The double-shift QR algorithm turns this matrix into itself for ever; the exceptional shifts end it.
        for n in 2..60 {
            let cycle = DMatrix::from_fn(n, n, |i, j| f64::from(u8::from((i + 1) % n == j)));
            let found = eigenvalues(&cycle).unwrap();
            assert!(found.iter().all(|s| (s.powi(n as i32) - 1.0).norm() < 1e-11), "{n}: {found:?}");
        }
    }

    #[test]
    fn the_sums_of_eigenvalues_and_of_their_squares_are_traces() {
        for n in [1, 3, 10, 66, 200] {
            let a = DMatrix::from_fn(n, n, |i, j| ((i * 7 + j * 13 + i * j * j) % 23) as f64 / 23.0 - 0.4);
            let start = std::time::Instant::now();
            let found = eigenvalues(&a).unwrap();
            println!("{n}: {:.2} ms", start.elapsed().as_secs_f64() * 1e3);
            let (one, two): (Complex<f64>, Complex<f64>) = (found.iter().sum(), found.iter().map(|s| s * s).sum());
            assert!(
                (one - a.trace()).norm() < 1e-12 * a.norm()
                    && (two - (&a * &a).trace()).norm() < 1e-12 * a.norm_squared()
            );
        }
    }

    #[test]
    fn what_is_not_finite_has_no_eigenvalues() {
        assert_eq!(eigenvalues(&DMatrix::from_element(2, 2, f64::NAN)), Err(Error::Eigenvalues { order: 2 }));
    }
}
