//! When the samples of a scenario are truly taken, and how late their commands arrive: `[scenarios.NAME.timing]`.

use crate::error::{Error, ErrorKind, Location};
use crate::fields::Fields;
use crate::kinds::TimingKind;
use crate::path;
use crate::quantity::parse_in_unit;
use crate::sampling::Sampling;
use crate::unit::Unit;
use crate::words;

/// When samples are taken and commands arrive. World and estimator step by the nominal period for any true intervals.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Timing {
    /// Every period, with the same delay.
    #[default]
    Even,
    /// Delays uniform in [delay, delay_max], intervals uniform in [the shortest or the delay, interval_max].
    Random {
        /// The same seed gives the same times.
        seed: u32,
        /// The shortest interval in s; `None`: as far below the period as `interval_max` is above, a hundredth of the period at least.
        shortest: Option<f64>,
    },
    /// Repeated.
    Pattern {
        /// In periods.
        intervals: Vec<f64>,
        /// In periods, one for all or as many as intervals; empty: the loop's delay.
        delays: Vec<f64>,
    },
    /// From a file.
    Recorded {
        /// As the world file names it.
        file: String,
        /// When each sample is taken in s, and how late its command arrives in s, where the file says it.
        samples: Vec<(f64, Option<f64>)>,
    },
    /// The pattern under which the analysis finds the hands-off loop to grow most. It becomes a [`Timing::Pattern`] before a run.
    Worst,
}

/// Rounding of a number that was written in another unit than the bound it is held to.
const ROUNDING: f64 = 1e-9;
/// Samples in a recording.
const MOST_SAMPLES: usize = 10_000_000;

impl Timing {
    /// Its kind.
    pub const fn kind(&self) -> TimingKind {
        match self {
            Timing::Even => TimingKind::Even,
            Timing::Random { .. } => TimingKind::Random,
            Timing::Pattern { .. } => TimingKind::Pattern,
            Timing::Recorded { .. } => TimingKind::Recorded,
            Timing::Worst => TimingKind::Worst,
        }
    }

    /// The shortest interval that it draws, in s.
    pub fn shortest(&self, sampling: &Sampling) -> f64 {
        let Sampling { period, .. } = *sampling;
        match self {
            Timing::Even => period,
            Timing::Random { shortest, .. } => shortest.unwrap_or(sampling.interval_min_s()).max(sampling.delay_s()),
            Timing::Worst => sampling.interval_min_s(),
            Timing::Pattern { intervals, .. } => period * intervals.iter().copied().fold(f64::INFINITY, f64::min),
            Timing::Recorded { samples, .. } => {
                samples.windows(2).map(|pair| pair[1].0 - pair[0].0).fold(f64::INFINITY, f64::min)
            }
        }
    }

    pub(crate) fn read(
        fields: &Fields<'_>,
        kind: TimingKind,
        sampling: &Sampling,
        duration: f64,
        files: &path::Reader<'_>,
    ) -> Result<Timing, Error> {
        let timing = match kind {
            TimingKind::Even => return Ok(Timing::Even),
            TimingKind::Worst => Timing::Worst,
            TimingKind::Random => {
                Timing::Random { seed: fields.whole("seed")?, shortest: fields.optional_number("shortest")? }
            }
            TimingKind::Pattern => Timing::Pattern {
                intervals: fields.numbers("intervals").unwrap_or_default().to_vec(),
                delays: fields.numbers("delays").unwrap_or_default().to_vec(),
            },
            TimingKind::Recorded => {
                let file = fields.text("file").ok_or_else(|| fields.missing("file"))?;
                let samples = files.text(&file).and_then(|(name, text)| parse(&name, &text, sampling));
                let samples = samples.map_err(|failure| match failure.location {
                    // A mistake in the file is shown there, one in its name here.
                    Some(_) => Error { key: format!("{}.file", fields.table_path()), ..failure },
                    None => fields.error(failure.kind, "file", failure.message),
                })?;
                Timing::Recorded { file, samples }
            }
        };
        match timing.fault(sampling, duration) {
            Some((key, message)) => Err(fields.error(ErrorKind::Combination, key, message)),
            None => Ok(timing),
        }
    }

    /// Why samples cannot be taken like this in this loop: the key, and the reason; `None` where they can. A world that was changed after
    /// it had been read is checked by this again.
    pub fn fault(&self, sampling: &Sampling, duration: f64) -> Option<(&'static str, String)> {
        let (period, longest) = (sampling.period, sampling.interval_max_s());
        let (least, largest) = (sampling.delay_s(), sampling.delay_max_s());
        if *self == Timing::Even {
            return None;
        }
        if largest > period * (1.0 + ROUNDING) {
            let message = format!(
                "uneven samples need a command to arrive before the next sample: the largest delay, {largest:?} s, is longer than \
                 the period, {period:?} s"
            );
            return Some(("kind", message));
        }
        let too_long = |interval: f64| {
            format!(
                "an interval of {interval:?} s is beyond the longest that the loop states, {longest:?} s; a larger loop.interval_max \
                 would allow it"
            )
        };
        match self {
            Timing::Even | Timing::Worst => None,
            Timing::Random { shortest, .. } => shortest
                .filter(|shortest| *shortest > longest)
                .map(|shortest| ("shortest", format!("{shortest:?} s is above loop.interval_max, {longest:?} s"))),
            Timing::Pattern { intervals, delays } => {
                if let Some(interval) = intervals.iter().find(|interval| **interval <= 0.0) {
                    return Some(("intervals", format!("{interval:?} is not above 0; intervals are in periods")));
                }
                if let Some(interval) = intervals.iter().find(|x| **x * period > longest * (1.0 + ROUNDING)) {
                    return Some(("intervals", too_long(interval * period)));
                }
                if delays.len() > 1 && delays.len() != intervals.len() {
                    let (delays, intervals) = (delays.len(), intervals.len());
                    return Some((
                        "delays",
                        format!("{delays} delays for {intervals} intervals; expected one, or as many"),
                    ));
                }
                for (i, interval) in intervals.iter().enumerate() {
                    let delay = of_pattern(delays, i).map_or(least, |delay| delay * period);
                    if let Some(message) = delay_fault(delay, interval * period, sampling) {
                        return Some((if delays.is_empty() { "intervals" } else { "delays" }, message));
                    }
                }
                None
            }
            Timing::Recorded { samples, .. } => {
                for (i, pair) in samples.windows(2).enumerate() {
                    let interval = pair[1].0 - pair[0].0;
                    let fault = if interval > longest * (1.0 + ROUNDING) {
                        Some(too_long(interval))
                    } else {
                        delay_fault(pair[0].1.unwrap_or(least), interval, sampling)
                    };
                    if let Some(fault) = fault {
                        return Some(("file", format!("its sample {}: {fault}", i + 1)));
                    }
                }
                let length = samples.last().map_or(0.0, |last| last.0) - samples.first().map_or(0.0, |first| first.0);
                (length < duration * (1.0 - ROUNDING)).then(|| {
                    let message = format!(
                        "the recording lasts {length:?} s, and the scenario {duration:?} s; a duration of {length:?} s is the longest"
                    );
                    ("file", message)
                })
            }
        }
    }
}

/// The delay of interval `i` of a pattern, in periods.
pub fn of_pattern(delays: &[f64], i: usize) -> Option<f64> {
    if let [only] = delays { Some(*only) } else { delays.get(i).copied() }
}

/// Why a command cannot have this delay before the sample after this interval, both in s.
fn delay_fault(delay: f64, interval: f64, sampling: &Sampling) -> Option<String> {
    let (least, largest) = (sampling.delay_s(), sampling.delay_max_s());
    if delay < least * (1.0 - ROUNDING) || delay > largest * (1.0 + ROUNDING) {
        return Some(format!(
            "a delay of {delay:?} s is not between loop.delay, {least:?} s, and loop.delay_max, {largest:?} s"
        ));
    }
    (delay > interval * (1.0 + ROUNDING)).then(|| {
        format!(
            "the next sample would be taken after {interval:?} s, before the command arrives after {delay:?} s; no interval is \
             shorter than the delay before it"
        )
    })
}

/// A CSV of `time_s` and, where it has a second column, `delay_s`.
fn parse(name: &str, text: &str, sampling: &Sampling) -> Result<Vec<(f64, Option<f64>)>, Error> {
    let mut samples: Vec<(f64, Option<f64>)> = Vec::new();
    let (mut start, mut has_delays) = (0, None);
    for line in text.split_inclusive('\n') {
        let (at, content) = (start, line.trim_start_matches('\u{feff}').trim());
        start += line.len();
        if content.is_empty() || content.starts_with('#') {
            continue;
        }
        let from = at + line.find(content).unwrap_or(0);
        let fail = |message: String| {
            let location = Location::new(name, text, from..from + content.len());
            Err(Error { kind: ErrorKind::Syntax, key: String::new(), message, location: Some(Box::new(location)) })
        };
        let columns: Vec<&str> = content.split(',').map(str::trim).collect();
        let Some(delays) = has_delays else {
            has_delays = match columns[..] {
                ["time_s"] => Some(false),
                ["time_s", "delay_s"] => Some(true),
                _ => {
                    return fail(
                        "a recording of samples begins with its header: time_s, or time_s,delay_s".to_string(),
                    );
                }
            };
            continue;
        };
        let number = |text: &str| parse_in_unit(text, Unit::ONE);
        let sample = match columns[..] {
            [time] if !delays => number(time).map(|time| (time, None)),
            [time, delay] if delays => number(time).zip(number(delay)).map(|(time, delay)| (time, Some(delay))),
            _ => return fail(format!("{} columns stand here; expected those of the header", columns.len())),
        };
        let Some(sample) = sample else {
            return fail(format!("{} is not finite numbers; expected times in s", words::quoted(content)));
        };
        if let Some((before, _)) = samples.last().filter(|(before, _)| *before >= sample.0) {
            return fail(format!("{:?} s does not come after {before:?} s; times must increase", sample.0));
        }
        let (least, largest) = (sampling.delay_s(), sampling.delay_max_s());
        if let Some(delay) =
            sample.1.filter(|delay| *delay < least * (1.0 - ROUNDING) || *delay > largest * (1.0 + ROUNDING))
        {
            return fail(format!(
                "a delay of {delay:?} s is not between loop.delay, {least:?} s, and loop.delay_max, {largest:?} s"
            ));
        }
        let longest = sampling.interval_max_s();
        if let Some((before, _)) = samples.last().filter(|(before, _)| sample.0 - before > longest * (1.0 + ROUNDING)) {
            return fail(format!(
                "an interval of {:?} s is beyond the longest that the loop states, {longest:?} s; a larger loop.interval_max would allow it",
                sample.0 - before
            ));
        }
        if samples.len() == MOST_SAMPLES {
            return fail(format!("a recording has at most {MOST_SAMPLES} samples"));
        }
        samples.push(sample);
    }
    if samples.len() < 2 {
        let location = Location::new(name, text, text.len()..text.len());
        let message =
            "the file ends here; a recording has its header, time_s or time_s,delay_s, and two samples at least";
        return Err(Error {
            kind: ErrorKind::Syntax,
            key: String::new(),
            message: message.to_string(),
            location: Some(Box::new(location)),
        });
    }
    Ok(samples)
}
