//! The transfer function of the world at the puck: from the sampled position to the torque, as a sum of discrete poles, those of
//! [`crate::stability::poles`].

use hapt_model::{Body, Coupling, End, Method, Output};
use nalgebra::{Complex, DMatrix, DVector};

use crate::equations::continuous::{Continuous, LinearCoupling, Slopes, linearise};
use crate::equations::estimator::PositionFilter;
use crate::equations::laws::Acceleration;
use crate::equations::modal::{Coupled, Modal};
use crate::equations::structure::{Part, inertias, parts};
use crate::error::{Error, positive};
use crate::numerics::phi::exp_m1;
use crate::stability::multiplier::Root;
use crate::stability::poles::{ContinuousPole, Gains, decompose, discrete, oscillator};
pub(crate) use crate::stability::poles::{Discretisation, Pole};
use crate::stability::roots::{balance_of, roots};

type C = Complex<f64>;

/// Relative coupling to the puck below which an undamped mode is omitted.
const NEGLIGIBLE: f64 = 1e-9;

/// Condition number of the eigenvectors above which a part counts as defective.
const DEFECTIVE: f64 = 3e5;

/// H z⁻ᵈ without the delay: H = stiffness + (z - 1) F, F = -(Σ gains·(1, z⁻¹, W, z⁻¹W)/(z - λ) + direct z⁻¹ W).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TransferFunction {
    /// H(1), N·m/rad.
    pub stiffness: f64,
    /// N·m·s/rad
    pub direct: f64,
    pub poles: Vec<Pole>,
    /// All stiffness and damping at the puck, and the gains along the acceleration: the scale for negligible residues.
    pub at_puck: [f64; 2],
    /// Whether the poles add up to the world's own response. They do not where rates of a part lie too far apart for double precision.
    pub is_accurate: bool,
}

/// Distance of a filter's pole from one of the world, relative to their distances from 1, below which their sum loses too many digits.
const TOO_NEAR: f64 = 1e-6;

/// Largest error of the poles' sum, relative to stiffness and damping at the puck.
const INACCURATE: f64 = 1e-7;

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
        let accelerations: Vec<Acceleration> = terms.iter().filter_map(|t| t.acceleration).collect();
        let gains: f64 = accelerations.iter().map(|a| a.gain(period)).sum();
        let at_puck = [stiffness, damping + gains];
        let poles = accelerations.iter().map(|a| along_acceleration(a, period)).collect();
        let mut port = TransferFunction { stiffness, direct: -damping, poles, at_puck, is_accurate: true };
        let mut coupled = Vec::new();
        for part in parts(&inertia, &terms) {
            if !part.members.iter().any(|&body| terms.iter().any(|t| is_between_puck_and(t, body))) {
                continue;
            }
            coupled.extend(port.add(&part, &terms, rule)?);
        }
        // Explicit methods are unstable where rates are that large, and semi-implicit Euler has another damping.
        if coupled.len() > 2 && !method.is_explicit() {
            let world = Continuous::new(bodies, couplings, slopes)?;
            port.is_accurate = is_response_of(&coupled, &world, port.stiffness, period);
        }
        Ok(port)
    }

    /// The world behind a filter of the position, c = (1 - p) z/(z - p): of H = K + (z - 1) F the part of the position becomes
    ///
    /// ```text
    /// c H = K + (z - 1) (c F - K p/(z - p)),    c (a + b z⁻¹)/(z - λ) = (1 - p) ((a λ + b)/(λ - p)/(z - λ) + (a p + b)/(p - λ)/(z - p))
    /// ```
    ///
    /// `None` where a pole of the world is so near to p that the sum loses its digits.
    pub fn behind(mut self, filter: PositionFilter) -> Option<TransferFunction> {
        let p = Pole { ln_abs: filter.ln_pole(), arg: 0.0, gains: [C::from(0.0); 4] };
        let mut own = C::from(self.stiffness * filter.pole());
        for pole in &mut self.poles {
            let [still, back, ..] = pole.gains;
            if still == C::from(0.0) && back == C::from(0.0) {
                continue;
            }
            let lambda = C::new(pole.ln_abs, pole.arg).exp();
            // λ - p, of two numbers that may both be next to 1.
            let apart = filter.pole() * exp_m1(C::new(pole.ln_abs - filter.ln_pole(), pole.arg));
            let size = filter.gain().max(exp_m1(C::new(pole.ln_abs, pole.arg)).norm());
            if apart.norm() < TOO_NEAR * size {
                return None;
            }
            own -= filter.gain() * (still * filter.pole() + back) / apart;
            (pole.gains[0], pole.gains[1]) = (filter.gain() * (still * lambda + back) / apart, C::from(0.0));
        }
        self.poles.push(Pole { gains: [C::from(own.re), C::from(0.0), C::from(0.0), C::from(0.0)], ..p });
        Some(self)
    }

    /// Whether all numbers are finite.
    pub fn is_finite(&self) -> bool {
        let number = |g: &C| g.re.is_finite() && g.im.is_finite();
        let pole = |p: &Pole| p.ln_abs < f64::INFINITY && p.arg.is_finite() && p.gains.iter().all(number);
        self.stiffness.is_finite() && self.direct.is_finite() && self.poles.iter().all(pole)
    }

    /// Adds the poles of a part, and returns those of the differential equation.
    fn add(
        &mut self,
        part: &Part,
        terms: &[LinearCoupling],
        rule: Discretisation,
    ) -> Result<Vec<ContinuousPole>, Error> {
        let mut all = Vec::new();
        let modal = Modal::new(part)?;
        let gains = gains_of(part, &modal, terms, rule.period);
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
                let poles = oscillator(*omega, x, (compensation + implicit) * x * x, spring, damper);
                self.take(&poles, rule);
                all.extend(poles);
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
                let poles = oscillator(omega, x, damping, gains.spring[0], gains.damper[0]);
                self.take(&poles, rule);
                all.extend(poles);
            }
            _ => {
                let poles = coupled_poles(coupled, &gains, rule)?;
                self.take(&poles, rule);
                all.extend(poles);
            }
        }
        Ok(all)
    }

    fn take(&mut self, poles: &[ContinuousPole], rule: Discretisation) {
        let first = self.poles.len();
        for e in poles {
            let (pole, direct) = discrete(e, rule);
            self.direct += direct;
            self.poles.push(pole);
        }
        make_real(&mut self.poles[first..]);
    }

    /// Whether the residue of a pole is more than rounding: the puck both moves the mode and feels it.
    pub fn has_residue(&self, pole: &Pole, period: f64) -> bool {
        let [still, back, moving, moving_back] = pole.gains.map(|g| g.norm());
        let all = still + back + (moving + moving_back) / period;
        all.is_nan() || all > 1e-18 * (self.at_puck[0] + self.at_puck[1] / period)
    }
}

/// Residues of real poles are real, and those of a pair conjugate. A rounding error of the other part would be amplified by 1/φ near φ = 0.
fn make_real(poles: &mut [Pole]) {
    for i in 0..poles.len() {
        let Pole { ln_abs, arg, gains } = poles[i];
        if arg == 0.0 || arg.abs() == std::f64::consts::PI {
            poles[i].gains = gains.map(|gain| C::from(gain.re));
        } else if arg > 0.0 {
            let Some(other) = poles.iter().position(|p| p.arg == -arg && p.ln_abs == ln_abs) else { continue };
            let mean: [C; 4] = std::array::from_fn(|k| 0.5 * (gains[k] + poles[other].gains[k].conj()));
            poles[i].gains = mean;
            poles[other].gains = mean.map(|gain| gain.conj());
        }
    }
}

/// Least pivot of a response that is known well enough to compare with.
const SINGULAR: f64 = 1e-3;

/// The pole of a torque along the acceleration: gain (v_k - s_{k-1}) = gain (1 - z⁻¹) z/(z - p) v, p = τ/(τ + T), is -H z with
/// F = -gain (1 - z⁻¹) W/(z - p).
fn along_acceleration(acceleration: &Acceleration, period: f64) -> Pole {
    let gain = C::from(acceleration.gain(period));
    let ln_abs = -(period / acceleration.tau).ln_1p();
    Pole { ln_abs, arg: 0.0, gains: [C::from(0.0), C::from(0.0), gain, -gain] }
}

/// Whether poles add up to the response of the world at real s > 0, where M s² + C s + K is positive definite and its solution has no
/// cancellation: K + s C - rᵀ (M s² + C s + K)⁻¹ r, r what joins bodies and puck, is K₀ + s C + Σ (P + Q) (σ - β) s/(s - s_i).
fn is_response_of(poles: &[ContinuousPole], world: &Continuous, stiffness: f64, period: f64) -> bool {
    let n = world.bodies();
    let damping = world.damping(period);
    (-24..=6).all(|half_decade| {
        let s = 10f64.powf(0.5 * f64::from(half_decade)) / period;
        let whole = &world.stiffness + s * &damping;
        let mut inner = whole.view((0, 0), (n, n)).into_owned();
        (0..n).for_each(|i| inner[(i, i)] += s * s * world.inertia[i]);
        // In units in which the diagonal is 1.
        let scale = inner.diagonal().map(|x| if x > 0.0 { 1.0 / x.sqrt() } else { 1.0 });
        let joined = whole.view((0, n), (n, 1)).column(0).component_mul(&scale);
        let scaled = DMatrix::from_fn(n, n, |i, j| scale[i] * inner[(i, j)] * scale[j]);
        // Bodies that are held only by each other: at such a low rate this response has a cancellation too.
        let root = scaled.cholesky().filter(|root| root.l_dirty().diagonal().iter().all(|pivot| *pivot >= SINGULAR));
        let Some(root) = root else { return true };
        let response = whole[(n, n)] - joined.dot(&root.solve(&joined));
        let of = |e: &ContinuousPole| {
            (e.position + e.velocity) * (e.shape - e.damper) * (s * period / (C::from(s * period) - e.root.z))
        };
        let sum = stiffness + s * damping[(n, n)] + poles.iter().map(|e| of(e).re).sum::<f64>();
        (sum - response).abs() <= INACCURATE * whole[(n, n)]
    })
}

fn damping(term: &LinearCoupling, period: f64) -> f64 {
    term.fixed + period * term.per_period
}

fn is_between_puck_and(term: &LinearCoupling, body: usize) -> bool {
    let ends = [term.first, term.second];
    ends.contains(&End::Puck) && ends.contains(&End::Body(body))
}

fn gains_of(part: &Part, modal: &Modal, terms: &[LinearCoupling], period: f64) -> Gains {
    // On w = M^{-1/2} V y.
    let across = |of: &dyn Fn(&LinearCoupling) -> f64| {
        let per_body = part.members.iter().zip(&part.inertia).map(|(&body, inertia)| {
            terms.iter().filter(|t| is_between_puck_and(t, body)).map(of).sum::<f64>() / inertia.sqrt()
        });
        modal.shapes.transpose() * DVector::from_iterator(part.members.len(), per_body)
    };
    Gains { spring: across(&|t| t.stiffness), damper: across(&|t| damping(t, period)) }
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
    let columns = values.iter().enumerate().map(|(i, &z)| {
        // The same eigenvalue, refined for light damping.
        let distance = |r: &Root| (r.z - z).norm();
        let nearest = (0..better.len()).min_by(|&a, &b| distance(&better[a]).total_cmp(&distance(&better[b])));
        let root = match nearest {
            Some(at) if distance(&better[at]) < 1e-7 * z.norm() + 1e-13 * size => better.swap_remove(at),
            _ => C::new(z.re.min(0.0), z.im).into(),
        };
        let row: Vec<C> = inverse.row(i).iter().copied().collect();
        ContinuousPole::new(root, v.column(i).as_slice(), &row, &modes.omega, gains)
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
