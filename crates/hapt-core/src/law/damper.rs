//! A damper.

use crate::contact::{Solution, StepResponse, within};
use crate::{Number, Real};

/// How much a damper damps.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Damping {
    /// N·m·s/rad, zero or more.
    Fixed(f64),
    /// T times the sum of the stiffnesses of the springs between the same two ends, in either order; for a damper from a
    /// body to ground, of all springs at the body. The notes' b = Tk, (2.24). At a body T is the bodies' step, [`crate::Spec::step`].
    Compensating,
}

/// A damper with a limit; those without are matrices. An assist is one of negative damping.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Damper<F> {
    pub damping: F,
    pub limit: F,
}

/// The largest number of a file.
pub(super) const MOST: f64 = 1e30;

/// torque/velocity of an assist, limited to the largest number of a file, so that its product with a velocity is finite.
pub(crate) fn gain(torque: f64, velocity: f64) -> f64 {
    let gain = torque / velocity;
    if gain < MOST { gain } else { MOST }
}

impl<F: Number> Damper<F> {
    /// -damping · q̇, within ±limit
    #[inline(always)]
    pub fn torque(&self, velocity: F) -> F {
        within(-(self.damping * velocity), -self.limit, self.limit)
    }
}

impl<F: Real> Damper<F> {
    /// The torque over a step of 1/`rate` seconds, from the mean velocity. The law is linear where it is not limited, so that the linear
    /// solution, limited, is the solution.
    pub fn solve(&self, response: &StepResponse<F>, rate: F) -> Solution<F> {
        let drag = self.damping * rate;
        let whole = F::ONE + drag * response.compliance;
        let torque = -(drag * response.free + self.damping * response.puck_rate) / whole;
        Solution { torque, by_free: -(drag / whole), by_rate: F::ZERO }.within(-self.limit, self.limit)
    }
}
