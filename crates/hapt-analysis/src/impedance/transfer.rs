//! The transfer function of the world at the puck: from the sampled position to the torque, as a sum of discrete poles.
//!
//! Each part of the world, in the modal coordinates x = (Ωy, ẏ), obeys ẋ = A x + (0, p) z + (0, c) ż, with p and c the
//! springs and dampers to the puck across each mode. With A = V diag(s) V⁻¹ every method has a closed form in ζ = Ts, one pole
//! at a time. The distance of a pole from the unit circle is therefore not computed by subtracting numbers near 1, and an
//! undamped mode lies on the circle exactly under the methods that preserve it.
//!
//! The static response xₛ = (p/Ω, 0) z is subtracted first: A xₛ + (0, p) z = 0, so that the rest e = x - xₛ z is driven by
//! differences of z alone. Neither z near 1 nor slow modes lose digits. Per pole, with λ - 1 = ζ f, g = (f - 1)/ζ, and
//! α, β, σ the coordinates of (0, p), (0, c), xₛ in V:
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

use hapt_model::{Body, Coupling, End, Method, Output};
use nalgebra::{Complex, DMatrix, DVector, linalg::Schur};

use crate::equations::continuous::{LinearCoupling, Slopes, linearise};
use crate::equations::modal::{Coupled, Modal};
use crate::equations::structure::{Part, inertias, parts};
use crate::error::{Error, positive};
use crate::numerics::phi::complex_phi2;
use crate::stability::multiplier::{Root, multiplier, pair};
use crate::stability::roots::{balance_of, roots};

type C = Complex<f64>;

const ZERO: C = C::new(0.0, 0.0);

/// Relative coupling to the puck below which an undamped mode is omitted.
const NEGLIGIBLE: f64 = 1e-9;

/// Condition number of the eigenvectors above which a part counts as defective.
const DEFECTIVE: f64 = 3e5;

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

/// H z⁻ᵈ without the delay: H = stiffness + (z - 1) F, F = -(Σ gains·(1, z⁻¹, W, z⁻¹W)/(z - λ) + direct z⁻¹ W).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TransferFunction {
    /// H(1), N·m/rad.
    pub stiffness: f64,
    /// N·m·s/rad
    pub direct: f64,
    pub poles: Vec<Pole>,
    /// All stiffness and damping at the puck: the scale for negligible residues.
    pub at_puck: [f64; 2],
}

/// A continuous pole, see the module documentation.
#[derive(Clone, Copy)]
struct ContinuousPole {
    root: Root,
    position: C,
    velocity: C,
    spring: C,
    damper: C,
    shape: C,
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
struct Gains {
    spring: DVector<f64>,
    damper: DVector<f64>,
}

impl TransferFunction {
    /// The transfer function of bodies joined by couplings.
    ///
    /// # Errors
    /// [`Error::Value`] for a period or inertia that is not positive; [`Error::Output`], [`Error::NoSuchBody`];
    /// [`Error::Eigenvalues`] and [`Error::Step`] when numbers leave double precision.
    pub fn new(
        bodies: &[Body],
        couplings: &[Coupling],
        slopes: &Slopes,
        rule: Discretisation,
    ) -> Result<TransferFunction, Error> {
        let Discretisation { method, output, advance, period } = rule;
        positive("the period", period)?;
        if method.takes_new_sample_first() && (output != Output::Start || advance > 0) {
            return Err(Error::Output { method, output });
        }
        let inertia = inertias(bodies)?;
        let terms = linearise(bodies, couplings, slopes)?;
        let at_puck = |of: fn(&LinearCoupling, f64) -> f64| -> f64 {
            terms.iter().filter(|t| t.first == End::Puck || t.second == End::Puck).map(|t| of(t, period)).sum()
        };
        let (stiffness, damping) = (at_puck(|t, _| t.stiffness), at_puck(damping));
        let mut port =
            TransferFunction { stiffness, direct: -damping, poles: Vec::new(), at_puck: [stiffness, damping] };
        for part in parts(&inertia, &terms) {
            if !part.members.iter().any(|&body| terms.iter().any(|t| is_between_puck_and(t, body))) {
                continue;
            }
            port.add(&part, &terms, rule)?;
        }
        Ok(port)
    }

    /// Whether all numbers are finite.
    pub fn is_finite(&self) -> bool {
        let number = |g: &C| g.re.is_finite() && g.im.is_finite();
        let pole = |p: &Pole| p.ln_abs < f64::INFINITY && p.arg.is_finite() && p.gains.iter().all(number);
        self.stiffness.is_finite() && self.direct.is_finite() && self.poles.iter().all(pole)
    }

    fn add(&mut self, part: &Part, terms: &[LinearCoupling], rule: Discretisation) -> Result<(), Error> {
        let modal = Modal::new(part)?;
        let gains = Gains::new(part, &modal, terms, rule.period);
        let size = gains.spring.norm();
        let (u, c) = (modal.undamped.len(), modal.compensated.len());
        // Semi-implicit Euler acts as forward Euler on a world with T K more damping.
        let implicit = if rule.method == Method::SemiImplicitEuler { 1.0 } else { 0.0 };
        for (i, omega) in modal.undamped.iter().chain(&modal.compensated).enumerate() {
            let (spring, compensation) = (gains.spring[i], if i < u { 0.0 } else { 1.0 });
            let damper = if i < u { 0.0 } else { gains.damper[i] };
            self.stiffness -= (spring / omega).powi(2);
            if spring.abs() > NEGLIGIBLE * size || damper != 0.0 {
                let x = omega * rule.period;
                self.take(&oscillator(*omega, x, (compensation + implicit) * x * x, spring, damper), rule);
            }
        }
        let coupled = &modal.coupled;
        let rows = |v: &DVector<f64>| v.rows(u + c, coupled.order()).into_owned();
        let gains = Gains { spring: rows(&gains.spring), damper: rows(&gains.damper) };
        self.stiffness -= coupled.omega.iter().zip(gains.spring.iter()).map(|(w, k)| (k / w).powi(2)).sum::<f64>();
        match coupled.omega[..] {
            _ if coupled.is_empty() => {}
            [omega] if coupled.order() == 1 => {
                let x = omega * rule.period;
                let damping = coupled.damping(rule.period, false)[0] * rule.period + implicit * x * x;
                self.take(&oscillator(omega, x, damping, gains.spring[0], gains.damper[0]), rule);
            }
            _ => self.take(&coupled_poles(coupled, &gains, rule)?, rule),
        }
        Ok(())
    }

    fn take(&mut self, poles: &[ContinuousPole], rule: Discretisation) {
        for e in poles {
            let (pole, direct) = discrete(e, rule);
            self.direct += direct;
            self.poles.push(pole);
        }
    }

    /// Whether the residue of a pole is more than rounding: the puck both moves the mode and feels it.
    pub fn has_residue(&self, pole: &Pole, period: f64) -> bool {
        let [still, back, moving, moving_back] = pole.gains.map(|g| g.norm());
        let all = still + back + (moving + moving_back) / period;
        all.is_nan() || all > 1e-18 * (self.at_puck[0] + self.at_puck[1] / period)
    }
}

fn damping(term: &LinearCoupling, period: f64) -> f64 {
    term.fixed + period * term.per_period
}

fn is_between_puck_and(term: &LinearCoupling, body: usize) -> bool {
    let ends = [term.first, term.second];
    ends.contains(&End::Puck) && ends.contains(&End::Body(body))
}

impl Gains {
    fn new(part: &Part, modal: &Modal, terms: &[LinearCoupling], period: f64) -> Gains {
        // On w = M^{-1/2} V y.
        let across = |of: &dyn Fn(&LinearCoupling) -> f64| {
            let per_body = part.members.iter().zip(&part.inertia).map(|(&body, inertia)| {
                terms.iter().filter(|t| is_between_puck_and(t, body)).map(of).sum::<f64>() / inertia.sqrt()
            });
            modal.shapes.transpose() * DVector::from_iterator(part.members.len(), per_body)
        };
        Gains { spring: across(&|t| t.stiffness), damper: across(&|t| damping(t, period)) }
    }
}

/// The two poles of a mode that is coupled to no other.
fn oscillator(omega: f64, x: f64, damping: f64, spring: f64, damper: f64) -> [ContinuousPole; 2] {
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

/// The poles of modes that dampers couple.
fn coupled_poles(coupled: &Coupled, gains: &Gains, rule: Discretisation) -> Result<Vec<ContinuousPole>, Error> {
    let n = coupled.omega.len() + coupled.order();
    let mut modes = coupled.clone();
    let mut grown = 1.0;
    let (values, v, inverse) = loop {
        let found = decompose(&modes.step(rule.period, &modes.damping(rule.period, implicit(rule.method))));
        match found {
            Some((values, v, inverse)) if v.norm() * inverse.norm() < DEFECTIVE * n as f64 || grown > 1.0 + 1e-9 => {
                break (values, v, inverse);
            }
            None if grown > 1.0 + 1e-9 => return Err(Error::Eigenvalues { order: n }),
            // Defective poles: a slight increase of the damping separates them.
            _ => {
                grown += 1e-10 * (1.0 + 1e9 * (grown - 1.0));
                modes = more_damped(coupled, grown);
            }
        }
    };
    let euler = match rule.method {
        Method::ForwardEuler => Some(balance_of(&modes, rule.period, &modes.uncovered)),
        Method::SemiImplicitEuler => Some(balance_of(&modes, rule.period, &modes.per_period)),
        Method::BackwardEuler | Method::Trapezoidal | Method::Zoh | Method::Rk4 | Method::Tustin | Method::Foh => None,
    };
    let mut better = roots(&modes, rule.period, implicit(rule.method), euler.as_ref())?;
    let size = values.iter().map(|z| z.norm()).fold(0.0, f64::max);
    let p = modes.omega.len();
    let columns = values.iter().enumerate().map(|(i, &z)| {
        // The same eigenvalue, refined for light damping.
        let distance = |r: &Root| (r.z - z).norm();
        let nearest = (0..better.len()).min_by(|&a, &b| distance(&better[a]).total_cmp(&distance(&better[b])));
        let root = match nearest {
            Some(at) if distance(&better[at]) < 1e-7 * z.norm() + 1e-13 * size => better.swap_remove(at),
            _ => C::new(z.re.min(0.0), z.im).into(),
        };
        let sum = |terms: &mut dyn Iterator<Item = C>| terms.fold(ZERO, |sum, t| sum + t);
        ContinuousPole {
            root,
            position: sum(&mut (0..p).map(|j| v[(j, i)] * (gains.spring[j] / modes.omega[j]))),
            velocity: sum(&mut (0..n - p).map(|j| v[(p + j, i)] * gains.damper[j])),
            spring: sum(&mut (0..n - p).map(|j| inverse[(i, p + j)] * gains.spring[j])),
            damper: sum(&mut (0..n - p).map(|j| inverse[(i, p + j)] * gains.damper[j])),
            shape: sum(&mut (0..p).map(|j| inverse[(i, j)] * (gains.spring[j] / modes.omega[j]))),
        }
    });
    Ok(columns.collect())
}

fn implicit(method: Method) -> bool {
    method == Method::SemiImplicitEuler
}

fn more_damped(modes: &Coupled, factor: f64) -> Coupled {
    Coupled {
        fixed: &modes.fixed * factor,
        per_period: &modes.per_period * factor,
        uncovered: &modes.uncovered + &modes.per_period * (factor - 1.0),
        fixed_rows: &modes.fixed_rows * factor.sqrt(),
        per_period_rows: &modes.per_period_rows * factor.sqrt(),
        ..modes.clone()
    }
}

/// Eigenvalues, eigenvectors and their inverse, from the Schur form. Bounded iterations.
fn decompose(a: &DMatrix<f64>) -> Option<(Vec<C>, DMatrix<C>, DMatrix<C>)> {
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
fn discrete(e: &ContinuousPole, Discretisation { method, output, advance, period }: Discretisation) -> (Pole, f64) {
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
