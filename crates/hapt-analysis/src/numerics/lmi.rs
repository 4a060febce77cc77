//! One quadratic form that shrinks under several linear maps.
//!
//! For maps 1 + D_i it seeks P with
//!
//! ```text
//! F_i = P - (1 + D_i)ᵀ P (1 + D_i) - s w_i = -(D_iᵀ P + P D_i + D_iᵀ P D_i) - s w_i ≻ 0,    0 ≺ P ≺ LARGEST
//! ```
//!
//! and the largest s, along the central path of the barrier -Σ ln det (Nesterov and Nemirovskii 1994). It is a proposal: the caller tests
//! P.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::until::is_over;

/// Bound of P, whose first proposal is 1.
const LARGEST: f64 = 1e4;
/// Newton steps in all.
const STEPS: usize = 60;

/// A map less 1, and the weight of its slack.
pub(crate) struct Constraint {
    pub d: DMatrix<f64>,
    pub weight: f64,
}

/// P and the largest s that was reached, positive where all maps shrink P.
pub(crate) fn common_form(constraints: &[Constraint], start: &DMatrix<f64>) -> Option<(DMatrix<f64>, f64)> {
    let n = start.nrows();
    let places: Vec<(usize, usize)> = (0..n).flat_map(|j| (0..=j).map(move |i| (i, j))).collect();
    let mut p = start.clone();
    let least = |p: &DMatrix<f64>| {
        let slack = |c: &Constraint| shrinks(&c.d, p).symmetric_eigenvalues().min() / c.weight;
        constraints.iter().map(slack).fold(f64::INFINITY, f64::min)
    };
    let mut s = least(&p);
    s -= 0.1 * s.abs() + 1e-9;
    let size = (n * (constraints.len() + 2)) as f64;
    let mut sharpness = size / s.abs().max(1e-9);
    for _ in 0..STEPS {
        if is_over() {
            return None;
        }
        let Some((mut gradient, hessian, value)) = barrier(constraints, &places, &p, s) else { break };
        let unknowns = places.len();
        gradient[unknowns] -= sharpness;
        let Some(root) = positive(hessian) else { break };
        let step = root.solve(&-&gradient);
        let decrement = -gradient.dot(&step);
        let direction = symmetric(n, &places, &step);
        let mut length = 1.0;
        let objective = |s: f64, value: f64| value - sharpness * s;
        let mut moved = false;
        while length > 1e-6 {
            let (trial, t) = (&p + &direction * length, s + step[unknowns] * length);
            if let Some(found) = value_at(constraints, &trial, t)
                && objective(t, found) <= objective(s, value) - 0.01 * length * decrement
            {
                (p, s, moved) = (trial, t, true);
                break;
            }
            length *= 0.5;
        }
        if !moved || decrement < 0.5 {
            // Near the path: continue with a sharper barrier, until the gap is small compared with s.
            if size / sharpness < 0.2 * s.abs() {
                break;
            }
            sharpness *= 8.0;
        }
    }
    Some((p, s))
}

/// The root of second derivatives, which rounding can make indefinite near the bounds: with as little added to their diagonal as it takes. The
/// step then still goes down.
fn positive(hessian: DMatrix<f64>) -> Option<Cholesky<f64, Dyn>> {
    let scale = hessian.diagonal();
    [0.0, 1e-14, 1e-12, 1e-10, 1e-8].into_iter().find_map(|part| {
        let mut raised = hessian.clone();
        raised.set_diagonal(&(&scale * (1.0 + part)));
        Cholesky::new(raised)
    })
}

/// -(DᵀP + PD + DᵀPD)
pub(crate) fn shrinks(d: &DMatrix<f64>, p: &DMatrix<f64>) -> DMatrix<f64> {
    let pd = p * d;
    let inner = d.transpose() * &pd;
    -(&pd + pd.transpose() + inner)
}

fn symmetric(n: usize, places: &[(usize, usize)], of: &DVector<f64>) -> DMatrix<f64> {
    let mut m = DMatrix::zeros(n, n);
    for (value, &(i, j)) in of.iter().zip(places) {
        m[(i, j)] += 0.5 * value;
        m[(j, i)] += 0.5 * value;
    }
    m
}

/// The matrices that stay positive: P, LARGEST - P, F_i.
fn matrices(constraints: &[Constraint], p: &DMatrix<f64>, s: f64) -> impl Iterator<Item = DMatrix<f64>> {
    let n = p.nrows();
    let one = move || DMatrix::<f64>::identity(n, n);
    let bounds = [p.clone(), one() * LARGEST - p];
    let shrinking = constraints.iter().map(move |c| shrinks(&c.d, p) - one() * (s * c.weight)).collect::<Vec<_>>();
    bounds.into_iter().chain(shrinking)
}

/// -Σ ln det; `None` outside.
fn value_at(constraints: &[Constraint], p: &DMatrix<f64>, s: f64) -> Option<f64> {
    matrices(constraints, p, s).try_fold(0.0, |sum, m| {
        let root = Cholesky::new(m)?;
        Some(sum - 2.0 * root.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>())
    })
}

/// Gradient, second derivatives and value of -Σ ln det in the entries of P and s.
fn barrier(
    constraints: &[Constraint],
    places: &[(usize, usize)],
    p: &DMatrix<f64>,
    s: f64,
) -> Option<(DVector<f64>, DMatrix<f64>, f64)> {
    let (n, unknowns) = (p.nrows(), places.len());
    let mut gradient = DVector::zeros(unknowns + 1);
    let mut hessian = DMatrix::zeros(unknowns + 1, unknowns + 1);
    let mut value = 0.0;
    for (index, m) in matrices(constraints, p, s).enumerate() {
        let root = Cholesky::new(m)?;
        value -= 2.0 * root.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>();
        // L⁻¹, and with it each derivative as L⁻¹ dM L⁻ᵀ.
        let inverse = root.l().solve_lower_triangular(&DMatrix::identity(n, n))?;
        let constraint = index.checked_sub(2).map(|i| &constraints[i]);
        let across = constraint.map(|c| &inverse * c.d.transpose());
        let mut rows = DMatrix::zeros(n * n, unknowns + 1);
        for (column, &(i, j)) in places.iter().enumerate() {
            let derivative = match &across {
                // dF = -(Dᵀ E + E D + Dᵀ E D), E symmetric with 1 at (i, j).
                Some(b) => {
                    let outer = |x: usize, y: usize| {
                        let (bx, ay, ax, by) = (b.column(x), inverse.column(y), inverse.column(x), b.column(y));
                        bx * ay.transpose() + (ax + bx) * by.transpose()
                    };
                    -(outer(i, j) + outer(j, i)) * 0.5
                }
                None => {
                    let sign = if index == 0 { 0.5 } else { -0.5 };
                    let (x, y) = (inverse.column(i), inverse.column(j));
                    (x * y.transpose() + y * x.transpose()) * sign
                }
            };
            rows.column_mut(column).copy_from_slice(derivative.as_slice());
        }
        if let Some(c) = constraint {
            let derivative = &inverse * inverse.transpose() * -c.weight;
            rows.column_mut(unknowns).copy_from_slice(derivative.as_slice());
        }
        for (column, g) in gradient.iter_mut().enumerate() {
            *g -= (0..n).map(|i| rows[(i * n + i, column)]).sum::<f64>();
        }
        hessian += rows.transpose() * rows;
    }
    Some((gradient, hessian, value))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    proptest! {
        /// Rotations that shrink, each in the coordinates of one hidden ellipse: that ellipse proves them, and the solver finds one.
        #[test]
        fn maps_that_shrink_one_ellipse_have_a_common_form(
            n in 2..6usize, skew in prop::collection::vec(-0.3..0.3f64, 4 * 36), basis in prop::collection::vec(-1.0..1.0f64, 36), loss in 1e-4..1e-1f64,
        ) {
            let hidden = DMatrix::from_fn(n, n, |i, j| basis[i * 6 + j] + if i == j { 3.0 } else { 0.0 });
            let inverse = hidden.clone().try_inverse().unwrap();
            let constraints: Vec<Constraint> = (0..4)
                .map(|k| {
                    let a = DMatrix::from_fn(n, n, |i, j| skew[36 * k + i * 6 + j] - skew[36 * k + j * 6 + i]);
                    let one = DMatrix::<f64>::identity(n, n);
                    // Cayley: a rotation, less a loss.
                    let turn = (&one - &a * 0.5).try_inverse().unwrap() * (&one + &a * 0.5);
                    Constraint { d: &inverse * (turn * (1.0 - loss) - &one) * &hidden, weight: 1.0 }
                })
                .collect();
            let (p, s) = common_form(&constraints, &DMatrix::identity(n, n)).unwrap();
            prop_assert!(s > 0.0, "{s}");
            for c in &constraints {
                prop_assert!(shrinks(&c.d, &p).symmetric_eigenvalues().min() > 0.0);
            }
        }
    }

    #[test]
    fn maps_whose_product_grows_have_none() {
        // Each has the eigenvalues 0.9 and 0.9, their product 3.4.
        let [a, b] = [[0.9, 1.0, 0.0, 0.9], [0.9, 0.0, 1.0, 0.9]];
        let of = |m: [f64; 4]| Constraint {
            d: DMatrix::from_row_slice(2, 2, &m) - DMatrix::<f64>::identity(2, 2),
            weight: 1.0,
        };
        let (_, s) = common_form(&[of(a), of(b)], &DMatrix::identity(2, 2)).unwrap();
        assert!(s < 0.0, "{s}");
    }
}
