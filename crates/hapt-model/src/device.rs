//! Reads `[device]` and its tables.

use hapt_plant::spec::{Cogging, DeviceTorque, FrictionByPosition, Gravity, Handle, Stops, Stribeck};

use crate::error::{Error, ErrorKind};
use crate::fields::Fields;
use crate::keys;
use crate::motor;
use crate::waveform;
use crate::world::{Device, Mounting, Tolerances};

/// The device, at a loop of this period in s.
pub(crate) fn device(fields: &Fields<'_>, period: f64) -> Result<Device, Error> {
    let (inertia, friction) = (fields.number("inertia")?, fields.number("friction")?);
    let friction_backward = fields.optional_number("friction_backward")?;
    let mut device = Device {
        inertia,
        damping: fields.number("damping")?,
        friction,
        friction_backward,
        lag: fields.number("lag")?,
        tolerances: Tolerances {
            inertia: fields.tolerance("inertia"),
            damping: fields.tolerance("damping"),
            friction: fields.tolerance("friction"),
            friction_backward: fields.tolerance("friction_backward"),
            lag: fields.tolerance("lag"),
        },
        limit: fields.optional_number("limit")?,
        encoder: fields.optional_number("encoder")?,
        levels: fields.optional_whole("levels")?,
        drive: mounting(&Fields::new(fields.inner("drive", "device.drive"), fields.node("drive"))?)?,
        friction_by_position: friction_by_position(fields)?,
        stribeck: stribeck(fields)?,
        stops: stops(fields)?,
        handle: handle(fields)?,
        torque: DeviceTorque { gravity: gravity(fields)?, cogging: cogging(fields)? },
    };
    motor::add(&mut device, fields)?;
    if device.levels.is_some() && device.limit.is_none() {
        let message = "levels divide the range of the motor: they need device.limit";
        return Err(fields.error(ErrorKind::Combination, "levels", message));
    }
    if let Some((table, key, message)) = device.fault(period) {
        let pattern = keys::rows("device").find(|row| row.name() == table).map_or("device", |row| row.path);
        let fields = Fields::new(fields.inner(table, pattern), fields.node(table))?;
        return Err(fields.error(ErrorKind::Combination, key, message));
    }
    Ok(device)
}

fn handle(fields: &Fields<'_>) -> Result<Option<Handle>, Error> {
    let Some(node) = fields.node("handle") else { return Ok(None) };
    let fields = Fields::new(fields.inner("handle", "device.handle"), Some(node))?;
    Ok(Some(Handle {
        inertia: fields.number("inertia")?,
        stiffness: fields.number("stiffness")?,
        damping: fields.number("damping")?,
    }))
}

fn friction_by_position(fields: &Fields<'_>) -> Result<Option<FrictionByPosition>, Error> {
    let Some(node) = fields.node("friction_by_position") else { return Ok(None) };
    let fields = Fields::new(fields.inner("friction_by_position", "device.friction_by_position"), Some(node))?;
    Ok(Some(FrictionByPosition {
        share: fields.number("share")?,
        pitch: fields.number("pitch")?,
        phase: fields.number("phase")?,
        waveform: waveform::of_harmonics(&fields)?,
    }))
}

fn stribeck(fields: &Fields<'_>) -> Result<Option<Stribeck>, Error> {
    let Some(node) = fields.node("stribeck") else { return Ok(None) };
    let fields = Fields::new(fields.inner("stribeck", "device.stribeck"), Some(node))?;
    Ok(Some(Stribeck { torque: fields.number("torque")?, velocity: fields.number("velocity")? }))
}

fn stops(fields: &Fields<'_>) -> Result<Option<Stops>, Error> {
    let Some(node) = fields.node("stops") else { return Ok(None) };
    let fields = Fields::new(fields.inner("stops", "device.stops"), Some(node))?;
    let (low, high) = (fields.optional_number("low")?, fields.optional_number("high")?);
    if low.is_none() && high.is_none() {
        let message = "low and high are both missing; expected one of them at least, such as high = \"60 deg\"";
        return Err(fields.error(ErrorKind::Name, "high", message));
    }
    Ok(Some(Stops { low, high, stiffness: fields.number("stiffness")?, damping: fields.number("damping")? }))
}

fn gravity(fields: &Fields<'_>) -> Result<Option<Gravity>, Error> {
    let Some(node) = fields.node("gravity") else { return Ok(None) };
    let fields = Fields::new(fields.inner("gravity", "device.gravity"), Some(node))?;
    Ok(Some(Gravity { torque: fields.number("torque")?, phase: fields.number("phase")? }))
}

fn cogging(fields: &Fields<'_>) -> Result<Option<Cogging>, Error> {
    let Some(node) = fields.node("cogging") else { return Ok(None) };
    let fields = Fields::new(fields.inner("cogging", "device.cogging"), Some(node))?;
    Ok(Some(Cogging {
        torque: fields.number("torque")?,
        pitch: fields.number("pitch")?,
        phase: fields.number("phase")?,
        waveform: waveform::of_harmonics(&fields)?,
    }))
}

fn mounting(fields: &Fields<'_>) -> Result<Mounting, Error> {
    Ok(Mounting {
        gear: fields.optional_number("gear")?,
        reversed: fields.name("direction") == Some(keys::DIRECTION[1]),
        home: fields.optional_number("home")?,
    })
}
