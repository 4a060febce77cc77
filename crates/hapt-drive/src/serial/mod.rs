//! Serial ports and pseudoterminals: raw bytes, read and written until an instant, without allocating.
//!
//! The crate `serial2` configures a port: 8 data bits, no parity, one stop bit, any speed.

use std::io;
use std::path::PathBuf;

#[cfg(unix)]
mod unix;
#[cfg(windows)]
mod windows;

#[cfg(unix)]
pub use unix::{Line, pty, wait};
#[cfg(windows)]
pub use windows::Line;

/// The default speed of a UART between a computer and a board or a drive, in bits per second. USB ports accept any speed.
pub const SPEED: u32 = 921_600;

/// The serial ports that the system lists, by name. On Linux [`crate::ports()`] gives more details of those on USB.
///
/// # Errors
/// Those of the system.
pub fn names() -> io::Result<Vec<PathBuf>> {
    let mut names = serial2::SerialPort::available_ports()?;
    names.sort();
    Ok(names)
}
