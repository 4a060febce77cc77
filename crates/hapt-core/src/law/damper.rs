//! A damper.

use crate::contact::{Solution, StepResponse, within};
use crate::{Number, Real};

/// A damper with a limit; those without are matrices.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Damper<F> {
    pub damping: F,
    pub limit: F,
}

impl<F: Number> Damper<F> {
    /// -damping · q̇, within ±limit
    #[inline(always)]
    pub fn torque(&self, velocity: F) -> F {
        within(-(self.damping * velocity), -self.limit, self.limit)
    }
}

impl<F: Real> Damper<F> {
    /// The torque over a step of 1/`rate` seconds, from the mean velocity. Straight where it is not limited, so that the straight
    /// solution, limited, is the solution.
    pub fn solve(&self, response: &StepResponse<F>, rate: F) -> Solution<F> {
        let drag = self.damping * rate;
        let whole = F::ONE + drag * response.compliance;
        let torque = -(drag * response.free + self.damping * response.puck_rate) / whole;
        Solution { torque, by_free: -(drag / whole), by_rate: F::ZERO }.within(-self.limit, self.limit)
    }
}
