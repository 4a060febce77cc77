//! Ports as files that are polled.
//!
//! `serial2` configures a port. Reading and writing are implemented here: its timeouts are whole milliseconds, and an exchange with a drive
//! takes a fraction of one.

use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{FlockOperation, Mode, OFlags, fcntl_setfl, flock, open};
use rustix::io::{Errno, FdFlags, fcntl_setfd};
use rustix::pty::{OpenptFlags, openpt, ptsname, unlockpt};
use serial2::SerialPort;

use super::SPEED;

/// An open serial port, or one end of a pseudoterminal. Reading and writing do not allocate.
#[derive(Debug)]
pub struct Line {
    fd: OwnedFd,
    /// The other end of a pseudoterminal, kept open so that programs may close and open it.
    _other: Option<OwnedFd>,
}

impl Line {
    /// Opens the port at `path` raw and exclusively, at [`SPEED`].
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
        let fd = open(path, OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC, Mode::empty())?;
        if !rustix::termios::isatty(&fd) {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is not a serial port"));
        }
        flock(&fd, FlockOperation::NonBlockingLockExclusive).map_err(|error| match error {
            Errno::WOULDBLOCK => io::Error::other("it is in use by another program"),
            error => error.into(),
        })?;
        let fd = configured(fd, speed)?;
        shorten_latency(path);
        Ok(Line { fd, _other: None })
    }

    /// Reads at least one byte; returns 0 if none arrives until that instant.
    ///
    /// # Errors
    /// The port is gone.
    pub fn read(&mut self, into: &mut [u8], until: Instant) -> io::Result<usize> {
        loop {
            match rustix::io::read(&self.fd, &mut *into) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(count) => return Ok(count),
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) => {
                    if !wait(&self.fd, PollFlags::IN, until)? {
                        return Ok(0);
                    }
                }
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// Writes all bytes.
    ///
    /// # Errors
    /// The port is gone, or has not accepted them until that instant.
    pub fn write(&mut self, mut bytes: &[u8], until: Instant) -> io::Result<()> {
        while !bytes.is_empty() {
            match rustix::io::write(&self.fd, bytes) {
                Ok(count) => bytes = &bytes[count..],
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) => {
                    if !wait(&self.fd, PollFlags::OUT, until)? {
                        return Err(io::ErrorKind::TimedOut.into());
                    }
                }
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }
}

/// A new pseudoterminal: one end for a simulated board or drive, and the path that others open as a serial port.
///
/// # Errors
/// The system has none.
pub fn pty() -> io::Result<(Line, PathBuf)> {
    let fd = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
    fcntl_setfd(&fd, FdFlags::CLOEXEC)?;
    fcntl_setfl(&fd, OFlags::RDWR | OFlags::NONBLOCK)?;
    unlockpt(&fd)?;
    let name = ptsname(&fd, Vec::new())?;
    let path = PathBuf::from(name.to_string_lossy().into_owned());
    let other = open(&path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
    let other = configured(other, SPEED)?;
    Ok((Line { fd, _other: Some(other) }, path))
}

/// Sets a port to raw bytes, 8N1, without flow control.
fn configured(fd: OwnedFd, speed: u32) -> io::Result<OwnedFd> {
    let mut port = SerialPort::from(fd);
    let mut settings = port.get_configuration()?;
    settings.set_raw();
    settings.set_baud_rate(speed)?;
    port.set_configuration(&settings)?;
    Ok(port.into())
}

/// Sets the latency timer of a USB serial chip from up to 16 ms to 1 ms. Without permission, or without such a timer, the port works
/// too, with slower exchanges.
fn shorten_latency(path: &Path) {
    let Ok(path) = path.canonicalize() else { return };
    let Some(name) = path.file_name() else { return };
    let _ = std::fs::write(Path::new("/sys/class/tty").join(name).join("device/latency_timer"), "1");
}

/// Waits for `what` on `fd`; `false` on a timeout.
///
/// # Errors
/// Those of the system.
pub fn wait(fd: impl AsFd, what: PollFlags, until: Instant) -> io::Result<bool> {
    let fd = fd.as_fd();
    loop {
        let left = until.saturating_duration_since(Instant::now());
        match poll(&mut [PollFd::new(&fd, what)], Some(&timespec(left))) {
            Ok(0) if left.is_zero() => return Ok(false),
            Ok(0) | Err(Errno::INTR) => {}
            Ok(_) => return Ok(true),
            Err(error) => return Err(error.into()),
        }
    }
}

fn timespec(time: Duration) -> Timespec {
    Timespec { tv_sec: i64::try_from(time.as_secs()).unwrap_or(i64::MAX), tv_nsec: time.subsec_nanos().into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn soon() -> Instant {
        Instant::now() + Duration::from_secs(10)
    }

    #[test]
    fn every_byte_goes_through_a_pseudoterminal_unchanged() {
        let (mut ours, path) = pty().unwrap();
        let mut theirs = Line::open(&path).unwrap();
        let bytes: Vec<u8> = (0..=255).collect();
        for (from, to) in [(0, 1), (1, 0)] {
            let ends = [&mut ours, &mut theirs];
            ends[from].write(&bytes, soon()).unwrap();
            let mut seen: Vec<u8> = Vec::new();
            let mut some = [0; 100];
            while seen.len() < bytes.len() {
                let count = ends[to].read(&mut some, soon()).unwrap();
                assert!(count > 0);
                seen.extend(&some[..count]);
            }
            assert_eq!(seen, bytes);
        }
    }

    #[test]
    fn a_read_without_a_byte_ends_at_its_instant() {
        let (_ours, path) = pty().unwrap();
        let mut theirs = Line::open(&path).unwrap();
        let until = Instant::now() + Duration::from_millis(20);
        assert_eq!(theirs.read(&mut [0; 8], until).unwrap(), 0);
        assert!(Instant::now() >= until);
    }

    #[test]
    fn a_port_is_exclusive_and_a_file_is_no_port() {
        let (_ours, path) = pty().unwrap();
        let _first = Line::open(&path).unwrap();
        assert!(Line::open(&path).unwrap_err().to_string().contains("another program"));
        assert!(Line::open(Path::new("/dev/null")).unwrap_err().to_string().contains("not a serial port"));
        assert!(Line::open(Path::new("/dev/no-such-port")).is_err());
    }

    #[test]
    fn a_port_has_the_speed_that_it_is_opened_at() {
        let (_ours, path) = pty().unwrap();
        for speed in [SPEED, 115_200, 2_000_000] {
            let line = Line::open_at(&path, speed).unwrap();
            assert_eq!(SerialPort::from(line.fd).get_configuration().unwrap().get_baud_rate().unwrap(), speed);
        }
    }

    #[test]
    fn a_removed_port_is_an_error() {
        let (ours, path) = pty().unwrap();
        let mut theirs = Line::open(&path).unwrap();
        drop(ours);
        assert!(theirs.read(&mut [0; 8], soon()).is_err());
    }
}
