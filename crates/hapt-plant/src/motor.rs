//! The motor: holds a command from t_k + delay on.

use alloc::collections::VecDeque;

use hapt_core::Number;

/// The longest delay line that is reserved in advance, in commands.
const ROOM: usize = 1 << 16;

/// The motor holds a command from t_k + delay on.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Motor<F> {
    /// Whole samples of the delay, and the rest in s.
    pub samples: usize,
    /// In s.
    pub rest: f64,
    /// The delay line.
    flying: VecDeque<F>,
    /// The torque that it holds.
    pub applied: F,
}

impl<F: Number> Motor<F> {
    /// A motor with this delay and period, in s; it holds 0.
    pub fn new(delay: f64, period: f64) -> Self {
        let ratio = delay / period;
        let whole = libm::round(ratio);
        // Within 1e-6 T of a whole sample it is that sample.
        let (samples, rest) = if (ratio - whole).abs() <= 1e-6 {
            (whole, 0.0)
        } else {
            (libm::floor(ratio), (ratio - libm::floor(ratio)) * period)
        };
        Motor { samples: samples as usize, rest, flying: VecDeque::new(), applied: F::ZERO }
    }

    /// Reserves the delay line, so that no command allocates.
    pub fn reserve(&mut self) {
        self.flying.reserve(self.samples.saturating_add(2).min(ROOM));
    }

    /// Takes over the held torque and the newest commands in the delay line of `before`, as far as there is room.
    pub fn follow(&mut self, before: &Self) {
        self.applied = before.applied;
        let kept = self.samples.min(self.flying.capacity());
        let old = before.flying.len().saturating_sub(kept);
        self.flying.clear();
        self.flying.extend(before.flying.iter().skip(old).copied());
    }

    /// Sets the torque to 0 and empties the delay line.
    pub fn clear(&mut self) {
        self.flying.clear();
        self.applied = F::ZERO;
    }

    /// The instant at which a command arrives.
    pub fn change(&mut self) {
        if self.flying.len() > self.samples {
            self.applied = self.flying.pop_front().unwrap_or(self.applied);
        }
    }

    /// The loop's command at a sample.
    pub fn command(&mut self, command: F) {
        if self.samples == 0 && self.rest == 0.0 {
            self.applied = command;
            return;
        }
        self.flying.push_back(command);
        if self.rest == 0.0 {
            self.change();
        }
    }
}
