//! Decodes a board's telemetry into records.

use hapt_core::{Phase, Reason};
use hapt_rt::{BODIES, Record};
use hapt_wire::Telemetry;

/// Decodes telemetry into the records that a local loop makes. Requests, lateness and silence follow from the phases; what telemetry does
/// not contain is 0.
#[derive(Clone, Debug)]
pub struct TelemetryDecoder {
    plan: u32,
    /// T in s.
    period: f64,
    /// The board's number of the first sample; and a sample with its instant, in ns from the first.
    first: Option<u64>,
    known: (u64, u64),
    /// The last telemetry.
    before: Option<Telemetry>,
}

impl TelemetryDecoder {
    /// Starts with plan `plan` and its period in s.
    pub fn new(plan: u32, period: f64) -> Self {
        TelemetryDecoder { plan, period, first: None, known: (0, 0), before: None }
    }

    /// Sets the telemetry that precedes the next sample, where no record was made of it.
    pub fn follows(&mut self, before: Option<Telemetry>) {
        self.before = before.or(self.before);
    }

    /// Changes the plan and its period in s, after the last sample.
    pub fn change(&mut self, plan: u32, period: f64) {
        let last = self.before.map_or(0, |before| before.sample);
        self.known = (last, self.instant(last));
        (self.plan, self.period) = (plan, period);
    }

    fn instant(&self, sample: u64) -> u64 {
        let (known, instant) = self.known;
        instant + (sample.saturating_sub(known) as f64 * self.period * 1e9).round() as u64
    }

    /// Decodes one sample.
    pub fn record(&mut self, telemetry: &Telemetry) -> Record {
        let sample = telemetry.sample;
        if self.first.is_none() {
            (self.first, self.known) = (Some(sample), (sample, 0));
        }
        let (before, now) = (self.before.replace(*telemetry), phase(telemetry));
        let missed = before.map_or(0, |before| telemetry.missed.wrapping_sub(before.missed));
        let reason = Reason::from_code(telemetry.reason);
        // The supervisor's request follows from two consecutive samples.
        let next = |before: &Telemetry| before.sample + 1 + u64::from(missed);
        let behind = before.filter(|before| next(before) == sample);
        let (request, late, silent) =
            behind.map_or((None, 0.0, 0.0), |before| hapt_log::inputs(phase(&before), now, reason));
        let mut bodies = [(0.0, 0.0); BODIES];
        for (place, (position, velocity)) in bodies.iter_mut().zip(telemetry.bodies.as_slice()) {
            *place = (f64::from(*position), f64::from(*velocity));
        }
        Record {
            sample: sample.saturating_sub(self.first.unwrap_or(sample)),
            due: self.instant(sample),
            plan: self.plan,
            position: telemetry.position.into(),
            // The board sends its estimate only.
            velocity: telemetry.velocity.into(),
            // The board does not send it.
            zero: 0.0,
            announced: false,
            late,
            missed,
            silent,
            request,
            measured: telemetry.measured.into(),
            measured_velocity: telemetry.velocity.into(),
            torque: telemetry.torque.into(),
            link: 0.0,
            command: telemetry.command.into(),
            output: telemetry.output.into(),
            applied: telemetry.output.into(),
            phase: now,
            reason,
            warning: Reason::from_code(telemetry.warning),
            latency: 0,
            computation: 0,
            outside: telemetry.outside,
            bodies,
        }
    }
}

/// The phase; an unknown one counts as faulted.
pub(crate) fn phase(telemetry: &Telemetry) -> Phase {
    Phase::ALL.get(usize::from(telemetry.phase)).copied().unwrap_or(Phase::Faulted)
}

#[cfg(test)]
mod tests {
    use hapt_sim::Signal;

    use super::*;
    use crate::frames::COLUMNS;
    use crate::session::Sample;
    use crate::testing::world;

    #[test]
    fn every_signal_that_a_board_sends_is_the_same_signal_on_the_page() {
        let sent = Telemetry {
            // In a phase without torque the page shows 0.
            phase: Phase::ALL.iter().position(|phase| *phase == Phase::Running).unwrap() as u8,
            position: 1.0,
            measured: 2.0,
            velocity: 3.0,
            torque: 4.0,
            command: 5.0,
            output: 6.0,
            ..Telemetry::default()
        };
        // A new field has to be a signal, or be listed here.
        let Telemetry {
            sequence: _,
            sample: _,
            phase: _,
            reason: _,
            warning: _,
            position,
            measured,
            velocity,
            torque,
            command,
            output,
            missed: _,
            used: _,
            bodies: _,
            outside: _,
        } = sent;
        let signals = [
            (Signal::PUCK, position),
            (Signal::MEASURED, measured),
            (Signal::MEASURED_VELOCITY, velocity),
            (Signal::TORQUE, torque),
            (Signal::COMMAND, command),
            (Signal::OUTPUT, output),
        ];
        let (record, world) = (TelemetryDecoder::new(0, 1e-3).record(&sent), world());
        let sample = Sample { world: &world, generation: 0, time: 0.0, position: record.position, record: &record };
        for (signal, value) in signals {
            let (_, shown) = COLUMNS.iter().find(|(own, _)| *own == signal).unwrap();
            assert_eq!(shown(&sample), f64::from(value), "{signal:?}");
        }
    }

    #[test]
    fn instants_are_continuous_over_a_change_of_the_period() {
        let mut decoder = TelemetryDecoder::new(3, 1e-3);
        let at = |sample, missed| Telemetry { sample, missed, ..Telemetry::default() };
        let decoded = |record: Record| (record.sample, record.due, record.plan, record.missed);
        // Samples and missed samples are counted from the board's start.
        assert_eq!(decoded(decoder.record(&at(70_000, 5))), (0, 0, 3, 0));
        assert_eq!(decoded(decoder.record(&at(70_010, 5))), (10, 10_000_000, 3, 0));
        decoder.change(4, 2e-3);
        assert_eq!(decoded(decoder.record(&at(70_020, 7))), (20, 30_000_000, 4, 2));
        assert_eq!(decoded(decoder.record(&at(70_021, 7))), (21, 32_000_000, 4, 0));
    }
}
