//! Motor drives as devices of the loop, over serial ports and CAN; and the same drives simulated. Drives need Linux; serial ports work on
//! every system.
//!
//! A [`Drive`] is the interface of a drive's protocol: start, read, command, stop. A [`DriveDevice`] makes it the loop's device: it holds
//! the direction and the transmission between drive and puck, and leaves no torque on, however the loop ends. All protocols use a [`Bus`],
//! which sends and receives CAN frames: a socket of the system, or a text protocol over a [`Line`].
//!
//! ```text
//!   DriveDevice (hapt_rt::Device)      Simulator
//!     |                                  |        \
//!   Drive: moteus, odrive, simplefoc   Firmware   Puck
//!     |                                  |
//!   Bus: socket, fdcanusb, slcan, text <-> Bus
//! ```
//!
//! Functions on the loop's thread allocate nothing, and wait until a given instant at most.
// Every match names all variants, so that a new one does not compile by default.
#![warn(clippy::wildcard_enum_match_arm)]

pub mod serial;

#[cfg(target_os = "linux")]
mod address;
#[cfg(target_os = "linux")]
pub mod can;
#[cfg(target_os = "linux")]
mod device;
#[cfg(target_os = "linux")]
mod drive;
#[cfg(target_os = "linux")]
mod frame;
#[cfg(target_os = "linux")]
pub mod moteus;
#[cfg(target_os = "linux")]
pub mod odrive;
#[cfg(target_os = "linux")]
mod ports;
#[cfg(target_os = "linux")]
pub mod simplefoc;
#[cfg(target_os = "linux")]
pub mod simulate;
#[cfg(target_os = "linux")]
pub mod slcan;
#[cfg(target_os = "linux")]
mod text;

pub use serial::Line;
#[cfg(unix)]
pub use serial::pty;
#[cfg(target_os = "linux")]
pub use {
    address::{Address, BusAddress, Make},
    can::{Bus, Socket},
    device::{DriveDevice, Mounting},
    drive::{Drive, DriveError, DriveLimits, Error, ShaftState},
    frame::Frame,
    ports::{Port, ports},
    text::Lines,
};
