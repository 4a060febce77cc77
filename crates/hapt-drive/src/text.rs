//! Lines of text out of bytes.

use std::io;
use std::time::Instant;

use crate::serial::Line;

/// Longer lines are garbage.
const LONGEST: usize = 512;
/// How often more is read when the time is over. Whoever talks without end does not hold the loop.
const READS: usize = 64;
/// They end a line: both newlines, and the bell by which slcan says no.
const ENDS: [u8; 3] = [b'\r', b'\n', 0x07];

/// A line of bytes, read line by line. No reading or writing allocates.
#[derive(Debug)]
pub struct Lines {
    line: Line,
    room: [u8; LONGEST],
    /// What is filled, and what of it has been given away.
    filled: usize,
    given: usize,
    /// The line was too long: everything up to its end is left out.
    skips: bool,
}

impl Lines {
    /// Reads `line`.
    pub fn new(line: Line) -> Self {
        Lines { line, room: [0; LONGEST], filled: 0, given: 0, skips: false }
    }

    /// The next line with the byte that ended it, none empty but by a bell; `None` when none has come until that instant, or only
    /// garbage without end. Half a line waits for its other half.
    ///
    /// # Errors
    /// The port is gone.
    pub fn next(&mut self, until: Instant) -> io::Result<Option<(&[u8], u8)>> {
        let mut reads = 0;
        loop {
            let fresh = &self.room[self.given..self.filled];
            if let Some(length) = fresh.iter().position(|byte| ENDS.contains(byte)) {
                let (from, to) = (self.given, self.given + length);
                let end = self.room[to];
                self.given = to + 1;
                let skips = std::mem::take(&mut self.skips);
                if !skips && (from < to || end == 0x07) {
                    return Ok(Some((&self.room[from..to], end)));
                }
                continue;
            }
            self.room.copy_within(self.given..self.filled, 0);
            self.filled -= self.given;
            self.given = 0;
            if self.filled == LONGEST {
                (self.filled, self.skips) = (0, true);
            }
            let count = self.line.read(&mut self.room[self.filled..], until)?;
            self.filled += count;
            if count == 0 || reads == READS {
                return Ok(None);
            }
            reads += usize::from(Instant::now() >= until);
        }
    }

    /// Writes all of it.
    ///
    /// # Errors
    /// The port is gone, or has not taken it until that instant.
    pub fn write(&mut self, bytes: &[u8], until: Instant) -> io::Result<()> {
        self.line.write(bytes, until)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::serial::pty;

    #[test]
    fn lines_come_whole_however_they_were_cut_and_too_long_ones_not_at_all() {
        let (mut ours, path) = pty().unwrap();
        let mut lines = Lines::new(Line::open(&path).unwrap());
        let soon = Instant::now() + Duration::from_secs(10);
        ours.write(b"one\r\n\r\ntw", soon).unwrap();
        assert_eq!(lines.next(soon).unwrap(), Some((&b"one"[..], b'\r')));
        assert_eq!(lines.next(Instant::now()).unwrap(), None);
        ours.write(b"o\n", soon).unwrap();
        assert_eq!(lines.next(soon).unwrap(), Some((&b"two"[..], b'\n')));
        ours.write(&[b'x'; 700], soon).unwrap();
        ours.write(b"\nthree\n\x07", soon).unwrap();
        assert_eq!(lines.next(soon).unwrap(), Some((&b"three"[..], b'\n')));
        assert_eq!(lines.next(soon).unwrap(), Some((&b""[..], 0x07)));
    }
}
