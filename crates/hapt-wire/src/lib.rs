//! A world as bytes for a microcontroller, which has no file system, and the frames that carry bytes.
//!
//! [`write()`] makes the bytes of a [`Spec`], [`Stored::read`] checks them and holds the world in memory of fixed size. The format is
//! postcard's, after a version and before a checksum; incomplete or corrupted bytes and other versions are refused as a whole. [`frame()`]
//! and [`Reader`] carry any message over a line that loses and corrupts bytes; [`HostMessage`] and [`DeviceMessage`] are the messages between a
//! host and a board (docs/wire.md), [`pack`] is the world with its limits for a board.
//!
//! ```
//! use hapt_core::{Body, Coupling, End, Estimator, Law, Loop, Method, Output, Spec};
//! use hapt_wire::{Stored, write};
//!
//! let spec = Spec {
//!     period: 1e-3,
//!     method: Method::Zoh,
//!     output: Output::End,
//!     advance: 0,
//!     bodies_every: 1,
//!     estimator: Estimator::Difference,
//!     filter: None,
//!     count: None,
//!     limit: Some(0.8),
//!     levels: None,
//!     bodies: &[Body { inertia: 0.0258, position: 0.0, velocity: 0.0 }],
//!     couplings: &[Coupling {
//!         first: End::Puck,
//!         second: End::Body(0),
//!         law: Law::Spring { stiffness: 1.02, rest: 0.0 },
//!         limit: None,
//!     }],
//! };
//! let mut room = [0; 512];
//! let bytes = write(&spec, &mut room)?;
//! let stored = Stored::<4, 8>::read(bytes)?;
//! assert_eq!(stored.spec(), spec);
//! let world = Loop::<f32, 4, 8, 17>::new(&stored.spec()).unwrap();
//! # Ok::<(), hapt_wire::Error>(())
//! ```
#![no_std]
#![warn(clippy::wildcard_enum_match_arm)]
#![forbid(unsafe_code)]

mod bytes;
mod cobs;
mod coupling;
pub mod device;
mod frame;
#[cfg(feature = "link")]
pub mod link;
mod load;
mod message;
pub mod pid;
#[cfg(feature = "usb")]
pub mod usb;
mod world;

use crc::{CRC_16_IBM_3740, Crc};

/// The checksum of worlds and frames: polynomial 0x1021, from 0xffff.
const SUM: Crc<u16> = Crc::<u16>::new(&CRC_16_IBM_3740);

pub use frame::{Reader, frame};
pub use load::{LARGEST, hash, pack, pack_wheel, unpack};
pub use message::{
    BODIES, Command, DeviceMessage, Hello, HostMessage, MAX_FRAME_BYTES, PIECE, PROTOCOL, Parameter, ROOM, Refusal,
    States, Telemetry,
};

#[doc(inline)]
pub use hapt_core::Spec;
pub use world::{Error, Stored, VERSION, write};
