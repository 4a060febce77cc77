//! The motor's constant: volts or amperes per torque.

use std::fmt;
use std::str::FromStr;

/// The factor from torque to target. SimpleFOC's target is a voltage or a current; the factor is a property of the motor.
///
/// ```
/// use hapt_drive::simplefoc::MotorConstant;
///
/// let by_voltage: MotorConstant = "volts-per-torque=20".parse()?;
/// assert_eq!(by_voltage.target(0.1), 2.0);
/// let by_current: MotorConstant = "torque-constant=0.05".parse()?;
/// assert_eq!(by_current.target(0.1), 2.0);
/// assert!("volts-per-torque=0".parse::<MotorConstant>().is_err());
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MotorConstant {
    /// Volts per N·m: the winding's resistance over the torque constant.
    VoltsPerTorque(f64),
    /// N·m per ampere.
    TorqueConstant(f64),
}

/// Sound, since the number is finite.
impl Eq for MotorConstant {}

const VOLTS: &str = "volts-per-torque";
const AMPERES: &str = "torque-constant";

impl MotorConstant {
    /// The sketch's letter of the unit.
    pub(super) fn unit(self) -> u8 {
        match self {
            MotorConstant::VoltsPerTorque(_) => b'V',
            MotorConstant::TorqueConstant(_) => b'A',
        }
    }

    /// The target for a torque in N·m.
    pub fn target(self, torque: f64) -> f64 {
        match self {
            MotorConstant::VoltsPerTorque(volts) => volts * torque,
            MotorConstant::TorqueConstant(constant) => torque / constant,
        }
    }

    /// The corrected constant of a motor that gives this part of the commanded torque, with five digits: no constant is known more
    /// accurately.
    #[must_use]
    pub fn corrected(self, gain: f64) -> Self {
        let rounded = |x: f64| format!("{x:.4e}").parse().unwrap_or(x);
        match self {
            MotorConstant::VoltsPerTorque(volts) => MotorConstant::VoltsPerTorque(rounded(volts / gain)),
            MotorConstant::TorqueConstant(constant) => MotorConstant::TorqueConstant(rounded(constant * gain)),
        }
    }
}

impl FromStr for MotorConstant {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, number) = text.split_once('=').unwrap_or((text, ""));
        let make = match name {
            VOLTS => MotorConstant::VoltsPerTorque,
            AMPERES => MotorConstant::TorqueConstant,
            _ => {
                return Err(format!(
                    "{name:?} is not an option of a SimpleFOC board; expected {VOLTS} in V/(N m), or {AMPERES} in N m/A"
                ));
            }
        };
        // No motor is outside of this range.
        let found = number.parse::<f64>().ok().filter(|number| (1e-6..=1e6).contains(number));
        found.map(make).ok_or_else(|| match number.split_once('&') {
            Some((_, more)) => format!("{text:?}: expected one option of a board, without {more:?}"),
            None => {
                let example = if name == VOLTS { "20" } else { "0.05" };
                format!("{text:?}: expected a number from 1e-6 to 1e6, as in {name}={example}")
            }
        })
    }
}

impl fmt::Display for MotorConstant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MotorConstant::VoltsPerTorque(volts) => write!(f, "{VOLTS}={volts}"),
            MotorConstant::TorqueConstant(constant) => write!(f, "{AMPERES}={constant}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use hapt_testing::prelude::*;

    use super::*;

    proptest! {
        /// With a wrong constant a motor gives `gain` of each commanded torque; with the corrected one it gives the commanded torque, and
        /// the address that is printed has the same constant.
        #[test]
        fn a_corrected_constant_gives_the_commanded_torque(
            is_current in any::<bool>(), of_the_motor in 1e-3_f64..1e3, guess in 1e-3_f64..1e3, torque in -10.0_f64..10.0,
        ) {
            let make = if is_current { MotorConstant::TorqueConstant } else { MotorConstant::VoltsPerTorque };
            let torque_of = |target: f64| if is_current { target * of_the_motor } else { target / of_the_motor };
            let guess = make(guess);
            let gain = torque_of(guess.target(1.0));
            let corrected = guess.corrected(gain);
            let given = torque_of(corrected.target(torque));
            prop_assert!((given - torque).abs() <= 1e-4 * torque.abs());
            prop_assert_eq!(corrected.to_string().parse(), Ok(corrected));
        }
    }
}
