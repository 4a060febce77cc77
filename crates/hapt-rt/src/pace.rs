//! Whether a loop's computer is fast enough for it.

/// How long a loop is watched before it is judged, in s.
const WINDOW: f64 = 5.0;
/// As how long one pause counts at most, in s: a computer that stands still for once is not too slow.
const PAUSE: f64 = 0.25;

/// Counts the time in which samples were taken, and in which they were missed.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pace {
    taken: f64,
    missed: f64,
}

impl Pace {
    /// Adds a sample of a loop with this period, before which so many were missed. Where more than half of a window was missed, the computer is too
    /// slow: how much, in per cent.
    pub fn add(&mut self, period: f64, missed: u32) -> Option<u8> {
        self.taken += period;
        self.missed += (f64::from(missed) * period).min(PAUSE);
        let all = self.taken + self.missed;
        if all < WINDOW {
            return None;
        }
        let Pace { missed, .. } = std::mem::take(self);
        // At most 100.
        (missed > 0.5 * all).then_some((100.0 * missed / all) as u8)
    }
}
