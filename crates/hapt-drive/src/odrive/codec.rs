//! CANSimple: the messages of ODrive's drives, by the DBC files of firmware 0.5.6 and 0.6.10.
//!
//! A frame's 11-bit identifier is `node << 5 | command`, its data up to 8 bytes, numbers little-endian, floats of 32 bits. Positions
//! are in revolutions, torques in N·m. A host requests data by a remote frame of the same identifier.
//!
//! This host always sends 8 bytes. A short frame of a host is padded with zeros, as in the drive; a frame of the drive that lacks a field
//! is ignored.

use hapt_core::Reason;
use hapt_rt::DriveFault;

/// The largest number of a node.
pub const LARGEST_NODE: u8 = 63;

/// The axis states that are used here.
pub mod state {
    /// Disarmed: no current in the motor.
    pub const IDLE: u32 = 1;
    /// The controller is active.
    pub const CLOSED_LOOP: u32 = 8;
}

/// The control modes.
pub mod control {
    /// Torque control.
    pub const TORQUE: u32 = 1;
    /// Velocity control.
    pub const VELOCITY: u32 = 2;
    /// Position control.
    pub const POSITION: u32 = 3;
}

/// The input mode without filter.
pub const PASSTHROUGH: u32 = 1;

hapt_core::named! {
    /// The command of a frame, its last five bits.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    #[repr(u8)]
    pub enum Command {
        /// The firmware's version; 0.5 does not answer.
        Version = 0x00 => "version",
        /// Every 100 ms unless configured otherwise.
        Heartbeat = 0x01 => "heartbeat",
        /// Disarms, with an error.
        Estop = 0x02 => "estop",
        /// The present errors, and the reason of the last disarming. In 0.5: the motor's errors.
        Error = 0x03 => "error",
        /// Requests an axis state.
        State = 0x07 => "state",
        /// Position and velocity.
        Estimates = 0x09 => "estimates",
        /// The control mode and the input mode.
        Mode = 0x0b => "mode",
        /// The position setpoint.
        Position = 0x0c => "position",
        /// The velocity setpoint.
        Velocity = 0x0d => "velocity",
        /// The torque setpoint.
        Torque = 0x0e => "torque",
        /// The limits of velocity and current.
        Limits = 0x0f => "limits",
        /// The motor's current, setpoint and measurement.
        Current = 0x14 => "current",
        /// The temperatures. Before 0.6: the sensorless estimates.
        Warmth = 0x15 => "temperature",
        /// Restarts the drive.
        Reboot = 0x16 => "reboot",
        /// The supply's voltage and current.
        Bus = 0x17 => "bus",
        /// Clears the errors.
        Clear = 0x18 => "clear",
        /// Sets the present position.
        Absolute = 0x19 => "absolute",
        /// From 0.6 on: the torque, setpoint and estimate.
        Torques = 0x1c => "torques",
        /// From 0.6 on: electrical and mechanical power. Before: the controller's errors.
        Powers = 0x1d => "powers",
    }
}

impl Command {
    /// The frame's identifier.
    pub fn id(self, node: u8) -> u16 {
        u16::from(node & LARGEST_NODE) << 5 | self as u16
    }

    /// Whether drives send it with data; all other commands come from a host.
    pub fn is_a_drives(self) -> bool {
        let of_drives = [Command::Version, Command::Heartbeat, Command::Error, Command::Estimates];
        let on_request = [Command::Current, Command::Warmth, Command::Bus, Command::Torques, Command::Powers];
        of_drives.contains(&self) || on_request.contains(&self)
    }

    /// The command of an identifier; `None`: an unknown command.
    pub fn of(id: u16) -> Option<Self> {
        Command::ALL.into_iter().find(|command| *command as u16 == id & 0x1f)
    }
}

/// The node of an identifier.
pub fn node(id: u16) -> u8 {
    (id >> 5) as u8 & LARGEST_NODE
}

/// The data of two numbers of 32 bits.
pub fn pair(first: u32, second: u32) -> [u8; 8] {
    let mut data = [0; 8];
    data[..4].copy_from_slice(&first.to_le_bytes());
    data[4..].copy_from_slice(&second.to_le_bytes());
    data
}

/// The same of two floats.
pub fn floats(first: f32, second: f32) -> [u8; 8] {
    pair(first.to_bits(), second.to_bits())
}

/// A host's data, padded with zeros.
pub fn padded(data: &[u8]) -> [u8; 8] {
    let mut whole = [0; 8];
    for (to, from) in whole.iter_mut().zip(data) {
        *to = *from;
    }
    whole
}

/// The two numbers of 32 bits in whole data.
pub fn numbers(data: [u8; 8]) -> (u32, u32) {
    let [a, b, c, d, e, f, g, h] = data;
    (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]))
}

/// The two floats in a drive's data; `None` where it is too short for both.
pub fn two_floats(data: &[u8]) -> Option<(f32, f32)> {
    let (first, second) = numbers(data.try_into().ok()?);
    Some((f32::from_bits(first), f32::from_bits(second)))
}

/// A drive's heartbeat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Heartbeat {
    /// The present errors; from 0.6 on also the reason of the last disarming.
    pub error: u32,
    /// The axis state.
    pub state: u8,
}

impl Heartbeat {
    /// The data of a heartbeat of 0.6.
    pub fn data(self) -> [u8; 8] {
        pair(self.error, u32::from(self.state))
    }

    /// Reads the first 5 bytes; the rest differs between versions.
    pub fn read(data: &[u8]) -> Option<Self> {
        let &[a, b, c, d, state, ..] = data else { return None };
        Some(Heartbeat { error: u32::from_le_bytes([a, b, c, d]), state })
    }
}

/// A drive's firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Version {
    /// 0 so far.
    pub major: u8,
    /// 6, or 5 where it does not answer.
    pub minor: u8,
    /// Counted from 0.
    pub revision: u8,
}

impl Version {
    /// The last version that does not answer the request.
    pub const SILENT: Version = Version { major: 0, minor: 5, revision: 6 };
    /// A version that answers.
    pub const LATE: Version = Version { major: 0, minor: 6, revision: 10 };

    /// The data of an answer: protocol 2, an unknown board.
    pub fn data(self) -> [u8; 8] {
        [2, 0, 0, 0, self.major, self.minor, self.revision, 0]
    }

    /// Reads 7 bytes or more.
    pub fn read(data: &[u8]) -> Option<Self> {
        let &[_, _, _, _, major, minor, revision, ..] = data else { return None };
        Some(Version { major, minor, revision })
    }

    /// The bit of an expired watchdog.
    pub fn watchdog(self) -> u32 {
        if self.is_old() { 0x800 } else { 0x0100_0000 }
    }

    /// The bit of a requested emergency stop.
    pub fn estop(self) -> u32 {
        if self.is_old() { 0x4000 } else { 0x0200_0000 }
    }

    /// The meaning of an error: the first of its bits that has a name.
    pub fn fault(self, error: u32) -> DriveFault {
        let table = if self.is_old() { OLD_ERRORS } else { ERRORS };
        let named = table.iter().find(|(bit, ..)| error & bit != 0);
        let (_, what, reason) = *named.unwrap_or(&(0, "disarmed, without an error", None));
        DriveFault { code: error, what, reason }
    }

    /// Before 0.6 errors had other numbers, and the heartbeat contained only the present errors.
    pub fn is_old(self) -> bool {
        (self.major, self.minor) < (0, 6)
    }
}

/// A bit of an axis's error, its name, and the corresponding reason of the supervisor, if any.
type Named = (u32, &'static str, Option<Reason>);

/// From 0.6 on.
const ERRORS: &[Named] = &[
    // The most specific errors come first: a fault often sets several bits.
    (0x0100_0000, "WATCHDOG_TIMER_EXPIRED", Some(Reason::Late)),
    (0x0200_0000, "ESTOP_REQUESTED", Some(Reason::Stop)),
    (0x2000, "MOTOR_OVER_TEMP", Some(Reason::Heat)),
    (0x4000, "INVERTER_OVER_TEMP", Some(Reason::DriverHeat)),
    (0x8000, "VELOCITY_LIMIT_VIOLATION", Some(Reason::Overspeed)),
    (0x0400_0000, "SPINOUT_DETECTED", None),
    (0x20, "DRV_FAULT", None),
    (0x100, "DC_BUS_OVER_VOLTAGE", None),
    (0x200, "DC_BUS_UNDER_VOLTAGE", None),
    (0x400, "DC_BUS_OVER_CURRENT", None),
    (0x800, "DC_BUS_OVER_REGEN_CURRENT", None),
    (0x1000, "CURRENT_LIMIT_VIOLATION", None),
    (0x1_0000, "POSITION_LIMIT_VIOLATION", None),
    (0x0800_0000, "BRAKE_RESISTOR_DISARMED", None),
    (0x1000_0000, "THERMISTOR_DISCONNECTED", None),
    (0x4000_0000, "CALIBRATION_ERROR", None),
    (0x8, "MISSING_ESTIMATE", None),
    (0x10, "BAD_CONFIG", None),
    (0x40, "MISSING_INPUT", None),
    (0x4, "TIMING_ERROR", None),
    (0x2, "SYSTEM_LEVEL", None),
    (0x1, "INITIALIZING", None),
];

/// Before.
const OLD_ERRORS: &[Named] = &[
    (0x800, "WATCHDOG_TIMER_EXPIRED", Some(Reason::Late)),
    (0x4000, "ESTOP_REQUESTED", Some(Reason::Stop)),
    (0x4_0000, "OVER_TEMP", Some(Reason::DriverHeat)),
    (0x2, "DC_BUS_UNDER_VOLTAGE", None),
    (0x4, "DC_BUS_OVER_VOLTAGE", None),
    (0x8, "CURRENT_MEASUREMENT_TIMEOUT", None),
    (0x10, "BRAKE_RESISTOR_DISARMED", None),
    (0x100, "ENCODER_FAILED", None),
    (0x200, "CONTROLLER_FAILED", None),
    (0x80, "SENSORLESS_ESTIMATOR_FAILED", None),
    (0x40, "MOTOR_FAILED", None),
    (0x20, "MOTOR_DISARMED", None),
    (0x1000, "MIN_ENDSTOP_PRESSED", None),
    (0x2000, "MAX_ENDSTOP_PRESSED", None),
    (0x2_0000, "HOMING_WITHOUT_ENDSTOP", None),
    (0x8_0000, "UNKNOWN_POSITION", None),
    (0x1, "INVALID_STATE", None),
];
