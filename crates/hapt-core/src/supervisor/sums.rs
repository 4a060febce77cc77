//! The energies of one step, summed over couplings and bodies.

use crate::Real;

/// What couplings stored before and after a step, what constants gave to bodies in it, and what the puck's motion carried into it.
pub(crate) struct Sums<F> {
    pub before: F,
    pub after: F,
    pub given: F,
    pub carried: F,
}

impl<F: Real> Sums<F> {
    pub const NONE: Self = Sums { before: F::ZERO, after: F::ZERO, given: F::ZERO, carried: F::ZERO };

    #[inline(always)]
    pub fn step(&self) -> Step<F> {
        // Rounding does not count as generated energy.
        let rounding = F::from_f64(16.0) * F::EPSILON * (self.before.abs() + self.after.abs());
        let made = self.after - self.before - self.given - self.carried - rounding;
        Step { stored: self.after, made, given: self.given }
    }
}

/// What one step did.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step<F> {
    /// Stored after it, with the puck where it was seen, in J.
    pub stored: F,
    /// What the integrator made, in J: the change of what is stored less what the puck's motion and constants brought in; at most what
    /// it made where something was damped.
    pub made: F,
    /// The constants' work on the bodies, in J.
    pub given: F,
}
