//! The parts of a world that move independently, found on the graph of couplings and never by rounding.
//!
//! With the puck held, puck and ground form one fixed side. A part is a connected component of the graph: bodies joined by
//! couplings, directly or through other bodies. Within a part, bodies joined by springs form clusters. A cluster without a spring to
//! the fixed side can shift as a whole without loading a spring: that is an eigenvalue of exactly 1 under every method. A part
//! without spring and damper to the fixed side also conserves its momentum: a second eigenvalue 1. Together they are a double 1,
//! which an eigenvalue solver splits by √eps, into a growth of ±5e-7 1/s at 1 ms. They are therefore removed before any solver runs.

use hapt_model::{Body, Coupling, End, World};

use crate::equations::continuous::{LinearCoupling, Slopes, linearise};
use crate::equations::laws::Acceleration;
use crate::error::{Error, positive};

/// All couplings between one pair of ends, summed. At least one of the three is above 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Link {
    /// A body, by its index in the part.
    pub body: usize,
    /// Another body; `None`: the fixed side.
    pub other: Option<usize>,
    pub stiffness: f64,
    pub fixed: f64,
    pub per_period: f64,
}

/// Bodies joined by springs.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Cluster {
    /// By index in the part.
    pub bodies: Vec<usize>,
    /// Whether a spring joins them to the fixed side.
    pub anchored: bool,
}

/// A connected component: bodies that are coupled to one another and to no others.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Part {
    /// The bodies' indices in the world.
    pub members: Vec<usize>,
    /// Of each body.
    pub inertia: Vec<f64>,
    pub links: Vec<Link>,
    pub clusters: Vec<Cluster>,
    /// Whether any spring or damper joins them to the fixed side.
    pub grounded: bool,
    /// The gain of the integral terms between the puck, its first member, and ground, N·m/(rad·s); 0: none.
    pub integral: f64,
    /// The torques along the acceleration between them.
    pub accelerations: Vec<Acceleration>,
}

impl Part {
    /// Adds a spring and a damper, not both 0, from a body to the fixed side.
    pub fn fix(&mut self, body: usize, stiffness: f64, damping: f64) {
        self.links.push(Link { body, other: None, stiffness, fixed: damping, per_period: 0.0 });
        self.grounded = true;
        if stiffness > 0.0 {
            self.clusters.iter_mut().filter(|c| c.bodies.contains(&body)).for_each(|c| c.anchored = true);
        }
    }

    /// Adds a body that a spring above 0 and a damper join to the body `to`; gives its place.
    pub fn add(&mut self, inertia: f64, to: usize, stiffness: f64, damping: f64) -> usize {
        let place = self.inertia.len();
        self.inertia.push(inertia);
        self.members.push(self.members.iter().max().map_or(0, |last| last + 1));
        self.links.push(Link { body: to, other: Some(place), stiffness, fixed: damping, per_period: 0.0 });
        self.clusters.iter_mut().filter(|c| c.bodies.contains(&to)).for_each(|c| c.bodies.push(place));
        place
    }
}

/// The label of each of `n` nodes after joining the pairs: the smallest index in its group.
fn groups(n: usize, pairs: impl Iterator<Item = (usize, usize)>) -> Vec<usize> {
    let mut label: Vec<usize> = (0..n).collect();
    for (a, b) in pairs {
        let (keep, gone) = (label[a].min(label[b]), label[a].max(label[b]));
        label.iter_mut().filter(|l| **l == gone).for_each(|l| *l = keep);
    }
    label
}

/// The links of all linear couplings, one per pair of ends, without those of no stiffness and no damping.
fn links(terms: &[LinearCoupling]) -> Vec<Link> {
    let mut links: Vec<Link> = Vec::new();
    for term in terms {
        let (body, other) = match (term.first, term.second) {
            (End::Body(a), End::Body(b)) if a != b => (a.min(b), Some(a.max(b))),
            (End::Body(a), End::Puck | End::Ground) | (End::Puck | End::Ground, End::Body(a)) => (a, None),
            (End::Body(_), End::Body(_)) | (End::Puck | End::Ground, End::Puck | End::Ground) => continue,
        };
        if term.stiffness == 0.0 && term.fixed == 0.0 && term.per_period == 0.0 {
            continue;
        }
        let at = links.iter().position(|l| l.body == body && l.other == other).unwrap_or_else(|| {
            links.push(Link { body, other, stiffness: 0.0, fixed: 0.0, per_period: 0.0 });
            links.len() - 1
        });
        links[at].stiffness += term.stiffness;
        links[at].fixed += term.fixed;
        links[at].per_period += term.per_period;
    }
    links
}

impl Link {
    /// The same link with the first member of the part as the fixed side.
    pub fn held(&self) -> Link {
        match (self.body, self.other) {
            (0, Some(other)) => Link { body: other - 1, other: None, ..*self },
            (body, other) => Link { body: body.saturating_sub(1), other: other.map(|i| i - 1), ..*self },
        }
    }
}

/// The part with its first member fixed to ground.
pub(crate) fn first_fixed(part: &Part) -> Part {
    let n = part.inertia.len() - 1;
    let links: Vec<Link> = part.links.iter().filter(|l| (l.body, l.other) != (0, None)).map(Link::held).collect();
    let spring = groups(n, links.iter().filter(|l| l.stiffness > 0.0).filter_map(|l| Some((l.body, l.other?))));
    let anchored = |label| links.iter().any(|l| l.other.is_none() && l.stiffness > 0.0 && spring[l.body] == label);
    let clusters = (0..n)
        .filter(|&i| spring[i] == i)
        .map(|label| Cluster { bodies: (0..n).filter(|&i| spring[i] == label).collect(), anchored: anchored(label) });
    let clusters = clusters.collect();
    let (members, inertia) = (part.members[1..].to_vec(), part.inertia[1..].to_vec());
    let grounded = links.iter().any(|l| l.other.is_none());
    Part { members, inertia, grounded, clusters, links, integral: 0.0, accelerations: Vec::new() }
}

/// Whether a coupling joins this body to the fixed side.
fn is_at(term: &LinearCoupling, body: usize) -> bool {
    match (term.first, term.second) {
        (End::Body(a), End::Puck | End::Ground) | (End::Puck | End::Ground, End::Body(a)) => a == body,
        (End::Body(_), End::Body(_)) | (End::Puck | End::Ground, End::Puck | End::Ground) => false,
    }
}

/// Splits a world into its connected components.
pub(crate) fn parts(inertia: &[f64], terms: &[LinearCoupling]) -> Vec<Part> {
    let n = inertia.len();
    let links = links(terms);
    let pair = |l: &Link| Some((l.body, l.other?));
    let part = groups(n, links.iter().filter_map(pair));
    let spring = groups(n, links.iter().filter(|l| l.stiffness > 0.0).filter_map(pair));
    (0..n)
        .filter(|&first| part[first] == first)
        .map(|first| {
            let members: Vec<usize> = (0..n).filter(|&i| part[i] == first).collect();
            let local = |body: usize| members.binary_search(&body).unwrap_or(0);
            let of_part: Vec<Link> = links.iter().filter(|l| part[l.body] == first).copied().collect();
            let clusters = members
                .iter()
                .filter(|&&i| spring[i] == i)
                .map(|&label| Cluster {
                    bodies: members.iter().filter(|&&i| spring[i] == label).map(|&i| local(i)).collect(),
                    anchored: of_part.iter().any(|l| l.other.is_none() && l.stiffness > 0.0 && spring[l.body] == label),
                })
                .collect();
            Part {
                inertia: members.iter().map(|&i| inertia[i]).collect(),
                grounded: of_part.iter().any(|l| l.other.is_none()),
                clusters,
                integral: terms.iter().filter(|t| is_at(t, first)).map(|t| t.integral).sum(),
                accelerations: terms.iter().filter(|t| is_at(t, first)).filter_map(|t| t.acceleration).collect(),
                links: of_part.iter().map(|l| Link { body: local(l.body), other: l.other.map(local), ..*l }).collect(),
                members,
            }
        })
        .collect()
}

/// The inertias of bodies, kg·m².
///
/// # Errors
/// [`Error::Value`] for one that is not positive.
pub(crate) fn inertias(bodies: &[Body]) -> Result<Vec<f64>, Error> {
    bodies.iter().map(|body| positive("a body's inertia", body.inertia)).collect()
}

/// The inertias of the puck, first, and the bodies.
///
/// # Errors
/// [`Error::Value`] for one that is not positive.
pub(crate) fn inertias_with_puck(world: &World) -> Result<Vec<f64>, Error> {
    let mut inertia = vec![positive("the device's inertia", world.device.inertia)?];
    inertia.extend(inertias(&world.bodies)?);
    Ok(inertia)
}

/// The linearised couplings of the world with the puck as body 0.
pub(crate) fn linearise_with_puck(
    bodies: &[Body],
    couplings: &[Coupling],
    slopes: &Slopes,
) -> Result<Vec<LinearCoupling>, Error> {
    let end = |end| match end {
        End::Puck => End::Body(0),
        End::Body(i) => End::Body(i + 1),
        End::Ground => End::Ground,
    };
    let term = |term: LinearCoupling| LinearCoupling { first: end(term.first), second: end(term.second), ..term };
    Ok(linearise(bodies, couplings, slopes)?.into_iter().map(term).collect())
}
