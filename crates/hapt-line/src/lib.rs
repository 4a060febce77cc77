//! A serial port: raw bytes, with an instant after which nobody waits any longer.

#![cfg(unix)]

use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{FlockOperation, Mode, OFlags, fcntl_setfl, flock, open};
use rustix::io::{Errno, FdFlags, fcntl_setfd};
use rustix::pty::{OpenptFlags, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// What a UART between a computer and a board or a drive is usually set to, in bits per second. USB ports take any.
pub const SPEED: u32 = 921_600;

/// An open serial port, or one end of a pseudoterminal. Neither reading nor writing allocates.
#[derive(Debug)]
pub struct Line {
    fd: OwnedFd,
    /// The other end of a pseudoterminal, held open so that it outlives those who come and go there.
    _other: Option<OwnedFd>,
}

impl Line {
    /// Opens the port at `path` raw, for this program alone, at [`SPEED`].
    ///
    /// # Errors
    /// There is none, it is no terminal, or another program holds it.
    pub fn open(path: &Path) -> io::Result<Self> {
        Line::open_at(path, SPEED)
    }

    /// The same at so many bits per second.
    ///
    /// # Errors
    /// As above, or the port knows no such speed.
    pub fn open_at(path: &Path, speed: u32) -> io::Result<Self> {
        let fd = open(path, OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC, Mode::empty())?;
        if !rustix::termios::isatty(&fd) {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is no serial port"));
        }
        flock(&fd, FlockOperation::NonBlockingLockExclusive).map_err(|error| match error {
            Errno::WOULDBLOCK => io::Error::other("another program holds it"),
            error => error.into(),
        })?;
        raw(&fd, speed)?;
        fast(path);
        Ok(Line { fd, _other: None })
    }

    /// What has come, at least one byte, or 0 when nothing has come until that instant.
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

    /// Writes all of it.
    ///
    /// # Errors
    /// The port is gone, or has not taken it until that instant.
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

/// A new pseudoterminal: the end that a simulated board or drive has, and the path that others open as a serial port.
///
/// # Errors
/// The system has none to give.
pub fn pty() -> io::Result<(Line, PathBuf)> {
    let fd = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
    fcntl_setfd(&fd, FdFlags::CLOEXEC)?;
    fcntl_setfl(&fd, OFlags::RDWR | OFlags::NONBLOCK)?;
    unlockpt(&fd)?;
    let name = ptsname(&fd, Vec::new())?;
    let path = PathBuf::from(name.to_string_lossy().into_owned());
    let other = open(&path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
    raw(&other, SPEED)?;
    Ok((Line { fd, _other: Some(other) }, path))
}

/// Bytes as they are: no echo, no lines, no signals.
fn raw(fd: &OwnedFd, speed: u32) -> io::Result<()> {
    let mut termios = tcgetattr(fd)?;
    termios.make_raw();
    termios.set_speed(speed)?;
    Ok(tcsetattr(fd, OptionalActions::Now, &termios)?)
}

/// USB serial chips that gather bytes for up to 16 ms are told to give them away after 1 ms. Where that is not for this user to say, or
/// the chip has no such timer, the port works all the same, and an exchange takes longer.
fn fast(path: &Path) {
    let Ok(path) = path.canonicalize() else { return };
    let Some(name) = path.file_name() else { return };
    let _ = std::fs::write(Path::new("/sys/class/tty").join(name).join("device/latency_timer"), "1");
}

/// Waits for `what` on `fd`; `false`: it has not come until that instant.
///
/// # Errors
/// The system's.
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
    fn who_waits_for_nothing_waits_until_the_instant_and_no_longer_counts_as_gone() {
        let (_ours, path) = pty().unwrap();
        let mut theirs = Line::open(&path).unwrap();
        let until = Instant::now() + Duration::from_millis(20);
        assert_eq!(theirs.read(&mut [0; 8], until).unwrap(), 0);
        assert!(Instant::now() >= until);
    }

    #[test]
    fn a_port_is_one_programs_and_a_file_is_no_port() {
        let (_ours, path) = pty().unwrap();
        let _first = Line::open(&path).unwrap();
        assert!(Line::open(&path).unwrap_err().to_string().contains("another program"));
        assert!(Line::open(Path::new("/dev/null")).unwrap_err().to_string().contains("no serial port"));
        assert!(Line::open(Path::new("/dev/no-such-port")).is_err());
    }

    #[test]
    fn a_port_has_the_speed_that_it_is_opened_at() {
        let (_ours, path) = pty().unwrap();
        for speed in [SPEED, 115_200, 2_000_000] {
            let line = Line::open_at(&path, speed).unwrap();
            assert_eq!(tcgetattr(&line.fd).unwrap().output_speed(), speed);
        }
    }

    #[test]
    fn a_port_that_is_pulled_out_is_an_error() {
        let (ours, path) = pty().unwrap();
        let mut theirs = Line::open(&path).unwrap();
        drop(ours);
        assert!(theirs.read(&mut [0; 8], soon()).is_err());
    }
}
