//! The faults of a moteus, and the corresponding reasons of the supervisor.

use hapt_core::Reason;

use super::mode;
use crate::drive::DriveFault;

/// Another host commands the drive, or requests data, and may command it next.
pub const FOREIGN: DriveFault = DriveFault { code: 0, what: "another host addresses it", reason: Some(Reason::Link) };

/// The drive does not execute the commands, or does not confirm them.
pub const NOT_EXECUTED: DriveFault = DriveFault {
    code: 0,
    what: "commands do not reach it, or their answers do not come back",
    reason: Some(Reason::Late),
};

/// The meaning of mode and fault register, where the drive gives no torque, or may give another one than commanded. A number that is not
/// known to be harmless is a fault in every mode: a new firmware may continue with it. A stopped drive keeps the number of its last fault
/// up to the next start.
pub fn fault(mode: i32, code: i32) -> Option<DriveFault> {
    match mode {
        mode::FAULT => Some(named(code)),
        mode::TIMEOUT => Some(DriveFault {
            code: mode::TIMEOUT as u32,
            what: "its watchdog expired: no command arrived in time",
            reason: Some(Reason::Late),
        }),
        mode::STOPPED => None,
        _ => match code {
            0 | FLUX_BRAKING | FIELD_WEAKENING => None,
            _ => Some(limit(code).unwrap_or_else(|| named(code))),
        },
    }
}

/// These codes set a current that gives no torque, and are harmless.
const FLUX_BRAKING: i32 = 104;
const FIELD_WEAKENING: i32 = 105;

/// The drive's own configuration limits its torque: the motor differs from the certified one.
fn limit(code: i32) -> Option<DriveFault> {
    let (what, reason) = match code {
        96 => ("it limits its torque above servo.max_velocity: set it above the largest velocity of the wheel", None),
        97 => ("it limits its torque at servo.max_power_W: raise it, or lower device.limit", None),
        98 => ("its supply's voltage is too low for this torque at this speed: raise it, or lower device.limit", None),
        99 => ("it limits its torque at servo.max_current_A: raise it, or lower device.limit", None),
        100 => ("it holds its torque back because its board is near servo.fault_temperature", Some(Reason::DriverHeat)),
        101 => ("it holds its torque back because its motor is near servo.motor_fault_temperature", Some(Reason::Heat)),
        102 => ("the torque command exceeded the limit in its own message", Some(Reason::Torque)),
        103 => (
            "it limits its torque at its position limits: set servopos.position_min and servopos.position_max to nan",
            None,
        ),
        106.. => ("it limits its output for an unknown reason", None),
        _ => return None,
    };
    Some(DriveFault { code: number(code), what, reason })
}

/// The number in the drive's own notation: the register is read as a signed byte.
fn number(code: i32) -> u32 {
    u32::from(code as u8)
}

/// The fault of a number in register 0x00f.
fn named(code: i32) -> DriveFault {
    let (what, reason) = match code {
        32 => ("calibration fault: the encoder detected no magnet", Some(Reason::Jump)),
        33 => ("motor driver fault, usually a voltage drop of the supply", None),
        34 => ("over voltage", None),
        35 => ("encoder fault: no magnet detected", Some(Reason::Jump)),
        36 => ("the motor is not configured: calibrate it with moteus_tool", None),
        37 => ("its control cycle took too long", Some(Reason::Late)),
        38 => ("over temperature", Some(Reason::DriverHeat)),
        39 => {
            ("started outside of its position limits: set servopos.position_min and servopos.position_max to nan", None)
        }
        40 => ("under voltage", None),
        41 => ("its configuration was changed while running", None),
        42 => ("its commutation angle is not valid: calibrate it with moteus_tool", Some(Reason::Jump)),
        43 => ("its position is not valid", Some(Reason::Jump)),
        44 => ("its motor driver does not switch on", None),
        45 => ("a stop position was combined with a velocity", None),
        46 => ("its timing was violated", Some(Reason::Late)),
        47 => ("servo.bemf_feedforward without a limit of acceleration: set it to 0", None),
        48 => ("servopos.position_min or servopos.position_max is out of range: set both to nan", None),
        49 => ("its position control error was larger than servo.fault_position_error: set that to nan", None),
        50 => ("its velocity control error was larger than servo.fault_velocity_error: set that to nan", None),
        _ => ("an unknown fault", None),
    };
    DriveFault { code: number(code), what, reason }
}

/// The drive is in another mode than the loop has set.
pub fn taken(mode: i32) -> DriveFault {
    DriveFault {
        code: u32::try_from(mode).unwrap_or(0),
        what: "another host has stopped it or changed its mode",
        reason: Some(Reason::Stop),
    }
}
