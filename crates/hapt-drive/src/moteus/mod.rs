//! moteus: a register protocol in CAN FD frames, over the system's CAN or as the text of an fdcanusb.
//!
//! Source: the moteus controller reference, sections A.1 (frames) and A.2 (registers).

mod back;
mod fault;
mod fdcanusb;
mod numbers;
mod registers;
mod simulated;
mod tuning;

pub use back::Moteus;
pub use fdcanusb::{Adapter, Client};
pub use registers::{Parser, Resolution, Subframe, Value, Writer};
pub use simulated::Simulated;
pub use tuning::Tuning;

/// Pads a frame to a valid length.
pub const NOP: u8 = 0x50;
/// The bit of a frame's identifier that requests an answer.
const REPLY: u32 = 0x8000;
/// The broadcast identifier.
const BROADCAST: u32 = 0x7f;

/// Registers by their numbers.
mod register {
    pub const MODE: u32 = 0x000;
    pub const POSITION: u32 = 0x001;
    pub const VELOCITY: u32 = 0x002;
    pub const TORQUE: u32 = 0x003;
    pub const Q_CURRENT: u32 = 0x004;
    pub const D_CURRENT: u32 = 0x005;
    pub const ABS_POSITION: u32 = 0x006;
    pub const POWER: u32 = 0x007;
    pub const MOTOR_TEMPERATURE: u32 = 0x00a;
    pub const TRAJECTORY_COMPLETE: u32 = 0x00b;
    pub const HOME_STATE: u32 = 0x00c;
    pub const VOLTAGE: u32 = 0x00d;
    pub const TEMPERATURE: u32 = 0x00e;
    pub const FAULT: u32 = 0x00f;
    /// A register of voltage mode, which is unused here: it keeps its value until the next command.
    pub const VOLTAGE_PHASE_A: u32 = 0x014;
    pub const COMMAND_POSITION: u32 = 0x020;
    pub const COMMAND_VELOCITY: u32 = 0x021;
    pub const COMMAND_TORQUE: u32 = 0x022;
    pub const COMMAND_KP_SCALE: u32 = 0x023;
    pub const COMMAND_KD_SCALE: u32 = 0x024;
    pub const COMMAND_MAX_TORQUE: u32 = 0x025;
    pub const COMMAND_STOP_POSITION: u32 = 0x026;
    pub const COMMAND_TIMEOUT: u32 = 0x027;
    /// This and the next register limit internal trajectories. A negative number means no limit.
    pub const COMMAND_VELOCITY_LIMIT: u32 = 0x028;
    pub const COMMAND_ILIMIT_SCALE: u32 = 0x02b;
    pub const COMMAND_IGNORE_BOUNDS: u32 = 0x02d;
    pub const LAST_COMMAND: u32 = 0x02d;
    pub const MODEL: u32 = 0x100;
    pub const FIRMWARE: u32 = 0x101;
    pub const MAP: u32 = 0x102;
    pub const ID: u32 = 0x110;
    pub const SERIAL: u32 = 0x120;
    pub const SET_OUTPUT_NEAREST: u32 = 0x130;
    pub const SET_OUTPUT_EXACT: u32 = 0x131;
    pub const UUID: u32 = 0x150;
    pub const UUID_MASK: u32 = 0x154;
    pub const UUID_MASK_CAPABLE: u32 = 0x158;
}

/// Modes by their numbers.
mod mode {
    pub const STOPPED: i32 = 0;
    pub const FAULT: i32 = 1;
    pub const CURRENT: i32 = 9;
    pub const POSITION: i32 = 10;
    pub const TIMEOUT: i32 = 11;
    pub const ZERO_VELOCITY: i32 = 12;
    pub const BRAKE: i32 = 15;
    /// The first unused number.
    pub const END: i32 = 16;
}
