//! Both halves in one thread: for externally clocked boards, emulators and tests.

use super::{Board, CommandHandler, Mailbox, Measurement, Motor, Sampler, WorldStorage};
use crate::MAX_FRAME_BYTES;

/// Command handler, sampler, and the mailbox between them.
#[derive(Debug)]
pub struct Endpoint<'w> {
    handler: CommandHandler<'w>,
    sampler: Sampler<'w>,
    mailbox: Mailbox<'w>,
}

impl<'w> Endpoint<'w> {
    /// A board after a reset.
    pub fn new(board: Board, one: &'w mut WorldStorage, other: &'w mut WorldStorage) -> Self {
        let sampler = Sampler::new(&board, other);
        Endpoint { handler: CommandHandler::new(board, one), sampler, mailbox: Mailbox::new() }
    }

    /// Takes a byte of the line; where it ends a [`crate::Command::Sample`] of an externally clocked board, takes that sample.
    pub fn push(&mut self, byte: u8) -> Option<Motor> {
        let measurement = self.handler.push(byte);
        if byte == 0 {
            self.exchange();
        }
        measurement.map(|measurement| self.sample(&measurement))
    }

    /// One sample.
    pub fn sample(&mut self, measurement: &Measurement) -> Motor {
        let motor = self.sampler.sample(measurement);
        self.exchange();
        motor
    }

    /// The next frame for the host, if there is one. On an externally clocked board: all of them after each byte, so that none is lost.
    pub fn answer<'r>(&mut self, room: &'r mut [u8; MAX_FRAME_BYTES]) -> Option<&'r [u8]> {
        self.handler.answer(room)
    }

    /// T in s.
    pub fn period(&self) -> f32 {
        self.sampler.period()
    }

    /// The number of the next sample, when none is missed.
    pub fn next(&self) -> u64 {
        self.sampler.next()
    }

    /// Sets the delay in s after which the motor has received the torque of the last sample.
    pub fn commanded(&mut self, delay: f32) {
        self.sampler.commanded(delay);
    }

    /// Sets the cost of the last sample, in a unit of the board.
    pub fn used(&mut self, used: u32) {
        self.sampler.used(used);
    }

    fn exchange(&mut self) {
        self.handler.exchange(&mut self.mailbox);
        self.sampler.exchange(&mut self.mailbox);
        self.handler.exchange(&mut self.mailbox);
    }
}
