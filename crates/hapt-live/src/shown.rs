//! A board's telemetry as samples.

use hapt_core::{Phase, Reason};
use hapt_rt::{BODIES, Record};
use hapt_wire::Telemetry;

/// Telemetry as a loop of this computer's would have it in its records; what it does not say is what its phases tell, or 0.
#[derive(Clone, Debug)]
pub struct Shown {
    plan: u32,
    /// T in s.
    period: f64,
    /// The first sample, and the one of which an instant is known, in ns from the start.
    first: Option<u64>,
    known: (u64, u64),
    /// What was shown last.
    before: Option<Telemetry>,
}

impl Shown {
    /// From the first sample that is shown on, of plan `plan` and with this period in s.
    pub fn new(plan: u32, period: f64) -> Self {
        Shown { plan, period, first: None, known: (0, 0), before: None }
    }

    /// What was shown last before the next sample, and is in no record.
    pub fn follows(&mut self, before: Option<Telemetry>) {
        self.before = before.or(self.before);
    }

    /// After the last sample the plan is another, and its period.
    pub fn goes_on(&mut self, plan: u32, period: f64) {
        let last = self.before.map_or(0, |before| before.sample);
        self.known = (last, self.instant(last));
        (self.plan, self.period) = (plan, period);
    }

    fn instant(&self, sample: u64) -> u64 {
        let (known, instant) = self.known;
        instant + (sample.saturating_sub(known) as f64 * self.period * 1e9).round() as u64
    }

    /// One more sample.
    pub fn record(&mut self, telemetry: &Telemetry) -> Record {
        let sample = telemetry.sample;
        if self.first.is_none() {
            (self.first, self.known) = (Some(sample), (sample, 0));
        }
        let (before, now) = (self.before.replace(*telemetry), phase(telemetry));
        let missed = before.map_or(0, |before| telemetry.missed.wrapping_sub(before.missed));
        let reason = Reason::from_code(telemetry.reason);
        // Of samples that were not shown nobody knows what they were told.
        let next = |before: &Telemetry| before.sample + 1 + u64::from(missed);
        let behind = before.filter(|before| next(before) == sample);
        let (request, late, silent) =
            behind.map_or((None, 0.0, 0.0), |before| hapt_log::told(phase(&before), now, reason));
        let mut bodies = [(0.0, 0.0); BODIES];
        for (place, (position, velocity)) in bodies.iter_mut().zip(telemetry.bodies.as_slice()) {
            *place = (f64::from(*position), f64::from(*velocity));
        }
        Record {
            sample: sample.saturating_sub(self.first.unwrap_or(sample)),
            due: self.instant(sample),
            plan: self.plan,
            position: telemetry.position.into(),
            // The only velocity that a board knows.
            velocity: telemetry.velocity.into(),
            // Only the board knows.
            zero: 0.0,
            announced: false,
            late,
            missed,
            silent,
            request,
            measured: telemetry.measured.into(),
            measured_velocity: telemetry.velocity.into(),
            torque: telemetry.torque.into(),
            command: telemetry.command.into(),
            output: telemetry.output.into(),
            applied: telemetry.output.into(),
            phase: now,
            reason,
            warning: Reason::from_code(telemetry.warning),
            latency: 0,
            computation: 0,
            bodies,
        }
    }
}

/// A phase that nobody knows is one without torque.
pub(crate) fn phase(telemetry: &Telemetry) -> Phase {
    Phase::ALL.get(usize::from(telemetry.phase)).copied().unwrap_or(Phase::Faulted)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instants_go_on_over_a_change_of_the_period() {
        let mut shown = Shown::new(3, 1e-3);
        let at = |sample, missed| Telemetry { sample, missed, ..Telemetry::default() };
        let told = |record: Record| (record.sample, record.due, record.plan, record.missed);
        // Samples are counted from the board's start, and its misses too.
        assert_eq!(told(shown.record(&at(70_000, 5))), (0, 0, 3, 0));
        assert_eq!(told(shown.record(&at(70_010, 5))), (10, 10_000_000, 3, 0));
        shown.goes_on(4, 2e-3);
        assert_eq!(told(shown.record(&at(70_020, 7))), (20, 30_000_000, 4, 2));
        assert_eq!(told(shown.record(&at(70_021, 7))), (21, 32_000_000, 4, 0));
    }
}
