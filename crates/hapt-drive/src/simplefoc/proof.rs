//! Verification that the board applies the commanded target.

use hapt_rt::DriveFault;

use super::fault::{ANOTHER_CURRENT, ANOTHER_TARGET};

/// The targets that an answer may belong to: a board takes a turn or two of its loop to apply one.
const RECENT: usize = 4;
/// The tolerance of a voltage, relative to it and to the largest one, and the consecutive answers that fail.
const VOLTAGE: ([f64; 2], u32) = ([0.01, 1e-3], 5);
/// The same of a measured current, and the shortest time of these answers in s: many times a current's response time.
const CURRENT: ([f64; 2], u32) = ([0.5, 0.02], 10);
const CURRENT_TIME: f64 = 0.15;

/// The last targets, and the answers that agree with none of them.
#[derive(Clone, Copy, Debug)]
pub struct Proof {
    is_current: bool,
    most: f64,
    recent: [f64; RECENT],
    wrong: u32,
    /// The time since the first of them, s.
    time: f64,
}

impl Proof {
    /// For targets up to `most`.
    pub fn new(is_current: bool, most: f64) -> Self {
        Proof { is_current, most, recent: [0.0; RECENT], wrong: 0, time: 0.0 }
    }

    /// Registers a target.
    pub fn record_target(&mut self, target: f64) {
        self.recent.rotate_right(1);
        self.recent[0] = target;
    }

    /// Compares an answer, `seconds` after the one before.
    pub fn receive(&mut self, measured: f64, seconds: f64) -> Option<DriveFault> {
        let ([of_it, of_most], longest) = if self.is_current { CURRENT } else { VOLTAGE };
        let agrees = |target: &f64| (measured - target).abs() <= of_it * target.abs() + of_most * self.most;
        if self.recent.iter().any(agrees) {
            (self.wrong, self.time) = (0, 0.0);
            return None;
        }
        self.wrong += 1;
        self.time += seconds;
        match self.is_current {
            false if self.wrong >= longest => Some(ANOTHER_TARGET),
            true if self.wrong >= longest && self.time >= CURRENT_TIME => Some(ANOTHER_CURRENT),
            _ => None,
        }
    }
}
