//! Lines of text from a stream of bytes.

use std::io;
use std::time::Instant;

use crate::serial::Line;

/// Longer lines are discarded.
const MAX_LINE_BYTES: usize = 512;
/// The number of reads after the deadline, so that an endless stream does not delay the loop.
const READS: usize = 64;
/// The bytes that end a line: both newlines, and the bell of a negative slcan answer.
const ENDS: [u8; 3] = [b'\r', b'\n', 0x07];

/// A serial line, read as lines of text. Reading and writing do not allocate.
#[derive(Debug)]
pub struct Lines {
    line: Line,
    room: [u8; MAX_LINE_BYTES],
    /// The filled part of the buffer, and the part already returned.
    filled: usize,
    given: usize,
    /// The line was too long: it is discarded up to its end.
    skips: bool,
}

impl Lines {
    /// Reads lines of text from `line`.
    pub fn new(line: Line) -> Self {
        Lines { line, room: [0; MAX_LINE_BYTES], filled: 0, given: 0, skips: false }
    }

    /// The next line with the byte that ended it, empty only before a bell; `None` if none is complete until that instant. An incomplete
    /// line stays in the buffer.
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
            if self.filled == MAX_LINE_BYTES {
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

    /// Writes all bytes.
    ///
    /// # Errors
    /// The port is gone, or has not accepted them until that instant.
    pub fn write(&mut self, bytes: &[u8], until: Instant) -> io::Result<()> {
        self.line.write(bytes, until)
    }
}

/// The byte of two hexadecimal digits.
pub(crate) fn byte(digits: [u8; 2]) -> Option<u8> {
    let digit = |c: u8| (c as char).to_digit(16);
    u8::try_from(digit(digits[0])? << 4 | digit(digits[1])?).ok()
}

/// Longer than any line of a frame: 64 bytes are 128 digits.
const MAX_TEXT_BYTES: usize = 192;
const DIGITS: &[u8; 16] = b"0123456789ABCDEF";

/// A line under construction, of fixed size in memory.
pub(crate) struct Text {
    room: [u8; MAX_TEXT_BYTES],
    length: usize,
}

impl Text {
    pub fn new() -> Self {
        Text { room: [0; MAX_TEXT_BYTES], length: 0 }
    }

    /// A line that is too long is cut, and thereby invalid.
    pub fn put(&mut self, bytes: &[u8]) {
        for byte in bytes {
            if let Some(place) = self.room.get_mut(self.length) {
                *place = *byte;
                self.length += 1;
            }
        }
    }

    pub fn hex(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.put(&[DIGITS[usize::from(byte >> 4)], DIGITS[usize::from(byte & 15)]]);
        }
    }

    pub fn bytes(&self) -> &[u8] {
        &self.room[..self.length]
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::serial::pty;

    #[test]
    fn lines_are_complete_however_they_were_split_and_too_long_ones_are_discarded() {
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
