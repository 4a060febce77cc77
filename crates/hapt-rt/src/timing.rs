//! The timing statistics of the records: period, latency and computation, as histograms.

use std::fmt;

use hdrhistogram::Histogram;

use crate::Record;

/// The times of a loop, from its records. All in ns.
///
/// A loop at 1 kHz whose sample 5 is missed:
///
/// ```
/// use hapt_core::SafetyProfile;
/// use hapt_model::{Source, World};
/// use hapt_rt::{Cycle, Moment, Plan, SimulatedDevice, Timing};
///
/// let file = "loop.period = \"1 ms\"\ndevice.inertia = \"6.4e-4 kg m^2\"\n";
/// let world = World::read(&Source::from_text("free.toml", file), &[])?;
/// let (device, _hands) = SimulatedDevice::new(&world);
/// let mut cycle = Cycle::new(Box::new(Plan::new(&world, SafetyProfile::Simulated)?), Box::new(device));
/// let mut timing = Timing::new();
/// for (due, periods) in [(0, 0), (1, 1), (2, 1), (3, 1), (4, 1), (6, 2), (7, 1)] {
///     cycle.pass(periods);
///     timing.add(&cycle.sample(&Moment { due: due * 1_000_000, periods, ..Moment::default() }, None)?);
/// }
/// assert_eq!((timing.samples(), timing.missed(), timing.longest_gap()), (7, 1, 2_000_000));
/// assert_eq!(timing.warning().unwrap(), "1 sample was missed; the longest gap between two samples was 2.000 ms");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Timing {
    /// From the instant of a sample to its reading; after missed samples, from the instant of the first of them.
    latency: Histogram<u64>,
    /// From one sample to the next, missed ones included.
    period: Histogram<u64>,
    /// From the reading to the completed write to the device.
    computation: Histogram<u64>,
    overruns: u64,
    missed: u64,
    lost: u64,
    /// The longest time between two samples, and the time of its end.
    gap: (u64, u64),
    certified: Certified,
    last: Option<Last>,
}

/// A sample that was taken.
#[derive(Clone, Copy, Debug)]
struct Last {
    sample: u64,
    due: u64,
    /// When its reading was taken; with a stale one the last new one.
    read: u64,
    /// The consecutive stale readings up to it; 0 at a new one.
    stale: u64,
    /// Whether a torque may follow it.
    is_active: bool,
    outside: u32,
    /// From the reading to the completed write to the device, in ns.
    computation: u32,
}

/// Whether a loop kept the times that its certificate covers, over the samples with a torque before them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Certified {
    /// The samples.
    pub samples: u64,
    /// The samples that were in time and followed a command in time.
    pub inside: u64,
    /// The longest time from a sample to the next, in ns.
    pub longest: u64,
    /// The longest time from a sample to the completed write to the device, in ns.
    pub longest_delay: u64,
}

/// Quantiles of a time, in ns; 0 without samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Quantiles {
    /// Half of the samples are below.
    pub p50: u64,
    /// 90 %.
    pub p90: u64,
    /// 99 %.
    pub p99: u64,
    /// 99.9 %.
    pub p999: u64,
    /// The largest.
    pub max: u64,
}

/// One bar of a histogram: the count in [from, to), in ns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bar {
    /// The lower edge.
    pub from: u64,
    /// The upper edge, which is the next bar's lower one.
    pub to: u64,
    /// The count.
    pub count: u64,
}

impl Timing {
    /// Empty statistics.
    pub fn new() -> Self {
        // Up to a minute, to a thousandth; longer is a minute.
        let histogram = || Histogram::new_with_bounds(1, 60_000_000_000, 3).expect("these bounds are good");
        Timing {
            latency: histogram(),
            period: histogram(),
            computation: histogram(),
            overruns: 0,
            missed: 0,
            lost: 0,
            gap: (0, 0),
            certified: Certified::default(),
            last: None,
        }
    }

    /// Adds a record, in the order of the loop.
    pub fn add(&mut self, record: &Record) {
        self.computation.saturating_record(record.computation.into());
        let Record { sample, due, outside, computation, phase, .. } = *record;
        let missed = u64::from(record.missed);
        // The schedule's sample is the last whose instant has passed: it is late by less than a period.
        let late = u64::from(record.latency);
        let taken = due + late;
        let mut latency = late;
        let steps = self.last.map_or(1, |last| sample.saturating_sub(last.sample).max(1));
        // A sample that was neither missed nor received is a lost record.
        let lost = steps.saturating_sub(1 + missed);
        // The next sample was due one period after the last. A device's stale readings count as missed, too, but at their own instants: each
        // comes with the number of them up to it, and the new reading behind them with the same number.
        let skipped = missed.min(steps - 1);
        let (stale, before) = (missed - skipped, self.last.map_or(0, |last| last.stale));
        let is_stale = stale > before;
        self.overruns += u64::from(skipped > 0 || is_stale && before == 0);
        self.missed += skipped + stale.saturating_sub(before);
        if let Some(last) = self.last {
            self.lost += lost;
            latency += due.saturating_sub(last.due) / steps * skipped;
            let between = taken.saturating_sub(last.read);
            if lost == 0 {
                self.gap = self.gap.max((between, taken));
            }
            if lost == 0 && !is_stale {
                self.period.saturating_record(between);
            }
            if last.is_active {
                let Certified { samples, inside, longest, longest_delay } = self.certified;
                let taken_since = steps.saturating_sub(missed).max(1);
                let outside = u64::from(outside.saturating_sub(last.outside)).min(taken_since);
                // For samples without a record only the count of missed ones is known: they may all have been missed in a row.
                let between = match lost {
                    0 => between,
                    _ => due.saturating_sub(last.due) / steps * (1 + missed),
                };
                self.certified = Certified {
                    samples: samples + taken_since,
                    inside: inside + taken_since - outside,
                    longest: longest.max(between),
                    // The supervisor evaluates it at this sample.
                    longest_delay: longest_delay.max(last.computation.into()),
                };
            }
        }
        self.latency.saturating_record(latency);
        let read = self.last.filter(|_| is_stale).map_or(taken, |last| last.read);
        let stale = if is_stale { stale } else { 0 };
        self.last = Some(Last { sample, due, read, stale, is_active: phase.is_active(), outside, computation });
    }

    /// Samples whose records arrived.
    pub fn samples(&self) -> u64 {
        self.latency.len()
    }

    /// The number of times that the loop missed at least one instant.
    pub fn overruns(&self) -> u64 {
        self.overruns
    }

    /// Instants without a sample.
    pub fn missed(&self) -> u64 {
        self.missed
    }

    /// Samples whose records were lost.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// The longest time between two samples, in ns; 0 before there are two.
    pub fn longest_gap(&self) -> u64 {
        self.gap.0
    }

    /// Whether the loop kept the times that its world states; with a world that states none every sample does.
    pub fn certified(&self) -> Certified {
        self.certified
    }

    /// A warning with the number of missed samples and the longest gap; `None` where none was missed.
    pub fn warning(&self) -> Option<String> {
        (self.missed > 0).then(|| {
            let samples = if self.missed == 1 { "sample was" } else { "samples were" };
            let gap = self.gap.0 as f64 * 1e-6;
            format!("{} {samples} missed; the longest gap between two samples was {gap:.3} ms", self.missed)
        })
    }

    /// From the instant of a sample to its reading; after missed samples, from the instant of the first of them.
    pub fn latency(&self) -> Quantiles {
        Quantiles::of(&self.latency)
    }

    /// From one sample to the next, missed ones included.
    pub fn period(&self) -> Quantiles {
        Quantiles::of(&self.period)
    }

    /// From the reading to the completed write to the device.
    pub fn computation(&self) -> Quantiles {
        Quantiles::of(&self.computation)
    }

    /// The latencies in bars between 1, 2 and 5 times the powers of ten, from the first that is not empty to the last; in ns.
    pub fn latency_bars(&self) -> Vec<Bar> {
        let mut edges = vec![0];
        let mut power = 100;
        while power < 100_000_000_000 {
            edges.extend([power, 2 * power, 5 * power]);
            power *= 10;
        }
        let bar = |(from, to): (u64, u64)| Bar { from, to, count: 0 };
        let mut bars: Vec<Bar> = edges.iter().copied().zip(edges.iter().copied().skip(1)).map(bar).collect();
        // The histogram's own bins are a thousandth wide; one that an edge cuts counts in the bar of its largest number.
        for bin in self.latency.iter_recorded() {
            let at = bars.partition_point(|bar| bar.to <= bin.value_iterated_to());
            if let Some(bar) = bars.get_mut(at) {
                bar.count += bin.count_since_last_iteration();
            }
        }
        let empty = |bar: &Bar| bar.count == 0;
        while bars.last().is_some_and(empty) {
            bars.pop();
        }
        let first = bars.iter().take_while(|bar| empty(bar)).count();
        bars.split_off(first)
    }
}

impl Default for Timing {
    fn default() -> Self {
        Timing::new()
    }
}

impl Quantiles {
    fn of(times: &Histogram<u64>) -> Self {
        let at = |quantile| times.value_at_quantile(quantile);
        Quantiles { p50: at(0.5), p90: at(0.9), p99: at(0.99), p999: at(0.999), max: times.max() }
    }

    /// In the order of a table: 50, 90, 99 and 99.9 %, and the largest.
    pub fn all(&self) -> [u64; 5] {
        [self.p50, self.p90, self.p99, self.p999, self.max]
    }
}

/// As a table, in microseconds.
impl fmt::Display for Timing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "             {:>9} {:>9} {:>9} {:>9} {:>9}", "p50", "p90", "p99", "p99.9", "max")?;
        let rows = [("latency", self.latency()), ("period", self.period()), ("computation", self.computation())];
        for (name, quantiles) in rows {
            write!(f, "{name:<12}")?;
            for ns in quantiles.all() {
                write!(f, " {:>9.1}", ns as f64 * 1e-3)?;
            }
            writeln!(f, " us")?;
        }
        let times = |n: u64| if n == 1 { "once".to_string() } else { format!("{n} times") };
        match self.overruns {
            0 => write!(f, "{} samples, none missed", self.samples())?,
            n => write!(f, "{} samples, {} missed, too late {}", self.samples(), self.missed, times(n))?,
        }
        match self.lost {
            0 => {}
            n => write!(f, "; {n} of the samples not seen here")?,
        }
        let (gap, at) = (self.gap.0 as f64 * 1e-6, self.gap.1 as f64 * 1e-9);
        if self.gap.0 > 0 {
            write!(f, "\nlongest gap  {gap:.3} ms between two samples, {at:.3} s after the start")
        } else {
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use hapt_core::Phase;
    use hapt_testing::prelude::*;

    use super::*;
    use crate::BODIES;

    fn record(sample: u64, missed: u32, latency: u32, computation: u32) -> Record {
        Record {
            sample,
            due: sample * 1_000_000,
            plan: 0,
            position: 0.0,
            velocity: 0.0,
            zero: 0.0,
            announced: false,
            late: f64::from(latency) * 1e-9,
            missed,
            silent: 0.0,
            request: None,
            measured: 0.0,
            measured_velocity: 0.0,
            torque: 0.0,
            link: 0.0,
            command: 0.0,
            output: 0.0,
            applied: 0.0,
            phase: Phase::Disarmed,
            reason: None,
            warning: None,
            latency,
            computation,
            outside: 0,
            bodies: [(0.0, 0.0); BODIES],
        }
    }

    proptest! {
        #![proptest_config(hapt_testing::cases(100))]

        #[test]
        fn quantiles_are_those_of_the_sorted_times_and_every_sample_is_in_one_bar(
            latencies in prop::collection::vec(1_u32..2_000_000, 1..500),
        ) {
            let mut timing = Timing::new();
            for (k, latency) in latencies.iter().enumerate() {
                timing.add(&record(k as u64, 0, *latency, 500));
            }
            let mut sorted = latencies.clone();
            sorted.sort_unstable();
            for (quantile, given) in [(0.5, timing.latency().p50), (0.9, timing.latency().p90), (1.0, timing.latency().max)] {
                let exact = f64::from(sorted[(quantile * sorted.len() as f64).ceil() as usize - 1]);
                prop_assert!((given as f64 - exact).abs() <= 1e-3 * exact + 1.0, "{quantile}: {given} {exact}");
            }
            prop_assert_eq!(timing.latency_bars().iter().map(|bar| bar.count).sum::<u64>(), latencies.len() as u64);
            prop_assert_eq!(timing.computation().max, 500);
            for (bar, next) in timing.latency_bars().iter().zip(timing.latency_bars().iter().skip(1)) {
                prop_assert_eq!(bar.to, next.from);
            }
        }
    }

    proptest! {
        #![proptest_config(hapt_testing::cases(100))]

        /// After a stall of any length, in a sleep or in a sample, the schedule's next sample is less than a period late, and the table shows
        /// the whole stall.
        #[test]
        fn a_stall_of_any_length_is_the_largest_latency_and_the_longest_gap(
            before in 1_u64..200, after in 1_u64..200, missed in 1_u32..50_000, late in 0_u32..1_000_000, device in 0_u32..4,
        ) {
            let mut timing = Timing::new();
            for k in 0..before {
                timing.add(&record(k, 0, 1000, 1));
            }
            let resumed = before + u64::from(missed);
            timing.add(&record(resumed, missed, late, 1));
            for k in 1..=after {
                // Stale readings are missed samples of the device, and no stall.
                let stale = if k <= u64::from(device) + 1 { device.min(k as u32) } else { 0 };
                timing.add(&record(resumed + k, stale, 1000, 1));
            }
            let stall = u64::from(missed) * 1_000_000 + u64::from(late);
            let silence = after.min(u64::from(device) + 1) * 1_000_000 + 1000 - u64::from(late);
            prop_assert!(timing.latency().max.abs_diff(stall) <= stall / 900 + 1, "{} {stall}", timing.latency().max);
            prop_assert_eq!(timing.longest_gap(), silence.max(stall + 1_000_000 - 1000));
            prop_assert!(timing.period().max >= timing.longest_gap() || after <= u64::from(device));
            prop_assert_eq!(timing.missed(), u64::from(missed) + after.min(device.into()));
            let (text, warning) = (timing.to_string(), timing.warning().unwrap());
            let gap = format!("{:.3} ms", timing.longest_gap() as f64 * 1e-6);
            prop_assert!(text.contains(&gap) && warning.contains(&gap), "{text} {warning}");
        }
    }

    #[test]
    fn a_silence_of_the_device_is_one_gap_and_each_of_its_instants_is_missed_once() {
        let powered = |sample, missed| Record { phase: Phase::Running, ..record(sample, missed, 0, 1) };
        for silent in 1..6 {
            let mut timing = Timing::new();
            let stale = (1..=silent).map(|k| (u64::from(k), k));
            let new = (u64::from(silent) + 1, silent);
            for (sample, missed) in
                [(0, 0)].into_iter().chain(stale).chain([new, (new.0 + 1, 0), (new.0 + 2, 1), (new.0 + 3, 1)])
            {
                timing.add(&powered(sample, missed));
            }
            assert_eq!((timing.missed(), timing.overruns(), timing.lost()), (u64::from(silent) + 1, 2, 0));
            let longest = new.0 * 1_000_000;
            assert_eq!(
                (timing.longest_gap(), timing.certified().longest),
                (longest.max(2_000_000), longest.max(2_000_000))
            );
        }
    }

    #[test]
    fn missed_samples_and_lost_records_count_apart_and_lost_records_are_no_gap() {
        let mut timing = Timing::new();
        // On time, late by 100 us, three missed by the loop, two records lost to a full ring.
        for given in [record(0, 0, 0, 1), record(1, 0, 100_000, 1), record(5, 3, 100_000, 1), record(8, 0, 100_000, 1)]
        {
            timing.add(&given);
        }
        assert_eq!((timing.samples(), timing.overruns(), timing.missed(), timing.lost()), (4, 1, 3, 2));
        // 1.1 ms and, over three that were missed, 4 ms; the gap over the lost ones is unknown.
        assert_eq!(timing.longest_gap(), 4_000_000);
        assert!(timing.period().p50.abs_diff(1_100_000) < 1_100, "{:?}", timing.period());
        let text = timing.to_string();
        assert!(
            text.ends_with(
                "4 samples, 3 missed, too late once; 2 of the samples not seen here\nlongest gap  4.000 ms between two samples, 0.005 s after the start"
            ),
            "{text}"
        );
    }
}
