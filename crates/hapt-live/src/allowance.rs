//! The limit of a page's messages.

use std::time::Instant;

/// The largest number of messages per second.
const MAX_PER_S: f64 = 200.0;

/// The state of an [`Allowance`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quota {
    /// The message is within the limit.
    Within,
    /// It is beyond the limit, and dropped.
    Exceeded,
    /// A second's worth of messages has been dropped.
    Exhausted,
}

/// Limits messages to a number a second, and a burst of as many.
pub struct Allowance {
    left: f64,
    at: Instant,
}

impl Allowance {
    pub fn new(now: Instant) -> Self {
        Allowance { left: MAX_PER_S, at: now }
    }

    /// Counts one message.
    pub fn spend(&mut self, now: Instant) -> Quota {
        self.left = (self.left + MAX_PER_S * now.saturating_duration_since(self.at).as_secs_f64()).min(MAX_PER_S);
        self.at = now;
        self.left = (self.left - 1.0).max(-MAX_PER_S - 1.0);
        match self.left {
            left if left >= 0.0 => Quota::Within,
            left if left >= -MAX_PER_S => Quota::Exceeded,
            _ => Quota::Exhausted,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn two_hundred_a_second_are_allowed_and_no_more() {
        let start = Instant::now();
        let at = |ms: u64| start + Duration::from_millis(ms);
        let mut steady = Allowance::new(start);
        assert!((1..=10_000).all(|n| steady.spend(at(5 * n)) == Quota::Within));
        let mut burst = Allowance::new(start);
        let burst: Vec<Quota> = (0..1000).map(|_| burst.spend(start)).collect();
        assert_eq!(
            [Quota::Within, Quota::Exceeded, Quota::Exhausted].map(|left| burst.iter().filter(|l| **l == left).count()),
            [200, 200, 600]
        );
        let mut fast = Allowance::new(start);
        // At 1000 per second each message exceeds the allowance by 0.8, and 200 are in reserve.
        let lasted = (1..).take_while(|n| fast.spend(at(*n)) == Quota::Within).count();
        assert!((249..=251).contains(&lasted), "{lasted}");
    }
}
