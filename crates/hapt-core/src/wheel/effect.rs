//! The effects that a host requests, in SI.

use crate::Real;
use crate::contact::within;

/// A law with a coefficient and a largest torque on either side of a band in which it is zero. Below, x stands for the position in rad
/// (a spring), the velocity in rad/s (a damper, friction) or the acceleration in rad/s² (inertia).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sides<F> {
    /// The middle of the band.
    pub offset: F,
    /// Half of the band, zero or more.
    pub dead_band: F,
    /// Torque per x above the band, resisting where positive.
    pub above: F,
    /// Torque per x below the band, resisting where positive.
    pub below: F,
    /// The largest torque above the band, N·m, zero or more.
    pub most_above: F,
    /// The largest torque below the band, N·m, zero or more.
    pub most_below: F,
}

impl<F: Real> Sides<F> {
    /// The same law on both sides, about 0.
    pub fn even(coefficient: F, most: F) -> Self {
        let zero = F::ZERO;
        Sides {
            offset: zero,
            dead_band: zero,
            above: coefficient,
            below: coefficient,
            most_above: most,
            most_below: most,
        }
    }

    /// Whether the torque of a side drives instead of resisting.
    pub(crate) fn drives(&self) -> bool {
        self.above < F::ZERO || self.below < F::ZERO
    }

    /// The resisting torque at x, with both coefficients multiplied by `scale`; its slope there. It never falls with x.
    pub(crate) fn resistance(&self, x: F, scale: F) -> (F, F) {
        let x = x - self.offset;
        let beyond = x - within(x, -self.dead_band, self.dead_band);
        let coefficient = scale * floored(if beyond < F::ZERO { self.below } else { self.above });
        let straight = coefficient * beyond;
        let torque = within(straight, -self.most_below, self.most_above);
        (torque, if torque == straight && beyond != F::ZERO { coefficient } else { F::ZERO })
    }

    /// The steeper side's coefficient.
    pub(crate) fn steepest(&self) -> F {
        let (a, b) = (floored(self.above), floored(self.below));
        if a > b { a } else { b }
    }

    /// The gentler side's coefficient.
    pub(crate) fn gentlest(&self) -> F {
        let (a, b) = (floored(self.above), floored(self.below));
        if a < b { a } else { b }
    }
}

/// Not less than 0; 0 in place of NaN.
pub(crate) fn floored<F: Real>(x: F) -> F {
    if x > F::ZERO { x } else { F::ZERO }
}

/// An effect at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Effect<F> {
    /// Resists the position, in N·m/rad.
    Spring(Sides<F>),
    /// Resists the velocity, in N·m·s/rad.
    Damper(Sides<F>),
    /// Resists motion with a torque of its coefficients, in N·m, at any velocity; the band is not used.
    Friction(Sides<F>),
    /// Resists the acceleration, in kg·m²: of both sides' coefficients and torques the smaller counts, the band is not used. A mass that differs by side
    /// or begins beyond an acceleration is no passive body.
    Inertia(Sides<F>),
    /// A torque whose level the host sets, N·m: constant, ramp and periodic effects.
    Torque(F),
}
