//! The samples within a communication step. Samples are counted; times are never summed.

/// An instant within this part of a period of a whole sample counts as that sample.
const SNAP: f64 = 1e-6;
/// The most samples of one communication step.
const MAX_SAMPLES: f64 = 1e10;

/// An instant on the samples of a loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// T in s.
    pub period: f64,
    /// The instant of sample 0 in s.
    pub start: f64,
    /// The last sample whose instant is not after this one.
    pub sample: u64,
    /// Seconds since that sample, 0 to below a period.
    pub part: f64,
}

impl Clock {
    /// At sample 0.
    pub fn new(period: f64, start: f64) -> Clock {
        Clock { period, start, sample: 0, part: 0.0 }
    }

    /// The instant in s: one multiplication, without accumulated rounding.
    pub fn time(&self) -> f64 {
        self.start + self.sample as f64 * self.period + self.part
    }

    /// The instant at the end of a step of `length` s that begins at `at` s, near this one by the importer's clock. A whole number of
    /// periods, up to rounding, advances by that number of samples, whatever the sum of the roundings in `at`.
    ///
    /// # Errors
    /// In a sentence: more than 10^10 samples.
    pub fn after(&self, at: f64, length: f64) -> Result<Clock, String> {
        let periods = length / self.period;
        if periods > MAX_SAMPLES {
            return Err(format!("a step of {length} s has {periods:.0} samples; one step has at most 10^10"));
        }
        let whole = periods.round();
        // A length that differs by more would add up over millions of steps.
        let rounding = (4.0 * f64::EPSILON * (at.abs() + length) / self.period).min(SNAP);
        if whole >= 1.0 && (periods - whole).abs() <= rounding {
            return Ok(Clock { sample: self.sample.saturating_add(whole as u64), ..*self });
        }
        let end = (at - self.start + length) / self.period;
        let (sample, part) = match end.round() {
            near if (end - near).abs() <= SNAP => (near, 0.0),
            _ => (end.floor(), (end - end.floor()) * self.period),
        };
        let next = Clock { sample: sample.max(0.0) as u64, part, ..*self };
        // The importer's time may be slightly before this one, and the step shorter than the difference.
        let is_later = (next.sample, next.part) > (self.sample, self.part);
        Ok(if is_later { next } else { *self })
    }

    /// The largest distance of a step's start from the end of the one before, in s: a thousandth of a period, and the rounding of a few
    /// operations.
    pub fn tolerance(&self) -> f64 {
        1e-3 * self.period + 1e-12 * self.time().abs()
    }
}
