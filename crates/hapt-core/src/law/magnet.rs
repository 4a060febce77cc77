//! A magnet: a pull toward a place that is strongest at a distance from it and fades beyond.
//!
//! With x = (q - at)/width the torque is -torque · x · exp((1 - x²)/2), which is -torque · x near the place and reaches its largest,
//! `torque`, at x = ±1. Its energy is torque · width · √e · (1 - exp(-x²/2)). It rises by at most √e · torque/width, at the place, and
//! falls by at most 2/e · torque/width, at x = ±√3.

use crate::contact::{Solution, StepResponse, solve_nearest};
use crate::{Number, Real};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Magnet<F> {
    pub torque: F,
    pub width: F,
    pub at: F,
}

/// √e
pub(super) const ROOT_E: f64 = 1.648_721_270_700_128_2;

/// The energy that it stores at q.
pub(super) fn energy(torque: f64, width: f64, at: f64, q: f64) -> f64 {
    let x = (q - at) / width;
    -(torque * width * ROOT_E * libm::expm1(-0.5 * x * x))
}

impl<F: Number> Magnet<F> {
    /// -torque · x · exp((1 - x²)/2)
    #[inline(always)]
    pub fn torque(&self, q: F) -> F {
        let x = (q - self.at) / self.width;
        -(self.torque * F::from_f64(ROOT_E) * x * (-(F::HALF * x * x)).exp())
    }
}

impl<F: Real> Magnet<F> {
    /// The torque that keeps its energy over a step, at the solution nearest to the free motion.
    pub fn solve(&self, response: &StepResponse<F>) -> Solution<F> {
        let response = &StepResponse { start: response.start - self.at, ..*response };
        let law = |distance: F| {
            let (mean, slope) = self.mean(response.start / self.width, distance);
            (-mean, -slope)
        };
        // A mean torque changes by at most half of the steepest slope.
        let turn = F::HALF * response.compliance * self.torque / self.width;
        let (fall, rise) = (F::from_f64(2.0 / core::f64::consts::E) * turn, F::from_f64(ROOT_E) * turn);
        solve_nearest(response, self.torque, (fall, rise), self.width * F::from_f64(1.0 / 64.0), law)
    }

    /// (V(q + distance) - V(q))/distance
    pub fn stored_slope(&self, start: F, distance: F) -> F {
        self.mean((start - self.at) / self.width, distance).0
    }

    /// The mean of V' over `distance` from x, and its derivative. With m the middle of the displacement and u = m · distance/width, the
    /// difference of the two exponentials is exp(-x²/2) (1 - e^-u): x is the end nearer to the place, so that u is not negative.
    fn mean(&self, x: F, distance: F) -> (F, F) {
        let travel = distance / self.width;
        let end = x + travel;
        let middle = x + F::HALF * travel;
        let (nearest, u) = if end.abs() < x.abs() { (end, -(travel * middle)) } else { (x, travel * middle) };
        let share = if u > F::ZERO { -((-u).expm1() / u) } else { F::ONE };
        let scale = self.torque * F::from_f64(ROOT_E);
        let mean = scale * middle * ((-(F::HALF * nearest * nearest)).exp() * share);
        let slope = if travel.abs() > F::from_f64(1.0 / 64.0) {
            (scale * end * (-(F::HALF * end * end)).exp() - mean) / distance
        } else {
            // Half of the slope in the middle.
            let square = middle * middle;
            F::HALF * (scale / self.width) * (F::ONE - square) * (-(F::HALF * square)).exp()
        };
        (mean, slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    proptest! {
        #[test]
        fn the_mean_torque_is_the_difference_of_the_energies_over_the_way(
            torque in 0.01_f64..2.0, width in 0.01_f64..1.0, from in -6.0_f64..6.0, travel in -6.0_f64..6.0, power in -9_i32..1,
        ) {
            let magnet = Magnet { torque, width, at: 0.3 };
            let (start, distance) = (0.3 + from * width, travel * 10_f64.powi(power) * width);
            let mean = magnet.stored_slope(start, distance);
            prop_assert!(mean.abs() <= torque * (1.0 + 1e-12));
            if distance.abs() > 1e-3 * width {
                let difference = energy(torque, width, 0.3, start + distance) - energy(torque, width, 0.3, start);
                prop_assert!((mean - difference / distance).abs() < 1e-11 * torque, "{mean} {}", difference / distance);
            } else {
                let middle = -magnet.torque(start + 0.5 * distance);
                prop_assert!((mean - middle).abs() < 1e-6 * torque, "{mean} {middle}");
            }
        }

        #[test]
        fn no_slope_passes_its_bounds(q in -10.0_f64..10.0) {
            let magnet = Magnet { torque: 1.0, width: 1.0, at: 0.0 };
            let h = 1e-5;
            let rise = -(magnet.torque(q + h) - magnet.torque(q - h)) / (2.0 * h);
            prop_assert!(rise < ROOT_E + 1e-6 && rise > -2.0 / core::f64::consts::E - 1e-6, "{rise}");
        }
    }
}
