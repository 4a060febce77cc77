//! The equations of motion of a world as matrices, assembled from its couplings.
//!
//! With w the n bodies' positions and z the puck's, y = (w, z):
//!
//! ```text
//! M ẅ = (f - K y - (C0 + T C1) ẏ), the first n rows          the bodies
//! torque = the last row of the same                          on the puck
//! ```
//!
//! A coupling on q = y_first - y_second with torque -(k q + c q̇ - f) on its first end adds k b bᵀ to K, c b bᵀ to C and f b to
//! f, where b is +1 at the first end, -1 at the second and has no entry for ground. So K, C0 and C1 are symmetric and positive
//! semidefinite: the world is passive, and the puck's torque row is the input column transposed.
//!
//! C1 is separate because a compensating damper, (2.24), is T times a stiffness: it changes with the period, and searches over
//! the period need both.

use std::borrow::Cow;

use hapt_model::{Body, Coupling, Damping, End, Law, Sampling};
use nalgebra::{DMatrix, DVector, RowDVector};

use crate::equations::laws::{self, Acceleration, LinearLaw};
use crate::error::{Error, positive};

/// The slope at which each nonlinear coupling is linearised: flat (outside the wall, detent 0, LuGre sliding, viscous) or steep
/// (inside the wall, detent 2π torque/pitch, LuGre sticking, σ0 and σ1 + σ2). Negative slopes are not used. Coulomb friction and
/// constants have slope 0 in both.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Slopes {
    /// All flat.
    #[default]
    Flat,
    /// All steep.
    Steep,
    /// Steep where the coupling's index is listed.
    Chosen(Vec<usize>),
}

impl Slopes {
    fn steep(&self, coupling: usize) -> bool {
        match self {
            Slopes::Flat => false,
            Slopes::Steep => true,
            Slopes::Chosen(list) => list.contains(&coupling),
        }
    }
}

/// A coupling, linearised: torque on the first end -(stiffness q + (fixed + T per_period) q̇) + force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearCoupling {
    /// The end that takes the torque.
    pub first: End,
    /// The end that takes the opposite.
    pub second: End,
    /// k in N·m/rad, zero or more.
    pub stiffness: f64,
    /// The damping that does not depend on the period, N·m·s/rad, zero or more.
    pub fixed: f64,
    /// The damping that is proportional to the period, per second of it: N·m/rad, zero or more.
    pub per_period: f64,
    /// The torque on the first end at q = 0, q̇ = 0: k · rest of a spring, or a constant. N·m.
    pub force: f64,
    /// The gain of an integral term, whose ends are puck and ground: N·m/(rad·s), zero or more. [`Continuous`] leaves it out.
    pub integral: f64,
    /// A torque along the acceleration, whose ends are puck and ground. [`Continuous`] leaves it out.
    pub acceleration: Option<Acceleration>,
}

/// Indices of the couplings at a body with two different slopes: those for which [`Slopes`] changes the eigenvalues of the held
/// world.
pub fn piecewise_at_bodies(couplings: &[Coupling]) -> Vec<usize> {
    let body = |end| matches!(end, End::Body(_));
    piecewise(couplings).into_iter().filter(|&i| body(couplings[i].first) || body(couplings[i].second)).collect()
}

/// Indices of all couplings with two different slopes: those for which [`Slopes`] changes the eigenvalues of the free loop.
pub fn piecewise(couplings: &[Coupling]) -> Vec<usize> {
    let two = |c: &Coupling| {
        laws::is_nonlinear(c) && (laws::steepest(&c.law) != laws::flattest(&c.law) || c.law.is_compensating())
    };
    (0..couplings.len()).filter(|&i| two(&couplings[i])).collect()
}

/// Whether a compensating damper follows this coupling: a spring between its two ends, in either order; from a body to ground, any
/// spring at the body.
pub(crate) fn compensated_by(damper: &Coupling, spring: &Coupling) -> bool {
    let (ends, c) = ([damper.first, damper.second], spring);
    let at = match ends {
        [End::Body(body), End::Ground] | [End::Ground, End::Body(body)] => {
            c.first == End::Body(body) || c.second == End::Body(body)
        }
        _ => [c.first, c.second] == ends || [c.second, c.first] == ends,
    };
    at && c.law.spring().is_some()
}

/// The stiffness, N·m/rad, of which a compensating damper is T times.
pub(crate) fn compensated(damper: &Coupling, couplings: &[Coupling]) -> f64 {
    couplings.iter().filter(|c| compensated_by(damper, c)).filter_map(|c| c.law.spring()).sum()
}

/// The couplings with each compensating damper replaced by its damping at `period`, so that a subset can be analysed by itself.
pub(crate) fn settled(couplings: &[Coupling], period: f64) -> Vec<Coupling> {
    settled_where(couplings, period, |_| true)
}

/// The couplings of a loop, of which those at bodies follow the bodies' step: where that is not the period, the compensating dampers between
/// puck and ground are replaced by their damping.
pub(crate) fn of_step<'a>(couplings: &'a [Coupling], sampling: &Sampling) -> Cow<'a, [Coupling]> {
    match sampling.bodies_every {
        1 => Cow::Borrowed(couplings),
        _ => Cow::Owned(settled_where(couplings, sampling.period, |c| !c.is_at_body())),
    }
}

fn settled_where(couplings: &[Coupling], period: f64, wanted: impl Fn(&Coupling) -> bool) -> Vec<Coupling> {
    let settle = |c: &Coupling| {
        let law = match c.law.is_compensating() && wanted(c) {
            true => Law::Damper { damping: Damping::Fixed(period * compensated(c, couplings)) },
            false => c.law,
        };
        Coupling { law, ..*c }
    };
    couplings.iter().map(settle).collect()
}

/// Linearises the couplings, in their order. The affine part of a nonlinear coupling is omitted, except that of a constant.
///
/// # Errors
/// [`Error::NoSuchBody`] when an end is not one of `bodies`.
pub fn linearise(bodies: &[Body], couplings: &[Coupling], slopes: &Slopes) -> Result<Vec<LinearCoupling>, Error> {
    let term = |(index, c): (usize, &Coupling)| {
        for end in [c.first, c.second] {
            match end {
                End::Body(body) if body >= bodies.len() => {
                    return Err(Error::NoSuchBody { coupling: index, body, bodies: bodies.len() });
                }
                End::Body(_) | End::Puck | End::Ground => {}
            }
        }
        let (mut stiffness, mut fixed, mut per_period, mut force) = (0.0, 0.0, 0.0, 0.0);
        let steep = slopes.steep(index);
        match laws::linear_law(c) {
            Some(LinearLaw::Spring(k, rest)) => (stiffness, force) = (k, k * rest),
            Some(LinearLaw::Damper(b)) => fixed = b,
            Some(LinearLaw::Compensating) => per_period = compensated(c, couplings),
            Some(LinearLaw::Constant(torque)) => force = torque,
            None if steep && c.law.is_compensating() => per_period = compensated(c, couplings),
            None if steep => (stiffness, fixed) = laws::steepest(&c.law),
            None => (stiffness, fixed) = laws::flattest(&c.law),
        }
        let integral = if c.is_at_body() { 0.0 } else { laws::integral_gain(&c.law) };
        let acceleration = Acceleration::of(&c.law).filter(|_| !c.is_at_body());
        let [first, second] = [c.first, c.second];
        Ok(LinearCoupling { first, second, stiffness, fixed, per_period, force, integral, acceleration })
    };
    couplings.iter().enumerate().map(term).collect()
}

/// The equations of motion of n bodies, see the module documentation. The puck is the last row and column.
#[derive(Clone, Debug, PartialEq)]
pub struct Continuous {
    /// The diagonal of M: n inertias, kg·m².
    pub inertia: DVector<f64>,
    /// K, (n+1) × (n+1), N·m/rad.
    pub stiffness: DMatrix<f64>,
    /// C0, (n+1) × (n+1), N·m·s/rad.
    pub fixed: DMatrix<f64>,
    /// C1, (n+1) × (n+1), N·m/rad.
    pub per_period: DMatrix<f64>,
    /// f, n+1 torques, N·m.
    pub force: DVector<f64>,
}

/// ẋ = a x + b u + constant, with x = (w, ẇ) and u = (z, ż).
#[derive(Clone, Debug, PartialEq)]
pub struct Rates {
    /// 2n × 2n.
    pub a: DMatrix<f64>,
    /// 2n × 2: the columns of z and ż.
    pub b: DMatrix<f64>,
    /// 2n.
    pub constant: DVector<f64>,
}

/// A torque on the puck as a function of the bodies' state x = (w, ẇ) and the puck's u = (z, ż):
/// state · x + puck · u + constant.
#[derive(Clone, Debug, PartialEq)]
pub struct Torque {
    /// 1 × 2n: N·m/rad on the positions, N·m·s/rad on the velocities.
    pub state: RowDVector<f64>,
    /// N·m/rad on z, N·m·s/rad on ż.
    pub puck: [f64; 2],
    /// N·m.
    pub constant: f64,
}

impl Continuous {
    /// The equations of `bodies` joined by `couplings`.
    ///
    /// # Errors
    /// [`Error::NoSuchBody`] when an end is not one of `bodies`; [`Error::Value`] when an inertia is not positive.
    pub fn new(bodies: &[Body], couplings: &[Coupling], slopes: &Slopes) -> Result<Self, Error> {
        let n = bodies.len();
        for body in bodies {
            positive("a body's inertia", body.inertia)?;
        }
        let mut world = Continuous {
            inertia: DVector::from_iterator(n, bodies.iter().map(|b| b.inertia)),
            stiffness: DMatrix::zeros(n + 1, n + 1),
            fixed: DMatrix::zeros(n + 1, n + 1),
            per_period: DMatrix::zeros(n + 1, n + 1),
            force: DVector::zeros(n + 1),
        };
        let row = |end| match end {
            End::Body(body) => Some(body),
            End::Puck => Some(n),
            End::Ground => None,
        };
        for term in linearise(bodies, couplings, slopes)? {
            let b = [(row(term.first), 1.0), (row(term.second), -1.0)];
            for (i, bi) in b.iter().filter_map(|&(i, bi)| Some((i?, bi))) {
                world.force[i] += bi * term.force;
                for (j, bj) in b.iter().filter_map(|&(j, bj)| Some((j?, bj))) {
                    world.stiffness[(i, j)] += bi * bj * term.stiffness;
                    world.fixed[(i, j)] += bi * bj * term.fixed;
                    world.per_period[(i, j)] += bi * bj * term.per_period;
                }
            }
        }
        Ok(world)
    }

    /// Number of bodies.
    pub fn bodies(&self) -> usize {
        self.inertia.len()
    }

    /// C0 + T C1, (n+1) × (n+1).
    pub fn damping(&self, period: f64) -> DMatrix<f64> {
        &self.fixed + period * &self.per_period
    }

    /// The bodies' first-order equations, compensating dampers at this period.
    pub fn rates(&self, period: f64) -> Rates {
        let n = self.bodies();
        let damping = self.damping(period);
        let (mut a, mut b, mut constant) =
            (DMatrix::zeros(2 * n, 2 * n), DMatrix::zeros(2 * n, 2), DVector::zeros(2 * n));
        for i in 0..n {
            a[(i, n + i)] = 1.0;
            for j in 0..n {
                a[(n + i, j)] = -self.stiffness[(i, j)] / self.inertia[i];
                a[(n + i, n + j)] = -damping[(i, j)] / self.inertia[i];
            }
            b[(n + i, 0)] = -self.stiffness[(i, n)] / self.inertia[i];
            b[(n + i, 1)] = -damping[(i, n)] / self.inertia[i];
            constant[n + i] = self.force[i] / self.inertia[i];
        }
        Rates { a, b, constant }
    }

    /// The torque on the puck at an instant, compensating dampers at this period.
    pub fn torque(&self, period: f64) -> Torque {
        let n = self.bodies();
        let damping = self.damping(period);
        let state =
            RowDVector::from_fn(2 * n, |_, j| if j < n { -self.stiffness[(n, j)] } else { -damping[(n, j - n)] });
        Torque { state, puck: [-self.stiffness[(n, n)], -damping[(n, n)]], constant: self.force[n] }
    }
}
