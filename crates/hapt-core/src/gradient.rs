//! The discrete-gradient step of docs/contract.md, section 4: nonlinear couplings at bodies under zoh, trapezoidal and backward
//! Euler, which never gain energy.
//!
//! With constant torques F at the couplings, the linear part of the world moves by its method, and the couplings' ends by
//!
//! ```text
//! d = d_free + G F,    G = Bᵀ P B
//! ```
//!
//! P being the bodies' displacement by a unit of held torque and B the couplings' ends. With z held these methods change the
//! linear part's energy by F·d, less what is damped. P is symmetric, for M, C and K are; and fᵀPf is what a torque f held from rest
//! has stored or damped after T, so that G is positive semidefinite for every world and period. A coupling that stores V exerts
//! F = -(V(q') - V(q))/d, whose work F d is exactly what V loses; what is added to that opposes d. The sum never gains (Itoh and
//! Abe, J. Comput. Phys. 76, 1988; Gonzalez, J. Nonlinear Sci. 6, 1996).
//!
//! The torques are found coupling by coupling (Gauss-Seidel), each by its own scalar equation (`contact.rs`), until a round of
//! them moves nothing beyond the last bits. A coupling that is alone in contact takes one. Where the laws are mean torques of convex
//! energies (walls, clamped springs and dampers, Coulomb friction that slides or holds), the equations are the conditions of the
//! least
//!
//! ```text
//! Fᵀ G F/2 + d_freeᵀ F + Σ ψ*(-F),    ψ convex, ψ' = -law
//! ```
//!
//! a smooth convex function and a separable one, on which the minimisation one coordinate at a time converges (Tseng, J. Optim.
//! Theory Appl. 109, 2001). Where couplings pull at each other through light bodies it does so slowly: every fourth round is followed by
//! a step of Newton's for all at once. Falling slopes of detents are milder than the line as long as (ωT)²/4 < 1, ω being the swing
//! in the detent. Friction that brings a body to rest within the step, and a wall's damping that ends in it, have no such function;
//! in the second half of the rounds friction is left to hold or slide, which has.
//!
//! No bound on the rounds is proved, so there is one, and what is proved is the end: the energy that the torques of the last round
//! would make, Σ (F d + V(q') - V(q)), is taken from the bodies' motion; if they have less, they stop where they were. Either way the
//! step gains nothing. [`Contacts`] counts such samples. Over random worlds there is none as long as the stiffest coupling at the
//! lightest body turns by less than two radians a step.

use crate::contact::Gap;
use crate::matrix::Vector;
use crate::nonlinear::{Curve, Nonlinear};
use crate::{End, Number, Real};

/// Rounds over the couplings before the step is given up.
const PASSES: usize = 60;
/// A coupling whose torque is a sum of others' to these digits adds nothing.
const LEAST_PIVOT: f64 = 1e-6;

/// What the discrete-gradient step needs beside the couplings and the bodies' response to torques.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gradient<F, const B: usize> {
    pub inertia: [F; B],
    /// 1/T
    pub rate: F,
    /// How many nonlinear couplings have a body at an end; at least 1.
    pub contacts: usize,
}

/// What a step starts from.
pub(crate) struct Step<'a, F, const B: usize> {
    pub bodies: usize,
    /// The bodies' response to a torque held over the step, one a body that it stands on.
    pub force: &'a [Vector<F, B>; B],
    pub couplings: &'a [Option<Nonlinear<F>>],
    /// The puck's measured position and velocity.
    pub puck: (F, F),
    pub x: &'a Vector<F, B>,
}

/// The step's nonlinear torques at bodies, as found.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(serialize = "F: serde::Serialize", deserialize = "F: crate::Number + serde::Deserialize<'de>"))
)]
pub struct Contacts<F, const C: usize> {
    /// Each coupling's torque on its first end over the last step in N·m (linear: N); 0 where it is linear, has no body at an end,
    /// or the method is explicit.
    #[cfg_attr(feature = "serde", serde(with = "crate::array"))]
    pub torques: [F; C],
    /// In how many steps the torques did not agree within the bounded number of passes; those steps lose energy, if anything.
    pub unsettled: u32,
}

impl<F: Number, const C: usize> Contacts<F, C> {
    pub(crate) const NONE: Self = Contacts { torques: [F::ZERO; C], unsettled: 0 };
}

impl<F: Real, const B: usize> Gradient<F, B> {
    /// Takes `change`, the motion of the bodies without nonlinear torques, to the motion with them.
    pub fn step<const C: usize>(
        &self,
        step: &Step<'_, F, B>,
        change: &mut Vector<F, B>,
        contacts: &mut Contacts<F, C>,
    ) {
        contacts.torques = [F::ZERO; C];
        // How many couplings have not been looked at since another last moved.
        let mut unsure = self.contacts;
        let mut scale = step.puck.0.abs();
        for pass in 0..PASSES {
            let stops = pass < PASSES / 2;
            for (coupling, torque) in step.couplings.iter().zip(contacts.torques.iter_mut()) {
                let Some(coupling) = at_body(coupling) else { continue };
                if self.settle(step, coupling, change, torque, &mut scale, stops) {
                    unsure = unsure.saturating_sub(1);
                } else {
                    unsure = self.contacts.saturating_sub(1);
                }
                if unsure == 0 {
                    return;
                }
            }
            if pass % 4 == 3 && pass + 1 < PASSES {
                self.agree(step, change, &mut contacts.torques, stops);
                unsure = self.contacts;
            }
        }
        contacts.unsettled = contacts.unsettled.saturating_add(1);
        self.lose(step, change, &mut contacts.torques);
    }

    /// What the step leaves to one coupling.
    #[inline]
    fn gap(
        &self,
        step: &Step<'_, F, B>,
        coupling: &Nonlinear<F>,
        change: &Vector<F, B>,
        torque: F,
        stops: bool,
    ) -> Gap<F> {
        let start = coupling.relative((step.puck.0, F::ZERO), step.x);
        let moved = coupling.relative((F::ZERO, F::ZERO), change);
        let (compliance, mobility) = step.across(coupling, coupling);
        Gap {
            start: start.position,
            free: moved.position - compliance * torque,
            compliance,
            rate: start.velocity + moved.velocity - mobility * torque,
            mobility: if stops { mobility } else { F::ZERO },
            carried: coupling.sign_at_puck() * step.puck.1,
        }
    }

    /// All torques at once, by a step of Newton's: as if each went on following the others as it does here. The passes between
    /// such steps see to it that each stays within its law.
    #[inline(never)]
    fn agree<const C: usize>(
        &self,
        step: &Step<'_, F, B>,
        change: &mut Vector<F, B>,
        torques: &mut [F; C],
        stops: bool,
    ) {
        let m = step.couplings.len().min(C);
        let mut rows = [[F::ZERO; C]; C];
        let mut steps = [F::ZERO; C];
        for i in 0..m {
            rows[i][i] = F::ONE;
            let Some(coupling) = at_body(&step.couplings[i]) else { continue };
            let answer = coupling.held(&self.gap(step, coupling, change, torques[i], stops), self.rate);
            steps[i] = answer.torque - torques[i];
            for j in 0..m {
                if let (Some(other), false) = (at_body(&step.couplings[j]), i == j) {
                    let (position, velocity) = step.across(coupling, other);
                    rows[i][j] = -(answer.by_free * position + answer.by_rate * velocity);
                }
            }
        }
        // Without pivoting: the rows of falling laws are those of a positive definite matrix, each divided by its diagonal.
        let least = F::from_f64(LEAST_PIVOT);
        for k in 0..m {
            let counts = rows[k][k] > least;
            if !counts {
                // What the others hold already need not be held again; nor does what is no number.
                rows[k] = [F::ZERO; C];
                rows[k][k] = F::ONE;
                steps[k] = F::ZERO;
            }
            for i in k + 1..m {
                let part = rows[i][k] / rows[k][k];
                if part != F::ZERO {
                    for j in k..m {
                        let x = rows[k][j];
                        rows[i][j] -= part * x;
                    }
                    let x = steps[k];
                    steps[i] -= part * x;
                }
            }
        }
        for i in (0..m).rev() {
            for j in i + 1..m {
                let x = steps[j];
                steps[i] -= rows[i][j] * x;
            }
            steps[i] = steps[i] / rows[i][i];
        }
        for i in 0..m {
            if let (Some(coupling), true) = (at_body(&step.couplings[i]), steps[i].is_finite()) {
                step.push(coupling, steps[i], change);
                torques[i] += steps[i];
            }
        }
    }

    /// One coupling's torque anew, the others' held. Whether it was right already: to the last bits of its own, or of the largest
    /// position or displacement by a torque, `scale`.
    #[inline]
    fn settle(
        &self,
        step: &Step<'_, F, B>,
        coupling: &Nonlinear<F>,
        change: &mut Vector<F, B>,
        torque: &mut F,
        scale: &mut F,
        stops: bool,
    ) -> bool {
        let old = *torque;
        if old == F::ZERO && matches!(coupling.curve, Curve::Wall(_)) {
            let start = coupling.relative((step.puck.0, F::ZERO), step.x).position;
            if coupling.is_clear(start, coupling.relative((F::ZERO, F::ZERO), change).position) {
                return true;
            }
        }
        let gap = self.gap(step, coupling, change, old, stops);
        let new = coupling.held(&gap, self.rate).torque;
        let by = new - old;
        if by == F::ZERO {
            return true;
        }
        step.push(coupling, by, change);
        *torque = new;
        for size in [gap.start.abs(), gap.free.abs(), gap.compliance * new.abs()] {
            if size > *scale {
                *scale = size;
            }
        }
        let bits = F::from_f64(4.0) * F::EPSILON;
        by.abs() <= bits * new.abs() || gap.compliance * by.abs() <= bits * *scale
    }

    /// What torques that do not agree would give is taken from the bodies' motion.
    fn lose<const C: usize>(&self, step: &Step<'_, F, B>, change: &mut Vector<F, B>, torques: &mut [F; C]) {
        let (mut gain, mut size) = (F::ZERO, F::ZERO);
        for (coupling, torque) in step.couplings.iter().zip(torques.iter()) {
            if let Some(coupling) = at_body(coupling) {
                let start = coupling.relative((step.puck.0, F::ZERO), step.x).position;
                let distance = coupling.relative((F::ZERO, F::ZERO), change).position;
                let slope = coupling.stored_slope(start, distance);
                gain += (*torque + slope) * distance;
                size += (torque.abs() + slope.abs()) * (start.abs() + distance.abs());
            }
        }
        // Rounding is no gain.
        if gain <= F::from_f64(16.0) * F::EPSILON * size {
            return;
        }
        let bodies = || step.x.velocity.iter().zip(&self.inertia).take(step.bodies);
        let mut moving = F::ZERO;
        for ((v, inertia), dv) in bodies().zip(&change.velocity) {
            moving += F::HALF * *inertia * ((*v + *dv) * (*v + *dv));
        }
        // (1 - s)² ≤ 1 - s: more than enough.
        let kept = if gain < moving { F::ONE - gain / moving } else { F::ZERO };
        if kept <= F::ZERO {
            change.position = [F::ZERO; B];
            *torques = [F::ZERO; C];
        }
        for ((v, _), dv) in bodies().zip(change.velocity.iter_mut()) {
            *dv = kept * (*v + *dv) - *v;
        }
    }
}

impl<F: Real, const B: usize> Step<'_, F, B> {
    /// change += response to a coupling's torque on its two ends
    #[inline]
    fn push(&self, coupling: &Nonlinear<F>, torque: F, change: &mut Vector<F, B>) {
        for (end, torque) in [(coupling.first, torque), (coupling.second, -torque)] {
            if let End::Body(j) = end {
                if let Some(response) = self.force.get(j) {
                    change.add(self.bodies, torque, response);
                }
            }
        }
    }

    /// How far a unit of torque at one coupling moves the ends of another apart, in position and in velocity.
    #[inline]
    fn across(&self, one: &Nonlinear<F>, other: &Nonlinear<F>) -> (F, F) {
        let entry = |i: End, j: End| {
            let (End::Body(i), End::Body(j)) = (i, j) else { return (F::ZERO, F::ZERO) };
            let of = |row: Option<&F>| row.copied().unwrap_or(F::ZERO);
            self.force.get(j).map_or((F::ZERO, F::ZERO), |r| (of(r.position.get(i)), of(r.velocity.get(i))))
        };
        let (a, b) = (entry(one.first, other.first), entry(one.second, other.second));
        let (c, d) = (entry(one.first, other.second), entry(one.second, other.first));
        (a.0 + b.0 - (c.0 + d.0), a.1 + b.1 - (c.1 + d.1))
    }
}

/// A coupling with a body at an end.
#[inline]
fn at_body<F: Real>(coupling: &Option<Nonlinear<F>>) -> Option<&Nonlinear<F>> {
    coupling.as_ref().filter(|coupling| coupling.at_body())
}
