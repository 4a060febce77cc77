//! `[device.motor]`: a motor behind a gear or a cable, with its numbers on its own side.
//!
//! The motor turns n times as fast as the puck. With θ = n z its kinetic energy J θ̇²/2 is (n² J) ż²/2, its power of friction f |θ̇| is
//! (n f) |ż|, and a torque τ on its shaft does the work τ dθ = (n τ) dz. So at the puck an inertia and a damping count n² times, a friction and a
//! limit n times, and a turn of the puck has n times the counts. Everything beyond this file is at the puck.

use crate::counts::at_the_puck;
use crate::error::{Error, ErrorKind};
use crate::fields::Fields;
use crate::keys::Range;
use crate::world::{Device, Tolerances};

/// A motor's numbers, on its own side, in SI.
struct Motor {
    /// Revolutions of the motor for one of the puck.
    ratio: f64,
    inertia: f64,
    damping: f64,
    friction: f64,
    limit: Option<f64>,
    encoder: Option<f64>,
}

/// Adds the motor of `[device.motor]`, where there is one, to a device whose other numbers are at the puck. `fields` are those of `[device]`.
pub(crate) fn add(device: &mut Device, fields: &Fields<'_>) -> Result<(), Error> {
    let Some(node) = fields.node("motor") else { return Ok(()) };
    let of_motor = Fields::new(fields.inner("motor", "device.motor"), Some(node))?;
    let motor = read(&of_motor)?;
    for (key, is_twice) in [
        ("limit", motor.limit.is_some() && device.limit.is_some()),
        ("encoder", motor.encoder.is_some() && device.encoder.is_some()),
    ] {
        if is_twice {
            let message = format!("device.{key} is there too; expected it on one side, the motor's or the puck's");
            return Err(of_motor.error(ErrorKind::Combination, key, message));
        }
    }
    reflect(device, &motor);
    let friction = device.largest_friction();
    let numbers = [Some(device.inertia), Some(device.damping), Some(friction), device.limit, device.encoder];
    // The same check as for numbers of the file.
    if numbers.into_iter().flatten().any(|number| !Range::ZeroOrMore.contains(number))
        || device.encoder > Some(2_f64.powi(53))
    {
        let message = "at the puck the motor's numbers are out of the range of physical ones, 1e-30 to 1e30 in SI; expected another ratio";
        return Err(of_motor.error(ErrorKind::Value, "ratio", message));
    }
    Ok(())
}

fn read(fields: &Fields<'_>) -> Result<Motor, Error> {
    let by_current = match (fields.optional_number("torque_constant")?, fields.optional_number("current")?) {
        (Some(constant), Some(current)) => Some(constant * current),
        (None, Some(_)) => return Err(fields.missing("torque_constant")),
        (Some(_), None) | (None, None) => None,
    };
    let limit = fields.optional_number("limit")?;
    if limit.is_some() && by_current.is_some() {
        let message = "torque_constant and current are a limit too; expected one of the two";
        return Err(fields.error(ErrorKind::Combination, "limit", message));
    }
    Ok(Motor {
        ratio: fields.number("ratio")?,
        inertia: fields.number("inertia")?,
        damping: fields.number("damping")?,
        friction: fields.number("friction")?,
        limit: limit.or(by_current),
        encoder: fields.optional_number("encoder")?,
    })
}

fn reflect(device: &mut Device, motor: &Motor) {
    let n = motor.ratio;
    // A tolerance belongs to the number that it follows in the file, the puck's own.
    let add = |own: &mut f64, tolerance: &mut f64, more: f64| {
        let whole = *own + more;
        // A number that is 0 has no tolerance.
        *tolerance *= if *own > 0.0 { *own / whole } else { 0.0 };
        *own = whole;
    };
    let Tolerances { inertia, damping, friction, friction_backward, lag: _ } = &mut device.tolerances;
    add(&mut device.inertia, inertia, n * n * motor.inertia);
    add(&mut device.damping, damping, n * n * motor.damping);
    add(&mut device.friction, friction, n * motor.friction);
    if let Some(backward) = &mut device.friction_backward {
        add(backward, friction_backward, n * motor.friction);
    }
    device.limit = device.limit.or(motor.limit.map(|limit| n * limit));
    device.encoder = device.encoder.or(motor.encoder.map(|encoder| at_the_puck(encoder, n)));
    device.drive.gear = device.drive.gear.or(Some(n));
}
