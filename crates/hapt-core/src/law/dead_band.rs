//! A dead band: a spring that begins at a distance from its rest.

use crate::contact::{Solution, StepResponse, solve_falling, within};
use crate::law::spring::{self, Ramp};
use crate::{Number, Real};

#[derive(Clone, Copy, Debug)]
pub(crate) struct DeadBand<F> {
    pub stiffness: F,
    pub rest: F,
    pub width: F,
    /// Infinite where it has none.
    pub limit: F,
}

/// The energy that it stores at q: a spring's energy, from the edge of the band on.
pub(super) fn energy(stiffness: f64, rest: f64, width: f64, q: f64, limit: f64) -> f64 {
    spring::energy(stiffness, ((q - rest).abs() - width).max(0.0), limit)
}

impl<F: Number> DeadBand<F> {
    /// -stiffness · (q - rest ∓ width) beyond ±width, within ±limit; 0 inside
    #[inline(always)]
    pub fn torque(&self, q: F) -> F {
        let x = q - self.rest;
        let beyond = x - within(x, -self.width, self.width);
        within(-(self.stiffness * beyond), -self.limit, self.limit)
    }
}

impl<F: Real> DeadBand<F> {
    /// The torque that keeps its energy over a step.
    pub fn solve(&self, response: &StepResponse<F>) -> Solution<F> {
        let response = StepResponse { start: response.start - self.rest, ..*response };
        let law = |distance| {
            let (mean, slope) = self.mean(response.start, distance);
            (-mean, -slope)
        };
        solve_falling(&response, law).within(-self.limit, self.limit)
    }

    /// (V(q + distance) - V(q))/distance
    pub fn stored_slope(&self, start: F, distance: F) -> F {
        self.mean(start - self.rest, distance).0
    }

    /// The mean of V' over `distance` from x = q - rest, and its derivative: that of two walls without damping, face to face.
    fn mean(&self, x: F, distance: F) -> (F, F) {
        let wall = Ramp::new(self.stiffness, F::ZERO, self.limit);
        let (above, below) = (wall.mean(x - self.width, distance), wall.mean(-x - self.width, -distance));
        (above.0 - below.0, above.1 + below.1)
    }
}
