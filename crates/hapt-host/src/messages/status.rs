//! The loop's state for the page: its phase, the reason of a fault in sentences, and the timing.

use hapt_core::{Phase, Reason};
use hapt_model::Sampling;
use hapt_rt::{Certified, Quantiles as Times, Timing};

use super::{Bars, CertifiedInfo, Quantiles, Realtime, RecordingInfo, Status, TimingInfo};
use crate::recording::RecordingStatus;

impl Status {
    /// Sets the phase and the reason.
    pub fn explain(&mut self, at: Phase, reason: Option<Reason>) {
        self.phase = at.name();
        self.code = reason.map(Reason::code);
        self.reason = reason.map(Reason::name);
        self.sentence = reason.map(|reason| reason.sentence().into());
        self.clear = reason.map(|reason| reason.remedy().into());
    }
}

impl From<RecordingStatus> for RecordingInfo {
    fn from(status: RecordingStatus) -> Self {
        let RecordingStatus { file, seconds, lost, error } = status;
        RecordingInfo { file: file.display().to_string(), seconds, lost, error }
    }
}

impl TimingInfo {
    /// The timing of a loop with these times.
    pub fn of(timing: &Timing, sampling: &Sampling) -> Self {
        let bars = timing.latency_bars();
        // A logarithmic axis has no 0.
        let first = bars.first().map(|bar| bar.from.max(bar.to / 2));
        let edges = first.into_iter().chain(bars.iter().map(|bar| bar.to));
        TimingInfo {
            samples: timing.samples(),
            overruns: timing.overruns(),
            missed: timing.missed(),
            latency_us: Quantiles::of(timing.latency()),
            period_us: Quantiles::of(timing.period()),
            computation_us: Quantiles::of(timing.computation()),
            histogram: Bars {
                edges_us: edges.map(|ns| ns as f64 / 1e3).collect(),
                latency: bars.iter().map(|bar| bar.count).collect(),
            },
            certified: sampling.states_times().then(|| {
                let Certified { samples, inside, longest, longest_delay } = timing.certified();
                CertifiedInfo {
                    samples,
                    inside,
                    longest_us: longest as f64 / 1e3,
                    interval_max_us: sampling.interval_max.map(|_| 1e6 * sampling.interval_max_s()),
                    longest_delay_us: longest_delay as f64 / 1e3,
                    delay_max_us: sampling.delay_max.map(|_| 1e6 * sampling.delay_max_s()),
                }
            }),
        }
    }
}

impl Quantiles {
    fn of(times: Times) -> Self {
        let [p50, p90, p99, p999, max] = times.all().map(|ns| ns as f64 / 1e3);
        Quantiles { p50, p90, p99, p999, max }
    }
}

impl Realtime {
    /// The scheduling that the system has granted.
    pub fn of(granted: &hapt_rt::Realtime) -> Self {
        let warning = Some(granted.warnings.join(" ")).filter(|warning| !warning.is_empty());
        Realtime { fifo: granted.priority.is_some(), locked: granted.locked, warning }
    }
}
