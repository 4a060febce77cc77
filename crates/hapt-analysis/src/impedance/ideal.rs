//! The world as its differential equations would be felt: nothing sampled, nothing late.
//!
//! The puck's own part of the world, from its links: y = k + jωc. Let p be the links of the bodies to the puck, g what holds a body
//! back by itself, its link to ground and its inertia, g = y - ω²J (the puck's own link to ground among them), and A the bodies'
//! matrix, A 1 = p + g. The torque that resists the puck at 1 is, by what the bodies do or by what they do more than the puck,
//!
//! ```text
//! K = g_puck + Σ p - pᵀ A⁻¹ p = Σ g - gᵀ A⁻¹ g
//! ```
//!
//! The first keeps its digits at high frequencies, and the second toward 0 Hz: where nothing ties the world to ground, g is
//! inertia alone, and none of it is lost beside the springs.

use hapt_model::{Method, World};
use nalgebra::{Complex, DMatrix, DVector};

use crate::equations::continuous::Slopes;
use crate::equations::structure::{Link, Part, inertias_with_puck, parts, with_puck};
use crate::error::Error;

type C = Complex<f64>;

/// The puck's part of the world, the puck its first member.
#[derive(Clone, Debug)]
pub(crate) struct Ideal {
    part: Part,
}

/// What the puck is tied to: what a slow hand feels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Tied {
    /// Springs lead to ground: the stiffness of them all.
    Spring(f64),
    /// Only dampers do: their damping, and the inertia that springs tie to the puck.
    Damper(f64, f64),
    /// Nothing does: the inertia that is taken along.
    Not(f64),
}

impl Ideal {
    /// Of `world`, nonlinear couplings on `slopes`. Compensating dampers undo what forward Euler adds, so there they are left
    /// out; under any other method they damp.
    ///
    /// # Errors
    /// [`Error::Value`] for an inertia that is not positive, [`Error::NoSuchBody`].
    pub fn new(world: &World, slopes: &Slopes) -> Result<Ideal, Error> {
        let inertia = inertias_with_puck(world)?;
        let mut ties = with_puck(&world.bodies, &world.couplings, slopes)?;
        for tie in &mut ties {
            tie.fixed += match world.sampling.method {
                Method::ForwardEuler => 0.0,
                Method::BackwardEuler
                | Method::SemiImplicitEuler
                | Method::Trapezoidal
                | Method::Zoh
                | Method::Rk4
                | Method::Tustin
                | Method::Foh => world.sampling.period * tie.per_period,
            };
            tie.per_period = 0.0;
        }
        // Every part begins with its first member, and the puck is the first of all.
        let part = parts(&inertia, &ties).swap_remove(0);
        Ok(Ideal { part })
    }

    /// K(jω) for ω > 0; `None` where it is infinite, or beyond double precision.
    pub fn at(&self, omega: f64) -> Option<C> {
        let own = self.part.inertia.iter().map(|inertia| C::from(-omega * omega * inertia));
        let own: Vec<C> = std::iter::once(C::from(0.0)).chain(own.skip(1)).collect();
        let same: Vec<usize> = (0..own.len()).collect();
        condensed(own, &same, &self.part.links, |link| C::new(link.stiffness, omega * link.fixed))
    }

    /// What a slow hand feels.
    pub fn tied(&self) -> Tied {
        let part = &self.part;
        // The puck's cluster first.
        let mut clusters = part.clusters.clone();
        clusters.sort_by_key(|cluster| !cluster.bodies.contains(&0));
        let inertia =
            |bodies: &mut dyn Iterator<Item = usize>| bodies.filter(|&i| i > 0).map(|i| part.inertia[i]).sum();
        let Some(own) = clusters.first() else { return Tied::Not(0.0) };
        if own.anchored {
            let bodies: Vec<usize> = (0..part.inertia.len())
                .map(|i| own.bodies.iter().position(|&b| b == i).unwrap_or(usize::MAX))
                .collect();
            let springs: Vec<Link> = part.links.iter().filter(|l| l.stiffness > 0.0).copied().collect();
            let still = vec![C::from(0.0); own.bodies.len()];
            let found = condensed(still, &bodies, &springs, |link| C::from(link.stiffness));
            return Tied::Spring(found.map_or(0.0, |k| k.re));
        }
        if !part.tied {
            return Tied::Not(inertia(&mut (0..part.inertia.len())));
        }
        // Slowly moved, what springs tie together is one; a cluster that is anchored stands still with the ground.
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
        let found = condensed(vec![C::from(0.0); moving.len()], &same, &dampers, |link| C::from(link.fixed));
        Tied::Damper(found.map_or(0.0, |c| c.re), inertia(&mut own.bodies.iter().copied()))
    }
}

/// K of the module's head: `own` is what each node has by itself, the puck's first, `node` where a link's body is among them,
/// `of` a link's y. `None` where A is singular.
fn condensed(own: Vec<C>, node: &[usize], links: &[Link], of: impl Fn(&Link) -> C) -> Option<C> {
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
