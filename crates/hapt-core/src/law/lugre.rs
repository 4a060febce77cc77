//! LuGre friction (Canudas de Wit, Olsson, Åström, Lischinsky, IEEE TAC 40(3), 1995): bristles that bend.

use crate::Number;

/// The parameters of [`crate::Law::Lugre`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lugre<F> {
    pub coulomb: F,
    pub stribeck: F,
    pub stribeck_velocity: F,
    pub bristle_stiffness: F,
    pub bristle_damping: F,
    pub viscous: F,
}

impl<F: Number> Lugre<F> {
    /// σ0 |q̇|/g in 1/s, the rate at which the bristle relaxes; infinite where g is 0.
    #[inline(always)]
    fn rate(&self, velocity: F) -> F {
        let ratio = velocity / self.stribeck_velocity;
        let level = self.coulomb + (self.stribeck - self.coulomb) * (-(ratio * ratio)).exp();
        self.bristle_stiffness * velocity.abs() / level
    }

    /// The bristle after `t` seconds at constant velocity, exactly: s e^{-at} + q̇ (1 - e^{-at})/a. Explicit Euler would need
    /// t < 2g/(σ0|q̇|).
    #[inline(always)]
    pub fn bend(&self, bristle: F, velocity: F, t: F) -> F {
        let rate = self.rate(velocity);
        let forgotten = (-(rate * t)).expm1();
        // At an infinite rate nothing is left of the bristle: level 0 holds nothing. At rest it stays, although its rate is 0/0.
        let deflection = bristle + bristle * forgotten - velocity * forgotten / rate;
        rate.if_above(F::ZERO, deflection, bristle + velocity * t)
    }

    /// -(σ0 s + σ1 ṡ + σ2 q̇), ṡ = q̇ - σ0 |q̇| s/g
    #[inline(always)]
    pub fn torque(&self, bristle: F, velocity: F) -> F {
        // An unbent bristle at an infinite rate bends no further.
        let rate = self.rate(velocity);
        let slip = F::from_f64(f64::INFINITY).if_above(rate, velocity - rate * bristle, F::ZERO);
        -(self.bristle_stiffness * bristle + self.bristle_damping * slip + self.viscous * velocity)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LUGRE: Lugre<f64> = Lugre {
        coulomb: 0.02,
        stribeck: 0.03,
        stribeck_velocity: 0.1,
        bristle_stiffness: 50.0,
        bristle_damping: 0.05,
        viscous: 1e-3,
    };

    #[test]
    fn a_bristle_bent_in_two_halves_is_bent_as_in_one() {
        for velocity in [-3.0, -1e-3, 0.0, 0.2, 40.0] {
            let once = LUGRE.bend(1e-4, velocity, 2e-3);
            let twice = LUGRE.bend(LUGRE.bend(1e-4, velocity, 1e-3), velocity, 1e-3);
            assert!((once - twice).abs() < 1e-18, "{velocity}: {once} {twice}");
        }
    }

    #[test]
    fn sliding_steadily_it_is_the_stribeck_curve() {
        for velocity in [-2.0_f64, 0.05, 0.4] {
            let bristle = LUGRE.bend(0.0, velocity, 100.0);
            let level = 0.02 + 0.01 * libm::exp(-(velocity / 0.1) * (velocity / 0.1));
            let expected = -(level * velocity.signum() + 1e-3 * velocity);
            assert!((LUGRE.torque(bristle, velocity) - expected).abs() < 1e-15);
        }
    }

    #[test]
    fn without_a_level_the_bristle_holds_nothing_and_stays_finite() {
        let slick = Lugre { coulomb: 0.0, stribeck: 0.0, ..LUGRE };
        let bristle = slick.bend(0.0, 1.0, 1e-3);
        assert_eq!(bristle, 0.0);
        assert_eq!(slick.torque(bristle, 1.0), -1e-3);
        assert_eq!(slick.torque(slick.bend(bristle, 0.0, 1e-3), 0.0), 0.0);
    }
}
