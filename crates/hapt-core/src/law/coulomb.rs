//! Coulomb friction.

use crate::contact::{Solution, StepResponse};
use crate::{Number, Real};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Coulomb<F> {
    pub torque: F,
}

impl<F: Number> Coulomb<F> {
    /// -torque · sign(q̇), 0 at q̇ = 0
    #[inline(always)]
    pub fn torque(&self, velocity: F) -> F {
        velocity.if_above(F::ZERO, -self.torque, F::ZERO.if_above(velocity, self.torque, F::ZERO))
    }
}

impl<F: Real> Coulomb<F> {
    /// Of the torques within ±`torque` that oppose q' - q, or bring it to 0, the one that brings q̇' nearest to rest.
    ///
    /// Under backward Euler, and for a coupling that continues to slide, or rests already, this is -`torque` · sign(q' - q), or the torque
    /// that makes q' - q 0. Under zoh and the trapezoidal rule this torque would not bring a moving body to rest: the body would return
    /// with -q̇, and again at every later sample.
    pub fn solve(&self, response: &StepResponse<F>) -> Solution<F> {
        let torque = self.torque;
        if response.free == F::ZERO {
            return Solution::fixed(F::ZERO);
        }
        let by_free = -(F::ONE / response.compliance);
        let most = Solution { torque: -(response.free / response.compliance), by_free, by_rate: F::ZERO }
            .within(-torque, torque);
        if response.mobility <= F::ZERO {
            return most;
        }
        let by_rate = -(F::ONE / response.mobility);
        let stop = Solution { torque: -(response.rate / response.mobility), by_free: F::ZERO, by_rate };
        let level = most.torque;
        let beyond = if level > F::ZERO { stop.torque > level } else { stop.torque < level };
        if beyond {
            most
        } else if level > F::ZERO {
            stop.within(F::ZERO, level)
        } else {
            stop.within(level, F::ZERO)
        }
    }
}
