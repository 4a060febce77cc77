//! One sample of a board's loop, in PendSV's interrupt: from its position to its torque.

use hapt_wire::device::{Measurement, Motor};

use crate::board::{Board, Device};
use crate::{Here, ticks};

/// Takes the sample of a period that began `late` clocks before, after `missed` missed ones. Returns the time until the device had the
/// torque, in s.
#[inline(always)]
pub fn take(
    device: &mut <Here as Board>::Device,
    missed: u32,
    late: u32,
    sample: impl FnOnce(&Measurement) -> Motor,
) -> f32 {
    let seconds = |clocks: u32| clocks as f32 / Here::CLOCK as f32;
    let fault = device.fault();
    let seen =
        Measurement { position: device.position(), late: seconds(late), missed, fault, ..Measurement::default() };
    let motor = sample(&seen);
    device.hold(motor.torque, motor.on);
    seconds(ticks::since_taken_up().saturating_sub(late))
}
