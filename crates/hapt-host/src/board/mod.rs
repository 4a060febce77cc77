//! The host's side of a board that runs hapt's firmware (docs/wire.md).
//!
//! [`Link::open`] opens a serial port and makes the handshake; [`Link::load`] loads a world, [`Link::arm`] switches its torque on. Without
//! [`Link::heartbeat`] for longer than its world allows the board itself removes the torque; a link that is dropped with a torque on sends a
//! stop.
//!
//! ```no_run
//! use std::time::{Duration, Instant};
//!
//! use hapt_host::board::Link;
//! # let packed: &[u8] = &[];
//!
//! let mut link = Link::open("/dev/ttyACM0".as_ref())?;
//! println!("{} with firmware {}", link.board().name, link.board().firmware);
//! let world = link.load(packed)?;
//! link.arm(world)?;
//! for _ in 0..100 {
//!     link.heartbeat()?;
//!     while let Some(telemetry) = link.telemetry(Instant::now() + Duration::from_millis(20))? {
//!         println!("{} rad, {} N m", telemetry.position, telemetry.output);
//!     }
//! }
//! link.disarm()?;
//! # Ok::<(), hapt_host::board::Error>(())
//! ```

mod error;
mod info;
mod link;
#[cfg(unix)]
pub mod simulate;
mod telemetry;

pub use error::Error;
#[cfg(unix)]
pub use hapt_drive::serial::pty;
pub use hapt_drive::serial::{Line, SPEED, names};
pub use hapt_wire::{Parameter, Refusal, Telemetry};
pub use info::Board;
pub use link::Link;
pub use telemetry::TelemetryDecoder;
pub(crate) use telemetry::phase;
