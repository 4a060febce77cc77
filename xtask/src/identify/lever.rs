//! Records of the slave's lever, and how much of its motion is predicted.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use hapt_identify::{Columns, Record};

/// By the lab's frequency response, kg m².
pub(super) const LAB: f64 = 1.0 / 631.36;
/// For how long its motion is predicted, s.
pub(super) const HORIZONS: [f64; 3] = [0.1, 0.3, 1.0];

/// A record of the slave's lever, with the torque of its motor or of its sensor.
pub(super) fn lever(folder: &Path, name: &str, torque: &str) -> Result<Record> {
    let path = folder.join(format!("{name}.csv"));
    let table = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    let columns = Columns::parse(&format!("time=time_s,position=slave_rad,torque=slave_{torque}_Nm"))?;
    let read = columns.read_all(&table)?;
    Ok(Record::new(read.times, read.positions, read.torques)?)
}

/// The velocity at a sample, over 10 ms.
pub(super) fn speed(record: &Record, k: usize) -> f64 {
    let (times, positions) = (record.times(), record.positions());
    let half = (5e-3 / record.period()).round() as usize;
    let (from, to) = (k.saturating_sub(half), (k + half).min(times.len() - 1));
    (positions[to] - positions[from]) / (times[to] - times[from])
}

/// The share of the motion that is predicted over a horizon in s, begun anew at its end; `predicted`: the positions from a sample on, and how
/// many.
pub(super) fn share(record: &Record, horizon: f64, predicted: impl Fn(usize, usize) -> Vec<f64>) -> f64 {
    let positions = record.positions();
    let length = (horizon / record.period()).round() as usize;
    let half = (5e-3 / record.period()).round() as usize;
    let (mut left, mut all) = (0.0, 0.0);
    for k in (half..positions.len() - length - half).step_by(length) {
        for (z, seen) in predicted(k, length).iter().zip(&positions[k..]) {
            left += (z - seen).powi(2);
            all += (seen - positions[k]).powi(2);
        }
    }
    1.0 - left / all
}
