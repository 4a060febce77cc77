//! Requests to a loop from any thread that do not queue: stop, heartbeats, and the withdrawal of control.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use crate::clock::Clock;

/// A stop counts in the upper half of [`Epoch`]; a withdrawal adds 1.
const STOP: u64 = 1 << 32;

/// The number of stops and withdrawals of control so far. A request to arm or to clear is valid only in the epoch in which it was
/// made, so that no queued request restores a torque after a stop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Epoch(u64);

impl Epoch {
    /// Whether the loop was stopped between `before` and this epoch.
    pub fn stopped_since(self, before: Epoch) -> bool {
        self.0 / STOP != before.0 / STOP
    }
}

/// A handle on a loop for any thread. Nothing here blocks or queues: the loop reads it at every sample.
#[derive(Clone, Debug)]
pub struct LoopHandle(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    clock: Clock,
    epoch: AtomicU64,
    /// Time of the last heartbeat in ns of the clock, at least 1; 0: no link.
    last_heartbeat: AtomicU64,
    end: AtomicBool,
}

impl Default for LoopHandle {
    fn default() -> Self {
        let clock = Clock::new(Duration::ZERO);
        LoopHandle(Arc::new(Shared {
            clock,
            epoch: AtomicU64::new(0),
            last_heartbeat: AtomicU64::new(0),
            end: AtomicBool::new(false),
        }))
    }
}

impl LoopHandle {
    /// Stop: no torque from the next sample on.
    pub fn stop(&self) {
        self.0.epoch.fetch_add(STOP, Ordering::AcqRel);
    }

    /// Ends the loop with the torque off, at its next instant; does not wait for it.
    pub fn end(&self) {
        self.0.end.store(true, Ordering::Release);
    }

    /// Whether the loop has to end.
    pub fn is_ended(&self) -> bool {
        self.0.end.load(Ordering::Acquire)
    }

    /// Withdraws control: the torque fades out from the next sample on, and earlier requests are void.
    pub fn withdraw(&self) {
        self.0.epoch.fetch_add(1, Ordering::AcqRel);
    }

    /// A heartbeat of the client in control. From the first heartbeat on the supervisor monitors the link.
    pub fn heartbeat(&self) {
        self.0.last_heartbeat.store(self.0.clock.now().max(1), Ordering::Release);
    }

    /// A mark of the last heartbeat, different for each.
    pub fn last_heartbeat(&self) -> u64 {
        self.0.last_heartbeat.load(Ordering::Acquire)
    }

    /// The present epoch, for a request that is made now.
    pub fn epoch(&self) -> Epoch {
        Epoch(self.0.epoch.load(Ordering::Acquire))
    }

    /// Time since the last heartbeat, in s; 0 without a link.
    pub fn since_heartbeat(&self) -> f64 {
        self.since_heartbeat_at(self.0.clock.now())
    }

    /// As [`LoopHandle::since_heartbeat`], at an instant of the clock in ns.
    pub(crate) fn since_heartbeat_at(&self, now: u64) -> f64 {
        match self.last_heartbeat() {
            0 => 0.0,
            last_heartbeat => now.saturating_sub(last_heartbeat) as f64 * 1e-9,
        }
    }

    /// The clock of the heartbeats.
    pub(crate) fn clock(&self) -> Clock {
        self.0.clock
    }
}
