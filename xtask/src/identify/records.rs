//! Records of real levers: what is told of each, and whether stretches of them agree.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use hapt_identify::{Columns, Interval, Known, Record, TorqueFit, fit_torque};

/// Beside the project, where they are at hand.
const FOLDER: &str = "../shared/data/tue";
/// By the lab's frequency response, kg m².
const LAB: f64 = 1.0 / 631.36;
/// Lengths of stretches, s.
const LENGTHS: [f64; 4] = [0.7, 1.0, 1.5, 2.5];

/// Both tables; `None` where the records are not at hand.
pub fn text() -> Result<Option<String>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(FOLDER);
    let Ok(entries) = fs::read_dir(&folder) else { return Ok(None) };
    let mut files: Vec<_> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "csv"));
    files.sort();
    let mut text = String::from(
        "| record | lever | sensor | inertia, g m² | by the torque | by the motion | sign | terms | left of the torque |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let mut free: Vec<[Vec<f64>; 3]> = Vec::new();
    for path in &files {
        let name = path.file_stem().map_or(String::new(), |name| name.to_string_lossy().into_owned());
        let table = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        for (lever, with_sensor) in [("slave", false), ("slave", true), ("master", false), ("master", true)] {
            let columns = Columns {
                force: with_sensor.then(|| format!("{lever}_sensor_Nm")),
                ..Columns::parse(&format!("time=time_s,position={lever}_rad,torque={lever}_motor_Nm"))?
            };
            let read = columns.read_all(&table)?;
            if !with_sensor && lever == "slave" && name.ends_with("free") {
                free.push([read.times.clone(), read.positions.clone(), read.torques.clone()]);
            }
            let mut record = Record::new(read.times, read.positions, read.torques)?;
            if let Some(forces) = read.forces {
                record = record.with_force(forces)?;
            }
            let fit = fit_torque(&record, &Known::default()).context("no window moves")?;
            let sensor = if with_sensor { "yes" } else { "no" };
            writeln!(text, "| {name} | {lever} | {sensor} | {}", row(&fit))?;
        }
    }
    text += "\nStretches of the slave's records that move freely, by the motor's torque alone, against each other and against the lab's 1.58 g m²:\n\n\
             | length, s | stretches | with an inertia | hold the lab's | pairs that overlap | signs told, and wrong |\n\
             | --- | --- | --- | --- | --- | --- |\n";
    for length in LENGTHS {
        writeln!(text, "{}", stretches(&free, length)?)?;
    }
    Ok(Some(text))
}

fn row(fit: &TorqueFit) -> String {
    let grams = |x: Option<Interval>| {
        x.map_or("not told".to_string(), |x| format!("{:.2}: {:.2} to {:.2}", 1e3 * x.value, 1e3 * x.low, 1e3 * x.high))
    };
    let terms: Vec<&str> = fit.terms.iter().map(|term| term.kind.word()).collect();
    format!(
        "{} | {} | {} | {} | {} | {:.1} % |",
        grams(fit.inertia),
        grams(fit.inertia_by_torque),
        grams(fit.inertia_by_motion),
        fit.sign.map_or("not told".into(), |sign| format!("{sign}")),
        if terms.is_empty() { "none".into() } else { terms.join(", ") },
        100.0 * fit.misfit.share
    )
}

fn stretches(free: &[[Vec<f64>; 3]], length: f64) -> Result<String> {
    let (mut all, mut signs, mut wrong, mut found) = (0, 0, 0, Vec::new());
    for lists in free {
        let samples = (length / (lists[0][1] - lists[0][0])).round() as usize;
        for i in 0..lists[0].len() / samples {
            let [times, positions, torques] = [0, 1, 2].map(|k| lists[k][i * samples..(i + 1) * samples].to_vec());
            all += 1;
            let fit = fit_torque(&Record::new(times, positions, torques)?, &Known::default()).context("no window")?;
            signs += usize::from(fit.sign.is_some());
            wrong += usize::from(fit.sign.is_some_and(|sign| sign < 0.0));
            found.extend(fit.inertia);
        }
    }
    let held = found.iter().filter(|x| x.covers(LAB)).count();
    let pairs = found.iter().enumerate().flat_map(|(i, a)| found[..i].iter().map(move |b| (a, b)));
    let overlap: Vec<bool> = pairs.map(|(a, b)| a.low <= b.high && b.low <= a.high).collect();
    let agree = overlap.iter().filter(|agree| **agree).count();
    Ok(format!("| {length} | {all} | {} | {held} | {agree} of {} | {signs}, {wrong} |", found.len(), overlap.len()))
}
