//! A force-feedback wheel on USB: the HID Physical Interface Device protocol between a host and a wheel.
//!
//! [`DESCRIPTOR`] states the reports, [`Report`] is one of them, and [`Pool`] holds the effects that a host makes. What plays at a time is a list of
//! [`hapt_core::wheel::Effect`], which [`hapt_core::wheel::Wheel`] renders.

mod descriptor;
mod player;
mod pool;
mod report;

pub use descriptor::{BUTTONS, DESCRIPTOR, EFFECTS, FULL, INFINITE, id};
pub use player::Player;
pub use pool::{Pool, SILENCE, Scale};
pub use report::{Common, Condition, Control, Envelope, Input, Kind, LONGEST_REPORT, Operation, Periodic, Report};
