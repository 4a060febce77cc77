//! The stability boundary in the plane of two parameters, by its equation: the D-decomposition (Neimark 1948; Gryazina and Polyak,
//! Automatica 42(1), 2006).
//!
//! Where two keys enter the loop as a stiffness K and a damping B of one coupling, the characteristic equation is linear in them,
//!
//! ```text
//! K + B W(λ) = R(λ)
//! ```
//!
//! and an eigenvalue crosses the unit circle only where this holds on it: on the line for λ = 1, on the line for λ = -1, and at one
//! point for each λ = e^{jφ}, 0 < φ < π, by its real and imaginary parts. The stability boundary consists of segments of these
//! curves. The verdicts on both sides select the segments.
//!
//! **Between puck and ground, the free loop.** With μ = λ - 1, the torque -(H_z z + H_v v) of the rest of the world
//! (`impedance`), and the puck's exact response to held commands over the two parts of a period (`closed_loop`; E = e^{-bT/J}),
//!
//! ```text
//! λ^d z = (T φ₁ n_v/(μ + 1 - E) + n_z)/μ,    λ^d ż = n_v/(μ + 1 - E),    per unit of command
//! R = -μ (μ + 1 - E) λ^d/G - H_z - H_v W,    G = T φ₁ n_v + n_z (μ + 1 - E)
//! W = V(λ), the estimator, or μ n_v/G for the true velocity
//! ```
//!
//! A motor that lags adds its torque m/(μ + 1 - e^{-T/lag}) per unit of command to n_v and n_z, each with its own factor.
//!
//! **At a body that is coupled to no other, the held world.** Under forward Euler K + C μ/T = -J μ²/T²; semi-implicit Euler is
//! forward Euler with C + TK. Apart from RK4, the other methods are stable for such a body.

use std::f64::consts::PI;

use hapt_model::{Coupling, End, Method, Sampling, World};
use nalgebra::Complex;

use crate::equations::continuous::{LinearCoupling, Slopes, linearise, piecewise, piecewise_at_bodies};
use crate::equations::delay::Delay;
use crate::equations::estimator::Filter;
use crate::equations::puck::DrivenPuck;
use crate::equations::slopes::combinations;
use crate::error::{Error, positive};
use crate::impedance::{Discretisation, Pole, TransferFunction};
use crate::numerics::phi::{phi1, phi2};

type C = Complex<f64>;

/// Relative deviation up to which the effect of two keys counts as linear.
const LINEAR: f64 = 1e-9;

/// Two keys of a world by their dotted paths, and the range of each in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keys<'a> {
    /// The dotted paths.
    pub paths: [&'a str; 2],
    /// From and to of each.
    pub ranges: [[f64; 2]; 2],
}

/// A line a A + b B = c in the plane of two keys A and B.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// a and b.
    pub normal: [f64; 2],
    /// c
    pub offset: f64,
}

/// The equation of one linear loop, see the module documentation.
///
/// ```
/// use hapt_analysis::{Decomposition, Keys, free_eigenvalues};
/// use hapt_model::{Source, World};
///
/// let source = r#"
///     [loop]
///     period = "1 ms"
///     estimator = "difference"
///     [device]
///     inertia = 6.4e-4
///     damping = 1.2e-3
///     [[couplings]]
///     kind = "spring"
///     between = ["puck", "ground"]
///     stiffness = 2.0
///     [[couplings]]
///     kind = "damper"
///     between = ["puck", "ground"]
///     damping = 0.1
///     [scenarios.still]
///     duration = "1 s"
///     hand = { kind = "step", to = 0.0 }
/// "#;
/// let mut world = World::read(&Source::from_text("wall", source), &[])?;
/// let paths = ["couplings.0.stiffness", "couplings.1.damping"];
/// let keys = Keys { paths, ranges: [[0.0, 1000.0], [0.0, 2.0]] };
/// let equations = Decomposition::free(&world, keys)?.unwrap();
/// // The stiffness and damping for which e^{jφ} is an eigenvalue.
/// let point = equations[0].at(0.5).unwrap();
/// paths.iter().zip(point).for_each(|(path, value)| assert!(world.set_number(path, value)));
/// let eigenvalues = free_eigenvalues(&world)?;
/// assert!(eigenvalues.iter().any(|v| (v.re - 0.5f64.cos()).hypot(v.im - 0.5f64.sin()) < 1e-9));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Decomposition {
    /// A and B at which K and B of the equation are 0.
    origin: [f64; 2],
    /// The contribution of each key to K, and to B.
    stiffness: [f64; 2],
    damping: [f64; 2],
    period: f64,
    equation: Equation,
}

#[derive(Clone, Debug, PartialEq)]
enum Equation {
    Puck(Box<Puck>),
    Body { inertia: f64, implicit: bool, stiffness: f64, damping: f64 },
}

/// The coefficients of the equation of the free loop.
#[derive(Clone, Debug, PartialEq)]
struct Puck {
    /// 1 - E
    decay: f64,
    /// T φ₁
    coast: f64,
    /// n_v and n_z: for the command of d samples ago, and for the one before it.
    velocity: [f64; 2],
    position: [f64; 2],
    /// Where the motor's torque lags behind its command.
    motor: Option<Motor>,
    delay: u32,
    /// V = μ Σ slope\[i\] λ^{-i-1}, or with a pole slope\[0\] μ/(λ - pole); empty: the true velocity.
    slope: Vec<f64>,
    /// 1 - pole
    forgets: Option<f64>,
    /// H(1), and the direct damping of the rest of the world at the puck.
    stiffness: f64,
    damping: f64,
    poles: Vec<Pole>,
}

/// A motor whose torque lags behind its command, over a period.
#[derive(Clone, Debug, PartialEq)]
struct Motor {
    /// 1 - e^{-T/lag}
    follows: f64,
    /// The contribution to the torque by the command of d samples ago, and by the one before it.
    torque: [f64; 2],
    /// The contribution of a torque at the sample to the velocity and to the position at the next.
    velocity: f64,
    position: f64,
}

/// The worlds at the corners and the centre of the plane.
struct Corners<'a> {
    keys: Keys<'a>,
    /// (0, 0), (1, 0), (0, 1), (1, 1), middle.
    worlds: Vec<World>,
}

impl<'a> Corners<'a> {
    fn new(world: &World, keys: Keys<'a>) -> Option<Self> {
        let [[a0, a1], [b0, b1]] = keys.ranges;
        let middle = [0.5 * (a0 + a1), 0.5 * (b0 + b1)];
        let at = |values: [f64; 2]| {
            let mut world = world.clone();
            let set = keys.paths.iter().zip(values).all(|(path, value)| world.set_number(path, value));
            set.then_some(world)
        };
        let worlds =
            [[a0, b0], [a1, b0], [a0, b1], [a1, b1], middle].into_iter().map(at).collect::<Option<Vec<_>>>()?;
        // The keys must not change anything else of the loop.
        let first = worlds.first()?;
        let same = |w: &World| {
            let inertias = w.bodies.iter().zip(&first.bodies).all(|(a, b)| a.inertia == b.inertia);
            let device = w.device.inertia == first.device.inertia
                && w.device.damping == first.device.damping
                && w.device.lag == first.device.lag;
            w.sampling == first.sampling && inertias && device
        };
        worlds.iter().all(same).then_some(Corners { keys, worlds })
    }

    fn middle(&self) -> &World {
        &self.worlds[4]
    }

    fn origin(&self) -> [f64; 2] {
        self.keys.ranges.map(|[from, to]| 0.5 * (from + to))
    }

    /// The linearised couplings at the corners and the centre.
    fn linear(&self, slopes: &Slopes) -> Result<Vec<Vec<LinearCoupling>>, Error> {
        self.worlds.iter().map(|w| linearise(&w.bodies, &w.couplings, slopes)).collect()
    }

    /// The contribution of each key to the stiffness and to the damping of the `chosen` couplings; `None` where it is not linear, or
    /// where a key changes another coupling.
    fn gains(&self, terms: &[Vec<LinearCoupling>], chosen: impl Fn(&LinearCoupling) -> bool) -> Option<[[f64; 2]; 2]> {
        let period = self.middle().sampling.period;
        let linear = |t: &LinearCoupling| (t.stiffness, t.fixed, t.per_period);
        let [first, ..] = terms else { return None };
        if terms.iter().any(|all| all.iter().zip(first).any(|(t, f)| !chosen(t) && linear(t) != linear(f))) {
            return None;
        }
        let sum = |of: &dyn Fn(&LinearCoupling) -> f64| -> Option<[f64; 2]> {
            let v: Vec<f64> = terms.iter().map(|all| all.iter().filter(|t| chosen(t)).map(of).sum()).collect();
            let size = v.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            let across = (v[3] - v[1] - v[2] + v[0]).abs();
            let middle = (v[4] - 0.25 * (v[0] + v[1] + v[2] + v[3])).abs();
            let [a, b] = self.keys.ranges.map(|[from, to]| to - from);
            (across.max(middle) <= LINEAR * size).then(|| [(v[1] - v[0]) / a, (v[2] - v[0]) / b])
        };
        Some([sum(&|t| t.stiffness)?, sum(&|t| t.fixed + period * t.per_period)?])
    }
}

/// Whether the contributions of the two keys are linearly independent.
fn independent([k, b]: [[f64; 2]; 2]) -> bool {
    let (one, other) = (k[0] * b[1], k[1] * b[0]);
    (one - other).abs() > LINEAR * (one.abs() + other.abs())
}

fn between_puck_and_ground(term: &LinearCoupling) -> bool {
    matches!((term.first, term.second), (End::Puck, End::Ground) | (End::Ground, End::Puck))
}

impl Decomposition {
    /// The equations of the free loop, one per combination of slopes and estimator windows; `None` unless the keys are exactly a
    /// stiffness and a damping between puck and ground, on a device without a handle on a shaft, gravity and cogging, the bodies step at every sample, and the position is not filtered.
    ///
    /// # Errors
    /// As [`crate::free()`].
    pub fn free(world: &World, keys: Keys<'_>) -> Result<Option<Vec<Decomposition>>, Error> {
        let is_plain = world.device.handle.is_none()
            && world.device.torque.is_none()
            && world.sampling.bodies_every == 1
            && world.sampling.filter.is_none()
            && !world.couplings.iter().any(|c| c.law.has_state() && !c.law.has_bristle());
        let Some(corners) = Corners::new(world, keys).filter(|_| is_plain) else { return Ok(None) };
        let world = corners.middle();
        let mut all = Vec::new();
        for slopes in combinations(&piecewise(&world.couplings)) {
            let Some(gains) = corners.gains(&corners.linear(&slopes)?, between_puck_and_ground) else {
                return Ok(None);
            };
            if gains == [[0.0; 2]; 2] {
                // The keys have no effect at these slopes.
                continue;
            }
            if !independent(gains) {
                return Ok(None);
            }
            for filter in Filter::of(&world.sampling, world.sampling.period) {
                if filter.kalman.is_some() {
                    return Ok(None);
                }
                let puck = Box::new(Puck::new(world, &world.couplings, &slopes, &filter)?);
                push(&mut all, &corners, gains, Equation::Puck(puck));
            }
        }
        Ok(Some(all))
    }

    /// The equations of the held world; `None` unless the keys are exactly a stiffness and a damping at a body that is coupled to no
    /// other, the method is one of the module documentation, the device has no handle on a shaft, gravity or cogging, and the bodies step at every sample.
    ///
    /// # Errors
    /// As [`crate::held()`].
    pub fn held(world: &World, keys: Keys<'_>) -> Result<Option<Vec<Decomposition>>, Error> {
        let implicit = match world.sampling.method {
            Method::ForwardEuler => false,
            Method::SemiImplicitEuler => true,
            Method::BackwardEuler | Method::Trapezoidal | Method::Zoh | Method::Rk4 | Method::Tustin | Method::Foh => {
                return Ok(None);
            }
        };
        let is_plain =
            world.device.handle.is_none() && world.device.torque.is_none() && world.sampling.bodies_every == 1;
        let Some(corners) = Corners::new(world, keys).filter(|_| is_plain) else { return Ok(None) };
        let world = corners.middle();
        let mut all = Vec::new();
        for slopes in combinations(&piecewise_at_bodies(&world.couplings)) {
            let terms = corners.linear(&slopes)?;
            // A body whose couplings depend on the keys.
            let changed =
                terms.iter().flat_map(|all| all.iter().zip(&terms[0])).find(|(t, f)| t != f && at_body(t).is_some());
            let Some(body) = changed.and_then(|(t, _)| at_body(t)) else { continue };
            let here = |t: &LinearCoupling| t.first == End::Body(body) || t.second == End::Body(body);
            let between = |t: &LinearCoupling| matches!((t.first, t.second), (End::Body(_), End::Body(_)));
            if terms[4].iter().any(|t| here(t) && between(t)) {
                return Ok(None);
            }
            let Some(gains) = corners.gains(&terms, here) else { return Ok(None) };
            if !independent(gains) {
                return Ok(None);
            }
            let period = world.sampling.period;
            let sum =
                |of: &dyn Fn(&LinearCoupling) -> f64| -> f64 { terms[4].iter().filter(|t| here(t)).map(of).sum() };
            let equation = Equation::Body {
                inertia: world.bodies[body].inertia,
                implicit,
                stiffness: sum(&|t| t.stiffness),
                damping: sum(&|t| t.fixed + period * t.per_period),
            };
            push(&mut all, &corners, gains, equation);
        }
        Ok(Some(all))
    }

    /// W and R of the module documentation.
    fn equation(&self, phi: f64) -> (C, C) {
        let (sin, cos) = (0.5 * phi).sin_cos();
        let mu = C::new(-2.0 * sin * sin, 2.0 * sin * cos);
        match &self.equation {
            Equation::Puck(puck) => puck.equation(phi, mu),
            Equation::Body { inertia, implicit, stiffness, damping } => {
                let per = if *implicit { 1.0 + mu } else { C::from(1.0) };
                let w = mu / (per * self.period);
                (w, -mu * mu * *inertia / (per * self.period * self.period) - stiffness - w * *damping)
            }
        }
    }

    /// The point (A, B) at which e^{jφ} is an eigenvalue, 0 < φ < π; `None` where there is none, or where it is a line.
    #[inline]
    pub fn at(&self, phi: f64) -> Option<[f64; 2]> {
        let (w, r) = self.equation(phi);
        let damping = r.im / w.im;
        let stiffness = r.re - damping * w.re;
        let [[ka, kb], [ba, bb]] = [self.stiffness, self.damping];
        let det = ka * bb - kb * ba;
        let a = self.origin[0] + (stiffness * bb - kb * damping) / det;
        let b = self.origin[1] + (ka * damping - stiffness * ba) / det;
        (a.is_finite() && b.is_finite()).then_some([a, b])
    }

    /// The lines on which 1 and -1 are eigenvalues; `None` where no key changes them.
    pub fn lines(&self) -> [Option<Line>; 2] {
        [0.0, PI].map(|phi| {
            let (w, r) = self.equation(phi);
            let normal = [0, 1].map(|i| self.stiffness[i] + self.damping[i] * w.re);
            let offset = r.re + normal[0] * self.origin[0] + normal[1] * self.origin[1];
            let all = normal[0].is_finite() && normal[1].is_finite() && offset.is_finite();
            (all && normal != [0.0; 2]).then_some(Line { normal, offset })
        })
    }

    /// The angles near which the curve may turn sharply, with the width in φ: those of the poles of the world.
    pub fn angles(&self) -> Vec<(f64, f64)> {
        let Equation::Puck(puck) = &self.equation else { return Vec::new() };
        puck.poles.iter().filter(|p| p.arg > 0.0 && p.arg < PI).map(|p| (p.arg, p.ln_abs.abs())).collect()
    }
}

fn at_body(term: &LinearCoupling) -> Option<usize> {
    [term.first, term.second].into_iter().find_map(|end| if let End::Body(body) = end { Some(body) } else { None })
}

/// Adds an equation unless it is there: combinations may differ in what no key moves.
fn push(all: &mut Vec<Decomposition>, corners: &Corners<'_>, [stiffness, damping]: [[f64; 2]; 2], equation: Equation) {
    let period = corners.middle().sampling.period;
    let one = Decomposition { origin: corners.origin(), stiffness, damping, period, equation };
    if !all.contains(&one) {
        all.push(one);
    }
}

impl Puck {
    fn new(world: &World, couplings: &[Coupling], slopes: &Slopes, filter: &Filter) -> Result<Puck, Error> {
        let Sampling { method, output, advance, period, .. } = world.sampling;
        let port = TransferFunction::new(
            &world.bodies,
            couplings,
            slopes,
            Discretisation { method, output, advance, period },
        )?;
        if !port.is_finite() {
            return Err(Error::Eigenvalues { order: port.poles.len() });
        }
        let inertia = positive("the device's inertia", world.device.inertia)?;
        let rate = world.device.damping / inertia;
        let delay = Delay::of(world.sampling.delay_s(), period)?;
        let (h1, h2) = (delay.fraction * period, period - delay.fraction * period);
        let push = h1 / inertia * phi1(rate * h1);
        let lag = world.device.lag;
        let driven = DrivenPuck { inertia, damping: world.device.damping, spring: 0.0, lag };
        let (matrix, old, new) = driven.over(h1).then(&driven.over(h2));
        let motor = (lag > 0.0).then(|| Motor {
            follows: -matrix[(2, 2)],
            torque: [new[2], old[2]],
            velocity: matrix[(1, 2)],
            position: matrix[(0, 2)],
        });
        let mut sum = 0.0;
        let mut slope: Vec<f64> = filter.taps.iter().map(|tap| (sum += tap, sum).1).collect();
        slope.pop();
        Ok(Puck {
            decay: -(-rate * period).exp_m1(),
            coast: period * phi1(rate * period),
            velocity: if lag > 0.0 {
                [new[1], old[1]]
            } else {
                [h2 / inertia * phi1(rate * h2), push * (-rate * h2).exp()]
            },
            position: if lag > 0.0 {
                [new[0], old[0]]
            } else {
                [h2 * h2 / inertia * phi2(rate * h2), h1 * h1 / inertia * phi2(rate * h1) + push * h2 * phi1(rate * h2)]
            },
            motor,
            delay: u32::try_from(delay.samples).unwrap_or(u32::MAX),
            forgets: (filter.pole > 0.0).then(|| period * filter.taps[0]),
            slope,
            stiffness: port.stiffness,
            damping: -port.direct,
            poles: port.poles,
        })
    }

    /// W and R at λ = 1 + μ = e^{jφ}.
    #[inline]
    fn equation(&self, phi: f64, mu: C) -> (C, C) {
        let z = 1.0 + mu;
        let back = z.conj();
        let [v0, v1] = self.velocity;
        let [p0, p1] = self.position;
        let (mut velocity, mut position) = (back * v1 + v0, back * p1 + p0);
        if let Some(motor) = &self.motor {
            let torque = (back * motor.torque[1] + motor.torque[0]) / (mu + motor.follows);
            velocity += torque * motor.velocity;
            position += torque * motor.position;
        }
        let coasting = mu + self.decay;
        let inverse = (velocity * self.coast + position * coasting).inv();
        let w = match (&self.slope[..], self.forgets) {
            ([], _) => mu * velocity * inverse,
            (slope, None) => slope.iter().rev().fold(C::from(0.0), |sum, g| (sum + g) * back) * mu,
            (slope, Some(forgets)) => mu * slope[0] / (mu + forgets),
        };
        let mut response = mu * coasting * inverse;
        if self.delay > 0 {
            response *= C::from_polar(1.0, f64::from(self.delay) * phi);
        }
        let (mut still, mut moving) = (C::from(self.stiffness), C::from(self.damping));
        for pole in &self.poles {
            // z - p = -z (e^{ln p - jφ} - 1)
            let x = C::new(pole.ln_abs, pole.arg - phi);
            let half = (0.5 * x.im).sin();
            let less = C::new(x.re.exp_m1() * x.im.cos() - 2.0 * half * half, x.re.exp() * x.im.sin());
            let resolvent = -back / less;
            let [one, one_back, slope, slope_back] = pole.gains;
            still -= mu * resolvent * (one + one_back * back);
            moving -= resolvent * (slope * z + slope_back);
        }
        (w, -response - still - moving * w)
    }
}
