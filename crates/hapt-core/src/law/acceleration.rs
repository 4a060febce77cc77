//! A torque along the acceleration, as a compensation of inertia makes it.

use super::damper::MOST;
use crate::Number;
use crate::contact::within;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Acceleration<F> {
    /// inertia/τ in N·m·s/rad, τ = 1/(2π cutoff)
    pub gain: F,
    /// τ in s
    pub tau: F,
    pub limit: F,
}

impl<F: Number> Acceleration<F> {
    /// The low-passed velocity s after a sample of `t` seconds at q̇: s + t/(τ + t) (q̇ - s).
    #[inline(always)]
    pub fn smooth(&self, s: F, velocity: F, t: F) -> F {
        s + t / (self.tau + t) * (velocity - s)
    }

    /// inertia · (q̇ - s)/τ, which is inertia times the change of s in this sample over t; within ±`limit`.
    #[inline(always)]
    pub fn torque(&self, s: F, velocity: F) -> F {
        within(self.gain * (velocity - s), -self.limit, self.limit)
    }
}

/// (inertia/τ, τ), limited to the largest number of a file, so that their products are finite.
pub(crate) fn filtered(inertia: f64, cutoff: f64) -> (f64, f64) {
    let rate = core::f64::consts::TAU * cutoff;
    ((inertia * rate).min(MOST), (1.0 / rate).min(MOST))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn its_torque_is_the_inertia_times_the_change_of_the_smoothed_velocity() {
        let (gain, tau) = filtered(2e-4, 5.0);
        let law = Acceleration { gain, tau, limit: f64::INFINITY };
        let (mut s, t) = (0.0, 1e-3);
        for k in 0..1000 {
            let (before, velocity) = (s, (0.02 * f64::from(k)).sin());
            s = law.smooth(s, velocity, t);
            let expected = 2e-4 * (s - before) / t;
            assert!((law.torque(s, velocity) - expected).abs() < 1e-15 + 1e-12 * expected.abs());
        }
        // At a constant acceleration the filter follows behind, and the torque is inertia times acceleration.
        let s = (0..1000).fold(0.0, |s, k| law.smooth(s, 3.0 * t * f64::from(k), t));
        assert!((law.torque(s, 3.0 * t * 999.0) - 2e-4 * 3.0).abs() < 1e-12);
    }

    #[test]
    fn it_has_no_torque_at_a_constant_velocity_and_none_beyond_its_limit() {
        let (gain, tau) = filtered(1e-3, 10.0);
        let law = Acceleration { gain, tau, limit: 1e-3 };
        assert_eq!(law.torque(0.0, 1e3), 1e-3);
        assert_eq!(law.torque(0.0, -1e3), -1e-3);
        assert_eq!(law.torque(7.0, 7.0), 0.0);
    }
}
