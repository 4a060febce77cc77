//! Records of real levers: the identified parameters of each, whether stretches of them agree, and how well one predicts another: tables of
//! docs/measured.md.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use hapt_identify::{Claims, Columns, Error, Interval, Known, Puck, Record, TorqueFit, Verdict, against, fit_torque};
use hapt_model::{Source, World};

use super::contact::contacts;
use super::lever::{HORIZONS, LAB, lever, share, speed};

/// Next to the project, if they are there.
const FOLDER: &str = "../shared/data/tue";
/// Records of a lever that moves freely.
const FREE: [&str; 4] = ["m1-a-free", "m1-e-free", "m2-a-free", "m2-d-free"];
/// The last record's device with the motor turned round.
const TURNED: &str = "m2-d-free, motor turned round";
/// Lengths of stretches, s.
const LENGTHS: [f64; 4] = [0.7, 1.0, 1.5, 2.5];

/// The tables; `None` where the records are not at hand.
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
             | length, s | stretches | with an inertia | hold the lab's | pairs that overlap | signs determined, and wrong |\n\
             | --- | --- | --- | --- | --- | --- |\n";
    for length in LENGTHS {
        writeln!(text, "{}", stretches(&free, length)?)?;
    }
    text += "\nWhat is beyond the slave's sensor, in free motion, with the sensor's column as the torque:\n\n\
             | record | inertia, g m² | left of the sensor's torque |\n| --- | --- | --- |\n";
    for name in FREE {
        let fit = fit_torque(&lever(&folder, name, "sensor")?, &Known::default()).context("no window moves")?;
        writeln!(text, "| {name} | {} | {:.1} % |", grams(fit.inertia), 100.0 * fit.misfit.share)?;
    }
    text += "\n### The levers' free motion\n\n";
    text += &predicted(&folder)?;
    text += "\n### The levers in contact\n\n";
    text += &contacts(&folder)?;
    text += "\n### The levers against a file\n\n";
    text += &compared(&folder)?;
    Ok(Some(text))
}

/// The share of the motion that a puck predicts, from the measured position and velocity.
fn share_of(puck: Puck, record: &Record, horizon: f64) -> f64 {
    let (times, positions, torques) = (record.times(), record.positions(), record.torques());
    share(record, horizon, |k, length| {
        let puck = Puck { position: positions[k], velocity: speed(record, k), ..puck };
        puck.positions(&times[k..k + length], &torques[k..k + length])
    })
}

fn predicted(folder: &Path) -> Result<String> {
    let all: Vec<(&str, Record)> =
        FREE.iter().map(|name| Ok((*name, lever(folder, name, "motor")?))).collect::<Result<_>>()?;
    let puck = |inertia: f64, damping: f64, friction: f64, offset: f64| Puck {
        gain: inertia.recip(),
        damping: damping / inertia,
        friction: friction / inertia,
        offset: offset / inertia,
        delay: 0.0,
        position: 0.0,
        velocity: 0.0,
        lag: 0.0,
    };
    let mut devices = vec![("the lab's inertia alone", puck(LAB, 0.0, 0.0, 0.0))];
    for (name, record) in &all {
        let fit = fit_torque(record, &Known::default()).context("no window moves")?;
        if let Some(inertia) = fit.inertia {
            let value = |x: Option<Interval>| x.map_or(0.0, |x| x.value);
            devices.push((name, puck(inertia.value, value(fit.damping), value(fit.friction), value(fit.offset))));
        }
    }
    // One record may have the motor's sign the other way round.
    if let Some((_, puck)) = devices.last().copied() {
        devices.push((TURNED, Puck { gain: -puck.gain, ..puck }));
    }
    let mut text = String::from("| device by | horizon, s |");
    for (name, _) in &all {
        write!(text, " {name} |")?;
    }
    text += "\n| --- | --- | --- | --- | --- | --- |\n";
    for (by, puck) in devices {
        for horizon in HORIZONS {
            let cell = |(name, record): &(&str, Record)| {
                if *name == by {
                    return "itself".into();
                }
                match 100.0 * share_of(puck, record, horizon) {
                    part if part > 0.0 => format!("{part:.1} %"),
                    _ => "none".into(),
                }
            };
            let cells: Vec<String> = all.iter().map(cell).collect();
            writeln!(text, "| {by} | {horizon} | {} |", cells.join(" | "))?;
        }
    }
    Ok(text)
}

fn compared(folder: &Path) -> Result<String> {
    let file = format!(
        "loop.period = \"0.5 ms\"\ndevice = {{ inertia = {LAB:e}, friction = \"27 N mm ± 25 %\", encoder = 300000 }}"
    );
    let claims = Claims::of(&World::read(&Source::from_text("lever.toml", file), &[])?);
    let mut text = String::from(
        "| record | `--against` the lab's inertia | why | inertia by the torque's equation, g m² | it agrees in | it contradicts |\n| --- | --- | --- | --- | --- | --- |\n",
    );
    for name in FREE.into_iter().chain(["m1-a-spring", "m1-c-foam"]) {
        let record = lever(folder, name, "motor")?;
        let Ok(comparison) = against(&record, &claims, false) else {
            writeln!(text, "| {name} | refused | no fit explains the motion | not determined | | |")?;
            continue;
        };
        let why = comparison.wrong.as_ref().map_or("its numbers", |wrong| match wrong {
            Error::Residual(_) => "the best fit leaves more than noise",
            _ => "no fit explains the motion",
        });
        let inertia = grams(comparison.numbers[0].estimate);
        let of = |verdict: Verdict| {
            let names = comparison.numbers.iter().filter(|number| number.verdict == verdict).map(|number| number.name);
            names.collect::<Vec<_>>().join(", ")
        };
        let verdict = if comparison.agrees() { "agrees" } else { "contradicts" };
        let (agrees, wrong) = (of(Verdict::Agrees), of(Verdict::Contradicts));
        writeln!(text, "| {name} | {verdict} | {why} | {inertia} | {agrees} | {wrong} |")?;
    }
    Ok(text)
}

/// An inertia in g m².
fn grams(x: Option<Interval>) -> String {
    x.map_or("not determined".into(), |x| format!("{:.2}: {:.2} to {:.2}", 1e3 * x.value, 1e3 * x.low, 1e3 * x.high))
}

fn row(fit: &TorqueFit) -> String {
    let terms: Vec<&str> = fit.terms.iter().map(|term| term.kind.word()).collect();
    format!(
        "{} | {} | {} | {} | {} | {:.1} % |",
        grams(fit.inertia),
        grams(fit.inertia_by_torque),
        grams(fit.inertia_by_motion),
        fit.sign.map_or("not determined".into(), |sign| format!("{sign}")),
        if terms.is_empty() { "none".into() } else { terms.join(", ") },
        100.0 * fit.misfit.share
    )
}

fn stretches(free: &[[Vec<f64>; 3]], length: f64) -> Result<String> {
    let (mut all, mut signs, mut wrong, mut inertias) = (0, 0, 0, Vec::new());
    for lists in free {
        let samples = (length / (lists[0][1] - lists[0][0])).round() as usize;
        for i in 0..lists[0].len() / samples {
            let [times, positions, torques] = [0, 1, 2].map(|k| lists[k][i * samples..(i + 1) * samples].to_vec());
            all += 1;
            let fit = fit_torque(&Record::new(times, positions, torques)?, &Known::default()).context("no window")?;
            signs += usize::from(fit.sign.is_some());
            wrong += usize::from(fit.sign.is_some_and(|sign| sign < 0.0));
            inertias.extend(fit.inertia);
        }
    }
    let covers = inertias.iter().filter(|x| x.covers(LAB)).count();
    let pairs = inertias.iter().enumerate().flat_map(|(i, a)| inertias[..i].iter().map(move |b| (a, b)));
    let overlap: Vec<bool> = pairs.map(|(a, b)| a.low <= b.high && b.low <= a.high).collect();
    let agree = overlap.iter().filter(|agree| **agree).count();
    Ok(format!(
        "| {length} | {all} | {} | {covers} | {agree} of {} | {signs}, {wrong} |",
        inertias.len(),
        overlap.len()
    ))
}
