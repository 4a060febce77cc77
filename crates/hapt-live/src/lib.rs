//! The loop in real time behind a web page.
//!
//! [`Live::start`] takes a world and an address. It starts the loop's session ([`hapt_host::Session`]), the [`session`] with the pages, which
//! owns it, and the [`server`], which carries their messages. A [`certifier`] computes the certificate on its own threads. Bounded queues
//! connect the threads. Stop, and the heartbeats of the client in control, bypass the queues and go directly from the server to the loop:
//!
//! ```text
//! browser <-> server <-> session with the pages <-> session of the loop <-> loop, or a board
//!                 |          |                                               |
//!                 |       certifier                                          |
//!                 +--------- stop, heartbeats -------------------------------+
//! ```
//!
//! The stations of a [`network`] have a page each, and a certificate together.
//!
//! [`standalone`] writes the same page as files, for a folder without a server.
//!
//! The messages are in [`hapt_host::messages`], the telemetry in [`hapt_host::frames`], the admission of requests in [`access`].
// Every match names all variants, so that a new one does not compile by default.
#![warn(clippy::wildcard_enum_match_arm)]

pub mod access;
mod allowance;
pub mod assets;
pub mod certifier;
mod clients;
pub mod control;
mod counted;
mod http;
mod live;
pub mod network;
mod requests;
pub mod sender;
pub mod server;
pub mod session;
mod socket;
pub mod standalone;

pub use live::{Error, Live, Options, PORT};
