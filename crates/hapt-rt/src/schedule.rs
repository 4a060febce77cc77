//! The assignment of samples to instants. All times are whole ns of one monotonic clock.

/// The instants origin + k · T, each taken at most once; missed instants are not caught up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Schedule {
    /// The instant of sample 0, or of the sample at which the period last changed.
    origin: u64,
    /// T in ns.
    period: f64,
    /// The next sample, counted from the origin.
    next: u64,
    /// The last one that was taken.
    last: Option<u64>,
}

/// A sample that is taken now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Taken {
    /// Its own instant in ns.
    pub due: u64,
    /// Time since that instant, less than a period.
    pub late: u64,
    /// Periods since the last sample; 0 at the first.
    pub periods: u32,
}

impl Schedule {
    /// From `origin` on, every `period` s.
    pub fn new(origin: u64, period: f64) -> Self {
        Schedule { origin, period: period * 1e9, next: 0, last: None }
    }

    fn instant(&self, k: u64) -> u64 {
        self.origin + (k as f64 * self.period).round() as u64
    }

    /// The last k whose instant is not after `now`.
    fn before(&self, now: u64) -> u64 {
        let k = (now.saturating_sub(self.origin) as f64 / self.period) as u64;
        // The quotient may be off by its rounding.
        if self.instant(k) > now {
            k.saturating_sub(1)
        } else if self.instant(k + 1) <= now {
            k + 1
        } else {
            k
        }
    }

    /// The next instant to wake up at.
    pub fn due(&self) -> u64 {
        self.instant(self.next)
    }

    /// Takes the sample at `now`, not before [`Schedule::due`]: that of the last instant that has passed.
    pub fn take(&mut self, now: u64) -> Taken {
        let mut k = self.before(now).max(self.next);
        if self.last.is_none() {
            // The first sample is number 0, for any lateness.
            (self.origin, k) = (self.instant(k), 0);
        }
        let due = self.instant(k);
        let periods = self.last.map_or(0, |last| u32::try_from(k - last).unwrap_or(u32::MAX));
        (self.last, self.next) = (Some(k), k + 1);
        Taken { due, late: now.saturating_sub(due), periods }
    }

    /// Completes the sample at `now`: the next is that of the first instant in the future.
    pub fn done(&mut self, now: u64) {
        if self.due() <= now {
            self.next = self.before(now) + 1;
        }
    }

    /// Changes the period, in s, from the last sample on.
    pub fn change_period(&mut self, period: f64) {
        let origin = self.instant(self.last.unwrap_or(0));
        *self = Schedule { origin, period: period * 1e9, next: 1, last: Some(0) };
    }
}

#[cfg(test)]
mod tests {
    use hapt_testing::prelude::*;

    use super::*;

    #[test]
    fn on_time_every_instant_is_taken_and_none_is_missed() {
        let mut schedule = Schedule::new(1_000, 1e-3);
        for k in 0..10_000 {
            assert_eq!(schedule.due(), 1_000 + k * 1_000_000);
            let taken = schedule.take(schedule.due() + 70);
            assert_eq!((taken.late, taken.periods), (70, u32::from(k > 0)));
            schedule.done(taken.due + 500);
        }
    }

    #[test]
    fn a_stopped_process_counts_its_missed_samples_and_does_not_catch_them_up() {
        let mut schedule = Schedule::new(0, 1e-3);
        schedule.take(0);
        schedule.done(10_000);
        // Stopped for 5.3 periods during a sleep.
        let taken = schedule.take(5_300_000);
        assert_eq!(taken, Taken { due: 5_000_000, late: 300_000, periods: 5 });
        schedule.done(5_310_000);
        assert_eq!(schedule.due(), 6_000_000);
        // And during a sample.
        schedule.take(6_000_000);
        schedule.done(9_400_000);
        assert_eq!(schedule.due(), 10_000_000);
        assert_eq!(schedule.take(10_000_010), Taken { due: 10_000_000, late: 10, periods: 4 });
    }

    #[test]
    fn a_new_period_counts_from_the_sample_of_its_change() {
        let mut schedule = Schedule::new(500, 1e-3);
        for _ in 0..4 {
            let taken = schedule.take(schedule.due() + 3);
            schedule.done(taken.due + 5);
        }
        schedule.change_period(0.25e-3);
        assert_eq!(schedule.due(), 500 + 3_250_000);
        assert_eq!(schedule.take(schedule.due()).periods, 1);
    }

    proptest! {
        #![proptest_config(hapt_testing::cases(200))]

        #[test]
        fn for_any_delays_each_sample_is_late_by_less_than_a_period_and_the_count_is_the_time_in_periods(
            period in 1e-5_f64..1e-2, delays in prop::collection::vec((0_u64..30_000_000, 0_u64..30_000_000), 1..200),
        ) {
            let mut schedule = Schedule::new(12_345, period);
            let (mut now, mut k, mut last_due, mut origin) = (0, 0, None, None);
            for (asleep, working) in delays {
                prop_assert!(schedule.due() > now, "the next instant is in the future");
                now = schedule.due() + asleep;
                let taken = schedule.take(now);
                prop_assert!(taken.due <= now && (taken.late as f64) < period * 1e9 + 2.0);
                prop_assert!(last_due.is_none_or(|last| taken.due > last), "no instant is taken twice");
                k += u64::from(taken.periods);
                let origin = *origin.get_or_insert(taken.due);
                prop_assert_eq!(taken.due, origin + (k as f64 * (period * 1e9)).round() as u64);
                last_due = Some(taken.due);
                now += working;
                schedule.done(now);
            }
        }
    }
}
