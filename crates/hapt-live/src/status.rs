//! What the page is told of the loop's state: its phase, and why it is faulted, in words.

use hapt_core::{Phase, Reason};
use hapt_rt::{Quantiles as Times, Timing};

use crate::protocol::{Bars, Quantiles, Realtime, Status, TimingSays};

impl Status {
    /// Puts the phase and the reason there.
    pub fn explain(&mut self, at: Phase, reason: Option<Reason>) {
        self.phase = at.name();
        self.code = reason.map(Reason::code);
        self.reason = reason.map(Reason::name);
        self.sentence = reason.map(|reason| reason.sentence().into());
        self.clear = reason.map(|reason| reason.remedy().into());
    }
}

impl TimingSays {
    /// What the page is told of the loop's clock.
    pub fn of(timing: &Timing) -> Self {
        let bars = timing.latency_bars();
        // A bar from 0 has no place on an axis by ratios.
        let first = bars.first().map(|bar| bar.from.max(bar.to / 2));
        let edges = first.into_iter().chain(bars.iter().map(|bar| bar.to));
        TimingSays {
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
    /// What the system has granted.
    pub fn of(granted: &hapt_rt::Realtime) -> Self {
        let warning = Some(granted.warnings.join(" ")).filter(|warning| !warning.is_empty());
        Realtime { fifo: granted.priority.is_some(), locked: granted.locked, warning }
    }
}
