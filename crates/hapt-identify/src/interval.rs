//! A number with its interval.

/// A value with its 95 % interval.
///
/// Damping, friction, delay and lag are 0 or more, and so are their values and ends. An interval that begins at 0 allows a value of 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The most likely value.
    pub value: f64,
    /// The lower end.
    pub low: f64,
    /// The upper end.
    pub high: f64,
}

impl Interval {
    /// The same value, and an interval that includes the other one.
    pub(crate) fn with(self, other: Interval) -> Self {
        Interval { value: self.value, low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Whether the interval contains a value.
    pub fn covers(&self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }
}
