//! What reaches a loop from any thread, past every queue: stop, heartbeats, and the withdrawal of whoever has control.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use crate::clock::Clock;

/// A stop, in the upper half of [`Epoch`]; a withdrawal is 1.
const STOP: u64 = 1 << 32;

/// How often the loop has been stopped, or its control withdrawn. A request to arm or to clear counts only in the epoch in which it was
/// made: no queue brings a torque back that somebody has taken away.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Epoch(u64);

impl Epoch {
    /// Whether somebody has pressed stop between `before` and this.
    pub fn stopped_since(self, before: Epoch) -> bool {
        self.0 / STOP != before.0 / STOP
    }
}

/// A handle on a loop for any thread. Nothing here waits, and nothing waits in a queue: the loop looks at it at every sample.
#[derive(Clone, Debug)]
pub struct LoopHandle(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    clock: Clock,
    epoch: AtomicU64,
    /// When the last heartbeat came, in ns of the clock and 1 at least; 0: there is no link.
    heard: AtomicU64,
    end: AtomicBool,
}

impl Default for LoopHandle {
    fn default() -> Self {
        let clock = Clock::new(Duration::ZERO);
        LoopHandle(Arc::new(Shared {
            clock,
            epoch: AtomicU64::new(0),
            heard: AtomicU64::new(0),
            end: AtomicBool::new(false),
        }))
    }
}

impl LoopHandle {
    /// Stop: no torque from the next sample on.
    pub fn stop(&self) {
        self.0.epoch.fetch_add(STOP, Ordering::AcqRel);
    }

    /// The loop ends with the torque off, at its next instant; nobody waits for that here.
    pub fn end(&self) {
        self.0.end.store(true, Ordering::Release);
    }

    /// Whether the loop is to end.
    pub fn is_ended(&self) -> bool {
        self.0.end.load(Ordering::Acquire)
    }

    /// Whoever had control has it no longer: the torque fades out from the next sample on, and what he asked for counts no more.
    pub fn withdraw(&self) {
        self.0.epoch.fetch_add(1, Ordering::AcqRel);
    }

    /// Whoever has control is there. After the first heartbeat the loop has a link, which the supervisor watches.
    pub fn heartbeat(&self) {
        self.0.heard.store(self.0.clock.now().max(1), Ordering::Release);
    }

    /// When the last heartbeat came; two of them differ.
    pub fn heard(&self) -> u64 {
        self.0.heard.load(Ordering::Acquire)
    }

    /// The present epoch, for a request that is made now.
    pub fn epoch(&self) -> Epoch {
        Epoch(self.0.epoch.load(Ordering::Acquire))
    }

    /// How long ago the last heartbeat came, in s; 0 where there is no link.
    pub fn silent(&self) -> f64 {
        self.silent_at(self.0.clock.now())
    }

    /// The same at an instant of the clock, in ns.
    pub(crate) fn silent_at(&self, now: u64) -> f64 {
        match self.heard() {
            0 => 0.0,
            heard => now.saturating_sub(heard) as f64 * 1e-9,
        }
    }

    /// The clock by which heartbeats are told.
    pub(crate) fn clock(&self) -> Clock {
        self.0.clock
    }
}
