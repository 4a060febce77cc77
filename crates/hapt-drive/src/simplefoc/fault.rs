//! The faults of a SimpleFOC board, and the corresponding reasons of the supervisor.

use hapt_core::Reason;
use hapt_rt::DriveFault;

use super::codec::state;

/// The meaning of a state in which the motor does not render the target. A board that was switched on should be on, and any other off.
pub fn fault(state: u8, is_on: bool) -> Option<DriveFault> {
    let (what, reason) = match state {
        state::ON if is_on => return None,
        state::OFF if !is_on => return None,
        state::OFF => ("it has restarted, or its supply was interrupted", Some(Reason::Link)),
        state::ON => ("another program has switched it on", Some(Reason::Link)),
        state::EXPIRED => ("its watchdog expired: no target arrived in time", Some(Reason::Late)),
        state::REFUSED => ("it was given a target that is no number, or one beyond its limit", Some(Reason::Torque)),
        state::FAILED => (
            "its motor is not ready: initFOC failed, its driver switched itself off, or a command has changed its type of control",
            Some(Reason::Driver),
        ),
        _ => ("it is in an unknown state", None),
    };
    Some(DriveFault { code: state.into(), what, reason })
}

/// Targets, or the last target, do not arrive.
pub const NOT_EXECUTED: DriveFault =
    DriveFault { code: state::ON as u32, what: "targets do not reach it, or come late", reason: Some(Reason::Late) };
/// The sensor's angle is invalid.
pub const NO_ANGLE: DriveFault =
    DriveFault { code: state::ON as u32, what: "its sensor gives no angle", reason: Some(Reason::Jump) };
/// Turns are counted in 16 bits.
pub const FARTHEST: DriveFault =
    DriveFault { code: state::ON as u32, what: "it has counted all the turns that it can", reason: Some(Reason::Jump) };
/// Of a motor controlled by voltage: the sketch reports the applied voltage exactly.
pub const ANOTHER_TARGET: DriveFault = DriveFault {
    code: state::ON as u32,
    what: "it uses another voltage than the commanded one: its sketch or its voltage_limit changes it",
    reason: None,
};
/// Of a motor controlled by current.
pub const ANOTHER_CURRENT: DriveFault = DriveFault {
    code: state::ON as u32,
    what: "its motor has another current than the commanded one: check its supply, its current_limit and its current sensors",
    reason: None,
};
