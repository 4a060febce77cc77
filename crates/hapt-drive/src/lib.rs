//! Motor drives as devices of the loop, over serial ports and CAN; and the same drives simulated.
//!
//! A [`Drive`] is what a drive's protocol comes to: start, read, command, stop. A [`Wheel`] makes it the loop's device: it knows which
//! way the drive turns, what stands between it and the puck, and leaves no torque on, however the loop ends. What the protocols have in
//! common is a [`Bus`], a way to send and receive CAN frames: a socket of the system's, or a text protocol over a [`Line`].
//!
//! ```text
//!   Wheel (hapt_rt::Device)            Simulator
//!     |                                  |        \
//!   Drive: moteus, odrive              Firmware   Puck
//!     |                                  |
//!   Bus: socket, fdcanusb, slcan  <--->  Bus
//! ```
//!
//! What is called on the loop's thread allocates nothing, and waits until an instant that it is given, no longer.

#![cfg(target_os = "linux")]

mod address;
pub mod can;
mod drive;
mod frame;
pub mod moteus;
pub mod odrive;
mod ports;
pub mod simulate;
pub mod slcan;
mod text;
mod wheel;

pub use address::{Address, Make};
pub use can::{Bus, Socket};
pub use drive::{Answer, Drive, Error, Terms, Trouble};
pub use frame::Frame;
pub use hapt_line::{Line, pty};
pub use ports::{Port, ports};
pub use text::Lines;
pub use wheel::{Mounting, Wheel};
