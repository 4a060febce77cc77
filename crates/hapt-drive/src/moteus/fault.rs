//! A moteus's faults, and what the supervisor calls them.

use hapt_core::Reason;

use super::mode;
use crate::drive::DriveFault;

/// Another host commands the drive, or asks it something: it may command it next.
pub const FOREIGN: DriveFault = DriveFault { code: 0, what: "another host speaks to it", reason: Some(Reason::Link) };

/// What a mode and a fault register say, where the drive gives no torque by its own decision.
pub fn fault(mode: i32, code: i32) -> Option<DriveFault> {
    match mode {
        mode::FAULT => Some(named(code)),
        mode::TIMEOUT => Some(DriveFault {
            code: mode::TIMEOUT as u32,
            what: "its watchdog has run out, no command came in time",
            reason: Some(Reason::Late),
        }),
        _ => None,
    }
}

/// By the number in register 0x00f.
fn named(code: i32) -> DriveFault {
    let (what, reason) = match code {
        32 => ("calibration fault, the encoder saw no magnet", Some(Reason::Jump)),
        33 => ("motor driver fault, most often the supply breaks down", None),
        34 => ("over voltage", None),
        35 => ("encoder fault, no magnet to be seen", Some(Reason::Jump)),
        36 => ("the motor is not configured: calibrate it with moteus_tool", None),
        37 => ("its control cycle took too long", Some(Reason::Late)),
        38 => ("over temperature", Some(Reason::DriverHeat)),
        39 => ("started outside of its position limits, servopos.position_min and position_max", None),
        40 => ("under voltage", None),
        41 => ("its configuration was changed under way", None),
        42 => ("its commutation angle is not valid: calibrate it with moteus_tool", Some(Reason::Jump)),
        43 => ("its position is not valid", Some(Reason::Jump)),
        44 => ("its driver does not switch on", None),
        45 => ("a stop position went with a velocity", None),
        46 => ("its timing was violated", Some(Reason::Late)),
        _ => ("an unknown fault", None),
    };
    DriveFault { code: u32::try_from(code).unwrap_or(0), what, reason }
}

/// The drive is in a mode that the loop has not put it into.
pub fn taken(mode: i32) -> DriveFault {
    DriveFault {
        code: u32::try_from(mode).unwrap_or(0),
        what: "somebody else has stopped it or put it into another mode",
        reason: Some(Reason::Stop),
    }
}
