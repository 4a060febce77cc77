//! The book's tables of keys and columns, made from the tables that the code itself reads.

use std::fmt::Write;

use anyhow::{Result, bail};
use hapt_core::{Limits, Reason, SafetyProfile};
use hapt_log::Kind;
use hapt_model::keys::{self, KEYS, Key, Measure, NETWORK, NETWORK_FILE, Presence, Range, Takes};
use hapt_model::{Motion, Source, World};
use hapt_sim::columns;

/// The tables called `name`, in Markdown.
pub fn tables(name: &str) -> Result<String> {
    match name {
        "keys" => keys(),
        "columns" => signals(),
        "reasons" => Ok(reasons()),
        "safety" => Ok(safety()),
        "log" => logged(),
        _ => bail!("there are no tables {name}"),
    }
}

/// The reasons for which the supervisor removes the torque.
fn reasons() -> String {
    let mut text = String::new();
    for reason in Reason::ALL {
        let (code, name) = (reason.code(), reason.name());
        text += &format!("- {code} `{name}`: {} {}\n", reason.sentence(), reason.remedy());
    }
    text
}

/// The limits that the notes' default world has without a `[safety]` table: certified, not certified, simulated.
fn safety() -> String {
    let text = include_str!("../../worlds/notes/default.toml");
    let Ok(world) = World::read(&Source::from_text("default.toml", text), &[]) else { return String::new() };
    let all = [SafetyProfile::Certified, SafetyProfile::Uncertified, SafetyProfile::Simulated]
        .map(|profile| world.limits(profile));
    type Row = (&'static str, &'static str, f64, fn(&Limits) -> f64);
    let rows: [Row; 11] = [
        ("fade", "ms", 1e3, |l| l.fade),
        ("velocity", "rad/s", 1.0, |l| l.velocity),
        ("jump", "mrad", 1e3, |l| l.jump),
        ("overspeed", "rad/s", 1.0, |l| l.overspeed),
        ("stuck", "s", 1.0, |l| l.stuck),
        ("torque", "N mm", 1e3, |l| l.torque),
        ("slew", "N mm", 1e3, |l| l.slew),
        ("stall", "ms", 1e3, |l| l.stall),
        ("link", "ms", 1e3, |l| l.link),
        ("energy", "mJ", 1e3, |l| l.energy),
        ("pulse", "N mm", 1e3, |l| l.pulse),
    ];
    let mut text = String::from("| key | certified | not certified | simulated |\n| --- | --- | --- | --- |\n");
    for (key, unit, factor, of) in rows {
        let shown = all.each_ref().map(|limits| match of(limits) {
            none if none.is_infinite() => "none".to_string(),
            value => format!("{:.4} {unit}", factor * value),
        });
        text += &format!("| `{key}` | {} |\n", shown.join(" | "));
    }
    text
}

fn keys() -> Result<String> {
    let mut tables: Vec<&str> = Vec::new();
    for key in KEYS.iter().chain(NETWORK) {
        if !tables.contains(&key.table()) {
            tables.push(key.table());
        }
    }
    let mut text = String::new();
    for table in tables {
        let rows: Vec<&Key> = keys::rows(table).collect();
        writeln!(text, "## {}\n", heading(table))?;
        for key in rows {
            let of = owner(key);
            let of = if of.is_empty() { of } else { format!(" ({of})") };
            writeln!(text, "- `{}`{of}: {}{}. {}", key.name(), takes(key), without(key), key.doc)?;
        }
        text.push('\n');
    }
    Ok(text.trim_end().to_string() + "\n")
}

/// The table as it is written in a world file.
fn heading(table: &str) -> String {
    if table.is_empty() {
        return "At the top".to_string();
    }
    if table == NETWORK_FILE {
        return "At the top of a network file".to_string();
    }
    let list = table.strip_suffix(".*").filter(|outer| {
        KEYS.iter().chain(NETWORK).any(|key| key.path == *outer && matches!(key.takes, Takes::List { .. }))
    });
    match list {
        Some(list) => format!("`[[{}]]`", in_file(list)),
        None => format!("`[{}]`", in_file(table).replace('*', "NAME")),
    }
}

/// A table's path in its file.
fn in_file(table: &str) -> &str {
    table.strip_prefix(NETWORK_FILE).map_or(table, |inner| inner.trim_start_matches('.'))
}

/// The kinds and the motion that a key belongs to.
fn owner(key: &Key) -> String {
    let names = |names: &[&str]| names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    let mut parts = vec![names(key.kinds)];
    if !key.hands.is_empty() {
        parts.push(format!("in {}", names(key.hands)));
    }
    parts.extend(key.motion.map(|motion| motion.name().to_string()));
    parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(" ")
}

/// The unit in SI, that of linear motion in parentheses where it differs; the range, and whether it may carry a tolerance.
fn quantity(key: &Key, measure: Measure, range: Range) -> String {
    let unit = |motion: Motion| {
        let dimension = measure.described(motion);
        let unit = dimension.split_once('(').and_then(|(_, unit)| unit.strip_suffix(')'));
        unit.map_or_else(|| "a number".to_string(), |unit| unit.replace(' ', "·"))
    };
    let (rotary, linear) = (unit(Motion::Rotary), unit(Motion::Linear));
    let unit = match key.motion {
        Some(motion) => unit(motion),
        None if rotary == linear => rotary,
        None => format!("{rotary} ({linear})"),
    };
    let range = match range {
        Range::Any => "",
        Range::ZeroOrMore => ", ≥ 0",
        Range::Positive => ", > 0",
        Range::Share => ", 0 to 1",
    };
    format!("{unit}{range}{}", if key.tolerance { ", ±" } else { "" })
}

fn takes(key: &Key) -> String {
    match key.takes {
        Takes::Text => "text".to_string(),
        Takes::Name(names) => names.iter().map(|name| format!("`\"{name}\"`")).collect::<Vec<_>>().join(", "),
        Takes::Quantity(measure, range) => quantity(key, measure, range),
        Takes::QuantityOr(measure, range, word) => format!("{}, or `\"{word}\"`", quantity(key, measure, range)),
        Takes::TimeOrSamples => {
            format!("{}, or `\"1.5 samples\"`", quantity(key, Measure::Time, Range::ZeroOrMore))
        }
        Takes::Whole { least, most, step } => format!("{least} to {most}{}", if step == 2 { ", even" } else { "" }),
        Takes::Numbers { least, most } => format!("{least} to {most} numbers"),
        Takes::Ends(_) => "two different ends".to_string(),
        Takes::Table => "a table".to_string(),
        Takes::Named { most, reserved, .. } => {
            let taken = if reserved.is_empty() { String::new() } else { format!(", not {}", reserved.join(", ")) };
            format!("{most} tables at most{taken}")
        }
        Takes::List { most, .. } => format!("{most} tables at most"),
    }
}

fn without(key: &Key) -> String {
    match key.presence {
        Presence::Required => ", required".to_string(),
        Presence::Optional => String::new(),
        Presence::Number(number) => format!("; default {number}"),
        Presence::Name(name) => format!("; default `\"{name}\"`"),
        Presence::Depends(text) if text.starts_with("required") => format!(", {text}"),
        Presence::Depends(text) => format!("; default {text}"),
    }
}

fn signals() -> Result<String> {
    let of = |motion: Motion, inertia: &str| {
        let text = format!(
            "motion = {:?}\n[loop]\nperiod = 1\n[device]\ninertia = {inertia:?}\nhandle = {{ inertia = 1, stiffness = 1 }}\n[bodies.NAME]\ninertia = {inertia:?}\n",
            motion.name()
        );
        World::read(&Source::from_text("columns", text), &[]).map(|world| columns(&world))
    };
    let mut text = String::new();
    for (rotary, linear) in of(Motion::Rotary, "1 kg m^2")?.iter().zip(of(Motion::Linear, "1 kg")?) {
        let (name, unit, doc) = (&rotary.name, rotary.unit, rotary.doc);
        if *name == linear.name {
            writeln!(text, "- `{name}` ({unit}): {doc}")?;
        } else {
            writeln!(text, "- `{name}` ({unit}), linear `{}` ({}): {doc}", linear.name, linear.unit)?;
        }
    }
    Ok(text)
}

/// The columns of the log of a loop in real time after those of a run.
fn logged() -> Result<String> {
    let text = "loop.period = 1\ndevice.inertia = 1\n";
    let world = World::read(&Source::from_text("columns", text), &[])?;
    let run = columns(&world).len();
    let mut text = String::new();
    for column in hapt_log::columns(&world, true, true).iter().skip(run) {
        let codes = match column.kind {
            Kind::Choice(choice) => {
                let codes: Vec<String> = choice.values.iter().map(|(name, code)| format!("{code} {name}")).collect();
                format!(": {}", codes.join(", "))
            }
            _ => String::new(),
        };
        let unit = if column.unit.is_empty() { String::new() } else { format!(" ({})", column.unit) };
        writeln!(text, "- `{}`{unit}: {}{codes}", column.name, column.doc)?;
    }
    Ok(text)
}
