//! The values of a world file, key by key: as written, and in SI.

use crate::counts::{self, InCounts};
use crate::dimension::Dimension;
use crate::document::{Document, Entry, Node, Value};
use crate::error::Error;
use crate::keys::{self, Key, NETWORK_FILE, Presence, Takes};
use crate::kinds::Motion;
use crate::path::Reader;
use crate::quantity::{parse_quantity, split_tolerance, tolerance};
use crate::source::Source;
use crate::system::{Station, System, station_key};
use crate::world::World;

/// A key of a world with its value.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// The dotted path: `couplings.0.stiffness`.
    pub path: String,
    /// The value as it is written in the file or its override, without quotes and tolerance; of an absent key its default.
    pub written: String,
    /// The tolerance of a quantity, a fraction of it; 0 without one.
    pub tolerance: f64,
    /// A quantity in SI.
    pub si: Option<f64>,
    /// The SI unit of a quantity; empty for other values.
    pub unit: String,
    /// What the key takes.
    pub takes: Takes,
    /// The meaning of the key.
    pub doc: &'static str,
    /// A warning about a bare number that no usual device has, with the unit that was probably meant.
    pub doubt: Option<String>,
    /// Whether it is in the file or an override; else it is a default.
    pub given: bool,
}

/// The keys of a world in the file's order, each table's absent ones with their defaults after it.
///
/// # Errors
/// As [`World::read`].
pub fn parameters(source: &Source, sets: &[String]) -> Result<Vec<Parameter>, Error> {
    parameters_of(&World::read(source, sets)?, source, sets)
}

/// The same of the `world` that has been read from these.
///
/// # Errors
/// As [`World::read`].
pub fn parameters_of(world: &World, source: &Source, sets: &[String]) -> Result<Vec<Parameter>, Error> {
    let World { motion, sampling, .. } = world;
    let document = Document::new(source, sets)?;
    let mut list = Vec::new();
    if let Value::Table(entries) = &document.root.value {
        table(&mut list, *motion, counts::size(&document, *motion), entries, "", "", None);
    }
    // A delay in samples is converted to seconds by the period.
    for delay in list.iter_mut().filter(|parameter| ["loop.delay", "loop.delay_max"].contains(&parameter.path.as_str()))
    {
        if let Some(samples) = keys::in_samples(&delay.written) {
            (delay.si, delay.unit) = (Some(samples * sampling.period), Dimension::TIME.symbol());
        }
    }
    Ok(list)
}

impl World {
    /// Warnings about bare numbers that no usual device has, each with the unit that was probably meant. `source` and `sets` are what the
    /// world was read from; a number with a typed unit is never warned about.
    pub fn warnings(&self, source: &Source, sets: &[String]) -> Vec<String> {
        let list = parameters_of(self, source, sets).unwrap_or_default();
        list.into_iter().filter_map(|parameter| parameter.doubt).collect()
    }
}

impl System {
    /// The same of all stations and of the network's own keys.
    pub fn warnings(&self, source: &Source, sets: &[String]) -> Vec<String> {
        let mut warnings = Vec::new();
        for Station { name, world, source, sets, .. } in &self.stations {
            let of_station = world.warnings(source, sets).into_iter();
            warnings.extend(
                of_station.map(|warning| if name.is_empty() { warning } else { format!("station {name}: {warning}") }),
            );
        }
        if self.world().is_none() {
            let own: Vec<String> = sets.iter().filter(|set| station_key(set).is_none()).cloned().collect();
            let mut list = Vec::new();
            if let Ok(Node { value: Value::Table(entries), .. }) =
                Document::within(NETWORK_FILE, source, &own).map(|d| d.root)
            {
                table(&mut list, self.motion, None, &entries, "", NETWORK_FILE, None);
            }
            warnings.extend(list.into_iter().filter_map(|parameter| parameter.doubt));
        }
        warnings
    }
}

/// The keys of one table, which has passed the reader's checks. `pattern` is its path in the table of keys, `count` the size of the
/// encoder's counts.
fn table(
    list: &mut Vec<Parameter>,
    motion: Motion,
    count: Option<f64>,
    entries: &[Entry],
    path: &str,
    pattern: &str,
    hand: Option<&str>,
) {
    let join = |path: &str, name: &str| if path.is_empty() { name.to_string() } else { format!("{path}.{name}") };
    let kind = entries.iter().find_map(|entry| match &entry.node.value {
        Value::Text(kind) if entry.key == "kind" => Some(kind.as_str()),
        _ => None,
    });
    for entry in entries {
        let path = join(path, &entry.key);
        let Some(row) = keys::rows(pattern).find(|row| row.name() == entry.key && row.belongs(kind, hand, motion))
        else {
            continue;
        };
        match (&entry.node.value, row.takes) {
            (Value::Table(inner), Takes::Named { .. }) => {
                for entry in inner {
                    if let Value::Table(inner) = &entry.node.value {
                        table(list, motion, count, inner, &join(&path, &entry.key), &format!("{}.*", row.path), None);
                    }
                }
            }
            (Value::Table(inner), _) => table(list, motion, count, inner, &path, row.path, kind),
            (Value::Array(items), Takes::List { .. }) => {
                for (index, item) in items.iter().enumerate() {
                    if let Value::Table(inner) = &item.value {
                        table(
                            list,
                            motion,
                            count,
                            inner,
                            &join(&path, &index.to_string()),
                            &format!("{}.*", row.path),
                            None,
                        );
                    }
                }
            }
            _ => list.push(given(row, motion, count, path, &entry.node)),
        }
    }
    for row in keys::rows(pattern).filter(|row| row.belongs(kind, hand, motion)) {
        if entries.iter().any(|entry| entry.key == row.name()) {
            continue;
        }
        let unit = si_unit(row, motion);
        let (written, si) = match row.presence {
            Presence::Number(number) if unit.is_empty() => (number.to_string(), None),
            Presence::Number(number) => (format!("{number} {unit}"), Some(number)),
            Presence::Name(name) => (name.to_string(), None),
            _ => continue,
        };
        let path = join(path, row.name());
        let Key { takes, doc, .. } = *row;
        list.push(Parameter { path, written, tolerance: 0.0, si, unit, takes, doc, doubt: None, given: false });
    }
}

fn given(row: &Key, motion: Motion, count: Option<f64>, path: String, node: &Node) -> Parameter {
    let written = match &node.value {
        Value::Text(text) | Value::Number(text) | Value::Date(text) => text.clone(),
        Value::Boolean(boolean) => boolean.to_string(),
        Value::Array(items) => {
            let text = |item: &Node| match &item.value {
                Value::Text(text) | Value::Number(text) => text.clone(),
                _ => String::new(),
            };
            items.iter().map(text).collect::<Vec<_>>().join(", ")
        }
        Value::Table(_) => String::new(),
    };
    let (written, tolerance) = tolerated(row, motion, written, node);
    let si = row.takes.quantity().and_then(|(measure, _)| {
        let wanted = measure.dimension(motion);
        match (InCounts::find(&written, motion), count) {
            (Some(in_counts), Some(size)) => in_counts.value(size, wanted),
            _ => parse_quantity(&written, wanted),
        }
        .ok()
    });
    let unit = if si.is_some() { si_unit(row, motion) } else { String::new() };
    // A warning about a number without a unit of its own.
    let doubt = match &node.value {
        Value::Number(number) => row.doubt(motion, &path, number),
        Value::Text(_) | Value::Boolean(_) | Value::Date(_) | Value::Array(_) | Value::Table(_) => None,
    };
    Parameter { path, written, tolerance, si, unit, takes: row.takes, doc: row.doc, doubt, given: true }
}

/// A quantity's text without its tolerance, and the tolerance: its own, or that of the number which an override has replaced.
fn tolerated(row: &Key, motion: Motion, written: String, node: &Node) -> (String, f64) {
    let Some((measure, _)) = row.takes.quantity().filter(|_| row.tolerance) else { return (written, 0.0) };
    let parts = |text: &str| {
        let (middle, width) = split_tolerance(text)?;
        tolerance(middle, width, measure.dimension(motion))
    };
    match (parts(&written), node.before.as_ref().map(|before| &before.value)) {
        (Some(parts), _) => parts,
        (None, Some(Value::Text(before))) => {
            let tolerance = parts(before).map_or(0.0, |(_, tolerance)| tolerance);
            (written, tolerance)
        }
        (None, _) => (written, 0.0),
    }
}

fn si_unit(row: &Key, motion: Motion) -> String {
    row.takes.quantity().map(|(measure, _)| measure.dimension(motion).symbol()).unwrap_or_default()
}

impl Source {
    /// The same with the texts of all files that the world names, itself or in `sets`, so that it can be read without these files.
    ///
    /// # Errors
    /// As [`crate::World::read`].
    pub fn with_files(&self, sets: &[String]) -> Result<Source, Error> {
        let mut whole = self.clone();
        for parameter in parameters(self, sets)? {
            if parameter.given && parameter.path.ends_with(".file") {
                let (_, text) = Reader::new(self, Motion::Rotary).text(&parameter.written)?;
                whole.files.insert(parameter.written, text);
            }
        }
        Ok(whole)
    }
}

/// The size of 1 `unit` in SI; `None` where it has another dimension. A sample is one period of the world, a count one of its encoder.
pub fn unit_size(unit: &str, dimension: Dimension, world: &World) -> Option<f64> {
    let one = format!("1 {unit}");
    if let Some(samples) = keys::in_samples(&one) {
        return (dimension == Dimension::TIME).then_some(samples * world.sampling.period);
    }
    match InCounts::find(&one, world.motion) {
        Some(in_counts) => in_counts.value(world.count()?, dimension).ok(),
        None => parse_quantity(&one, dimension).ok(),
    }
}

/// The unit in "17.8 N mm/deg".
pub fn unit(written: &str) -> String {
    let number = |c: char| c.is_ascii_digit() || matches!(c, '.' | '+' | '-' | '_');
    let rest = written.trim().trim_start_matches(number);
    // The exponent of "1.2e-3 N".
    let rest = match rest.strip_prefix(['e', 'E']) {
        Some(exponent) if exponent.starts_with(|c: char| number(c)) => exponent.trim_start_matches(number),
        _ => rest,
    };
    rest.trim().to_string()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[test]
    fn every_key_comes_as_it_is_written_and_in_si() {
        let file = "[loop]\nperiod = \"1 ms\"\n[device]\ninertia = \"6.4e-4 kg m^2\"\nlimit = \"822.25 N mm\"\n\
            [bodies.wheel]\ninertia = 0.5\n[[couplings]]\nkind = \"damper\"\nbetween = [\"puck\", \"wheel\"]\n\
            damping = \"1 N m s/rad\"\n[scenarios.turn]\nduration = \"1 s\"\n\
            hand = { kind = \"torque\", moves = { kind = \"step\", to = \"5 N mm\" } }\n";
        let source = Source::from_text("wheel.toml", file);
        let list = parameters(&source, &["loop.period=2ms".to_string()]).unwrap();
        let find = |path: &str| list.iter().find(|p| p.path == path).unwrap_or_else(|| panic!("no {path}"));
        let shown = |path: &str| (find(path).written.as_str(), find(path).si, find(path).unit.as_str());
        assert_eq!(shown("loop.period"), ("2ms", Some(0.002), "s"));
        assert_eq!(shown("device.limit"), ("822.25 N mm", Some(0.82225), "N m"));
        assert_eq!(shown("bodies.wheel.inertia"), ("0.5", Some(0.5), "kg m^2"));
        assert_eq!(shown("couplings.0.between"), ("puck, wheel", None, ""));
        assert_eq!(shown("scenarios.turn.hand.moves.to"), ("5 N mm", Some(0.005), "N m"));
        assert_eq!(shown("loop.method"), ("zoh", None, ""));
        assert!(!find("loop.method").given && find("loop.period").given);
        assert!(list.iter().all(|p| p.path != "couplings.0.rest"), "a damper has no rest");
    }

    #[test]
    fn with_its_files_a_world_reads_where_they_are_not() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("wave.csv"), "waveform\n1\n-1\n").unwrap();
        std::fs::write(folder.path().join("path.csv"), "time_s,puck_rad\n0,0\n1,2\n").unwrap();
        std::fs::write(folder.path().join("push.csv"), "time_s,torque_Nm\n0,0\n1,2\n").unwrap();
        let text = "loop.period = 1e-3\ndevice.inertia = 1e-3\n[[couplings]]\nkind = \"texture\"\nbetween = [\"puck\", \"ground\"]\n\
                    torque = 1\npitch = 1\nfile = \"wave.csv\"\n[scenarios.a]\nduration = 1\n\
                    hand = { kind = \"path\", file = \"path.csv\" }\n[scenarios.b]\nduration = 1\n\
                    hand = { kind = \"torque\", moves = { kind = \"path\", file = \"push.csv\" } }\n";
        let here = Source { folder: folder.path().into(), ..Source::from_text("w.toml", text) };
        let whole = here.with_files(&[]).unwrap();
        let elsewhere = Source { folder: "nowhere".into(), ..whole.clone() };
        assert_eq!(whole.files.len(), 3);
        assert_eq!(World::read(&elsewhere, &[]), World::read(&here, &[]));
        assert!(World::read(&Source { files: BTreeMap::new(), ..elsewhere }, &[]).is_err());
    }
}
