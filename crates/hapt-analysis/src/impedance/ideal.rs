//! The ideal impedance: that of the differential equations, without sampling and delay.
//!
//! The part of the world with the puck, from its links: y = k + jωc. Let p be the links of the bodies to the puck, g the link of each
//! body to ground and its inertia, g = y - ω²J (for the puck only its link to ground), and A the matrix of the bodies, A 1 = p + g.
//! The torque that resists a unit motion of the puck is, with absolute or with relative motions of the bodies,
//!
//! ```text
//! K = g_puck + Σ p - pᵀ A⁻¹ p = Σ g - gᵀ A⁻¹ g
//! ```
//!
//! The first is accurate at high frequencies, the second toward 0 Hz: without a coupling to ground, g is only inertia, which the springs do
//! not cancel.

use hapt_model::{Method, World};
use nalgebra::{Complex, DMatrix, DVector};

use crate::equations::continuous::Slopes;
use crate::equations::laws::Acceleration;
use crate::equations::structure::{Link, Part, inertias_with_puck, linearise_with_puck, parts};
use crate::error::Error;

type C = Complex<f64>;

/// The part of the world that contains the puck, its first member.
#[derive(Clone, Debug)]
pub(crate) struct Ideal {
    part: Part,
}

/// The low-frequency form of the impedance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum LowFrequency {
    /// Springs lead to ground: their total stiffness.
    Spring(f64),
    /// Only dampers lead to ground: their damping, and the inertia that springs join to the puck.
    Damper(f64, f64),
    /// No coupling leads to ground: the inertia that moves with the puck.
    Free(f64),
}

impl Ideal {
    /// Of `world`, nonlinear couplings linearised at `slopes`. Compensating dampers cancel the growth of forward Euler, so there they
    /// are omitted; under any other method they damp.
    ///
    /// # Errors
    /// [`Error::Value`] for an inertia that is not positive, [`Error::NoSuchBody`].
    pub fn new(world: &World, slopes: &Slopes) -> Result<Ideal, Error> {
        let inertia = inertias_with_puck(world)?;
        let mut terms = linearise_with_puck(&world.bodies, &world.couplings, slopes)?;
        for term in &mut terms {
            term.fixed += match world.sampling.method {
                Method::ForwardEuler => 0.0,
                Method::BackwardEuler
                | Method::SemiImplicitEuler
                | Method::Trapezoidal
                | Method::Zoh
                | Method::Rk4
                | Method::Tustin
                | Method::Foh => world.sampling.period * term.per_period,
            };
            term.per_period = 0.0;
        }
        // The first part contains body 0, the puck.
        let part = parts(&inertia, &terms).swap_remove(0);
        Ok(Ideal { part })
    }

    /// K(jω) for ω > 0; `None` where it is infinite, or beyond double precision.
    pub fn at(&self, omega: f64) -> Option<C> {
        let own = self.part.inertia.iter().map(|inertia| C::from(-omega * omega * inertia));
        let own: Vec<C> = std::iter::once(C::from(0.0)).chain(own.skip(1)).collect();
        let same: Vec<usize> = (0..own.len()).collect();
        let rest = condense(own, &same, &self.part.links, |link| C::new(link.stiffness, omega * link.fixed))?;
        // A torque J_c z̈ behind its low-pass is an inertia of -J_c.
        let along = |a: &Acceleration| omega * omega * a.inertia / C::new(1.0, omega * a.tau);
        let accelerations: C = self.part.accelerations.iter().map(along).sum();
        Some(rest + C::new(0.0, -self.part.integral / omega) + accelerations)
    }

    /// The low-frequency form.
    pub fn low_frequency(&self) -> LowFrequency {
        let part = &self.part;
        // The puck's cluster first.
        let mut clusters = part.clusters.clone();
        clusters.sort_by_key(|cluster| !cluster.bodies.contains(&0));
        let compensated: f64 = part.accelerations.iter().map(|a| a.inertia).sum();
        let inertia = |bodies: &mut dyn Iterator<Item = usize>| {
            bodies.filter(|&i| i > 0).map(|i| part.inertia[i]).sum::<f64>() - compensated
        };
        let Some(own) = clusters.first() else { return LowFrequency::Free(0.0) };
        if own.anchored {
            let bodies: Vec<usize> = (0..part.inertia.len())
                .map(|i| own.bodies.iter().position(|&b| b == i).unwrap_or(usize::MAX))
                .collect();
            let springs: Vec<Link> = part.links.iter().filter(|l| l.stiffness > 0.0).copied().collect();
            let still = vec![C::from(0.0); own.bodies.len()];
            let found = condense(still, &bodies, &springs, |link| C::from(link.stiffness));
            return LowFrequency::Spring(found.map_or(0.0, |k| k.re));
        }
        if !part.grounded {
            return LowFrequency::Free(inertia(&mut (0..part.inertia.len())));
        }
        // At low frequency a cluster moves as one body, and an anchored cluster is at rest.
        let of = |body: usize| clusters.iter().position(|c| c.bodies.contains(&body)).unwrap_or(0);
        let moving: Vec<usize> = (0..clusters.len()).filter(|&c| !clusters[c].anchored).collect();
        let node = |body: usize| moving.iter().position(|&c| c == of(body));
        let dampers = part.links.iter().filter(|l| l.fixed > 0.0).filter_map(|link| {
            let (body, other) = (node(link.body), link.other.and_then(node));
            let (body, other) = match (body, other) {
                (Some(a), Some(b)) => (a.min(b), Some(a.max(b))),
                (Some(a), None) | (None, Some(a)) => (a, None),
                (None, None) => return None,
            };
            (Some(body) != other).then_some(Link { body, other, ..*link })
        });
        let dampers: Vec<Link> = dampers.collect();
        let same: Vec<usize> = (0..moving.len()).collect();
        let found = condense(vec![C::from(0.0); moving.len()], &same, &dampers, |link| C::from(link.fixed));
        LowFrequency::Damper(found.map_or(0.0, |c| c.re), inertia(&mut own.bodies.iter().copied()))
    }
}

/// K of the module documentation by static condensation. `own` has the inertia of each node, the puck first; `node` maps a body to
/// its node; `of` is y of a link. `None` where A is singular.
fn condense(own: Vec<C>, node: &[usize], links: &[Link], of: impl Fn(&Link) -> C) -> Option<C> {
    let n = own.len() - 1;
    let mut g = DVector::from_vec(own);
    let mut p = DVector::<C>::zeros(n);
    let mut a = DMatrix::from_diagonal(&g.rows(1, n).into_owned());
    for link in links {
        let (y, i) = (of(link), node[link.body]);
        let j = link.other.map(|other| node[other]);
        if i > n || j.is_some_and(|j| j > n) {
            continue;
        }
        for body in [Some(i), j].into_iter().flatten().filter(|node| *node > 0) {
            a[(body - 1, body - 1)] += y;
        }
        match (i.min(j.unwrap_or(i)), i.max(j.unwrap_or(i))) {
            _ if j.is_none() => g[i] += y,
            (0, body) => p[body - 1] += y,
            (i, j) => {
                a[(i - 1, j - 1)] -= y;
                a[(j - 1, i - 1)] -= y;
            }
        }
    }
    let rest = g.rows(1, n).into_owned();
    let (one, side) = if rest.lp_norm(1) < p.lp_norm(1) { (g.sum(), rest) } else { (g[0] + p.sum(), p) };
    let solved = if n > 0 { a.lu().solve(&side)? } else { side.clone() };
    let k = one - side.dot(&solved);
    (k.re.is_finite() && k.im.is_finite()).then_some(k)
}
