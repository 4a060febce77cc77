//! The mailbox between command handler and sampler.

use crate::{Refusal, Telemetry};
use hapt_core::Request;

use super::WorldStorage;

/// T before there is a world, in s.
pub(crate) const FIRST_PERIOD: f32 = 1e-3;

/// Capacity of the queues of commands and of responses.
pub(crate) const WAITING: usize = 8;

/// A short queue.
#[derive(Debug)]
pub(crate) struct Queue<T> {
    /// The oldest first, without gaps.
    items: [Option<T>; WAITING],
}

impl<T> Queue<T> {
    pub const fn new() -> Self {
        Queue { items: [const { None }; WAITING] }
    }

    /// Appends an entry; returns it where the queue is full.
    pub fn push(&mut self, item: T) -> Result<(), T> {
        match self.items.iter_mut().find(|place| place.is_none()) {
            Some(place) => {
                *place = Some(item);
                Ok(())
            }
            None => Err(item),
        }
    }

    /// Removes the oldest entry.
    pub fn pop(&mut self) -> Option<T> {
        let item = self.items.first_mut()?.take();
        self.items.rotate_left(1);
        item
    }

    pub fn is_full(&self) -> bool {
        self.items.iter().all(Option::is_some)
    }
}

/// A command to the sampler.
#[derive(Debug)]
pub(crate) struct Pending<'w> {
    pub sequence: u32,
    pub not_after: u64,
    pub what: Action<'w>,
}

#[derive(Debug)]
pub(crate) enum Action<'w> {
    Heartbeat,
    /// A request to the supervisor; to arm, with the hash of the world.
    Ask(Request, Option<u32>),
    Swap(&'w mut WorldStorage),
    Divide(u16),
    CountUseFrom(u32),
}

/// The outcome of a command.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Response {
    pub sequence: u32,
    pub outcome: Outcome,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Outcome {
    Done,
    Refused(Refusal),
    Value(u8, u32),
}

/// The progress of the sampler.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Progress {
    /// The number of the next sample.
    pub next: u64,
    /// In s.
    pub period: f32,
    pub phase: u8,
    pub reason: u8,
    pub world: Option<u32>,
    pub divider: u16,
    pub missed: u32,
    pub most_used: u32,
    pub outside: u32,
}

impl Progress {
    pub const START: Progress = Progress {
        next: 0,
        period: FIRST_PERIOD,
        phase: 0,
        reason: 0,
        world: None,
        divider: 0,
        missed: 0,
        most_used: 0,
        outside: 0,
    };
}

/// The data shared by both halves, each of which locks it for microseconds at most.
#[derive(Debug)]
pub struct Mailbox<'w> {
    pub(crate) pending: Queue<Pending<'w>>,
    /// The sequence of a stop, which does not queue.
    pub(crate) stop: Option<u32>,
    pub(crate) responses: Queue<Response>,
    /// The storage of the previous world, or of a refused one.
    pub(crate) back: Option<&'w mut WorldStorage>,
    pub(crate) telemetry: Option<Telemetry>,
    pub(crate) progress: Progress,
}

impl Mailbox<'_> {
    /// Empty.
    pub const fn new() -> Self {
        Mailbox {
            pending: Queue::new(),
            stop: None,
            responses: Queue::new(),
            back: None,
            telemetry: None,
            progress: Progress::START,
        }
    }
}

impl Default for Mailbox<'_> {
    fn default() -> Self {
        Mailbox::new()
    }
}
