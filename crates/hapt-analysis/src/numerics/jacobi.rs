//! One-sided Jacobi: the singular values of a matrix to high relative accuracy (Demmel and Veselić, SIAM J. Matrix Anal.
//! Appl. 13(4), 1992). With springs from 1 to 1e12 N·m/rad in one world, the slow modes keep all digits. The usual
//! symmetric eigenvalue solvers lose them: their error is eps of the fastest mode.

use nalgebra::DMatrix;

/// Rotates the columns of `g` until they are orthogonal, and the columns of `v` by the same rotations: g = U Σ, with Σ the column
/// norms. Both have the same number of columns.
pub(crate) fn orthogonalise(g: &mut DMatrix<f64>, v: &mut DMatrix<f64>) {
    let n = g.ncols();
    for _ in 0..60 {
        let mut settled = true;
        for p in 0..n {
            for q in p + 1..n {
                let (a, b, c) = (g.column(p).norm_squared(), g.column(q).norm_squared(), g.column(p).dot(&g.column(q)));
                // Also false where a column is 0, or not finite.
                let turned = c.abs() > 1e-15 * (a * b).sqrt() && (a * b).is_finite();
                if !turned {
                    continue;
                }
                settled = false;
                let zeta = (b - a) / (2.0 * c);
                let t = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
                let cos = 1.0 / t.hypot(1.0);
                rotate(g, p, q, cos, cos * t);
                rotate(v, p, q, cos, cos * t);
            }
        }
        if settled {
            break;
        }
    }
}

fn rotate(m: &mut DMatrix<f64>, p: usize, q: usize, cos: f64, sin: f64) {
    for i in 0..m.nrows() {
        let (x, y) = (m[(i, p)], m[(i, q)]);
        m[(i, p)] = cos * x - sin * y;
        m[(i, q)] = sin * x + cos * y;
    }
}
