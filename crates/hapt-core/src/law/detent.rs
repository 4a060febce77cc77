//! A detent: a torque that goes up and down as a sine.

use crate::contact::{Solution, StepResponse, solve_nearest};
use crate::{Number, Real};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Detent<F> {
    pub torque: F,
    pub pitch: F,
    pub phase: F,
}

impl<F: Number> Detent<F> {
    /// -torque · sin(2π (q - phase)/pitch)
    #[inline(always)]
    pub fn torque(&self, q: F) -> F {
        let turns = (q - self.phase) / self.pitch;
        // Taken from the nearest rest, so that every rest is exactly one, however far it is.
        let rest = (turns + F::HALF).floor();
        -(self.torque * (F::from_f64(core::f64::consts::TAU) * (turns - rest)).sin())
    }
}

impl<F: Real> Detent<F> {
    /// The torque that keeps its energy over a step, at the solution nearest to the free motion.
    pub fn solve(&self, response: &StepResponse<F>) -> Solution<F> {
        let from = self.turns(response.start);
        let response = &StepResponse { start: from * self.pitch, ..*response };
        let law = |distance: F| {
            let (mean, slope) = self.mean(from, distance);
            (-mean, -slope)
        };
        let reach = response.compliance * self.torque;
        // It falls as steeply as it rises.
        let turn = reach * F::from_f64(core::f64::consts::PI) / self.pitch;
        solve_nearest(response, self.torque, (turn, turn), self.pitch * F::from_f64(1.0 / 64.0), law)
    }

    /// (V(q + distance) - V(q))/distance
    pub fn stored_slope(&self, start: F, distance: F) -> F {
        self.mean(self.turns(start), distance).0
    }

    /// q from the nearest rest, in turns.
    fn turns(&self, q: F) -> F {
        let turns = (q - self.phase) / self.pitch;
        turns - (turns + F::HALF).floor()
    }

    /// The mean of torque · sin over `distance` from `from` turns, and its derivative:
    /// (cos a - cos(a + 2h))/2h = sin(a + h) · sin(h)/h.
    fn mean(&self, from: F, distance: F) -> (F, F) {
        let Detent { torque, pitch, .. } = *self;
        let tau = F::from_f64(core::f64::consts::TAU);
        let half = F::HALF * (distance / pitch);
        let angle = tau * half;
        let share = if angle == F::ZERO { F::ONE } else { angle.sin() / angle };
        let mean = torque * ((tau * (from + half)).sin() * share);
        let slope = if half.abs() > F::from_f64(1.0 / 64.0) {
            (torque * (tau * (from + half + half)).sin() - mean) / distance
        } else {
            // Half of the slope in the middle; sin a quarter of a turn on is cos.
            torque * F::HALF * (tau / pitch) * (tau * (from + half + F::HALF * F::HALF)).sin()
        };
        (mean, slope)
    }
}

impl Detent<f64> {
    /// torque · pitch/2π · (1 - cos 2π(q - phase)/pitch)
    pub fn energy(&self, q: f64) -> f64 {
        // 1 - cos 2a = 2 sin² a: a small swing about a rest keeps its digits.
        let sine = libm::sin(core::f64::consts::PI * (q - self.phase) / self.pitch);
        self.torque * self.pitch / core::f64::consts::PI * (sine * sine)
    }
}
