//! The loop in real time behind a web page.
//!
//! [`Live::start`] takes a world and an address, and runs three things on threads of their own: the loop ([`hapt_rt::Engine`], which knows
//! nothing of pages), the [`desk`], which owns it and speaks with the pages, and the [`server`], which carries what they say. A
//! [`judge`] computes the certificate aside, and a worker what takes long. Between them are bounded queues, and only the desk ever waits for
//! something to do. Stop, and the word that whoever has control is there, go from the server to the loop itself:
//!
//! ```text
//! browser <-> server <-> desk <-> loop, or a board
//!                 |       |  \      |
//!                 |     judge worker, recorder
//!                 +--- stop --------+
//! ```
//!
//! [`standalone`] writes the same page with all of that left out, for a folder without a server.
//!
//! The messages are in [`protocol`], the telemetry in [`frames`], who may come in is in [`access`].

pub mod access;
pub mod assets;
mod attached;
#[cfg(unix)]
mod board;
pub mod control;
mod counted;
pub mod desk;
pub mod frames;
mod hand;
mod http;
pub mod judge;
pub mod keys;
mod live;
mod packed;
pub mod protocol;
mod recording;
mod requests;
mod runner;
mod sensible;
pub mod server;
#[cfg(unix)]
mod shown;
mod socket;
pub mod standalone;
pub mod state;
mod status;
#[cfg(test)]
mod testing;
mod worker;

pub use live::{Error, Live, Machine, Options, PORT, Runs};
pub use packed::packed;
#[cfg(unix)]
pub use shown::Shown;
