//! The keys that can be set while the loop runs: their values as written, and a sensible range for each.

use hapt_model::keys::{KEYS, Key, Measure, Range, Takes};
use hapt_model::{
    Coupling, End, Error, EstimatorKind, Method, Motion, Output, Parameter, Source, World, parameters, unit, unit_size,
};

use serde::Serialize;

/// The periods that a page offers, in s.
pub const PERIODS: std::ops::RangeInclusive<f64> = 5e-5..=0.1;

/// A key that can be set while the loop runs. Serialised, it is part of the page's protocol (docs/live.md).
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(rename = "Key"))]
pub struct SettableKey {
    /// Dotted: `couplings.0.stiffness`.
    pub path: String,
    /// What it belongs to: `loop`, `spring, puck to wheel`.
    pub group: String,
    /// Its name for display.
    pub label: String,
    /// What it means.
    pub doc: &'static str,
    /// `quantity`, `choice` or `whole`.
    #[cfg_attr(test, ts(type = "\"quantity\" | \"choice\" | \"whole\""))]
    pub kind: &'static str,
    /// The value as written in the file or set.
    pub written: String,
    /// The value in SI; `None` for a choice and for a compensating damper.
    pub value: Option<f64>,
    /// The unit in which it is written.
    pub unit: String,
    /// The size of that unit in SI.
    pub factor: f64,
    /// The lower end of a slider, in SI.
    pub min: f64,
    /// The upper end of a slider, in SI.
    pub max: f64,
    /// Whether the slider is logarithmic.
    pub log: bool,
    /// The names that it takes.
    pub choices: Vec<&'static str>,
    /// The value as the file has it; `None` in a coupling that the file does not have.
    pub own: Option<String>,
    /// Whether it differs from the file.
    pub changed: bool,
    /// Whether it cannot be set with the attached motor.
    pub fixed: bool,
}

/// A logarithmic slider covers this factor in either direction.
const DECADE: f64 = 10.0;

/// The keys to which a motor behind a gear adds.
const REFLECTED: [&str; 4] = ["device.inertia", "device.damping", "device.friction", "device.friction_backward"];

/// Every key that can be set, with sliders about the values of the file under `given`, the overrides of the command line.
///
/// # Errors
/// As [`World::read`].
pub fn keys(source: &Source, given: &[String], sets: &[String]) -> Result<Vec<SettableKey>, Error> {
    let file = World::read(source, given)?;
    let world = World::read(source, sets)?;
    let mut own = parameters(source, given)?;
    let mut now = parameters(source, sets)?;
    add_output(&mut own, &file);
    add_output(&mut now, &world);
    // A slider is about a number at the puck; with `device.motor` the file's number is only a part of that.
    let is_geared = now.iter().any(|parameter| parameter.path.starts_with("device.motor."));
    let is_part = |path: &str| is_geared && REFLECTED.contains(&path);
    let shown = now.iter().filter(|parameter| {
        is_settable(&parameter.path) && has_effect(&world, &parameter.path) && !is_part(&parameter.path)
    });
    Ok(shown
        .filter_map(|parameter| {
            let before = own.iter().find(|own| own.path == parameter.path);
            key(&world, parameter, before, &file)
                .map(|key| SettableKey { group: group(&world, &parameter.path, &now), ..key })
        })
        .collect())
}

/// Whether a key can be set while the loop runs: numbers and choices, not the structure.
fn is_settable(path: &str) -> bool {
    let names: Vec<&str> = path.split('.').collect();
    match names[..] {
        ["loop", _] | ["device", ..] => true,
        ["bodies", _, name] => !matches!(name, "position" | "velocity"),
        ["couplings", _, name] => !matches!(name, "kind" | "between"),
        ["compensation", _, name] => name != "of",
        _ => false,
    }
}

/// Whether the key has an effect in this loop: a window without FOAW has none.
fn has_effect(world: &World, path: &str) -> bool {
    let sampling = &world.sampling;
    match path {
        "loop.window" => match sampling.estimator {
            EstimatorKind::Foaw | EstimatorKind::FoawBest => true,
            EstimatorKind::Exact
            | EstimatorKind::Difference
            | EstimatorKind::LowPass
            | EstimatorKind::Kalman
            | EstimatorKind::Levant => false,
        },
        "loop.every" => sampling.estimator == EstimatorKind::Difference,
        "loop.cutoff" => matches!(sampling.estimator, EstimatorKind::LowPass | EstimatorKind::Kalman),
        "loop.acceleration" => sampling.estimator == EstimatorKind::Levant,
        "loop.advance" => sampling.output == Output::End && sampling.bodies_every == 1,
        "loop.bodies_every" => {
            !world.bodies.is_empty() && !sampling.method.takes_new_sample_first() && sampling.advance == 0
        }
        _ => true,
    }
}

/// Adds `loop.output` where the file omits it: its default depends on the method.
fn add_output(list: &mut Vec<Parameter>, world: &World) {
    if list.iter().any(|parameter| parameter.path == "loop.output") {
        return;
    }
    let Some(Key { takes, doc, .. }) = KEYS.iter().find(|key| key.path == "loop.output") else { return };
    let output = Parameter {
        path: "loop.output".into(),
        written: world.sampling.output.name().into(),
        si: None,
        tolerance: 0.0,
        unit: String::new(),
        takes: *takes,
        doc,
        doubt: None,
        given: false,
    };
    let after = list.iter().position(|parameter| parameter.path == "loop.method").map_or(0, |method| method + 1);
    list.insert(after.min(list.len()), output);
}

fn key(world: &World, now: &Parameter, before: Option<&Parameter>, file: &World) -> Option<SettableKey> {
    let row = row(world, &now.path)?;
    let own = before.unwrap_or(now);
    let mut key = SettableKey {
        path: now.path.clone(),
        group: String::new(),
        label: row.name().replace('_', " "),
        doc: now.doc,
        kind: "quantity",
        written: now.written.clone(),
        value: now.si,
        unit: String::new(),
        factor: 1.0,
        min: 0.0,
        max: 1.0,
        log: false,
        choices: Vec::new(),
        own: before.map(|own| own.written.clone()),
        changed: before.is_none_or(|own| now.written != own.written),
        fixed: false,
    };
    match row.takes {
        Takes::Name(names) => {
            (key.kind, key.choices) = ("choice", names.to_vec());
        }
        Takes::Whole { least, most, .. } => {
            let value = now.written.parse().ok();
            let about: f64 = own.written.parse().unwrap_or(least as f64);
            let farthest = (4.0 * about).max(8.0).min(most as f64);
            (key.kind, key.value, key.min, key.max) = ("whole", value, least as f64, farthest);
        }
        Takes::Quantity(..) | Takes::QuantityOr(..) | Takes::TimeOrSamples => {
            let (measure, range) = row.takes.quantity()?;
            if let Takes::QuantityOr(.., word) = row.takes {
                key.choices.push(word);
            }
            let dimension = measure.dimension(world.motion);
            if !now.given && now.si == Some(0.0) {
                // The file omits it: the display unit of such devices.
                key.written = format!("0 {}", display_unit(measure, world.motion).unwrap_or(&now.unit));
            }
            let named = Some(unit(&key.written)).filter(|unit| !unit.is_empty());
            let sized = named.and_then(|unit| Some((unit_size(&unit, dimension, world)?, unit)));
            let sized = sized.map(|(size, unit)| (unit, size));
            (key.unit, key.factor) = sized.unwrap_or_else(|| (dimension.symbol(), 1.0));
            (key.min, key.max, key.log) = slider(&now.path, measure, range, own.si.unwrap_or(0.0), file);
        }
        Takes::Text
        | Takes::Numbers { .. }
        | Takes::Ends(_)
        | Takes::Table
        | Takes::Named { .. }
        | Takes::List { .. } => {
            return None;
        }
    }
    Some(key)
}

/// The display unit of a key that the file omits, where it is not the SI unit.
fn display_unit(measure: Measure, motion: Motion) -> Option<&'static str> {
    match (measure, motion) {
        (Measure::Time, _) => Some("ms"),
        (Measure::Angle, _) | (Measure::Position, Motion::Rotary) => Some("deg"),
        (Measure::Position, Motion::Linear) => Some("mm"),
        (Measure::Torque, Motion::Rotary) => Some("N mm"),
        _ => None,
    }
}

/// The row of the table of keys for a path of this world.
pub fn row(world: &World, path: &str) -> Option<&'static Key> {
    let names: Vec<&str> = path.split('.').collect();
    let (pattern, kind) = match names[..] {
        ["loop" | "device", _] => (path.to_string(), None),
        // The numbers of an existing handle: a single one does not make a handle.
        ["device", table, _] if has_table(world, table) => (path.to_string(), None),
        // Only an existing name: another text with a `=` would be read as an override of another key.
        ["bodies", body, name] if world.names.iter().any(|own| own == body) && !body.contains('=') => {
            (format!("bodies.*.{name}"), None)
        }
        ["couplings", index, name] => (format!("couplings.*.{name}"), Some(kind(world.couplings.get(place(index)?)?))),
        ["compensation", index, name] => {
            place(index)?;
            (format!("compensation.*.{name}"), None)
        }
        _ => return None,
    };
    KEYS.iter().find(|key| key.path == pattern && key.belongs(kind, None, world.motion))
}

/// The place in a list. One spelling of each number: 00 would be another key.
fn place(index: &str) -> Option<usize> {
    index.parse().ok().filter(|place: &usize| place.to_string() == index)
}

/// Whether the device has this table.
fn has_table(world: &World, table: &str) -> bool {
    let device = &world.device;
    match table {
        "friction_by_position" => device.friction_by_position.is_some(),
        "handle" => device.handle.is_some(),
        "stribeck" => device.stribeck.is_some(),
        "stops" => device.stops.is_some(),
        "gravity" => device.torque.gravity.is_some(),
        "cogging" => device.torque.cogging.is_some(),
        _ => false,
    }
}

/// A coupling's kind in world files.
pub fn kind(coupling: &Coupling) -> &'static str {
    coupling.law.kind().name()
}

/// An end's name in world files.
pub fn end(world: &World, end: End) -> &str {
    match end {
        End::Puck => "puck",
        End::Ground => "ground",
        End::Body(index) => world.names.get(index).map_or("", String::as_str),
    }
}

/// What a key belongs to, for display; `all` are the world's parameters.
fn group(world: &World, path: &str, all: &[Parameter]) -> String {
    let names: Vec<&str> = path.split('.').collect();
    match names[..] {
        ["compensation", index, _] => {
            let of = all.iter().find(|parameter| parameter.path == format!("compensation.{index}.of"));
            of.map_or(String::new(), |of| format!("compensation of {}", of.written))
        }
        ["couplings", index, _] => {
            let coupling = index.parse().ok().and_then(|index: usize| world.couplings.get(index));
            coupling.map_or(String::new(), |coupling| {
                let [first, second] = [coupling.first, coupling.second].map(|at| end(world, at));
                format!("{}, {first} to {second}", kind(coupling))
            })
        }
        ["bodies", name, _] => name.to_string(),
        ["device", table, _] => table.replace('_', " "),
        [table, ..] => table.to_string(),
        [] => String::new(),
    }
}

/// A slider's ends in SI about the file's value, and whether it is logarithmic.
fn slider(path: &str, measure: Measure, range: Range, about: f64, file: &World) -> (f64, f64, bool) {
    if path == "loop.period" {
        return ((about / DECADE).max(*PERIODS.start()), (about * DECADE).min(*PERIODS.end()), true);
    }
    if path == "loop.delay" || path == "loop.delay_max" {
        return (0.0, (4.0 * about).max(5.0 * file.sampling.period), false);
    }
    // A part of a whole.
    if range == Range::Share || path.ends_with(".share") {
        return (0.0, 1.0, false);
    }
    if range != Range::Any && about > 0.0 {
        return (about / DECADE, about * DECADE, true);
    }
    // About 0: a perceptible magnitude on this device.
    let device = &file.device;
    let (turn, effort) = match file.motion {
        Motion::Rotary => (std::f64::consts::PI, device.limit.unwrap_or(1.0)),
        Motion::Linear => (0.1, device.limit.unwrap_or(10.0)),
    };
    let size = match measure {
        Measure::Time => 5.0 * file.sampling.period,
        Measure::Frequency => 0.1 / file.sampling.period,
        Measure::Angle => std::f64::consts::PI,
        Measure::Position => turn,
        Measure::Velocity => 10.0 * turn,
        Measure::Acceleration => 10.0 * effort / device.inertia,
        Measure::Torque => 0.2 * effort,
        Measure::Stiffness => 4.0 * effort / turn,
        // Reduces the puck's speed by a tenth in one sample.
        Measure::Damping => (0.1 * device.inertia / file.sampling.period).min(10.0 * device.damping.max(1e-9 * effort)),
        Measure::Inertia => DECADE * device.inertia,
        Measure::Energy => effort * turn,
        Measure::Ratio => DECADE,
    };
    match range {
        Range::Any => {
            let size = size.max(2.0 * about.abs());
            (-size, size, false)
        }
        Range::ZeroOrMore | Range::Share | Range::Positive => (0.0, size, false),
    }
}

/// The key that must be set together with a choice, so that no choice on offer is always refused.
pub fn companion(world: &World, key: &str, value: &str) -> Option<(String, String)> {
    match (key, value.trim()) {
        // The cutoff starts at a tenth of the sampling rate.
        ("loop.estimator", "low-pass" | "kalman") => {
            Some(("loop.cutoff".into(), format!("{} Hz", (0.1 / world.sampling.period).round().max(1.0))))
        }
        // Ten times what the device's largest torque gives it, or 1000 where it has none.
        ("loop.estimator", "levant") => {
            let device = &world.device;
            let most = device.limit.map_or(1000.0, |limit| 10.0 * limit / device.inertia);
            let unit = Measure::Acceleration.dimension(world.motion).symbol();
            Some(("loop.acceleration".into(), format!("{most:e} {unit}")))
        }
        // Methods that take the new sample first take the torque from the start only.
        ("loop.method", name) => {
            let method = Method::ALL.into_iter().find(|method| method.name() == name)?;
            method.takes_new_sample_first().then(|| ("loop.output".into(), Output::Start.name().into()))
        }
        _ => None,
    }
}

/// Whether the key can be set while the loop runs, also where the file omits it.
pub fn may_be_set(world: &World, path: &str) -> bool {
    is_settable(path) && row(world, path).is_some_and(|row| is_setting(row.takes))
}

/// Whether `key` and `value` add a damper behind the last coupling, in the words of a remedy (hapt-analysis, `proposal`). No other coupling can be added: it might name a file.
pub fn adds_damper(world: &World, key: &str, value: &str) -> bool {
    let is_next = key == format!("couplings.{}", world.couplings.len());
    let damper = || {
        let rest = value.strip_prefix("{ kind = \"damper\", between = [\"")?.strip_suffix("\" }")?;
        let (first, rest) = rest.split_once("\", \"")?;
        let (second, damping) = rest.split_once("\"], damping = \"")?;
        let is_end = |name: &str| ["puck", "ground"].contains(&name) || world.names.iter().any(|own| own == name);
        let is_plain = !damping.contains(|c: char| c == '"' || c == '\\' || c.is_control());
        Some(is_end(first) && is_end(second) && is_plain)
    };
    is_next && damper() == Some(true)
}

/// Whether a key takes a number or a choice. Texts are not settings: one of them names a file, and a page must not choose what is read.
fn is_setting(takes: Takes) -> bool {
    match takes {
        Takes::Name(_) | Takes::Quantity(..) | Takes::QuantityOr(..) | Takes::TimeOrSamples | Takes::Whole { .. } => {
            true
        }
        Takes::Text
        | Takes::Numbers { .. }
        | Takes::Ends(_)
        | Takes::Table
        | Takes::Named { .. }
        | Takes::List { .. } => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_in_samples_has_samples_for_its_unit_as_long_as_the_period() {
        let source = Source::from_text(
            "w.toml",
            "loop = { period = \"2 ms\", delay = \"1.5 samples\" }\ndevice.inertia = 1e-3\n",
        );
        for (sets, period) in [(vec![], 2e-3), (vec!["loop.period=4 ms".to_string()], 4e-3)] {
            let keys = keys(&source, &[], &sets).unwrap();
            let delay = keys.iter().find(|key| key.path == "loop.delay").unwrap();
            assert_eq!((delay.written.as_str(), delay.unit.as_str(), delay.factor), ("1.5 samples", "samples", period));
            assert_eq!(delay.value, Some(1.5 * period));
        }
    }

    #[test]
    fn a_share_of_a_compensation_is_set_from_none_to_all() {
        let file = "loop.period = \"1 ms\"\ndevice.inertia = 1e-3\ndevice.friction = 0.02\ndevice.gravity.torque = 0.1\n\
                    [[compensation]]\nof = \"gravity\"\nshare = 0.8\n[[compensation]]\nof = \"friction\"\nshare = 0.5\nvelocity = 2\n";
        let source = Source::from_text("w.toml", file);
        let keys = keys(&source, &[], &[]).unwrap();
        let of = |path: &str| keys.iter().find(|key| key.path == path);
        for (path, group, value) in [
            ("compensation.0.share", "compensation of gravity", 0.8),
            ("compensation.1.share", "compensation of friction", 0.5),
        ] {
            let key = of(path).unwrap();
            assert_eq!((key.group.as_str(), key.value), (group, Some(value)));
            assert_eq!((key.min, key.max, key.log), (0.0, 1.0, false));
        }
        assert_eq!(of("compensation.1.velocity").unwrap().value, Some(2.0));
        assert!(of("compensation.0.of").is_none() && of("compensation.0.velocity").is_none());

        let config = crate::WorldConfig::new(source, Vec::new()).unwrap();
        let torque = |config: &crate::WorldConfig| config.world.couplings[0].law.slopes().stiffness;
        let less = config.with("compensation.0.share", "0.4").unwrap();
        assert!((torque(&less) / torque(&config) - 0.5).abs() < 1e-12);
        for (key, value) in [
            ("compensation.0.share", "1.5"),
            ("compensation.2.share", "0.5"),
            ("compensation.00.share", "0.5"),
            ("compensation.0.of", "cogging"),
        ] {
            assert!(config.with(key, value).is_err(), "{key} = {value}");
        }
    }
}
