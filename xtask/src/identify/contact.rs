//! The slave's lever in contact with a spring and with foam: its motion from the motor's torque, by the device of a record in free motion and a
//! contact that the sensor's torque gives.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use hapt_identify::{Columns, Known, Record, fit_torque};
use hapt_model::{DeviceSpec, Stops};
use hapt_plant::VirtualDevice;
use nalgebra::{Matrix3, Vector3};

use super::lever::{HORIZONS, LAB, lever, share, speed};

const RECORDS: [&str; 2] = ["m1-a-spring", "m1-c-foam"];
/// The record in free motion that determines its inertia best.
const DEVICE: &str = "m2-d-free";
/// Places that are tried for the beginning of the contact.
const PLACES: usize = 400;

/// A spring and a damper that the lever meets at a place.
struct Contact {
    /// 1: it pushes toward smaller positions.
    side: f64,
    place: f64,
    stiffness: f64,
    damping: f64,
    /// The part of the sensor's torque that it does not explain.
    left: f64,
}

/// The contact whose torque follows the sensor's best, with the sensor's own zero; `factor`: N m for one of its column.
fn contact(record: &Record, sensor: &[f64], factor: f64) -> Option<Contact> {
    let positions = record.positions();
    let (low, high) = positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, z| (a.0.min(*z), a.1.max(*z)));
    let mean = sensor.iter().sum::<f64>() / sensor.len() as f64;
    let all: f64 = sensor.iter().map(|x| (x - mean).powi(2)).sum();
    let speeds: Vec<f64> = (0..positions.len()).map(|k| speed(record, k)).collect();
    let at = |side: f64, place: f64| {
        let row = |k: usize| {
            let depth = (side * (positions[k] - place)).max(0.0);
            Vector3::new(1.0, depth, if depth > 0.0 { speeds[k] } else { 0.0 })
        };
        let (mut gram, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (k, torque) in sensor.iter().enumerate() {
            gram += row(k) * row(k).transpose();
            right += row(k) * *torque;
        }
        let solved = gram.cholesky()?.solve(&right);
        let left: f64 = sensor.iter().enumerate().map(|(k, torque)| (torque - row(k).dot(&solved)).powi(2)).sum();
        // On the lever the contact pushes out, and its damper against the motion.
        let (stiffness, damping) = (-side * factor * solved[1], (-factor * solved[2]).max(0.0));
        (stiffness > 0.0).then_some(Contact { side, place, stiffness, damping, left: left / all })
    };
    let places = (0..PLACES).map(|i| low + (high - low) * i as f64 / PLACES as f64);
    let tried = places.flat_map(|place| [at(1.0, place), at(-1.0, place)]).flatten();
    tried.min_by(|a, b| a.left.total_cmp(&b.left))
}

/// The lever's positions from a position and a velocity on, under torques of its motor.
fn motion(
    device: &DeviceSpec,
    contact: Option<&Contact>,
    (position, velocity): (f64, f64),
    torques: &[f64],
) -> Vec<f64> {
    let (place, side) = contact.map_or((0.0, 1.0), |contact| (contact.place, contact.side));
    let stops = contact.map(|contact| {
        let (low, high) = if side > 0.0 { (None, Some(0.0)) } else { (Some(0.0), None) };
        Stops { low, high, stiffness: contact.stiffness, damping: contact.damping }
    });
    let mut device = VirtualDevice::new(&DeviceSpec { stops, ..*device });
    device.set_out((position - place, velocity), (position - place, velocity));
    let at = |torque: &f64| {
        let position = device.puck().0 + place;
        device.command(*torque);
        device.travel();
        position
    };
    torques.iter().map(at).collect()
}

pub(super) fn contacts(folder: &Path) -> Result<String> {
    let free = fit_torque(&lever(folder, DEVICE, "motor")?, &Known::default()).context("no window moves")?;
    let value = |x: Option<hapt_identify::Interval>| x.map_or(0.0, |x| x.value);
    let device = DeviceSpec {
        damping: value(free.damping),
        friction: value(free.friction),
        ..DeviceSpec::new(5e-4, free.inertia.context("no inertia")?.value)
    };
    let mut text = String::from(
        "| record | contact | stiffness, N m/rad | damping, N m s/rad | left of the sensor's torque | motor | horizon, s | without the contact | with it |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for name in RECORDS {
        let path = folder.join(format!("{name}.csv"));
        let table = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
        let columns = Columns {
            force: Some("slave_sensor_Nm".into()),
            ..Columns::parse("time=time_s,position=slave_rad,torque=slave_motor_Nm")?
        };
        let read = columns.read_all(&table)?;
        let sensor = read.forces.context("no sensor")?;
        let record = Record::new(read.times, read.positions, read.torques)?;
        let with_sensor = fit_torque(&record.clone().with_force(sensor.clone())?, &Known::default());
        let factor = value(with_sensor.and_then(|fit| fit.force)).abs();
        // Either sign of the sensor.
        let found = [factor, -factor].into_iter().filter_map(|factor| contact(&record, &sensor, factor));
        let found = found.min_by(|a, b| a.left.total_cmp(&b.left)).context("no contact")?;
        let predicted = |sign: f64, contact: Option<&Contact>, horizon: f64| {
            share(&record, horizon, |k, length| {
                let torques: Vec<f64> = record.torques()[k..k + length].iter().map(|torque| sign * torque).collect();
                motion(&device, contact, (record.positions()[k], speed(&record, k)), &torques)
            })
        };
        // Its motor's sign is that by which the contact predicts more.
        let sign = [1.0, -1.0].into_iter().max_by(|a, b| {
            let of = |sign: f64| predicted(sign, Some(&found), HORIZONS[0]);
            of(*a).total_cmp(&of(*b))
        });
        let sign = sign.unwrap_or(1.0);
        for horizon in HORIZONS {
            let shown = |part: f64| if part > 0.0 { format!("{:.1} %", 100.0 * part) } else { "none".into() };
            writeln!(
                text,
                "| {name} | {} {:.1} deg | {:.2} | {:.3} | {:.1} % | {} | {horizon} | {} | {} |",
                if found.side > 0.0 { "above" } else { "below" },
                found.place.to_degrees(),
                found.stiffness,
                found.damping,
                100.0 * found.left,
                if sign > 0.0 { "as in free motion" } else { "turned round" },
                shown(predicted(sign, None, horizon)),
                shown(predicted(sign, Some(&found), horizon))
            )?;
        }
    }
    let [inertia, damping, friction] = [device.inertia, device.damping, device.friction].map(|x| 1e3 * x);
    writeln!(
        text,
        "\nThe device is that of {DEVICE}: {inertia:.2} g m² (the lab: {:.2}), {damping:.1} N mm s/rad, {friction:.1} N mm.",
        1e3 * LAB
    )?;
    Ok(text)
}
