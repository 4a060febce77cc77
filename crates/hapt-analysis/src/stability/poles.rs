//! The poles of a world at the puck, one by one: a continuous pole and what a method makes of it.
//!
//! Each part of the world, in the modal coordinates x = (Ωy, ẏ), obeys ẋ = A x + (0, p) z + (0, c) ż, with p and c the
//! springs and dampers to the puck across each mode. With A = V diag(s) V⁻¹ every method has a closed form in ζ = Ts, one pole
//! at a time. The distance of a pole from the unit circle is therefore not computed by subtracting numbers near 1, and an
//! undamped mode lies on the circle exactly under the methods that preserve it.
//!
//! The static response xₛ = (p/Ω, 0) z is subtracted first: A xₛ + (0, p) z = 0, so that the rest e = x - xₛ z is driven only by
//! differences of z. Neither z near 1 nor slow modes lose digits. Per pole, with λ - 1 = ζ f, g = (f - 1)/ζ, and α, β, σ the coordinates of
//! (0, p), (0, c), xₛ in V:
//!
//! ```text
//! e_k = λ e_{k-1} + a (z_k - z_{k-1}) + b₀ v_k + b₁ v_{k-1}
//!     held methods        a = -σ              b₀ = 0        b₁ = T f β
//!     semi-implicit       a = Tα - σ          b₀ = T β      b₁ = 0          state (Ωw_k, v_{k+1}), damping C + TK
//!     tustin              a = T f α/2 - σ     b₀ = T f β/2  b₁ = T f β/2
//!     foh                 a = T g α - σ       b₀ = T g β    b₁ = T (f - g) β
//! torque_k = t₀ e_k + t₁ e_{k-1} + direct v_k - K z_k
//!     start               t₀ = P + Q;  semi-implicit: t₀ = P, t₁ = Q
//!     middle              t₀ = (P + Q)(1 + λ)/2;  semi-implicit: t₀ = P (1 + λ)/2 + Q/2, t₁ = Q/2
//!     end                 t₀ = P λ + Q f, the mean velocity being v f;  n steps ahead: λⁿ t₀
//! ```
//!
//! P = Σ p (Ωy)/Ω and Q = Σ c ẏ of the pole's column of V, K the static stiffness. The contribution of b₁ v_k to the torque of the same
//! sample is in `direct`.

use hapt_model::{Method, Output};
use nalgebra::{Complex, DMatrix, DVector, linalg::Schur};

use crate::numerics::phi::complex_phi2;
use crate::stability::multiplier::{Root, multiplier, pair};

type C = Complex<f64>;

const ZERO: C = C::new(0.0, 0.0);

/// Σ gains·(1, z⁻¹, W, z⁻¹W)/(z - λ), where v = (1 - z⁻¹) W z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pole {
    /// ln |λ|
    pub ln_abs: f64,
    /// arg λ
    pub arg: f64,
    /// N·m/rad; those of W N·m·s/rad.
    pub gains: [C; 4],
}

/// A continuous pole, see the module documentation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ContinuousPole {
    pub root: Root,
    pub position: C,
    pub velocity: C,
    pub spring: C,
    pub damper: C,
    pub shape: C,
}

impl ContinuousPole {
    /// That of an eigenvalue `root`, with its column of the eigenvectors of (Ωy, ẏ) and its row of their inverse.
    pub fn new(root: Root, column: &[C], row: &[C], omega: &[f64], gains: &Gains) -> Self {
        let p = omega.len();
        let [spring, damper] = [gains.spring.as_slice(), gains.damper.as_slice()];
        let shape = |v: &[C]| v.iter().zip(omega).zip(spring).fold(ZERO, |sum, ((v, w), k)| sum + v * (k / w));
        let across = |v: &[C], of: &[f64]| v[p..].iter().zip(of).fold(ZERO, |sum, (v, k)| sum + v * *k);
        ContinuousPole {
            root,
            position: shape(column),
            velocity: across(column, damper),
            spring: across(row, spring),
            damper: across(row, damper),
            shape: shape(row),
        }
    }
}

/// The discretisation of a loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Discretisation {
    pub method: Method,
    pub output: Output,
    pub advance: u32,
    pub period: f64,
}

/// The springs and dampers of one part to the puck, across each mode.
pub(crate) struct Gains {
    pub spring: DVector<f64>,
    pub damper: DVector<f64>,
}

/// The two poles of a mode that is coupled to no other.
pub(crate) fn oscillator(omega: f64, x: f64, damping: f64, spring: f64, damper: f64) -> [ContinuousPole; 2] {
    let mut roots = pair(x, damping);
    if (roots[0].z - roots[1].z).norm() < 2e-5 * x {
        // A double pole has only one eigenvector. An increase of the damping by 1e-10 separates it.
        roots = pair(x, damping * (1.0 + 1e-10));
    }
    let [first, second] = roots.map(|r| r.z);
    let of = |root: Root, other: C| {
        let z = root.z;
        let input = z / (z - other);
        ContinuousPole {
            root,
            position: spring / omega * x / z,
            velocity: C::from(damper),
            spring: input * spring,
            damper: input * damper,
            shape: spring / omega * (z * other / (x * (other - z))),
        }
    };
    [of(roots[0], second), of(roots[1], first)]
}

/// Eigenvalues, eigenvectors and their inverse, from the Schur form. Bounded iterations.
pub(crate) fn decompose(a: &DMatrix<f64>) -> Option<(Vec<C>, DMatrix<C>, DMatrix<C>)> {
    let n = a.nrows();
    let size = a.amax();
    if !(size.is_finite() && size > 0.0) {
        return None;
    }
    // With a zero diagonal the solver may not converge; then it is shifted by 1.
    let a = a.map(|x| C::from(x / size));
    let one = DMatrix::<C>::identity(n, n);
    let (q, mut t) = match Schur::try_new(a.clone(), f64::EPSILON, 100 * n) {
        Some(schur) => schur.unpack(),
        None => {
            let (q, t) = Schur::try_new(a + &one, f64::EPSILON, 100 * n)?.unpack();
            (q, t - one)
        }
    };
    t *= C::from(size);
    let least = f64::EPSILON * size;
    let mut y = DMatrix::<C>::zeros(n, n);
    for i in 0..n {
        y[(i, i)] = C::from(1.0);
        for row in (0..i).rev() {
            let sum = (row + 1..=i).fold(ZERO, |sum, j| sum + t[(row, j)] * y[(j, i)]);
            let gap = t[(row, row)] - t[(i, i)];
            y[(row, i)] = -sum / if gap.norm() < least { C::from(least) } else { gap };
        }
        let norm = y.column(i).norm();
        y.column_mut(i).unscale_mut(norm);
    }
    let v = q * y;
    let inverse = v.clone().lu().try_inverse()?;
    let finite = v.iter().chain(inverse.iter()).all(|x| x.re.is_finite() && x.im.is_finite());
    finite.then(|| ((0..n).map(|i| t[(i, i)]).collect(), v, inverse))
}

/// The discrete pole, and its contribution to `direct`: the table of the module documentation.
pub(crate) fn discrete(
    e: &ContinuousPole,
    Discretisation { method, output, advance, period }: Discretisation,
) -> (Pole, f64) {
    let multiplier = multiplier(method, e.root);
    let (z, less) = (e.root.z, multiplier.less_one);
    let f = match method {
        Method::ForwardEuler | Method::SemiImplicitEuler => C::from(1.0),
        Method::BackwardEuler | Method::Trapezoidal | Method::Zoh | Method::Rk4 | Method::Tustin | Method::Foh => {
            if z == ZERO { C::from(1.0) } else { less / z }
        }
    };
    let g = match method {
        Method::ForwardEuler | Method::SemiImplicitEuler => ZERO,
        Method::BackwardEuler => 1.0 / (1.0 - z),
        Method::Trapezoidal | Method::Tustin => 0.5 / (1.0 - 0.5 * z),
        Method::Zoh | Method::Foh => complex_phi2(z, less),
        Method::Rk4 => 0.5 + z / 6.0 * (1.0 + 0.25 * z),
    };
    let (hold_spring, hold_damper) = (e.spring * f * period, e.damper * f * period);
    let semi = method == Method::SemiImplicitEuler;
    let (a, b0, b1) = match method {
        Method::SemiImplicitEuler => (hold_spring - e.shape, hold_damper, ZERO),
        Method::Tustin => (hold_spring * 0.5 - e.shape, hold_damper * 0.5, hold_damper * 0.5),
        Method::Foh => (e.spring * g * period - e.shape, e.damper * g * period, e.damper * (f - g) * period),
        Method::ForwardEuler | Method::BackwardEuler | Method::Trapezoidal | Method::Zoh | Method::Rk4 => {
            (-e.shape, ZERO, hold_damper)
        }
    };
    let end = e.position * (1.0 + less) + e.velocity * f;
    let (t0, t1, direct) = match output {
        Output::Start if semi => (e.position, e.velocity, ZERO),
        Output::Start => (e.position + e.velocity, ZERO, ZERO),
        Output::Middle if semi => (e.position * (1.0 + 0.5 * less) + e.velocity * 0.5, e.velocity * 0.5, ZERO),
        Output::Middle => {
            let both = e.position + e.velocity;
            (both * (1.0 + 0.5 * less), ZERO, both * b1 * 0.5)
        }
        Output::End if advance == 0 => {
            (end, ZERO, if semi { ZERO } else { e.position * b1 + e.velocity * e.damper * g * period })
        }
        Output::End => {
            let power = |n: u32| (C::new(multiplier.ln_abs, multiplier.arg()) * f64::from(n)).exp();
            let power = |n: u32| if n == 0 { C::from(1.0) } else { power(n) };
            (end * power(advance), ZERO, end * power(advance - 1) * b1)
        }
    };
    let gains = [t0 * a, t1 * a, t0 * b0, t0 * b1 + t1 * b0];
    (Pole { ln_abs: multiplier.ln_abs, arg: multiplier.arg(), gains }, direct.re)
}
