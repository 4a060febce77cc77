//! i²t: a first-order thermal model of a winding or a transistor.

use crate::{Constants, Heat, Real};

/// heat += (τ² - heat) · part, part = 1 - exp(-T/time): the square of the constant torque that heats as much.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Thermal<F> {
    part: F,
    /// rms²
    most: F,
}

impl<F: Real> Thermal<F> {
    pub fn new(heat: &Heat, period: f64) -> Self {
        Thermal { part: F::from_f64(-libm::expm1(-period / heat.time)), most: F::from_f64(heat.rms * heat.rms) }
    }

    pub fn constants(&self, to: &mut dyn Constants, part: &'static str, most: &'static str) {
        to.number(part, "of the heat that a sample adds", self.part.to_f64());
        to.number(most, "the most heat, torque squared", self.most.to_f64());
    }

    /// One sample at a torque; whether it is too hot.
    pub fn warm(&self, heat: &mut F, torque: F) -> bool {
        *heat += (torque * torque - *heat) * self.part;
        *heat > self.most
    }

    /// Whether it is below half of the limit.
    pub fn has_cooled(&self, heat: F) -> bool {
        heat <= F::HALF * self.most
    }
}
