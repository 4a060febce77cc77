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
//! them changes nothing beyond the last bits. A single coupling in contact takes one round. Where the laws are mean torques of convex
//! energies (walls, clamped springs and dampers, Coulomb friction that slides or holds), the equations are the conditions of the
//! minimum of
//!
//! ```text
//! Fᵀ G F/2 + d_freeᵀ F + Σ ψ*(-F),    ψ convex, ψ' = -law
//! ```
//!
//! the sum of a smooth convex function and a separable convex one, for which minimising one coordinate at a time converges (Tseng,
//! J. Optim. Theory Appl. 109, 2001). Between couplings at light bodies this is slow: a step of Newton's method for all torques follows
//! every fourth round. The falling slope of a detent keeps the solution unique while (ωT)²/4 < 1, ω being the frequency of the swing in
//! the detent. Friction that brings a body to rest within the step, and a wall whose damping ends within it, have no such function;
//! in the second half of the rounds friction may only hold or slide, which has one.
//!
//! The number of rounds that this takes has no proved bound, so it is limited. If the torques have not converged by then, those along each line,
//! at one body or between the same two, are solved together (`line.rs`): for one line, and so for every world of one body, by a bracket that can't
//! miss. Several lines are solved in turn, again for a limited number of rounds. If they have not converged either, the energy that
//! those of the last round would add, Σ (F d + V(q') - V(q)), is taken from the bodies' motion; if the bodies have less, they stop where
//! they were. In either case the step gains no energy. [`Contacts`] counts such samples. Over random worlds none occurs as long as
//! the stiffest coupling at the lightest body oscillates by less than two radians a step.

use crate::contact::StepResponse;
use crate::matrix::Vector;
use crate::nonlinear::{LoopLaw, Nonlinear};
use crate::{End, Number, Real};

/// The most rounds over the couplings.
const PASSES: usize = 60;
/// Pivots below this are skipped: the coupling's torque is a combination of others' to these digits.
const LEAST_PIVOT: f64 = 1e-6;

/// The data of the discrete-gradient step, in addition to the couplings and the bodies' response to torques.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gradient<F, const B: usize> {
    pub inertia: [F; B],
    /// 1/T, T the bodies' step.
    pub rate: F,
    /// The number of nonlinear couplings with a body at an end; at least 1.
    pub contacts: usize,
}

/// The inputs of a step.
pub(crate) struct Step<'a, F, const B: usize> {
    pub bodies: usize,
    /// For each body, the motion of all bodies by a unit of torque on it, held over the step.
    pub force: &'a [Vector<F, B>; B],
    pub couplings: &'a [Option<Nonlinear<F>>],
    /// The puck's measured position and velocity.
    pub puck: (F, F),
    pub x: &'a Vector<F, B>,
}

/// The nonlinear torques at bodies that the last step found.
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
    /// The number of steps in which the torques did not converge within the bounded number of passes. Such a step never gains energy.
    pub unsettled: u32,
}

impl<F: Number, const C: usize> Contacts<F, C> {
    pub(crate) const NONE: Self = Contacts { torques: [F::ZERO; C], unsettled: 0 };
}

impl<F: Real, const B: usize> Gradient<F, B> {
    /// Adds the nonlinear torques' motion to `change`, the motion of the bodies without them.
    pub fn step<const C: usize>(
        &self,
        step: &Step<'_, F, B>,
        change: &mut Vector<F, B>,
        contacts: &mut Contacts<F, C>,
    ) {
        contacts.torques = [F::ZERO; C];
        // The number of couplings that have not been solved since another last changed.
        let mut unchecked = self.contacts;
        let mut scale = step.puck.0.abs();
        for pass in 0..PASSES {
            let stops = pass < PASSES / 2;
            for (coupling, torque) in step.couplings.iter().zip(contacts.torques.iter_mut()) {
                let Some(coupling) = at_body(coupling) else { continue };
                if self.solve_one(step, coupling, change, torque, &mut scale, stops) {
                    unchecked = unchecked.saturating_sub(1);
                } else {
                    unchecked = self.contacts.saturating_sub(1);
                }
                if unchecked == 0 {
                    return;
                }
            }
            if pass % 4 == 3 && pass + 1 < PASSES {
                self.newton(step, change, &mut contacts.torques, stops);
                unchecked = self.contacts;
            }
        }
        if !self.by_lines(step, change, &mut contacts.torques, PASSES) {
            contacts.unsettled = contacts.unsettled.saturating_add(1);
            self.dissipate(step, change, &mut contacts.torques);
        }
    }

    /// How the step moves one coupling as a function of its torque.
    #[inline]
    fn response(
        &self,
        step: &Step<'_, F, B>,
        coupling: &Nonlinear<F>,
        change: &Vector<F, B>,
        torque: F,
        stops: bool,
    ) -> StepResponse<F> {
        let start = coupling.relative((step.puck.0, F::ZERO), step.x);
        let moved = coupling.relative((F::ZERO, F::ZERO), change);
        let (compliance, mobility) = step.across(coupling, coupling);
        StepResponse {
            start: start.position,
            free: moved.position - compliance * torque,
            compliance,
            rate: start.velocity + moved.velocity - mobility * torque,
            mobility: if stops { mobility } else { F::ZERO },
            puck_rate: F::from_f64(coupling.sign_at_puck()) * step.puck.1,
        }
    }

    /// One step of Newton's method for all torques at once, from the derivatives of each solution. The passes between such steps bring
    /// each torque back to its own law.
    #[inline(never)]
    fn newton<const C: usize>(
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
            let solution = coupling.solve(&self.response(step, coupling, change, torques[i], stops), self.rate);
            steps[i] = solution.torque - torques[i];
            for j in 0..m {
                if let (Some(other), false) = (at_body(&step.couplings[j]), i == j) {
                    let (position, velocity) = step.across(coupling, other);
                    rows[i][j] = -(solution.by_free * position + solution.by_rate * velocity);
                }
            }
        }
        // Without pivoting: the rows of falling laws are those of a positive definite matrix, each divided by its diagonal.
        let least = F::from_f64(LEAST_PIVOT);
        for k in 0..m {
            let counts = rows[k][k] > least;
            if !counts {
                // A torque that the others determine already, or a NaN, gets no correction.
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

    /// Solves one coupling's torque, the others' held constant. Returns whether it was converged before: to its own last bits, or to
    /// those of `scale`, the largest position or displacement by a torque so far.
    #[inline]
    fn solve_one(
        &self,
        step: &Step<'_, F, B>,
        coupling: &Nonlinear<F>,
        change: &mut Vector<F, B>,
        torque: &mut F,
        scale: &mut F,
        stops: bool,
    ) -> bool {
        let old = *torque;
        if old == F::ZERO && matches!(coupling.curve, LoopLaw::Wall(_)) {
            let start = coupling.relative((step.puck.0, F::ZERO), step.x).position;
            if coupling.is_clear(start, coupling.relative((F::ZERO, F::ZERO), change).position) {
                return true;
            }
        }
        let response = self.response(step, coupling, change, old, stops);
        let new = coupling.solve(&response, self.rate).torque;
        let by = new - old;
        if by == F::ZERO {
            return true;
        }
        step.push(coupling, by, change);
        *torque = new;
        for size in [response.start.abs(), response.free.abs(), response.compliance * new.abs()] {
            if size > *scale {
                *scale = size;
            }
        }
        let bits = F::from_f64(4.0) * F::EPSILON;
        by.abs() <= bits * new.abs() || response.compliance * by.abs() <= bits * *scale
    }

    /// Takes the energy that unconverged torques would add from the bodies' motion.
    fn dissipate<const C: usize>(&self, step: &Step<'_, F, B>, change: &mut Vector<F, B>, torques: &mut [F; C]) {
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
        // A gain within rounding counts as none.
        if gain <= F::from_f64(16.0) * F::EPSILON * size {
            return;
        }
        let bodies = || step.x.velocity.iter().zip(&self.inertia).take(step.bodies);
        let mut moving = F::ZERO;
        for ((v, inertia), dv) in bodies().zip(&change.velocity) {
            moving += F::HALF * *inertia * ((*v + *dv) * (*v + *dv));
        }
        // Scaling velocities by 1 - s leaves (1 - s)² ≤ 1 - s of the energy, which removes at least the gain.
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
    pub(crate) fn push(&self, coupling: &Nonlinear<F>, torque: F, change: &mut Vector<F, B>) {
        for (end, torque) in [(coupling.first, torque), (coupling.second, -torque)] {
            if let End::Body(j) = end {
                if let Some(response) = self.force.get(j) {
                    change.add(self.bodies, torque, response);
                }
            }
        }
    }

    /// The change of another coupling's q and q̇ by a unit of torque at this one.
    #[inline]
    pub(crate) fn across(&self, one: &Nonlinear<F>, other: &Nonlinear<F>) -> (F, F) {
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
pub(crate) fn at_body<F: Real>(coupling: &Option<Nonlinear<F>>) -> Option<&Nonlinear<F>> {
    coupling.as_ref().filter(|coupling| coupling.at_body())
}
