//! The numbers that a loop behind a page accepts. Beyond them no real device exists, and sums, squares and exponentials overflow.

use hapt_model::keys::{Measure, Range, Takes};
use hapt_model::{Handle, Parameter, Source, World, parameters};

use crate::keys::{PERIODS, row};

/// The largest size of a number in SI, and the smallest that is not 0.
const LARGEST: f64 = 1e9;
const SMALLEST: f64 = 1e-15;
/// The longest delay in periods.
const MAX_DELAY_PERIODS: f64 = 1000.0;
/// The fastest decay of the puck's speed, in 1/s.
const MAX_DECAY_PER_S: f64 = 1e7;

/// Whether a number of this measure is in the range of a loop behind a page.
fn is_sensible(value: f64, measure: Measure, range: Range) -> bool {
    let size = value.abs();
    // Positions have no smallest size.
    let least = match (measure, range) {
        (Measure::Position | Measure::Angle, Range::Any) => 0.0,
        _ => SMALLEST,
    };
    size == 0.0 || (least..=LARGEST).contains(&size)
}

/// Checks the period and all numbers of a world, read from `source` and `sets`.
///
/// # Errors
/// In a sentence: the first that is out of range.
pub fn check(world: &World, source: &Source, sets: &[String]) -> Result<(), String> {
    let period = world.sampling.period;
    if !PERIODS.contains(&period) {
        return Err(format!(
            "loop.period: {period} s is too short or too long for a live loop; expected 50 us to 100 ms"
        ));
    }
    for Parameter { path, si, .. } in parameters(source, sets).map_err(|error| error.message)? {
        let (Some(value), Some(row)) = (si, row(world, &path)) else { continue };
        let (Takes::Quantity(measure, range) | Takes::QuantityOr(measure, range, _)) = row.takes else { continue };
        if !is_sensible(value, measure, range) {
            return Err(format!(
                "{path}: {value:e} is out of the range of a loop behind a page: sizes from {SMALLEST:e} to {LARGEST:e} (SI), or 0"
            ));
        }
    }
    if world.sampling.delay_s() > MAX_DELAY_PERIODS * world.sampling.period {
        let delay = world.sampling.delay_s();
        return Err(format!(
            "loop.delay: {delay} s is more than {MAX_DELAY_PERIODS} periods, the longest behind a page"
        ));
    }
    if let Some(Handle { inertia, stiffness, damping }) = world.device.handle {
        let masses = 1.0 / world.device.inertia + 1.0 / inertia;
        let rate = (stiffness * masses).sqrt().max(damping * masses);
        if rate > MAX_DECAY_PER_S {
            return Err(format!(
                "device.handle: its shaft swings or decays at {rate:e} per s; at most {MAX_DECAY_PER_S:e} behind a page"
            ));
        }
    }
    let rate = world.device.damping / world.device.inertia;
    if rate > MAX_DECAY_PER_S {
        return Err(format!(
            "device.damping: over the inertia it is {rate:e} per s; at most {MAX_DECAY_PER_S:e} behind a page"
        ));
    }
    Ok(())
}
