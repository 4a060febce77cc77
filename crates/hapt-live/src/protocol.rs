//! What the page and the server say to each other: version 1, text frames of JSON. The telemetry is in [`crate::frames`].
//!
//! Numbers are SI; where people read or write a quantity, it is a string with its unit.

mod said;
mod says;

pub use said::{FARTHEST, LONGEST, Said, Wish};
pub use says::*;

/// The version that both sides say in their hello.
pub const VERSION: u32 = 1;
