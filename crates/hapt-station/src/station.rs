//! Both halves in one thread: for fed boards, emulators and tests.

use crate::{Board, Desk, LONGEST, Mail, Motor, Sampler, Seen, Slot};

/// Desk, sampler, and the mail between them.
#[derive(Debug)]
pub struct Station<'w> {
    desk: Desk<'w>,
    sampler: Sampler<'w>,
    mail: Mail<'w>,
}

impl<'w> Station<'w> {
    /// A board that begins.
    pub fn new(board: Board, one: &'w mut Slot, other: &'w mut Slot) -> Self {
        let sampler = Sampler::new(&board, other);
        Station { desk: Desk::new(board, one), sampler, mail: Mail::new() }
    }

    /// Takes a byte of the line; where it ends a [`hapt_wire::Order::Feed`] of a fed board, takes that sample.
    pub fn push(&mut self, byte: u8) -> Option<Motor> {
        let seen = self.desk.push(byte);
        if byte == 0 {
            self.exchange();
        }
        seen.map(|seen| self.sample(&seen))
    }

    /// One sample.
    pub fn sample(&mut self, seen: &Seen) -> Motor {
        let motor = self.sampler.sample(seen);
        self.exchange();
        motor
    }

    /// The next frame for the host, if there is one. On a fed board: all of them after each byte, so that none is lost.
    pub fn answer<'r>(&mut self, room: &'r mut [u8; LONGEST]) -> Option<&'r [u8]> {
        self.desk.answer(room)
    }

    /// T in s.
    pub fn period(&self) -> f32 {
        self.sampler.period()
    }

    /// The number of the next sample, when none is missed.
    pub fn next(&self) -> u64 {
        self.sampler.next()
    }

    /// What the sample just taken has cost, in a unit of the board's.
    pub fn used(&mut self, used: u32) {
        self.sampler.used(used);
    }

    fn exchange(&mut self) {
        self.desk.exchange(&mut self.mail);
        self.sampler.exchange(&mut self.mail);
        self.desk.exchange(&mut self.mail);
    }
}
