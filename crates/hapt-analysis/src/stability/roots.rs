//! The roots of coupled modes, and the digits that an eigenvalue solver loses.

use nalgebra::{Complex, DMatrix, DVector};

use crate::equations::modal::Coupled;
use crate::error::Error;
use crate::numerics::eigenvalues::eigenvalues;
use crate::stability::multiplier::Root;

/// z = Ts of the modes with C = C0 + T C1, with T K more when `implicit`; see [`refine`].
pub(crate) fn roots(
    modes: &Coupled,
    period: f64,
    implicit: bool,
    euler: Option<&DMatrix<f64>>,
) -> Result<Vec<Root>, Error> {
    let a = modes.step(period, &modes.damping(period, implicit));
    let mut found = passive_roots(&a)?;
    refine(modes, period, implicit, euler, &a, &mut found, |_| true);
    Ok(found)
}

/// The eigenvalues of T A. A passive world has none in the right half plane: a positive real part is rounding, and becomes 0.
pub(crate) fn passive_roots(a: &DMatrix<f64>) -> Result<Vec<Root>, Error> {
    Ok(eigenvalues(a)?.into_iter().map(|z| Complex::new(z.re.min(0.0), z.im).into()).collect())
}

/// C~ of forward Euler with C1' - K.
pub(crate) fn balance_of(modes: &Coupled, period: f64, uncovered: &DMatrix<f64>) -> DMatrix<f64> {
    &modes.fixed + uncovered * period
}

/// Refines the `wanted` complex pairs by their eigenvectors, where the solver is not accurate enough. Its error is eps of the fastest
/// rate of the world, which may exceed the whole damping of a slow mode. A quadratic form in the eigenvector has no such limit.
///
/// * Lightly damped: Re z is the energy that the vector x = (Ωy, v) loses, -T v*Cv/|x|².
/// * Near forward Euler's circle, with `euler` = C~: from the pencil in `critical`, Re s = -w*C~w/(2 w*M~w) and
///   |s|² = w*Kw/w*M~w, so that |λ|² - 1 = -(|z|²/T) w*C~w/w*Kw, w being v here. Where dampers match springs C~ is 0, and so
///   is this, instead of 2 Re z + |z|² by rounding.
pub(crate) fn refine(
    modes: &Coupled,
    period: f64,
    implicit: bool,
    euler: Option<&DMatrix<f64>>,
    a: &DMatrix<f64>,
    found: &mut [Root],
    wanted: impl Fn(Root) -> bool,
) {
    let (n, p) = (a.nrows(), modes.omega.len());
    let size = a.amax();
    let complex = a.map(|x| Complex::new(x, 0.0));
    let start = DVector::from_fn(n, |i, _| Complex::new(1.0 + 0.1 * (i % 7) as f64, 0.3 - 0.1 * (i % 3) as f64));
    for i in 1..n {
        // The roots of a pair are adjacent.
        let Root { z, square, .. } = found[i - 1];
        let light = z.re.abs() < 1e-2 * z.im;
        let near = euler.filter(|_| (2.0 * z.re + square).abs() < 1e-2 * square.sqrt());
        if found[i].z != z.conj() || z.im <= 0.0 || !(light || near.is_some()) || !wanted(found[i - 1]) {
            continue;
        }
        let lu = (&complex - DMatrix::from_diagonal_element(n, n, z * (1.0 + 1e-13))).lu();
        // Two inverse iterations.
        let Some(x) = lu.solve(&start).map(|x| x.unscale(x.norm())).and_then(|x| lu.solve(&x)) else { continue };
        let x = x.unscale(x.norm());
        let v = x.rows(p, n - p);
        let (re, im) = (v.map(|c| c.re), v.map(|c| c.im));
        let form = |m: &DMatrix<f64>| (re.transpose() * m * &re)[0] + (im.transpose() * m * &im)[0];
        let mut better = found[i - 1];
        if light {
            let loss = modes.loss(period, implicit, &re) + modes.loss(period, implicit, &im);
            let quotient = Complex::new(-period * loss, x.dotc(&(&complex * &x)).im);
            // For nearly multiple eigenvalues the vector is no more accurate than the eigenvalue.
            if (quotient - z).norm() < 1e-8 * z.im + 1e-14 * size && quotient.im > 0.5 * z.im {
                better = Root::from(quotient);
            }
        }
        if let Some(balance) = near {
            let stored: f64 = modes.omega.iter().zip(v.iter()).map(|(w, v)| w * w * v.norm_sqr()).sum();
            let excess = -better.square / period * form(balance) / stored;
            if (excess - (2.0 * z.re + square)).abs() < 1e-8 * square.sqrt() + 1e-14 * size {
                better.excess = Some(excess);
            }
        }
        found[i - 1] = better;
        found[i] = Root { z: better.z.conj(), ..better };
    }
}
