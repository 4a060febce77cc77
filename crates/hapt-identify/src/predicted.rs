//! The motion that a fit to the torque predicts.

use crate::puck::Puck;
use crate::record::{LONGEST_DELAY, Record};
use crate::start::velocities;

/// The motion is predicted over this many s, and restarted from the measured one: over a longer time the errors of the equation add up.
pub const PREDICTION_S: f64 = 0.25;

/// Times and positions, from the measured position and velocity at the beginning of each stretch on.
pub(crate) fn predicted(record: &Record, puck: Puck) -> Vec<(f64, f64)> {
    let (times, positions, torques) = (record.times(), record.positions(), record.torques());
    let speeds = velocities(record);
    let samples = |duration: f64| (duration / record.period()).ceil() as usize;
    let (length, before) = (samples(PREDICTION_S).max(2), samples(LONGEST_DELAY));
    let mut all = Vec::with_capacity(times.len());
    for begin in (0..times.len()).step_by(length) {
        let (from, to) = (begin.saturating_sub(before), (begin + length).min(times.len()));
        let puck = Puck { position: positions[begin], velocity: speeds[begin], ..puck };
        puck.follow(&times[from..to], &torques[from..to], begin - from, |i, z, _| all.push((times[from + i], z)));
    }
    all
}
