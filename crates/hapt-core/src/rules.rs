//! The rules of the methods, as matrices: run once a world, never in the loop.
//!
//! For J ẅ = -K w - C ẇ + F with F held over the step, every method is an increment
//!
//! ```text
//! x_{k+1} - x_k = S · T A x_k + S · T [0; J⁻¹] F,    A = [0 I; -J⁻¹K -J⁻¹C],    x = (w, ẇ)
//! ```
//!
//! and the rule is just S: I for forward Euler, (I - hA)⁻¹ for backward Euler (h = T) and the trapezoidal rule (h = T/2),
//! [I TI; 0 I] for semi-implicit Euler, φ1(TA) = Σ (TA)^j/(j+1)! for the exact hold, and that series cut after four terms for
//! classical Runge-Kutta. Increments rather than x_{k+1} itself: the eigenvalues crowd near 1, and 1 + 2e-5 in `f32` has lost the digits of
//! the growth.

use crate::matrix::{Block, Half, Matrix, Vector, cholesky, cholesky_solve, places};
use crate::{Error, Method};

/// J ẅ = -K w - C ẇ + F.
pub(crate) struct Dynamics<const B: usize> {
    pub n: usize,
    pub inertia: [f64; B],
    pub stiffness: Block<f64, B>,
    pub damping: Block<f64, B>,
}

/// One step of a method: x_{k+1} - x_k = state · x_k + old · F_{k-1} + new · F_k, or `old` + `new` on a torque that is held.
pub(crate) struct Rule<const B: usize> {
    pub state: Matrix<f64, B>,
    /// Response to the torque at the start of the step; zero for the methods that hold u_k.
    pub old: Half<f64, B>,
    /// Response to the torque at the new sample.
    pub new: Half<f64, B>,
}

impl<const B: usize> Dynamics<B> {
    /// The rule of `method` over the period `t`, in s.
    pub fn rule(&self, method: Method, t: f64) -> Result<Rule<B>, Error> {
        let rule = match method {
            Method::ForwardEuler => self.one_stage(t, 0.0, 0.0)?,
            Method::SemiImplicitEuler => self.one_stage(t, 0.0, t)?,
            Method::BackwardEuler => self.one_stage(t, t, t)?,
            Method::Trapezoidal => self.one_stage(t, 0.5 * t, 0.5 * t)?,
            Method::Tustin => self.one_stage(t, 0.5 * t, 0.5 * t)?.split_evenly(),
            Method::Rk4 => self.series(t, 4, 0, false),
            Method::Zoh => self.series(t, TERMS, self.halvings(t), false),
            Method::Foh => self.series(t, TERMS, self.halvings(t), true),
        };
        let finite = rule.state.is_finite() && rule.old.is_finite() && rule.new.is_finite();
        if finite { Ok(rule) } else { Err(Error::NotFinite) }
    }

    /// The four one-stage methods are one: velocities by T times the acceleration at w + h(...), then positions by T v_k + g
    /// times the change of velocity. (h, g) is (0, 0) for forward Euler, (0, T) semi-implicit, (T, T) backward, (T/2, T/2)
    /// trapezoidal. Eliminating the positions leaves J + hC + hgK, symmetric and positive definite: it always has a solution.
    ///
    /// ```text
    /// (J + hC + hgK) Δv = T (F - K w_k - (C + hK) v_k),    Δw = T v_k + g Δv
    /// ```
    fn one_stage(&self, t: f64, h: f64, g: f64) -> Result<Rule<B>, Error> {
        let n = self.n;
        let mut lhs = [[0.0; B]; B];
        let mut rule = Rule { state: Matrix::ZERO, old: Half::ZERO, new: Half::ZERO };
        for i in places::<B>(n) {
            for j in places::<B>(n) {
                lhs[i][j] = h * self.damping[i][j] + h * g * self.stiffness[i][j];
                rule.state.from_position.velocity[i][j] = -t * self.stiffness[i][j];
                rule.state.from_velocity.velocity[i][j] = -t * (self.damping[i][j] + h * self.stiffness[i][j]);
            }
            lhs[i][i] += self.inertia[i];
            rule.new.velocity[i][i] = t;
        }
        cholesky(n, &mut lhs).ok_or(Error::NotFinite)?;
        for half in [&mut rule.state.from_position, &mut rule.state.from_velocity, &mut rule.new] {
            cholesky_solve(n, &lhs, &mut half.velocity);
            for i in places::<B>(n) {
                for j in places::<B>(n) {
                    half.position[i][j] = g * half.velocity[i][j];
                }
            }
        }
        for i in places::<B>(n) {
            rule.state.from_velocity.position[i][i] += t;
        }
        Ok(rule)
    }

    /// How often the step is halved before the series: until the fastest motion turns by half a radian at most.
    fn halvings(&self, t: f64) -> u32 {
        let n = self.n;
        let (mut stiffest, mut most_damped) = (0.0_f64, 0.0_f64);
        for i in places::<B>(n) {
            let (mut k, mut c) = (0.0, 0.0);
            for j in places::<B>(n) {
                k += libm::fabs(self.stiffness[i][j]) / self.inertia[i];
                c += libm::fabs(self.damping[i][j]) / self.inertia[i];
            }
            stiffest = stiffest.max(k);
            most_damped = most_damped.max(c);
        }
        let mut angle = t * (libm::sqrt(stiffest) + most_damped);
        let mut halvings = 0;
        while angle > 0.5 && halvings < 1100 {
            angle *= 0.5;
            halvings += 1;
        }
        halvings
    }

    /// The exact hold: Φ1(h) = ∫₀ʰ e^{As} ds by its series at h = T/2^halvings, then doubled,
    ///
    /// ```text
    /// Φ1(2h) = 2 Φ1(h) + E Φ1(h),    Φ2(2h) = 2 Φ2(h) + E Φ2(h) + h Φ1(h),    E(2h) = 2 E(h) + E(h)²,    E = e^{Ah} - I
    /// ```
    ///
    /// E = A Φ1(h) is taken once, at the start: computed anew at each doubling it would lose digits by C h/J every time, and a light body
    /// on a strong damper would keep none.
    ///
    /// where Φ2(h) = ∫₀ʰ e^{A(h-s)} s ds is the response to a ramp. With `ramp` the torque runs straight from the old to the
    /// new sample: new = Φ2/T, old = Φ1 - Φ2/T; without, it is held: new = Φ1.
    fn series(&self, t: f64, terms: u32, halvings: u32, ramp: bool) -> Rule<B> {
        let n = self.n;
        let mut h = t;
        for _ in 0..halvings {
            h *= 0.5;
        }
        let mut hold = self.phi(h, terms, 1).map(|x| h * x);
        let mut slope = if ramp { self.phi(h, terms, 2).map(|x| h * h * x) } else { Matrix::ZERO };
        let mut e = self.rate_of(1.0, &hold);
        for _ in 0..halvings {
            if ramp {
                let mut doubled = product(n, &e, &slope);
                add(n, 2.0, &slope, &mut doubled);
                add(n, h, &hold, &mut doubled);
                slope = doubled;
            }
            let mut doubled = product(n, &e, &hold);
            add(n, 2.0, &hold, &mut doubled);
            hold = doubled;
            let mut doubled = product(n, &e, &e);
            add(n, 2.0, &e, &mut doubled);
            e = doubled;
            h *= 2.0;
        }
        let state = e;
        let mut new = hold.from_velocity;
        let mut old = Half::ZERO;
        for i in places::<B>(n) {
            for j in places::<B>(n) {
                // A torque F on body j accelerates it by F/J_j.
                for (new, old, slope) in [
                    (&mut new.position[i][j], &mut old.position[i][j], slope.from_velocity.position[i][j]),
                    (&mut new.velocity[i][j], &mut old.velocity[i][j], slope.from_velocity.velocity[i][j]),
                ] {
                    let held = *new / self.inertia[j];
                    let risen = slope / (t * self.inertia[j]);
                    (*new, *old) = if ramp { (risen, held - risen) } else { (held, 0.0) };
                }
            }
        }
        Rule { state, old, new }
    }

    /// φ_p(hA) = Σ (hA)^j/(j+p)!, p = 1 or 2, by Horner's rule over `terms` terms.
    fn phi(&self, h: f64, terms: u32, p: u32) -> Matrix<f64, B> {
        let n = self.n;
        let mut sum = Matrix::ZERO;
        for j in (0..terms).rev() {
            // sum = I + hA/(j+1+p) · sum, from the last term inward; the common 1/p! comes at the end.
            sum = self.rate_of(h / f64::from(j + 1 + p), &sum);
            for i in places::<B>(n) {
                sum.from_position.position[i][i] += 1.0;
                sum.from_velocity.velocity[i][i] += 1.0;
            }
        }
        if p == 2 { sum.map(|x| 0.5 * x) } else { sum }
    }

    /// h A · m
    fn rate_of(&self, h: f64, m: &Matrix<f64, B>) -> Matrix<f64, B> {
        let n = self.n;
        let mut out = Matrix::ZERO;
        for (out, m) in [(&mut out.from_position, &m.from_position), (&mut out.from_velocity, &m.from_velocity)] {
            for i in places::<B>(n) {
                for k in places::<B>(n) {
                    out.position[i][k] = h * m.velocity[i][k];
                    let mut torque = 0.0;
                    for j in places::<B>(n) {
                        torque += self.stiffness[i][j] * m.position[j][k] + self.damping[i][j] * m.velocity[j][k];
                    }
                    out.velocity[i][k] = -h * torque / self.inertia[i];
                }
            }
        }
        out
    }
}

/// Terms of the series: at half a radian, 0.5^20/20! is far below the last bit.
const TERMS: u32 = 20;

impl<const B: usize> Rule<B> {
    /// Half of the torque's response at either end of the step.
    fn split_evenly(mut self) -> Self {
        self.new = self.new.map(|x| 0.5 * x);
        self.old = self.new;
        self
    }
}

/// out += factor · m
fn add<const B: usize>(n: usize, factor: f64, m: &Matrix<f64, B>, out: &mut Matrix<f64, B>) {
    for (m, out) in [(&m.from_position, &mut out.from_position), (&m.from_velocity, &mut out.from_velocity)] {
        for i in places::<B>(n) {
            for j in places::<B>(n) {
                out.position[i][j] += factor * m.position[i][j];
                out.velocity[i][j] += factor * m.velocity[i][j];
            }
        }
    }
}

/// a · b
fn product<const B: usize>(n: usize, a: &Matrix<f64, B>, b: &Matrix<f64, B>) -> Matrix<f64, B> {
    let mut out = Matrix::ZERO;
    for (b, out) in [(&b.from_position, &mut out.from_position), (&b.from_velocity, &mut out.from_velocity)] {
        for k in places::<B>(n) {
            let mut x = Vector::ZERO;
            for j in places::<B>(n) {
                x.position[j] = b.position[j][k];
                x.velocity[j] = b.velocity[j][k];
            }
            let mut y = Vector::ZERO;
            a.apply(n, &x, &mut y);
            for i in places::<B>(n) {
                out.position[i][k] = y.position[i];
                out.velocity[i][k] = y.velocity[i];
            }
        }
    }
    out
}
