//! A session with a loop, which runs on a thread of this computer or on a board with hapt's firmware.
//!
//! [`Session`] is the state machine of a loop: it holds the world, arms and disarms it, sets keys, moves a simulated hand and records. It
//! takes a [`WorldConfig`] (a world file and the keys set over it) and a [`Machine`] (which runs the loop), and is advanced by [`Session::poll`].
//! `device` opens a machine by its address, such as `sim` or `moteus:/dev/ttyACM0`.
//! `hapt run` and `hapt live` are both thin layers over it.
//!
//! [`PageSession`] is a session with pages: it takes their [`messages`], and gives messages and telemetry [`frames`] for them.
//!
//! With [`Machine::stepped`] a session needs no thread and no clock: a page without a server runs it as WebAssembly.
//!
//! `board` is the host's side of a board: its serial port, its worlds, its torque.
//!
//! ```no_run
//! use std::time::{Duration, Instant};
//!
//! use hapt_core::Request;
//! use hapt_host::{Machine, Session, WorldConfig};
//! use hapt_model::Source;
//!
//! let config = WorldConfig::new(Source::open("wheel.toml")?, Vec::new())?;
//! let machine = Machine::simulated(&config.world);
//! let mut session = Session::start(config, machine)?;
//! session.request(Request::Arm, session.handle().epoch())?;
//! let begin = Instant::now();
//! while session.time() < 1.0 {
//!     std::thread::sleep(Duration::from_millis(5));
//!     session.poll(begin.elapsed(), |sample| println!("{} {}", sample.position, sample.record.output));
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
// Every match names all variants, so that a new one does not compile by default.
#![warn(clippy::wildcard_enum_match_arm)]

mod attached;
#[cfg(not(target_family = "wasm"))]
pub mod board;
#[cfg(not(target_family = "wasm"))]
mod board_loop;
mod config;
#[cfg(not(target_family = "wasm"))]
pub mod conform;
#[cfg(not(target_family = "wasm"))]
pub mod device;
mod error;
pub mod frames;
#[cfg(target_os = "linux")]
pub mod game_wheel;
mod hand;
pub mod keys;
pub mod links;
mod local;
mod machine;
pub mod messages;
#[cfg(not(target_family = "wasm"))]
mod packed;
mod page;
mod recording;
pub mod rule;
mod runner;
mod session;
pub mod simulated_network;
#[cfg(test)]
mod testing;
mod worker;

pub use config::{Rule, WorldConfig, WorldName};
#[cfg(not(target_family = "wasm"))]
pub use device::{DeviceAddress, DeviceError};
pub use error::Error;
pub use hand::VirtualHand;
pub use keys::SettableKey;
pub use machine::{Backend, Machine, StationView, WheelView};
#[cfg(not(target_family = "wasm"))]
pub use packed::packed;
pub use page::{PageSession, describe};
pub use recording::{Recording, RecordingStatus};
pub use session::{Event, NotTaken, Sample, Session};
pub use worker::Task;
