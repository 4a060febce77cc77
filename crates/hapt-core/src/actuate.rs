//! The last step before the motor: levels and limit (docs/contract.md, section 3, step 4).

use crate::{Error, Number, Spec};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Actuator<F> {
    pub limit: Option<F>,
    pub step: Option<F>,
}

impl<F: Number> Actuator<F> {
    pub fn new(spec: &Spec) -> Result<Self, Error> {
        if let Some(limit) = spec.limit {
            Error::check_positive("limit", limit)?;
        }
        let step = match (spec.levels, spec.limit) {
            (None, _) => None,
            (Some(levels), Some(limit)) if levels > 0 && levels % 2 == 0 => Some(2.0 * limit / f64::from(levels)),
            (Some(levels), _) => {
                let wanted = "positive, even, and with a limit";
                return Err(Error::Value { what: "levels", given: f64::from(levels), wanted });
            }
        };
        Ok(Actuator { limit: spec.limit.map(F::from_f64), step: step.map(F::from_f64) })
    }

    /// step · floor(τ/step + 1/2 + 1e-9), within ±limit. A torque that is no number commands 0: the only safe answer.
    #[inline(always)]
    pub fn command(&self, torque: F) -> F {
        let mut command = torque;
        if let Some(step) = self.step {
            command = step * (command / step + F::HALF + F::from_f64(1e-9)).floor();
        }
        if let Some(limit) = self.limit {
            command = command.within(limit);
        }
        command.finite_or_zero()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Estimator, Method, Output};

    const SPEC: Spec = Spec {
        period: 1e-3,
        method: Method::Zoh,
        output: Output::End,
        advance: 0,
        estimator: Estimator::Exact,
        count: None,
        limit: Some(0.8),
        levels: Some(16),
        bodies: &[],
        couplings: &[],
    };

    #[test]
    fn the_motor_takes_whole_steps_ties_up_and_never_more_than_its_limit() {
        let motor = Actuator::<f64>::new(&SPEC).unwrap();
        for (torque, command) in
            [(0.0, 0.0), (0.049, 0.0), (0.05, 0.1), (-0.05, 0.0), (-0.0501, -0.1), (0.8, 0.8), (7.0, 0.8), (-7.0, -0.8)]
        {
            assert!((motor.command(torque) - command).abs() < 1e-15, "{torque}: {}", motor.command(torque));
        }
        assert_eq!(motor.command(f64::INFINITY), 0.8);
        assert_eq!(motor.command(f64::NAN), 0.0);
    }

    #[test]
    fn a_motor_without_a_limit_takes_what_is_asked() {
        let motor = Actuator::<f64>::new(&Spec { limit: None, levels: None, ..SPEC }).unwrap();
        assert_eq!(motor.command(-123.456), -123.456);
        assert!(Actuator::<f64>::new(&Spec { limit: None, ..SPEC }).is_err());
        assert!(Actuator::<f64>::new(&Spec { levels: Some(15), ..SPEC }).is_err());
        assert!(Actuator::<f64>::new(&Spec { limit: Some(0.0), ..SPEC }).is_err());
    }
}
