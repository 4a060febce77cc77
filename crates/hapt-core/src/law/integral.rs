//! The integral term of a PID controller: a torque that grows while the puck is away from its rest.

use crate::Number;
use crate::contact::within;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Integral<F> {
    /// stiffness/time in N·m/(rad·s)
    pub gain: F,
    pub rest: F,
    /// The largest |s|, at which the torque is the coupling's limit; infinite: any.
    pub most: F,
}

impl<F: Number> Integral<F> {
    /// s after a sample of `t` seconds at q: s + t (q - rest), within ±`most`. So an integral that has reached its limit leaves it at the first
    /// sample on the other side of the rest.
    #[inline(always)]
    pub fn sum(&self, s: F, q: F, t: F) -> F {
        within(s + t * (q - self.rest), -self.most, self.most)
    }

    /// -stiffness/time · s
    #[inline(always)]
    pub fn torque(&self, s: F) -> F {
        -(self.gain * s)
    }
}

/// The s at which the torque reaches `limit`, infinite where it never does; 0 without a stiffness, which needs no s.
pub(crate) fn most(stiffness: f64, time: f64, limit: f64) -> f64 {
    if stiffness > 0.0 { limit * time / stiffness } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_grows_by_the_time_away_from_its_rest_and_stops_at_its_limit() {
        let law = Integral { gain: 2.0, rest: 0.1, most: most(6.0, 3.0, 0.5) };
        let s = (0..10).fold(0.0, |s, _| law.sum(s, 0.3, 1e-2));
        assert!((law.torque(s) + 2.0 * 0.2 * 0.1_f64).abs() < 1e-15);
        let s = (0..1000).fold(s, |s, _| law.sum(s, 0.3, 1e-2));
        assert_eq!(law.torque(s), -0.5);
        assert!(law.torque(law.sum(s, 0.0, 1e-2)) > -0.5);
        assert_eq!(law.torque(law.sum(0.0, 0.1, 1e-2)), 0.0);
    }

    #[test]
    fn without_a_stiffness_it_has_no_torque() {
        let law = Integral { gain: 0.0, rest: 0.0, most: most(0.0, 1.0, 0.5) };
        assert_eq!(law.torque(law.sum(0.0, 1e3, 1.0)), 0.0);
    }
}
