//! SimpleFOC on a maker's board: lines of text through its Commander, and the sketch that answers them.
//!
//! Commander has no watchdog, no checksum and no answer to a target. So the board runs the sketch `simplefoc_drive` of the Arduino library
//! that `hapt export c --arduino` writes: it registers one letter with Commander, after which a line has a kind, a number, data, and a
//! checksum. Each line has one answer.

mod back;
mod codec;
mod constant;
mod fault;
mod lines;
mod proof;
mod simulated;

pub use back::SimpleFoc;
pub use constant::MotorConstant;
pub use lines::{Adapter, Client};
pub use simulated::{Simulated, VOLTS_PER_TORQUE};

/// The version of the protocol that the sketch has to have.
pub const VERSION: u8 = 1;
