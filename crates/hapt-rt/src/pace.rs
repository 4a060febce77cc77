//! Whether a loop's computer is fast enough for it.

/// The time over which missed samples are counted, in s.
const WINDOW_S: f64 = 5.0;
/// The longest time that one pause counts, in s: a computer that pauses once is not too slow.
const MAX_PAUSE_S: f64 = 0.25;

/// Counts the time in which samples were taken, and in which they were missed.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pace {
    taken: f64,
    missed: f64,
}

impl Pace {
    /// Adds a sample of a loop with this period, after `missed` missed ones. Returns the missed part in per cent where it is more than half of the
    /// window: the computer is too slow.
    pub fn add(&mut self, period: f64, missed: u32) -> Option<u8> {
        self.taken += period;
        self.missed += (f64::from(missed) * period).min(MAX_PAUSE_S);
        let all = self.taken + self.missed;
        if all < WINDOW_S {
            return None;
        }
        let Pace { missed, .. } = std::mem::take(self);
        // At most 100.
        (missed > 0.5 * all).then_some((100.0 * missed / all) as u8)
    }
}
