//! Eigenvalues without vectors: Hessenberg form, then Francis's double-shift QR algorithm on the active block
//! (Golub and Van Loan, Matrix Computations, 4th edition, section 7.5; the deflation and the exceptional shifts are EISPACK's
//! hqr). A Schur decomposition also updates the vectors and the deflated rows and columns, and takes several times as long.

use nalgebra::linalg::Hessenberg;
use nalgebra::{Complex, DMatrix};

/// Largest number of steps per eigenvalue. Three is typical.
const MAX_ITERATIONS: usize = 60;

/// The eigenvalues of a square matrix, complex ones as exact conjugates; `None` when the iteration does not converge.
pub(crate) fn eigenvalues(a: DMatrix<f64>) -> Option<Vec<Complex<f64>>> {
    let n = a.nrows();
    let mut h = if n > 2 { Hessenberg::new(a).unpack_h() } else { a };
    let norm = h.amax();
    let mut found = Vec::with_capacity(n);
    // Rows and columns from `end` on are deflated.
    let mut end = n;
    let mut tried = 0;
    // The sum of the exceptional shifts, subtracted from the diagonal.
    let mut taken = 0.0;
    while end > 0 {
        let last = end - 1;
        let start = first_of_block(&mut h, last, norm);
        if start == last {
            found.push(Complex::new(h[(last, last)] + taken, 0.0));
            (end, tried) = (end - 1, 0);
            continue;
        }
        if start + 1 == last {
            let (p, q) = (last - 1, last);
            found.extend(block(h[(p, p)] + taken, h[(p, q)], h[(q, p)], h[(q, q)] + taken));
            (end, tried) = (end - 2, 0);
            continue;
        }
        if tried == MAX_ITERATIONS {
            return None;
        }
        // The lower right 2 × 2 block gives both shifts: their sum and their product.
        let (x, y) = (h[(last, last)], h[(last - 1, last - 1)]);
        let mut shifts = (x + y, x * y - h[(last, last - 1)] * h[(last - 1, last)]);
        // Real shifts from two clusters of eigenvalues may converge to neither. After ten steps the shift nearer to the last entry
        // is used twice, as in LAPACK's dlahqr.
        let [one, other] = block(y, h[(last - 1, last)], h[(last, last - 1)], x);
        if tried > 9 && one.im == 0.0 {
            let nearer = if (one.re - x).abs() < (other.re - x).abs() { one.re } else { other.re };
            shifts = (2.0 * nearer, nearer * nearer);
        }
        // An exceptional shift every ten steps, for matrices that are invariant under the step.
        if tried % 10 == 9 {
            taken += x;
            (0..end).for_each(|i| h[(i, i)] -= x);
            let s = h[(last, last - 1)].abs() + h[(last - 1, last - 2)].abs();
            shifts = (1.5 * s, s * s);
        }
        tried += 1;
        francis(&mut h, start, last, shifts);
    }
    Some(found)
}

/// The first row of the block that ends with row `last`; the entry before it, negligible compared with its neighbours, is set to 0.
fn first_of_block(h: &mut DMatrix<f64>, last: usize, norm: f64) -> usize {
    for i in (1..=last).rev() {
        let neighbours = h[(i - 1, i - 1)].abs() + h[(i, i)].abs();
        let neighbours = if neighbours == 0.0 { norm } else { neighbours };
        if h[(i, i - 1)].abs() <= f64::EPSILON * neighbours {
            h[(i, i - 1)] = 0.0;
            return i;
        }
    }
    0
}

/// One double-shift step on rows and columns `start` to `last`, three at least.
fn francis(h: &mut DMatrix<f64>, start: usize, last: usize, (sum, product): (f64, f64)) {
    let first = |h: &DMatrix<f64>, i: usize| {
        let (a, b, c, d) = (h[(i, i)], h[(i, i + 1)], h[(i + 1, i)], h[(i + 1, i + 1)]);
        // The first column of (H - s₁)(H - s₂), over c, with a² - a sum + product = (a - s₁)(a - s₂).
        [(a * a - sum * a + product) / c + b, a + d - sum, h[(i + 2, i + 1)]]
    };
    // Start lower where two small entries in a row make a small product.
    let mut from = last - 2;
    let mut v = first(h, from);
    while from > start {
        let size = v.iter().map(|x| x.abs()).sum::<f64>();
        let neighbours = h[(from - 1, from - 1)].abs() + h[(from, from)].abs() + h[(from + 1, from + 1)].abs();
        if h[(from, from - 1)].abs() * (v[1].abs() + v[2].abs()) < f64::EPSILON * v[0].abs() * neighbours && size > 0.0
        {
            break;
        }
        from -= 1;
        v = first(h, from);
    }
    for i in from + 2..=last {
        h[(i, i - 2)] = 0.0;
        if i > from + 2 {
            h[(i, i - 3)] = 0.0;
        }
    }
    for k in from..last {
        let three = k + 1 < last;
        if k > from {
            v = [h[(k, k - 1)], h[(k + 1, k - 1)], if three { h[(k + 2, k - 1)] } else { 0.0 }];
        }
        let scale = v.iter().map(|x| x.abs()).sum::<f64>();
        if scale == 0.0 {
            continue;
        }
        let [p, q, r] = v.map(|x| x / scale);
        let s = (p * p + q * q + r * r).sqrt().copysign(p);
        if k > from {
            h[(k, k - 1)] = -s * scale;
        } else if from > start {
            h[(k, k - 1)] = -h[(k, k - 1)];
        }
        // The reflection 1 - (1, y, z)ᵀ(tx, ty, tz).
        let (tx, ty, tz, y, z) = ((p + s) / s, q / s, r / s, q / (p + s), r / (p + s));
        let n = h.nrows();
        let data = h.as_mut_slice();
        if three {
            for column in data.chunks_exact_mut(n).take(last + 1).skip(k) {
                let w = column[k] + y * column[k + 1] + z * column[k + 2];
                column[k] -= w * tx;
                column[k + 1] -= w * ty;
                column[k + 2] -= w * tz;
            }
            let bottom = (k + 3).min(last) + 1;
            let (left, rest) = data[k * n..].split_at_mut(n);
            let (middle, right) = rest.split_at_mut(n);
            let rows = left[start..bottom].iter_mut().zip(&mut middle[start..bottom]).zip(&mut right[start..bottom]);
            for ((a, b), c) in rows {
                let w = tx * *a + ty * *b + tz * *c;
                *a -= w;
                *b -= w * y;
                *c -= w * z;
            }
        } else {
            for column in data.chunks_exact_mut(n).take(last + 1).skip(k) {
                let w = column[k] + y * column[k + 1];
                column[k] -= w * tx;
                column[k + 1] -= w * ty;
            }
            let (left, right) = data[k * n..].split_at_mut(n);
            for (a, b) in left[start..=last].iter_mut().zip(&mut right[start..=last]) {
                let w = tx * *a + ty * *b;
                *a -= w;
                *b -= w * y;
            }
        }
    }
}

/// The eigenvalues of \[\[a, b\], \[c, d\]\], to a few eps of the block; a much smaller one to a few eps of itself, where a d - b c has its digits.
fn block(a: f64, b: f64, c: f64, d: f64) -> [Complex<f64>; 2] {
    let (mean, half) = (0.5 * (a + d), 0.5 * (a - d));
    let square = half * half + b * c;
    if square < 0.0 {
        let im = (-square).sqrt();
        return [Complex::new(mean, im), Complex::new(mean, -im)];
    }
    let far = mean + square.sqrt().copysign(mean);
    let size = a.abs().max(d.abs()).max((b * c).abs().sqrt());
    // Where both are far smaller than the block, as a double 0 is, a d - b c is rounding, and its quotient by `far` may be any number.
    let near = if far.abs() < 0.25 * size { (a - far) + d } else { (a * d - b * c) / far };
    [Complex::new(far, 0.0), Complex::new(near, 0.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    proptest! {
        // Equal ones up to rounding, of which the larger may be smaller than the rounding of a d - b c.
        #[test]
        fn a_double_eigenvalue_stays_two_that_are_alike(
            double in prop_oneof![Just(0.0), -1e-15..1e-15f64, -1.0..1.0f64], half in -1.0..1.0f64, grade in -6..6i32, ulps in -3..=3i32, lean in -3..=3i32,
        ) {
            let b = 10f64.powi(grade);
            let c = -half * half / b * (1.0 + f64::from(ulps) * f64::EPSILON);
            let (a, d) = (double + half, double - half + f64::from(lean) * f64::EPSILON * half);
            let size = double.abs() + half.abs();
            for found in block(a, b, c, d) {
                prop_assert!((found - double).norm() <= 1e-7 * size, "{found} of {double}: [[{a:e}, {b:e}], [{c:e}, {d:e}]]");
            }
        }

        #[test]
        fn a_small_eigenvalue_of_a_triangle_keeps_its_digits(large in prop_oneof![-2.0..-0.5f64, 0.5..2.0f64], small in 1e-15..1e-6f64, b in -1.0..1.0f64) {
            for found in [block(large, b, 0.0, small), block(small, b, 0.0, large)] {
                let least = if found[0].norm() < found[1].norm() { found[0].re } else { found[1].re };
                prop_assert!((least - small).abs() <= 4.0 * f64::EPSILON * small, "{least:e}: {small:e}");
            }
        }
    }
}
