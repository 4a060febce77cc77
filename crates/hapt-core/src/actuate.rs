//! The last step before the motor: levels and limit (docs/contract.md, section 3, step 4).

use crate::{Error, Number, Real, Spec};

#[derive(Clone, Copy, Debug)]
pub(crate) struct Actuator<F> {
    pub limit: Option<F>,
    pub step: Option<F>,
    /// A torque up to this size is commanded unchanged; below 0 where there are levels.
    pub passes: F,
    /// The command for a torque beyond: the limit. Without a limit, only an infinite torque is beyond, and commands 0.
    pub beyond: F,
}

impl<F: Real> Actuator<F> {
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
        let limit = spec.limit.map(F::from_f64);
        let beyond = limit.filter(|limit| limit.is_finite());
        let passes = if step.is_some() { -F::ONE } else { beyond.unwrap_or(F::MAX) };
        Ok(Actuator { limit, step: step.map(F::from_f64), passes, beyond: beyond.unwrap_or(F::ZERO) })
    }

    /// [`Actuator::command`], for one number.
    #[inline(always)]
    pub fn command_one(&self, torque: F) -> F {
        if torque.abs() <= self.passes {
            torque
        } else if self.step.is_some() {
            self.stepped(torque)
        } else if torque > F::ZERO {
            self.beyond
        } else if torque < F::ZERO {
            F::ZERO - self.beyond
        } else {
            F::ZERO
        }
    }

    /// Out of line: the division would take registers that every sample needs.
    #[inline(never)]
    fn stepped(&self, torque: F) -> F {
        self.command(torque)
    }
}

impl<F: Number> Actuator<F> {
    /// step · floor(τ/step + 1/2 + 1e-9), within ±limit. A NaN commands 0, the only safe torque.
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

    const SPEC: Spec = Spec { limit: Some(0.8), levels: Some(16), ..Spec::new(1e-3) };

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

    #[test]
    fn one_number_commands_what_lanes_do_to_the_bit() {
        let mut torques = torques_at_edges();
        let mut bits = 1_u64;
        for torque in &mut torques[16..] {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            *torque = ((bits >> 11) as f64 / 9.0e15 - 0.5) * 4.0;
        }
        for limit in [None, Some(0.8), Some(1e300), Some(f64::MAX)] {
            for levels in [None, limit.map(|_| 16)] {
                let motor = Actuator::<f64>::new(&Spec { limit, levels, ..SPEC }).unwrap();
                let single = Actuator::<f32>::new(&Spec { limit, levels, ..SPEC }).unwrap();
                for torque in torques {
                    assert_eq!(
                        motor.command_one(torque).to_bits(),
                        motor.command(torque).to_bits(),
                        "{limit:?} {torque}"
                    );
                    let torque = torque as f32;
                    assert_eq!(
                        single.command_one(torque).to_bits(),
                        single.command(torque).to_bits(),
                        "{limit:?} {torque}"
                    );
                }
            }
        }
    }

    /// Numbers at the edges of branches, and space for others.
    fn torques_at_edges() -> [f64; 1000] {
        let mut torques = [0.0; 1000];
        let edges = [0.8, 1e300, f64::MAX, f64::MIN_POSITIVE, f64::INFINITY, 3.4e38, 0.0];
        for (i, edge) in edges.into_iter().enumerate() {
            (torques[2 * i], torques[2 * i + 1]) = (edge, -edge);
        }
        (torques[14], torques[15]) = (f64::NAN, -f64::NAN);
        torques
    }
}
