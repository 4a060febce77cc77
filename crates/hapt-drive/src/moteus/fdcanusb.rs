//! The text of an fdcanusb: a CAN FD bus as lines on a serial port.
//!
//! ```text
//! > can send 8001 1f01 bF        to the adapter: identifier, data, flags (B or b: faster data or not, F: FD)
//! < OK                           it was sent
//! < rcv 0100 2f01... E B F       a frame was received
//! ```
//!
//! Where the port is a drive's own UART and no fdcanusb, every line ends with ` *` and a CRC-8, of the polynomial 0x97, of everything
//! before the `*`.

use std::io;
use std::time::Instant;

use crate::can::Bus;
use crate::drive::OTHERS;
use crate::frame::Frame;
use crate::serial::Line;
use crate::text::{Lines, Text, byte};

/// A serial port with an adapter or a drive at its other end.
pub struct Client {
    lines: Lines,
    /// Lines carry a CRC.
    checked: bool,
}

/// The peer on the port: an adapter, or a drive with a UART.
pub struct Adapter {
    lines: Lines,
    /// Whether the last line carried a CRC: then the answers do.
    checked: bool,
}

impl Client {
    /// The port `line`; `checked`: its lines carry a CRC, which an fdcanusb does not require.
    pub fn new(line: Line, checked: bool) -> Self {
        Client { lines: Lines::new(line), checked }
    }
}

impl Bus for Client {
    fn send(&mut self, frame: &Frame, until: Instant) -> io::Result<()> {
        let mut text = Text::new();
        text.put(b"can send ");
        text.hex_number(frame.id);
        text.put(b" ");
        text.hex(frame.data());
        text.put(if frame.fd { b" BF" } else { b" bf" });
        self.lines.write(text.line(self.checked, b"\n"), until)
    }

    fn receive(&mut self, until: Instant) -> io::Result<Option<Frame>> {
        for _ in 0..OTHERS {
            let Some((line, _)) = self.lines.next(until)? else { break };
            // OK is ignored: the drive's answer matters. An invalid line counts as none.
            let Some((line, checked)) = unchecked(line) else { continue };
            let frame = line.strip_prefix(b"rcv ").and_then(frame);
            if frame.is_some() && (checked || !self.checked) {
                return Ok(frame);
            }
        }
        Ok(None)
    }
}

impl Adapter {
    /// An adapter on `line`.
    pub fn new(line: Line) -> Self {
        Adapter { lines: Lines::new(line), checked: false }
    }

    /// Sends a reply; a host that does not read loses it.
    fn reply(&mut self, what: &[u8], until: Instant) -> io::Result<()> {
        let mut text = Text::new();
        text.put(what);
        match self.lines.write(text.line(self.checked, b"\r\n"), until) {
            Err(error) if error.kind() == io::ErrorKind::TimedOut => Ok(()),
            other => other,
        }
    }
}

impl Bus for Adapter {
    fn send(&mut self, frame: &Frame, until: Instant) -> io::Result<()> {
        let mut text = Text::new();
        text.put(b"rcv ");
        text.hex_number(frame.id);
        text.put(b" ");
        text.hex(frame.data());
        text.put(if frame.extended { b" E" } else { b" e" });
        text.put(if frame.fd { b" B F" } else { b" b f" });
        self.lines.write(text.line(self.checked, b"\r\n"), until)
    }

    fn receive(&mut self, until: Instant) -> io::Result<Option<Frame>> {
        loop {
            let Some((line, _)) = self.lines.next(until)? else { return Ok(None) };
            let Some((line, checked)) = unchecked(line) else {
                self.checked = true;
                self.reply(b"ERR invalid checksum", until)?;
                continue;
            };
            let sent = line.strip_prefix(b"can send ").and_then(frame);
            let knows = sent.is_some() || line.starts_with(b"can ") || line.starts_with(b"conf ");
            self.checked = checked;
            self.reply(if knows { b"OK" } else { b"ERR unknown command" }, until)?;
            if sent.is_some() {
                return Ok(sent);
            }
        }
    }
}

/// A line without its CRC, and whether it had one; `None`: the CRC is wrong.
fn unchecked(line: &[u8]) -> Option<(&[u8], bool)> {
    let (before, digits) = line.split_at(line.len().saturating_sub(2));
    let Some(content) = before.strip_suffix(b"*") else { return Some((line, false)) };
    let Some(claimed) = digits.first_chunk().and_then(|digits| byte(*digits)) else { return Some((line, false)) };
    (crc(content) == claimed).then(|| (content.trim_ascii_end(), true))
}

/// CRC-8 of the polynomial 0x97, most significant bit first, from 0.
fn crc(bytes: &[u8]) -> u8 {
    let bit = |crc: u8, _| if crc & 0x80 != 0 { crc << 1 ^ 0x97 } else { crc << 1 };
    bytes.iter().fold(0, |crc, byte| (0..8).fold(crc ^ byte, bit))
}

/// Identifier, data, and flags.
fn frame(text: &[u8]) -> Option<Frame> {
    let mut words = text.split(|byte| *byte == b' ').filter(|word| !word.is_empty());
    let id = u32::from_str_radix(std::str::from_utf8(words.next()?).ok()?, 16).ok().filter(|id| *id < 1 << 29)?;
    let data = words.next().unwrap_or_default();
    let is_extended = words.flatten().any(|flag| *flag == b'E');
    let mut frame = Frame::fd(id, &[]).with_extended(id > 0x7ff || is_extended);
    let (pairs, rest) = data.as_chunks::<2>();
    for pair in pairs {
        if !frame.push(byte(*pair)?) {
            return None;
        }
    }
    rest.is_empty().then_some(frame)
}

impl Text {
    fn hex_number(&mut self, number: u32) {
        let bytes = number.to_be_bytes();
        self.hex(if number > 0xffff { &bytes } else { &bytes[2..] });
    }

    fn line(&mut self, checked: bool, end: &[u8]) -> &[u8] {
        if checked {
            self.put(b" ");
            let crc = crc(self.bytes());
            self.put(b"*");
            self.hex(&[crc]);
        }
        self.put(end);
        self.bytes()
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use hapt_testing::prelude::*;

    use super::*;
    use crate::serial::pty;

    /// Some rows of the manufacturer's table of half bytes.
    #[test]
    fn the_crc_is_the_drives() {
        assert_eq!(crc(&[]), 0);
        assert_eq!(crc(&[0x01]), 0x97);
        assert_eq!(crc(&[0x02]), 0xb9);
        assert_eq!(crc(&[0x08]), 0x5d);
        assert_eq!(crc(&[0x0f]), 0x96);
        assert_eq!(unchecked(b"OK"), Some((&b"OK"[..], false)));
        let right = format!("OK *{:02X}", crc(b"OK "));
        assert_eq!(unchecked(right.as_bytes()), Some((&b"OK"[..], true)));
        let wrong = format!("OK *{:02X}", crc(b"OK ") ^ 4);
        assert_eq!(unchecked(wrong.as_bytes()), None);
    }

    #[test]
    fn frames_go_both_ways_with_a_crc_and_without() {
        for checked in [false, true] {
            let (line, path) = pty().unwrap();
            let mut adapter = Adapter::new(line);
            let mut client = Client::new(Line::open(&path).unwrap(), checked);
            let soon = || Instant::now() + Duration::from_secs(10);
            let there = Frame::fd(0x8001, &[0x1f, 0x01]);
            client.send(&there, soon()).unwrap();
            assert_eq!(adapter.receive(soon()).unwrap(), Some(there));
            let back = Frame::fd(0x100, &[7; 64]);
            adapter.send(&back, soon()).unwrap();
            assert_eq!(client.receive(soon()).unwrap(), Some(back));
            assert_eq!(client.receive(Instant::now()).unwrap(), None);
        }
    }

    #[test]
    fn a_host_that_never_reads_does_not_end_the_adapter() {
        let (line, path) = pty().unwrap();
        let mut adapter = Adapter::new(line);
        let mut client = Client::new(Line::open(&path).unwrap(), true);
        // Two thousand OKs are more than the line holds.
        for _ in 0..2_000 {
            client.send(&Frame::fd(1, &[0x50]), Instant::now() + Duration::from_secs(10)).unwrap();
            assert!(adapter.receive(Instant::now() + Duration::from_millis(1)).unwrap().is_some());
        }
    }

    proptest! {
        #[test]
        fn any_line_is_parsed_without_a_panic(line in proptest::collection::vec(any::<u8>(), 0..200)) {
            if let Some((line, _)) = unchecked(&line) {
                let _ = frame(line);
            }
        }
    }
}
