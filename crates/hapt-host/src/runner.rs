//! The interface to the loop's runner: a thread of this computer, or a board.

use std::time::Duration;

use hapt_core::Request;
use hapt_rt::{Change, Epoch, LoopHandle, Realtime, Record};

use crate::config::WorldConfig;
use crate::error::Error;
use crate::recording::Recorder;

/// Runs the loop. No call blocks, except [`Runner::end`]. Dropping it removes the torque.
#[cfg_attr(target_family = "wasm", allow(dead_code))]
pub(crate) trait Runner: Send {
    /// Stop, heartbeats and the withdrawal of control, from any thread, ahead of all requests.
    fn handle(&self) -> LoopHandle;

    /// Queues a request to the supervisor, made in this epoch; `false`: the queue is full.
    fn request(&mut self, request: Request, epoch: Epoch) -> bool;

    /// Changes the world atomically at one of the next samples; from there on samples carry plan `next.generation`.
    ///
    /// # Errors
    /// In a sentence; nothing has changed.
    fn change(&mut self, next: &WorldConfig, change: Change) -> Result<(), String>;

    /// Advances a loop without a thread to the time `now`, counted from any instant; other loops have a clock.
    fn advance(&mut self, _now: Duration) {}

    /// The next event.
    fn event(&mut self) -> Option<RunnerEvent>;

    /// The next sample.
    fn record(&mut self) -> Option<Record>;

    /// Whether the loop has ended: on request, or by an error.
    fn ended(&mut self) -> Option<Result<(), Error>>;

    /// Ends the loop, and waits until the torque is off.
    fn end(&mut self);

    /// The scheduling that the system grants the loop; `None`: the loop runs on a board.
    fn realtime(&self) -> Option<&Realtime>;

    /// Whether its samples can be recorded.
    fn can_record(&self) -> bool {
        true
    }

    /// Whether external torques add to the world's: of links, or of a game's effects.
    fn has_outside(&self) -> bool {
        false
    }

    /// Prepares the start of a log in the middle of a run; `false`: the queue is full.
    fn begin_log(&mut self) -> bool;

    /// Whether a log prepared by [`Runner::begin_log`] can begin with this sample.
    fn log_begins(&mut self, record: &Record) -> bool;

    /// Adds a sample to a log.
    fn log(&mut self, recorder: &Recorder, record: &Record);
}

/// A board's report other than a sample.
#[cfg_attr(not(unix), allow(dead_code))]
pub(crate) enum RunnerEvent {
    /// A request was refused, or the board has faulted for an unknown reason.
    Error(Error),
    /// The world of this generation was refused; the given one still runs.
    Rejected(u32, Box<WorldConfig>, Error),
}
