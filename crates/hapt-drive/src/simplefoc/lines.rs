//! The text of a line: a letter for Commander, the kind, the data in hexadecimal digits, and a checksum.
//!
//! ```text
//! > HT 07 3f000000 XXXX      to the board: kind T, number 07, the data (without the spaces)
//! < hT 07 01 07 ... XXXX     its answer
//! ```
//!
//! The checksum is CRC-16/IBM-3740 of everything before it. A line to the board has at most [`MAX_LINE_BYTES`] bytes and its newline, the
//! size of Commander's buffer. Everything else is discarded, on both sides.

use std::io;
use std::time::Instant;

use crate::can::Bus;
use crate::drive::OTHERS;
use crate::frame::Frame;
use crate::serial::Line;
use crate::text::{Lines, Text, byte};

/// The first letter of a line to the board, which is registered with Commander, and of its answer.
const TO_BOARD: u8 = b'H';
const FROM_BOARD: u8 = b'h';
/// The longest line to the board, without its newline.
const MAX_LINE_BYTES: usize = 19;

/// A serial port with a board at its other end.
pub struct Client(Lines);

/// The board's end.
pub struct Adapter(Lines);

impl Client {
    /// The port `line`.
    pub fn new(line: Line) -> Self {
        Client(Lines::new(line))
    }
}

impl Adapter {
    /// The board at `line`.
    pub fn new(line: Line) -> Self {
        Adapter(Lines::new(line))
    }
}

impl Bus for Client {
    fn send(&mut self, frame: &Frame, until: Instant) -> io::Result<()> {
        self.0.write(text(TO_BOARD, frame).bytes(), until)
    }

    fn receive(&mut self, until: Instant) -> io::Result<Option<Frame>> {
        receive(&mut self.0, FROM_BOARD, usize::MAX, until)
    }
}

impl Bus for Adapter {
    /// Sends an answer; a host that does not read loses it.
    fn send(&mut self, frame: &Frame, until: Instant) -> io::Result<()> {
        match self.0.write(text(FROM_BOARD, frame).bytes(), until) {
            Err(error) if error.kind() == io::ErrorKind::TimedOut => Ok(()),
            sent => sent,
        }
    }

    fn receive(&mut self, until: Instant) -> io::Result<Option<Frame>> {
        receive(&mut self.0, TO_BOARD, MAX_LINE_BYTES, until)
    }
}

fn receive(lines: &mut Lines, first: u8, longest: usize, until: Instant) -> io::Result<Option<Frame>> {
    for _ in 0..OTHERS {
        let Some((line, end)) = lines.next(until)? else { break };
        let frame = if end == b'\n' && line.len() <= longest { frame(first, line) } else { None };
        if frame.is_some() {
            return Ok(frame);
        }
    }
    Ok(None)
}

fn text(first: u8, frame: &Frame) -> Text {
    let mut text = Text::new();
    text.put(&[first, u8::try_from(frame.id).unwrap_or(b'?')]);
    text.hex(frame.data());
    let crc = crc(text.bytes());
    text.hex(&crc.to_be_bytes());
    text.put(b"\n");
    text
}

fn frame(first: u8, line: &[u8]) -> Option<Frame> {
    let (content, digits) = line.split_at_checked(line.len().checked_sub(4)?)?;
    let [letter, kind, data @ ..] = content else { return None };
    let is_digit = |c: &u8| c.is_ascii_digit() || (b'A'..=b'F').contains(c);
    if *letter != first || !kind.is_ascii_uppercase() || !line.get(2..)?.iter().all(is_digit) {
        return None;
    }
    let [high, low] = [digits.first_chunk()?, digits.last_chunk()?];
    if crc(content).to_be_bytes() != [byte(*high)?, byte(*low)?] {
        return None;
    }
    let (pairs, rest) = data.as_chunks::<2>();
    let mut frame = Frame::fd((*kind).into(), &[]);
    for pair in pairs {
        if !frame.push(byte(*pair)?) {
            return None;
        }
    }
    (rest.is_empty() && !pairs.is_empty()).then_some(frame)
}

/// CRC-16/IBM-3740: the polynomial 0x1021, most significant bit first, from 0xffff.
fn crc(bytes: &[u8]) -> u16 {
    let bit = |crc: u16, _| if crc & 0x8000 != 0 { crc << 1 ^ 0x1021 } else { crc << 1 };
    bytes.iter().fold(0xffff, |crc, byte| (0..8).fold(crc ^ u16::from(*byte) << 8, bit))
}

#[cfg(test)]
mod tests {
    use hapt_testing::prelude::*;

    use super::*;

    /// The check value of the published algorithm.
    #[test]
    fn the_crc_is_the_published_one() {
        assert_eq!(crc(b"123456789"), 0x29b1);
    }

    fn read(first: u8, text: &Text) -> Option<Frame> {
        frame(first, text.bytes().strip_suffix(b"\n").unwrap())
    }

    proptest! {
        #[test]
        fn a_line_reads_back_and_with_a_changed_byte_it_is_none(
            kind in b'A'..=b'Z',
            data in proptest::collection::vec(any::<u8>(), 1..14),
            at in any::<prop::sample::Index>(),
            other in any::<u8>(),
        ) {
            let sent = Frame::fd(kind.into(), &data);
            let right = text(TO_BOARD, &sent);
            prop_assert_eq!(read(TO_BOARD, &right), Some(sent));
            prop_assert_eq!(read(FROM_BOARD, &right), None);
            let mut wrong = right.bytes().strip_suffix(b"\n").unwrap().to_vec();
            let at = at.index(wrong.len());
            prop_assume!(wrong[at] != other);
            wrong[at] = other;
            prop_assert_eq!(frame(TO_BOARD, &wrong), None);
        }

        #[test]
        fn any_line_is_parsed_without_a_panic(line in proptest::collection::vec(any::<u8>(), 0..60)) {
            let _ = frame(TO_BOARD, &line);
        }
    }
}
