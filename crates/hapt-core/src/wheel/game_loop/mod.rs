//! The loop that a game closes: it computes a torque from the wheel's position, late and at a rate of its own.

mod cost;

pub use cost::{Damper, HostTime};
