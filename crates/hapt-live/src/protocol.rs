//! The messages between page and server: version 1, text frames of JSON. The telemetry is in [`crate::frames`].
//!
//! Numbers are SI; a quantity that people read or write is a string with its unit.

mod client;
mod server;

pub use client::{ClientMessage, Command, FARTHEST, LONGEST};
pub use server::*;

/// The version in the hello of both sides.
pub const VERSION: u32 = 1;
