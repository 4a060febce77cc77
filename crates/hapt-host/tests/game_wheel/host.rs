//! A USB/IP host over a stream.

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;

use hapt_wire::pid::{Common, FULL, INFINITE, Kind, Operation, Report, id};

use crate::TEST_TIMEOUT;

/// A transfer's answer: its status and its data.
pub type Answer = (i32, Vec<u8>);

/// A USB host.
pub struct Host {
    pub stream: UnixStream,
    pub number: u32,
    /// The pending transfer for the wheel's position.
    pub waiting: Option<u32>,
    pub shown: Vec<Vec<u8>>,
}

impl Host {
    pub fn new(stream: UnixStream) -> Self {
        stream.set_read_timeout(Some(TEST_TIMEOUT)).unwrap();
        Host { stream, number: 0, waiting: None, shown: Vec::new() }
    }

    pub fn message(&mut self, words: [u32; 10], setup: [u8; 8], data: &[u8]) {
        let mut bytes: Vec<u8> = words.iter().flat_map(|word| word.to_be_bytes()).collect();
        bytes.extend(setup);
        bytes.extend(data);
        // A wheel that has ended reads no more.
        let is_gone = |error: &std::io::Error| error.kind() == std::io::ErrorKind::BrokenPipe;
        self.stream.write_all(&bytes).or_else(|error| if is_gone(&error) { Ok(()) } else { Err(error) }).unwrap();
    }

    pub fn submit(&mut self, endpoint: u32, is_in: bool, length: usize, setup: [u8; 8], data: &[u8]) -> u32 {
        self.number += 1;
        let words = [1, self.number, 1 << 16 | 2, u32::from(is_in), endpoint, 0, length as u32, 0, 0, 1];
        self.message(words, setup, data);
        self.number
    }

    /// The next answer: the number of its transfer, its command, and its content.
    pub fn next(&mut self, ins: impl Fn(u32) -> bool) -> (u32, u32, Answer) {
        let mut header = [0; 48];
        self.stream.read_exact(&mut header).unwrap();
        let word = |at: usize| u32::from_be_bytes(header[at..at + 4].try_into().unwrap());
        let (command, number, status, length) = (word(0), word(4), word(20) as i32, word(24) as usize);
        let is_in = ins(number) || self.waiting == Some(number);
        let mut data = vec![0; if is_in && command == 3 { length } else { 0 }];
        self.stream.read_exact(&mut data).unwrap();
        (command, number, (status, data))
    }

    pub fn answer(&mut self, number: u32, is_in: bool) -> Answer {
        loop {
            let (command, from, answer) = self.next(|from| is_in && from == number);
            assert_eq!(command, 3);
            if from == number {
                return answer;
            }
            assert_eq!(Some(from), self.waiting.take(), "an answer to nothing");
            self.shown.push(answer.1);
            self.look();
        }
    }

    /// Sends a transfer for a position, as a driver always has one pending.
    pub fn look(&mut self) {
        self.waiting = Some(self.submit(1, true, 64, [0; 8], &[]));
    }

    pub fn control(&mut self, setup: [u8; 8], data: &[u8]) -> Answer {
        let is_in = setup[0] & 0x80 != 0;
        let length = usize::from(u16::from_le_bytes([setup[6], setup[7]]));
        let number = self.submit(0, is_in, length, setup, data);
        self.answer(number, is_in)
    }

    pub fn get(&mut self, kind: u8, value: u16, length: u16) -> Answer {
        let [low, high] = value.to_le_bytes();
        let [least, most] = length.to_le_bytes();
        // Strings are requested in English.
        let [of, language] = if value >> 8 == 3 { [0x09, 0x04] } else { [0, 0] };
        self.control([0x80 | kind, 6, low, high, of, language, least, most], &[])
    }

    /// Sends a feature report to the wheel; `feature` gets one from it.
    pub fn set_feature(&mut self, bytes: &[u8]) -> i32 {
        self.control([0x21, 9, bytes[0], 3, 0, 0, bytes.len() as u8, 0], bytes).0
    }

    pub fn feature(&mut self, id: u8) -> Answer {
        self.control([0xa1, 1, id, 3, 0, 0, 64, 0], &[])
    }

    pub fn configure(&mut self) {
        assert_eq!(self.control([0, 9, 1, 0, 0, 0, 0, 0], &[]).0, 0);
        self.look();
    }

    /// Sends a report to the endpoint; the transfer is answered when the wheel has read it.
    pub fn send(&mut self, bytes: &[u8]) {
        let number = self.submit(1, false, bytes.len(), [0; 8], bytes);
        assert_eq!(self.answer(number, false).0, 0);
    }

    pub fn report(&mut self, report: Report) {
        let (bytes, length) = report.write();
        if matches!(report, Report::Create(_)) {
            assert_eq!(self.set_feature(&bytes[..length]), 0);
        } else {
            self.send(&bytes[..length]);
        }
    }

    /// Makes an effect and starts it; its place.
    pub fn play(&mut self, kind: Kind, of: impl Fn(usize) -> Report) -> usize {
        self.report(Report::Create(kind));
        let (_, load) = self.feature(id::LOAD);
        assert_eq!(load[2], 1, "a place");
        let block = usize::from(load[1]) - 1;
        let common =
            Common { kind, duration: INFINITE, repeat: 0, delay: 0, gain: FULL, button: 0, direction: Some(9000) };
        self.report(Report::Effect { block, common });
        self.report(of(block));
        self.report(Report::Operation { block, operation: Operation::Start, loops: 1 });
        block
    }
}
