//! A board that runs hapt's firmware, from the computer's side: docs/wire.md, spoken.
//!
//! [`Link::open`] greets the board at a serial port; [`Link::load`] gives it a world, [`Link::arm`] its torque. The board itself takes the
//! torque away when nobody calls [`Link::keep`] for longer than its world allows; a link that is dropped with a torque on says stop.
//!
//! ```no_run
//! use std::time::{Duration, Instant};
//!
//! use hapt_link::Link;
//! # let packed: &[u8] = &[];
//!
//! let mut link = Link::open("/dev/ttyACM0".as_ref())?;
//! println!("{} with firmware {}", link.board().name, link.board().firmware);
//! let world = link.load(packed)?;
//! link.arm(world)?;
//! for _ in 0..100 {
//!     link.keep()?;
//!     while let Some(telemetry) = link.telemetry(Instant::now() + Duration::from_millis(20))? {
//!         println!("{} rad, {} N m", telemetry.position, telemetry.output);
//!     }
//! }
//! link.disarm()?;
//! # Ok::<(), hapt_link::Error>(())
//! ```
#![cfg(unix)]

mod board;
mod error;
mod link;
pub mod simulate;

pub use board::Board;
pub use error::Error;
pub use hapt_line::{Line, SPEED, pty};
pub use hapt_wire::{Parameter, Refusal, Telemetry};
pub use link::Link;
