//! Whether a loop's computer is fast enough for it.

use hapt_rt::Record;

/// How long a loop is watched before it is judged, in s, and with how many samples at least: one long pause is one late sample.
const WINDOW: f64 = 5.0;
const LEAST: u32 = 40;

/// Counts the samples of which the one before was missed.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pace {
    /// When the count began, by the loop's time in s.
    since: f64,
    samples: u32,
    after_missed: u32,
}

impl Pace {
    /// Adds a sample. Where more than three of four in a window came after missed ones, the loop cannot keep its period: how many of how many.
    pub fn add(&mut self, record: &Record) -> Option<[u32; 2]> {
        let now = record.due as f64 * 1e-9;
        self.samples += 1;
        self.after_missed += u32::from(record.missed > 0);
        if now - self.since < WINDOW || self.samples < LEAST {
            return None;
        }
        let Pace { samples, after_missed, .. } = std::mem::replace(self, Pace { since: now, ..Pace::default() });
        (4 * u64::from(after_missed) > 3 * u64::from(samples)).then_some([after_missed, samples])
    }
}
