//! Ports by name, such as `COM3`. Timeouts are whole milliseconds, which is enough for a board: it runs the loop itself.

use std::io;
use std::path::Path;
use std::time::{Duration, Instant};

use serial2::SerialPort;

use super::SPEED;

/// An open serial port.
#[derive(Debug)]
pub struct Line {
    port: SerialPort,
}

impl Line {
    /// Opens the port at `path` raw, at [`SPEED`]. The system opens a port for one program at a time.
    ///
    /// # Errors
    /// It does not exist, is not a serial port, or is in use by another program.
    pub fn open(path: &Path) -> io::Result<Self> {
        Line::open_at(path, SPEED)
    }

    /// The same at another speed, in bits per second.
    ///
    /// # Errors
    /// As [`Line::open`], or the port does not support the speed.
    pub fn open_at(path: &Path, speed: u32) -> io::Result<Self> {
        let port = SerialPort::open(path, |mut settings: serial2::Settings| {
            settings.set_raw();
            settings.set_baud_rate(speed)?;
            Ok(settings)
        });
        let port = port.map_err(|error| match error.kind() {
            io::ErrorKind::PermissionDenied => io::Error::other("it is in use by another program"),
            io::ErrorKind::NotFound => io::Error::new(error.kind(), "there is no such port"),
            _ => error,
        })?;
        Ok(Line { port })
    }

    /// Reads at least one byte; returns 0 if none arrives until that instant.
    ///
    /// # Errors
    /// The port is gone.
    pub fn read(&mut self, into: &mut [u8], until: Instant) -> io::Result<usize> {
        loop {
            self.port.set_read_timeout(left(until))?;
            match self.port.read(into) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(count) => return Ok(count),
                Err(error) if error.kind() == io::ErrorKind::TimedOut => {
                    if Instant::now() >= until {
                        return Ok(0);
                    }
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Writes all bytes.
    ///
    /// # Errors
    /// The port is gone, or has not accepted them until that instant.
    pub fn write(&mut self, mut bytes: &[u8], until: Instant) -> io::Result<()> {
        while !bytes.is_empty() {
            self.port.set_write_timeout(left(until))?;
            match self.port.write(bytes) {
                Ok(count) => bytes = &bytes[count..],
                Err(error) if error.kind() == io::ErrorKind::TimedOut && Instant::now() < until => {}
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

/// The time until then; at least 1 ms, as 0 would be no limit.
fn left(until: Instant) -> Duration {
    until.saturating_duration_since(Instant::now()).max(Duration::from_millis(1))
}
