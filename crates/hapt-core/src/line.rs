//! The couplings at one body, or between the same two, over one step, all at once.
//!
//! Where the torques are found coupling by coupling, steep detents in parallel may drive each other to and fro between their rests. But
//! all couplings between the same bodies see one displacement d, so that together they have one equation in one unknown:
//!
//! ```text
//! d = free + G (Σ F(d) + friction)
//! ```
//!
//! Coulomb friction of all of them is that of their levels' sum, a continuous function of the other torques. The residual is negative at one end of
//! the reach of all torques, and positive at the other: a bracket can't miss, and the search begins at the motion without the couplings. It
//! ends in two neighbouring numbers. Each torque is interpolated between its values there so that the line is satisfied: the damping of a
//! wall that ends at the edge is included in part.

use crate::Real;
use crate::contact::{StepResponse, enclose_nearest, within};
use crate::gradient::{Gradient, Step, at_body};
use crate::law::Coulomb;
use crate::matrix::Vector;
use crate::nonlinear::Nonlinear;

/// The couplings along a line, relative to the first of them.
struct Line<'a, F, const B: usize> {
    step: &'a Step<'a, F, B>,
    leader: &'a Nonlinear<F>,
    rate: F,
    /// Of all of its friction.
    level: F,
    response: StepResponse<F>,
}

impl<'a, F: Real, const B: usize> Line<'a, F, B> {
    /// The couplings along it: index, coupling, and its sign there.
    fn members(&self) -> impl Iterator<Item = (usize, &'a Nonlinear<F>, F)> + use<'_, 'a, F, B> {
        let at = |(place, coupling)| {
            let coupling = at_body(coupling)?;
            Some((place, coupling, coupling.along(self.leader)?))
        };
        self.step.couplings.iter().enumerate().filter_map(at)
    }

    /// Where a coupling starts, and the part of its velocity that is due to the puck.
    fn start(&self, coupling: &Nonlinear<F>) -> (F, F) {
        let start = coupling.relative((self.step.puck.0, F::ZERO), self.step.x).position;
        (start, F::from_f64(coupling.sign_at_puck()) * self.step.puck.1)
    }

    /// A member's torque on its own first end where the leader's ends move by `distance`, without friction.
    fn torque(&self, (_, coupling, sign): (usize, &Nonlinear<F>, F), distance: F) -> F {
        let (start, puck_rate) = self.start(coupling);
        coupling.over_step(start, sign * distance, puck_rate, self.rate)
    }

    /// All torques, and friction's among them.
    fn sum(&self, distance: F) -> (F, F) {
        let mut sum = F::ZERO;
        for member in self.members() {
            sum += member.2 * self.torque(member, distance);
        }
        if self.level <= F::ZERO {
            return (sum, F::ZERO);
        }
        let StepResponse { free, rate, compliance, mobility, .. } = self.response;
        let pushed = StepResponse { free: free + compliance * sum, rate: rate + mobility * sum, ..self.response };
        let friction = Coulomb { torque: self.level }.solve(&pushed).torque;
        (sum + friction, friction)
    }
}

impl<F: Real, const B: usize> Gradient<F, B> {
    /// Solves the couplings along each line at once, line after line, with the torques of the others held, until nothing changes. One line, as of one
    /// body, takes one round. Several have no such bound: whether they have settled.
    pub(crate) fn by_lines<const C: usize>(
        &self,
        step: &Step<'_, F, B>,
        change: &mut Vector<F, B>,
        torques: &mut [F; C],
        rounds: usize,
    ) -> bool {
        let leader = |(place, coupling)| {
            let coupling: &Nonlinear<F> = at_body(coupling)?;
            let mut before = step.couplings.iter().take(place).filter_map(at_body);
            before.all(|other| coupling.along(other).is_none()).then_some(coupling)
        };
        let leaders = || step.couplings.iter().enumerate().filter_map(leader);
        let is_one = leaders().count() == 1;
        for round in 0..rounds {
            let mut settled = true;
            for leader in leaders() {
                match self.solve_line(step, leader, change, torques, round < rounds / 2) {
                    Some(was_settled) => settled &= was_settled || is_one,
                    None => return false,
                }
            }
            if settled {
                return true;
            }
        }
        false
    }

    /// Solves one line; whether it was settled before, to the last bits of its motion. `None`, with its torques 0, where numbers are beyond their range.
    fn solve_line<const C: usize>(
        &self,
        step: &Step<'_, F, B>,
        leader: &Nonlinear<F>,
        change: &mut Vector<F, B>,
        torques: &mut [F; C],
        stops: bool,
    ) -> Option<bool> {
        let (compliance, mobility) = step.across(leader, leader);
        let none = StepResponse {
            start: F::ZERO,
            free: F::ZERO,
            compliance,
            rate: F::ZERO,
            mobility: if stops { mobility } else { F::ZERO },
            puck_rate: F::ZERO,
        };
        let mut line = Line { step, leader, rate: self.rate, level: F::ZERO, response: none };
        let before = leader.relative((F::ZERO, F::ZERO), change).position;
        for (place, coupling, _) in line.members() {
            if let Some(torque) = torques.get_mut(place) {
                step.push(coupling, -*torque, change);
                *torque = F::ZERO;
            }
        }
        let start = leader.relative((step.puck.0, F::ZERO), step.x);
        let moved = leader.relative((F::ZERO, F::ZERO), change);
        (line.response.free, line.response.rate) = (moved.position, start.velocity + moved.velocity);
        let free = moved.position;
        let (mut most, mut steepest, mut level) = (F::ZERO, F::ZERO, F::ZERO);
        let mut fine: Option<F> = None;
        for (_, coupling, sign) in line.members() {
            let (start, puck_rate) = line.start(coupling);
            let (bound, slope) = coupling.bounds(start, sign * free, puck_rate, self.rate);
            (most, steepest) = (most + bound, steepest + compliance * slope);
            level += coupling.coulomb().unwrap_or(F::ZERO);
            fine = match (fine, coupling.fine()) {
                (Some(a), Some(b)) => Some(if a < b { a } else { b }),
                (a, b) => a.or(b),
            };
        }
        line.level = level;
        let (low, high) =
            enclose_nearest(&line.response, most, steepest, fine.unwrap_or(F::ZERO), |distance| line.sum(distance).0);
        let residual = |distance: F, sum: F| distance - free - compliance * sum;
        let (at_low, at_high) = (line.sum(low), line.sum(high));
        let (below, above) = (residual(low, at_low.0), residual(high, at_high.0));
        // The interpolation factor at which the line is satisfied.
        let part = if below == above { F::ZERO } else { below / (below - above) };
        let part = within(part, F::ZERO, F::ONE);
        for member in line.members() {
            // Each friction has its level's share of the total.
            let torque = |distance: F, friction: F| match member.1.coulomb() {
                Some(own) if own > F::ZERO => within(member.2 * (friction * (own / level)), -own, own),
                Some(_) => F::ZERO,
                None => line.torque(member, distance),
            };
            let (one, other) = (torque(low, at_low.1), torque(high, at_high.1));
            let found = one + part * (other - one);
            if !found.is_finite() {
                for (place, coupling, _) in line.members() {
                    if let Some(torque) = torques.get_mut(place) {
                        step.push(coupling, -*torque, change);
                        *torque = F::ZERO;
                    }
                }
                return None;
            }
            if let Some(torque) = torques.get_mut(member.0) {
                step.push(member.1, found, change);
                *torque = found;
            }
        }
        let after = leader.relative((F::ZERO, F::ZERO), change).position;
        let size = start.position.abs() + after.abs() + before.abs() + free.abs();
        Some((after - before).abs() <= F::from_f64(8.0) * F::EPSILON * size)
    }
}
