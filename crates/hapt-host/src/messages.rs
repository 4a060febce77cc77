//! The messages between a page and a session: version 1, text of JSON (docs/live.md). The telemetry is in [`crate::frames`].
//!
//! Numbers are SI; a quantity that people read or write is a string with its unit.

mod client;
mod server;
mod status;
mod world_file;

pub use client::{ClientMessage, Command, Controls, FARTHEST, MAX_MESSAGE_BYTES, NetworkChange};
pub use server::*;
pub use world_file::{NetworkFile, WorldFile};

/// The version in the hello of both sides.
pub const VERSION: u32 = 1;

#[cfg(test)]
mod typescript;
