//! The energies of one step, summed over couplings and bodies.

use crate::Real;

/// The energy that couplings stored before and after a step, the work of constants on bodies in it, and the energy that the puck's motion
/// brought in.
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

/// The energies of one step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step<F> {
    /// Stored after it, with the puck where it was seen, in J.
    pub stored: F,
    /// The energy that the integrator generated, in J: the change of the stored energy less the energy that the puck's motion and constants
    /// brought in; a lower bound where dampers dissipate.
    pub made: F,
    /// The constants' work on the bodies, in J.
    pub given: F,
}
