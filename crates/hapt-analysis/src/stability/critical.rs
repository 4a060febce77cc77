//! The critical period: the supremum of T0 such that no modulus exceeds 1 for all 0 < T ≤ T0. Compensating dampers
//! change with the period.
//!
//! Backward Euler, trapezoidal, tustin, zoh and foh map the left half plane into the unit circle: unbounded.
//!
//! # Forward and semi-implicit Euler
//!
//! With μ = (λ - 1)/T the positions w of an eigenvector obey, puck held,
//!
//! ```text
//! forward        μ w = v,           M μ v = -K w - C v    =>  (M μ² + C μ + K) w = 0
//! semi-implicit  μ w = (1 + Tμ) v,  M μ v = -K w - C v    =>  (M μ² + (C + T K) μ + K) w = 0
//! ```
//!
//! so both are C' = C0 + T C1', with C1' = C1 or C1 + K. Then λ = (1 + sT/2)/(1 - sT/2), μ = s/(1 - sT/2), takes the circle to
//! the left half plane and keeps the matrices symmetric:
//!
//! ```text
//! (M~ s² + C~ s + K) w = 0,   M~ = M - (T/2) C0 - (T²/2) C1' + (T²/4) K,   C~ = C0 + T (C1' - K)
//! ```
//!
//! Where C1' - K ≥ 0 (semi-implicit Euler always, forward Euler when compensated) C~ and K are not negative, so the world is
//! stable while M~ > 0, and for each negative eigenvalue of M~ a root lies in the right half plane. With G = C1'/2 - K/4 ≥ 0 and τ = 1/T,
//! det M~ = 0 is det(τ² - τ C0/2 - G) = 0, M~ shrinks as T grows, and the largest τ is the largest eigenvalue of the symmetric
//! matrix \[\[C0/2, L\], \[Lᵀ, 0\]\], G = L Lᵀ: no search. One mode: Tω = 2(√(1+ζ²) - ζ) for semi-implicit Euler, and 2 for
//! forward Euler with b = Tk, (2.24).
//!
//! Forward Euler with fixed dampers only is |1 + Ts| ≤ 1 for each s of the differential equation: T ≤ -2 Re s/|s|². That is
//! (2.14), T ≤ 2ζ/ω, for ζ < 1, and 2(ζ - √(ζ²-1))/ω from there on. An undamped mode is never stable.
//!
//! # Runge-Kutta
//!
//! |R(Ts)|² - 1 is a polynomial in T for each s; its first sign change is isolated. An undamped mode: Tω = 2√2.
//!
//! # Other cases
//!
//! Compensation below K, and any compensation under RK4, has no such form. The neutral modes are separated by structure, each with
//! its closed form; the others are tracked along T.

use hapt_model::{Body, Coupling, Method};
use nalgebra::{DMatrix, linalg::SymmetricEigen};

use crate::equations::continuous::{Slopes, linearise};
use crate::equations::modal::{Coupled, Modal, SAME};
use crate::equations::structure::parts;
use crate::error::Error;
use crate::numerics::crossing::{Ranked, Spacing, first_crossing, growth_floor};
use crate::numerics::jacobi::orthogonalise;
use crate::numerics::polynomial::{sign_changes, value};
use crate::stability::multiplier::{Root, multiplier, rk4_excess};
use crate::stability::roots::{balance_of, passive_roots, refine, roots};

/// The end of the stability interval of RK4 on the negative real axis: 1 + z/2 + z²/6 + z³/24 = 0.
pub const RK4_REAL: f64 = -2.785_293_563_405_282;

/// The critical period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Critical {
    /// Unstable from 0 on.
    Never,
    /// Up to this period, in s.
    Period(f64),
    /// Stable at every period.
    Unbounded,
}

impl Critical {
    /// The smaller of two.
    pub fn min(self, other: Critical) -> Critical {
        match (self, other) {
            (Critical::Never, _) | (_, Critical::Never) => Critical::Never,
            (Critical::Unbounded, c) | (c, Critical::Unbounded) => c,
            (Critical::Period(a), Critical::Period(b)) => Critical::Period(a.min(b)),
        }
    }

    /// With a period this many times as long.
    pub(crate) fn times(self, factor: f64) -> Critical {
        match self {
            Critical::Period(period) => Critical::Period(factor * period),
            Critical::Never | Critical::Unbounded => self,
        }
    }

    /// In s, if it exists.
    pub fn period(self) -> Option<f64> {
        match self {
            Critical::Period(period) => Some(period),
            Critical::Never | Critical::Unbounded => None,
        }
    }

    /// Why there is no critical period: `"never"` or `"unbounded"`.
    pub fn reason(self) -> Option<&'static str> {
        match self {
            Critical::Never => Some("never"),
            Critical::Period(_) => None,
            Critical::Unbounded => Some("unbounded"),
        }
    }

    /// From a period in s: 0 or less is `Never`, infinite is `Unbounded`.
    fn at(period: f64) -> Critical {
        if period.is_nan() || period <= 0.0 {
            Critical::Never
        } else if period.is_finite() {
            Critical::Period(period)
        } else {
            Critical::Unbounded
        }
    }
}

/// The critical period of bodies joined by couplings, the puck held, nonlinear couplings linearised at the given slopes.
///
/// ```
/// use hapt_analysis::{Critical, Slopes, stability::critical::critical};
/// use hapt_model::{Body, Coupling, End, Law, Method};
///
/// // Semi-implicit Euler is stable on an undamped mode up to Tω = 2.
/// let body = Body { inertia: 1.0, position: 0.0, velocity: 0.0 };
/// let law = Law::Spring { stiffness: 100.0, rest: 0.0 };
/// let spring = Coupling { first: End::Body(0), second: End::Ground, law, limit: None };
/// let found = critical(&[body], &[spring], &Slopes::Flat, Method::SemiImplicitEuler)?;
/// assert_eq!(found, Critical::Period(0.2));
/// # Ok::<(), hapt_analysis::Error>(())
/// ```
///
/// # Errors
/// [`Error::NoSuchBody`]; [`Error::Eigenvalues`] when numbers leave double precision.
pub fn critical(bodies: &[Body], couplings: &[Coupling], slopes: &Slopes, method: Method) -> Result<Critical, Error> {
    let inertia: Vec<f64> = bodies.iter().map(|b| b.inertia).collect();
    let mut worst = Critical::Unbounded;
    for part in parts(&inertia, &linearise(bodies, couplings, slopes)?) {
        worst = worst.min(of_part(&Modal::new(&part)?, method, worst)?);
    }
    Ok(worst)
}

/// The critical period of one part. A search for it stops at `known`.
pub(crate) fn of_part(part: &Modal, method: Method, known: Critical) -> Result<Critical, Error> {
    if known == Critical::Never {
        return Ok(known);
    }
    // Tω of an undamped mode, and of one whose damping is T ω²: s² + Tω² s + ω² = 0.
    let (undamped, compensated) = match method {
        Method::ForwardEuler => (0.0, 2.0),
        // C1' = 2 K: M~ = 1 - 3 (Tω)²/4.
        Method::SemiImplicitEuler => (2.0, 2.0 / 3f64.sqrt()),
        // Complex roots, Tω < 2, remain inside. The real root then reaches the end of the interval, where z² + x² z + x² = 0.
        Method::Rk4 => (8f64.sqrt(), -RK4_REAL / (-RK4_REAL - 1.0).sqrt()),
        Method::BackwardEuler | Method::Trapezoidal | Method::Zoh | Method::Tustin | Method::Foh => {
            return Ok(Critical::Unbounded);
        }
    };
    let limit = |x: f64, modes: &[f64]| modes.iter().fold(Critical::Unbounded, |c, w| c.min(Critical::at(x / w)));
    let decoupled = limit(undamped, &part.undamped).min(limit(compensated, &part.compensated));
    if part.coupled.is_empty() || decoupled == Critical::Never {
        return Ok(decoupled);
    }
    let known = known.min(decoupled).period().unwrap_or(f64::INFINITY);
    Ok(decoupled.min(of_coupled(&part.coupled, method, known)?))
}

fn of_coupled(modes: &Coupled, method: Method, known: f64) -> Result<Critical, Error> {
    let follows = modes.per_period.iter().any(|x| *x != 0.0);
    match method {
        Method::SemiImplicitEuler => definite(modes, &(&modes.per_period * 0.5 + modes.stiffness() * 0.25)),
        Method::ForwardEuler if !follows => {
            let roots = roots(modes, 1.0, false, None)?;
            Ok(roots.iter().fold(Critical::Unbounded, |c, s| c.min(Critical::at(-2.0 * s.z.re / s.square))))
        }
        Method::ForwardEuler if modes.covered || is_covered(modes)? => {
            definite(modes, &(&modes.per_period * 0.5 - modes.stiffness() * 0.25))
        }
        Method::ForwardEuler if unstable_from_zero(modes)? => Ok(Critical::Never),
        Method::Rk4 if !follows => {
            let roots = roots(modes, 1.0, false, None)?;
            Ok(roots.iter().fold(Critical::Unbounded, |c, s| c.min(runge_kutta(*s))))
        }
        Method::ForwardEuler
        | Method::BackwardEuler
        | Method::Trapezoidal
        | Method::Zoh
        | Method::Rk4
        | Method::Tustin
        | Method::Foh => tracked(modes, method, known),
    }
}

/// 1/τ for the largest eigenvalue τ of [[C0/2, L], [Lᵀ, 0]], L Lᵀ = G.
fn definite(modes: &Coupled, g: &DMatrix<f64>) -> Result<Critical, Error> {
    let m = modes.order();
    let g = symmetric(g.clone())?;
    let mut l = g.eigenvectors;
    for (mut column, value) in l.column_iter_mut().zip(g.eigenvalues.iter()) {
        column.scale_mut(value.max(0.0).sqrt());
    }
    let mut s = DMatrix::zeros(2 * m, 2 * m);
    s.view_mut((0, 0), (m, m)).copy_from(&(&modes.fixed * 0.5));
    s.view_mut((0, m), (m, m)).copy_from(&l);
    s.view_mut((m, 0), (m, m)).copy_from(&l.transpose());
    Ok(Critical::at(1.0 / symmetric(s)?.eigenvalues.max()))
}

fn symmetric(a: DMatrix<f64>) -> Result<SymmetricEigen<f64, nalgebra::Dyn>, Error> {
    let failed = Error::Eigenvalues { order: a.nrows() };
    if !a.iter().all(|x| x.is_finite()) {
        return Err(failed);
    }
    let bound = 100 * (a.nrows() + 1);
    SymmetricEigen::try_new(a, f64::EPSILON, bound).ok_or(failed)
}

/// Whether the matrix C1 - K is positive semidefinite, up to rounding.
fn is_covered(modes: &Coupled) -> Result<bool, Error> {
    Ok(symmetric(modes.uncovered.clone())?.eigenvalues.min() >= -1e-14 * modes.uncovered.amax())
}

/// The period at which RK4 leaves the unit circle along the ray of s.
fn runge_kutta(s: Root) -> Critical {
    let size = s.square.sqrt();
    if size == 0.0 {
        return Critical::Unbounded;
    }
    // In h = T|s|: (|R|² - 1)/h, and no direction in the left half plane remains inside beyond h = 4.
    let p = rk4_excess(Root { z: s.z / size, square: 1.0, excess: None });
    let rise = |x: &f64| value(&p, x * (1.0 + 1e-9)) > 0.0;
    let first = sign_changes(&p, 0.0, 4.0).into_iter().find(rise);
    Critical::at(first.unwrap_or(0.0) / size)
}

/// Whether forward Euler with partial compensation grows for every small T. To first order, on the modes of one frequency,
/// (|λ|² - 1)/T is -C0 + T (ω² - C1): where C0 vanishes by structure, the sign of the second term decides.
fn unstable_from_zero(modes: &Coupled) -> Result<bool, Error> {
    let trace = modes.fixed.trace();
    let mut start = 0;
    for group in modes.omega.chunk_by(|a, b| b - a <= SAME * b) {
        let columns: Vec<usize> = (start..start + group.len()).collect();
        start += group.len();
        let mut seen = modes.fixed_rows.select_columns(&columns);
        let mut shapes = DMatrix::zeros(modes.order(), group.len());
        columns.iter().enumerate().for_each(|(j, &i)| shapes[(i, j)] = 1.0);
        orthogonalise(&mut seen, &mut shapes);
        let undamped: Vec<usize> =
            (0..group.len()).filter(|&j| seen.column(j).norm_squared() <= 1e-18 * trace).collect();
        if undamped.is_empty() {
            continue;
        }
        let shapes = shapes.select_columns(&undamped);
        let least = symmetric(shapes.transpose() * &modes.uncovered * &shapes)?.eigenvalues.min();
        if least < -1e-13 * group[0] * group[0] {
            return Ok(true);
        }
    }
    Ok(false)
}

/// The first period at which one of the modes leaves the unit circle, found by tracking them along T; `known` when they remain
/// inside up to there.
fn tracked(modes: &Coupled, method: Method, known: f64) -> Result<Critical, Error> {
    let (c0, c1) = (modes.fixed.trace(), modes.per_period.trace());
    let fastest = modes.omega.iter().copied().fold(0.0, f64::max);
    // No |λ| above 1 needs |z| below 2 (forward Euler) or about 3 (RK4) for all m pairs, and the sum of z is -T tr C.
    let most = 6.0 * modes.order() as f64;
    let high = (2.0 * most / (c0 + c0.hypot((4.0 * most * c1).sqrt()))).min(6.0 / fastest).min(known);
    // Start well below the limit of every mode. For forward Euler that is -2 Re s/|s|² of the world with only its fixed dampers;
    // `unstable_from_zero` has handled the modes that these do not damp.
    let mut low = 0.05 * high.min(1.0 / fastest);
    if method == Method::ForwardEuler {
        let own = |s: Root| -2.0 * s.z.re / s.square;
        let m = modes.order();
        let fixed =
            Coupled { per_period: DMatrix::zeros(m, m), per_period_rows: DMatrix::zeros(0, m), ..modes.clone() };
        low = roots(&fixed, 1.0, false, None)?
            .into_iter()
            .filter(|s| -s.z.re > 1e-18 * c0)
            .map(|s| 0.05 * own(s))
            .fold(low, f64::min);
    }
    let growth = |period: f64| {
        let a = modes.step(period, &modes.damping(period, false));
        let log = |root: Root| multiplier(method, root).ln_abs;
        let mut roots = passive_roots(&a)?;
        let most = roots.iter().copied().map(log).fold(f64::NEG_INFINITY, f64::max);
        // Only the roots that decide, and only where the solver is not accurate enough.
        let short = 1e-10 * a.amax();
        if most.abs() < short {
            let euler = (method == Method::ForwardEuler).then(|| balance_of(modes, period, &modes.uncovered));
            refine(modes, period, false, euler.as_ref(), &a, &mut roots, |root| log(root) > most - short);
        }
        let without_shifts = roots.into_iter().filter(|root| root.z.im >= 0.0);
        Ok(Ranked::new(without_shifts.map(|root| log(root) / period), growth_floor(period, 0.0), 0.0))
    };
    if !(low.is_normal() && high.is_normal() && low <= high) {
        return Err(Error::Eigenvalues { order: 2 * modes.order() });
    }
    // If a root grows at `low`, the crossing is below it.
    for _ in 0..4 {
        if growth(low)?.max() <= 0.0 {
            break;
        }
        low *= 0.1;
    }
    Ok(match first_crossing(growth, Spacing::Ratio, low, high, 0.0)? {
        Some(period) if period <= low => Critical::Never,
        Some(period) => Critical::Period(period),
        // Beyond `high` no loop is stable, or the result is not needed.
        None => Critical::Period(high),
    })
}
