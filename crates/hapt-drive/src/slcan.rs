//! slcan: classic CAN frames as lines of text over a serial port, the protocol of the Lawicel adapters that Linux, python-can and most
//! USB adapters use.
//!
//! ```text
//! t 029 8 0000803f00000000 \r      a frame: 11-bit identifier, length, data, in hexadecimal digits (without the spaces)
//! T 00008001 2 aabb \r             with a 29-bit identifier
//! r 029 8 \r                       a remote frame: a length, no data
//! ```
//!
//! The adapter answers commands by `\r`, and refuses them by the bell; some answer each frame by `z\r`. A host ignores all these answers:
//! the drive's answers prove that frames arrive.

use std::fmt;
use std::io;
use std::str::FromStr;
use std::time::{Duration, Instant};

use crate::can::Bus;
use crate::drive::OTHERS;
use crate::frame::Frame;
use crate::serial::Line;
use crate::text::Lines;

/// The rates that an adapter can be set to, in kbit/s, by their numbers.
const RATES: [u32; 9] = [10, 20, 50, 100, 125, 250, 500, 800, 1000];
/// An adapter's positive and negative answers.
const YES: &[u8] = b"\r";
const NO: &[u8] = b"\x07";
/// The longest time of an adapter for a command outside the loop.
const COMMAND_TIMEOUT: Duration = Duration::from_millis(200);
/// The longest line: the kind, 8 digits of identifier, the length, 16 digits of data, the end.
const MAX_LINE_BYTES: usize = 1 + 8 + 1 + 16 + 1;

/// The bit rate of the bus behind an adapter; 1 Mbit/s by default, as exchanges take longer at lower rates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rate(u8);

impl Default for Rate {
    fn default() -> Self {
        Rate(8)
    }
}

impl Rate {
    /// In bit/s.
    pub fn bits(self) -> u32 {
        1000 * RATES[usize::from(self.0.min(8))]
    }
}

/// `250k` or `1M`.
impl FromStr for Rate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = RATES.iter().position(|kilobits| text == format!("{kilobits}k"));
        let number = number.or((text == "1M").then_some(8));
        number.map(|number| Rate(number as u8)).ok_or_else(|| {
            let all = RATES[..8].iter().map(|kilobits| format!("{kilobits}k, ")).collect::<String>();
            format!("{text:?} is not a bit rate of the adapter; expected {all}or 1M, in bit/s")
        })
    }
}

impl fmt::Display for Rate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match RATES[usize::from(self.0.min(8))] {
            1000 => f.write_str("1M"),
            kilobits => write!(f, "{kilobits}k"),
        }
    }
}

/// A bus behind an adapter on a serial port. It stays open when this is dropped: closing it could lose the last frames, which stop a drive.
#[derive(Debug)]
pub struct Client(Lines);

impl Client {
    /// Closes the adapter's bus, sets its rate, and opens it.
    ///
    /// # Errors
    /// The port is gone.
    pub fn open(line: Line, rate: Rate) -> io::Result<Self> {
        let mut lines = Lines::new(line);
        lines.write(&[b'C', b'\r', b'S', b'0' + rate.0, b'\r', b'O', b'\r'], Instant::now() + COMMAND_TIMEOUT)?;
        Ok(Client(lines))
    }
}

impl Bus for Client {
    fn send(&mut self, frame: &Frame, until: Instant) -> io::Result<()> {
        let mut room = [0; MAX_LINE_BYTES];
        let length = write(frame, &mut room).ok_or(io::ErrorKind::InvalidInput)?;
        self.0.write(&room[..length], until)
    }

    fn receive(&mut self, until: Instant) -> io::Result<Option<Frame>> {
        for _ in 0..OTHERS {
            let Some((line, _)) = self.0.next(until)? else { break };
            if let Some(frame) = read(line) {
                return Ok(Some(frame));
            }
        }
        Ok(None)
    }
}

/// The adapter's side, the bus of a simulated drive behind an adapter.
#[derive(Debug)]
pub struct Adapter {
    lines: Lines,
    is_open: bool,
}

impl Adapter {
    /// Closed until the host opens it.
    pub fn new(line: Line) -> Self {
        Adapter { lines: Lines::new(line), is_open: false }
    }
}

impl Bus for Adapter {
    /// A closed bus discards frames without an error.
    fn send(&mut self, frame: &Frame, until: Instant) -> io::Result<()> {
        if !self.is_open {
            return Ok(());
        }
        let mut room = [0; MAX_LINE_BYTES];
        let length = write(frame, &mut room).ok_or(io::ErrorKind::InvalidInput)?;
        self.lines.write(&room[..length], until)
    }

    fn receive(&mut self, until: Instant) -> io::Result<Option<Frame>> {
        while let Some((line, _)) = self.lines.next(until)? {
            let frame = read(line);
            if frame.is_some() && self.is_open {
                return Ok(frame);
            }
            let answer = match command(line) {
                HostCommand::Open => {
                    self.is_open = true;
                    YES
                }
                HostCommand::Close => {
                    self.is_open = false;
                    YES
                }
                HostCommand::Setting => YES,
                HostCommand::Version => b"V1013\r",
                HostCommand::Number => b"NHAPT\r",
                HostCommand::Unknown => NO,
            };
            self.lines.write(answer, Instant::now() + COMMAND_TIMEOUT)?;
        }
        Ok(None)
    }
}

/// Writes a frame as a line, and returns its length; `None`: it is CAN FD, or its identifier is out of range.
fn write(frame: &Frame, line: &mut [u8; MAX_LINE_BYTES]) -> Option<usize> {
    let (kind, digits) = match (frame.extended, frame.remote) {
        (false, false) => (b't', 3),
        (true, false) => (b'T', 8),
        (false, true) => (b'r', 3),
        (true, true) => (b'R', 8),
    };
    if frame.fd || u64::from(frame.id) >> if frame.extended { 29 } else { 11 } != 0 {
        return None;
    }
    let mut length = 0;
    let mut push = |byte| {
        line[length] = byte;
        length += 1;
    };
    push(kind);
    for place in (0..digits).rev() {
        push(digit(frame.id >> (4 * place)));
    }
    push(digit(frame.length().into()));
    for byte in frame.data() {
        push(digit(u32::from(byte >> 4)));
        push(digit(u32::from(*byte)));
    }
    push(b'\r');
    Some(length)
}

/// The frame of a line without its end; `None`: it is not a frame. A time stamp after the data is ignored.
fn read(line: &[u8]) -> Option<Frame> {
    let (kind, rest) = line.split_first()?;
    let (extended, remote) = match kind {
        b't' => (false, false),
        b'T' => (true, false),
        b'r' => (false, true),
        b'R' => (true, true),
        _ => return None,
    };
    let (id, rest) = rest.split_at_checked(if extended { 8 } else { 3 })?;
    let id = id.iter().try_fold(0, |id, digit| Some(id << 4 | u32::from(value(*digit)?)))?;
    let (length, rest) = rest.split_first()?;
    let length = value(*length).filter(|length| *length <= 8)?;
    if id >> if extended { 29 } else { 11 } != 0 {
        return None;
    }
    let mut frame = if remote { Frame::remote(id, length) } else { Frame::classic(id, &[]) };
    frame.extended = extended;
    if !remote {
        for digits in rest.get(..2 * usize::from(length))?.chunks_exact(2) {
            frame.push(value(digits[0])? << 4 | value(digits[1])?);
        }
    }
    Some(frame)
}

fn digit(number: u32) -> u8 {
    b"0123456789ABCDEF"[(number & 0xf) as usize]
}

fn value(digit: u8) -> Option<u8> {
    char::from(digit).to_digit(16).map(|value| value as u8)
}

/// A command of a host to an adapter, a line that is not a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum HostCommand {
    Open,
    Close,
    /// Without effect on a simulated bus: speed, filters, time stamps.
    Setting,
    Version,
    Number,
    Unknown,
}

fn command(line: &[u8]) -> HostCommand {
    match line {
        [b'O' | b'L', ..] => HostCommand::Open,
        [b'C', ..] => HostCommand::Close,
        [b'V', ..] => HostCommand::Version,
        [b'N', ..] => HostCommand::Number,
        [] | [b'S' | b's' | b'Y' | b'F' | b'Z' | b'M' | b'm' | b'X', ..] => HostCommand::Setting,
        _ => HostCommand::Unknown,
    }
}

#[cfg(test)]
mod tests {
    use hapt_testing::prelude::*;

    use super::*;

    fn line(frame: &Frame) -> Vec<u8> {
        let mut room = [0; MAX_LINE_BYTES];
        let length = write(frame, &mut room).unwrap();
        room[..length].to_vec()
    }

    #[test]
    fn lines_are_those_of_the_adapters() {
        let torque = Frame::classic(0x02e, &[0, 0, 0x80, 0x3f, 0, 0, 0, 0]);
        assert_eq!(line(&torque), b"t02E80000803F00000000\r");
        assert_eq!(line(&Frame::remote(0x029, 8)), b"r0298\r");
        let mut long = Frame::classic(0x8001, &[0xaa, 0xbb]);
        long.extended = true;
        assert_eq!(line(&long), b"T000080012AABB\r");
        assert_eq!(read(b"T000080012aabb"), Some(long));
        // With the adapter's time stamp, in ms.
        assert_eq!(read(b"T000080012aabb03E7"), Some(long));
    }

    /// The numbers are those of the adapters' manuals.
    #[test]
    fn a_rate_is_sent_to_the_adapter_by_its_number() {
        for (text, opens) in
            [("10k", b"C\rS0\rO\r"), ("125k", b"C\rS4\rO\r"), ("250k", b"C\rS5\rO\r"), ("1M", b"C\rS8\rO\r")]
        {
            let (mut adapter, path) = crate::serial::pty().unwrap();
            let rate: Rate = text.parse().unwrap();
            let _client = Client::open(Line::open(&path).unwrap(), rate).unwrap();
            let (mut written, mut some) = (Vec::new(), [0; 16]);
            while written.len() < opens.len() {
                let count = adapter.read(&mut some, Instant::now() + Duration::from_secs(10)).unwrap();
                assert!(count > 0, "{written:?}");
                written.extend(&some[..count]);
            }
            assert_eq!((written.as_slice(), rate.to_string().as_str()), (&opens[..], text));
        }
        assert_eq!("1000k".parse(), Ok(Rate::default()));
        for text in ["", "250", "300k", "2M", "k", "1m", "250K"] {
            assert!(text.parse::<Rate>().unwrap_err().contains("250k"), "{text}");
        }
    }

    #[test]
    fn a_truncated_line_is_no_other_frame() {
        let whole = b"t02E80000803F00000000";
        for length in 0..whole.len() {
            assert_eq!(read(&whole[..length]), None, "{length}");
        }
        for line in [&b"t82E0"[..], b"t02E9", b"T200000010", b"t0 E0", b"q0290", b"z"] {
            assert_eq!(read(line), None, "{line:?}");
        }
    }

    proptest! {
        #[test]
        fn a_written_frame_reads_back(
            id in 0_u32..1 << 29, extended in any::<bool>(), remote in any::<bool>(), length in 0_u8..9,
            data in any::<[u8; 8]>(),
        ) {
            let id = if extended { id } else { id & 0x7ff };
            let mut frame = if remote { Frame::remote(id, length) } else { Frame::classic(id, &data[..length.into()]) };
            frame.extended = extended;
            let line = line(&frame);
            prop_assert_eq!(read(&line[..line.len() - 1]), Some(frame));
        }

        #[test]
        fn random_bytes_are_parsed_without_a_panic(line in any::<Vec<u8>>()) {
            if let Some(frame) = read(&line) {
                let mut room = [0; MAX_LINE_BYTES];
                prop_assert!(write(&frame, &mut room).is_some());
            }
        }
    }
}
