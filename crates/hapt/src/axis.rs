//! The axes of a sweep's figure and of a boundary's: in words, and in the typed unit.

use hapt_host::keys::{end, kind};
use hapt_model::{System, parse_quantity, unit};
use hapt_report::figure;
use hapt_sweep::Axis;

use crate::format;

/// An axis in the unit in which it was typed.
pub struct DisplayedAxis {
    pub key: String,
    /// For people: "sampling period", "stiffness of the spring puck–ground".
    words: String,
    pub unit: String,
    /// The size of the unit in SI.
    pub size: f64,
    pub from: f64,
    pub to: f64,
    pub logarithmic: bool,
}

impl DisplayedAxis {
    /// In the unit of its ends as typed, `KEY=FROM..TO` followed by anything after a colon; else in SI.
    pub fn new(system: &System, axis: &Axis, typed: &str) -> Self {
        let range = typed.split_once('=').map_or("", |(_, range)| range);
        let ends = range.split(':').next().unwrap_or_default().split("..");
        let measure = system.key(&axis.key).and_then(|key| key.takes.quantity());
        let dimension = measure.map(|(measure, _)| measure.dimension(system.motion));
        let own = ends.map(unit).filter(|unit| !unit.is_empty()).find_map(|unit| {
            let size = parse_quantity(&format!("1 {unit}"), dimension?).ok()?;
            Some((unit, size))
        });
        let (unit, size) = own.unwrap_or_else(|| (axis.unit.clone(), 1.0));
        DisplayedAxis {
            key: axis.key.clone(),
            words: words(system, &axis.key),
            unit,
            size,
            from: axis.from,
            to: axis.to,
            logarithmic: axis.logarithmic,
        }
    }

    /// A value without its unit, rounded to a pixel of the range.
    pub fn value(&self, si: f64) -> String {
        let step = if self.logarithmic {
            10f64.powf((si / self.size).abs().log10().floor() - 4.0)
        } else {
            10f64.powf(((self.to - self.from) / self.size).log10().floor() - 4.0)
        };
        format::number((si / self.size / step).round() * step)
    }

    /// "loop.period from 1 to 10 ms"
    pub fn range(&self) -> String {
        let text = format!("{} from {} to {} {}", self.key, self.value(self.from), self.value(self.to), self.unit);
        text.trim_end().to_string()
    }

    /// The axis of a figure, with this part of the range beyond either end.
    pub fn figure(&self, beyond: f64) -> figure::Axis {
        let ends = [self.from, self.to].map(|end| end / self.size);
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        if self.logarithmic && low > 0.0 {
            let reach = (high / low).powf(beyond);
            figure::Axis::logarithmic(&self.words, &self.unit, low / reach, high * reach)
        } else {
            let reach = (high - low) * beyond;
            figure::Axis::from_to(&self.words, &self.unit, low - reach, high + reach)
        }
    }
}

/// A key in words; the key itself where it belongs to nothing that has a name.
fn words(system: &System, key: &str) -> String {
    let spoken = |name: &str| name.replace('_', " ");
    let parts: Vec<&str> = key.split('.').collect();
    let (station, parts) = match parts[..] {
        ["stations", name, ref rest @ ..] => (system.stations.iter().find(|station| station.name == name), rest),
        ref all => (system.stations.first(), all),
    };
    let of_station = match station {
        Some(station) if key.starts_with("stations.") => format!(", {}", station.name),
        _ => String::new(),
    };
    let words = match *parts {
        ["loop", "period"] => "sampling period".to_string(),
        ["loop", name] => spoken(name),
        ["device", name] => format!("{} of the device", spoken(name)),
        ["device", table, name] => format!("{} of the {table}", spoken(name)),
        ["bodies", body, name] => format!("{} of {body}", spoken(name)),
        ["links", index, name] => match index.parse::<usize>() {
            Ok(index) if system.links.len() > 1 => format!("{} of link {}", spoken(name), index + 1),
            _ => format!("{} of the link", spoken(name)),
        },
        ["couplings", index, name] => {
            let world = station.map(|station| &station.world);
            let coupling = world
                .zip(index.parse::<usize>().ok())
                .and_then(|(world, index)| Some((world, world.couplings.get(index)?)));
            match coupling {
                Some((world, coupling)) => {
                    let [first, second] = [coupling.first, coupling.second].map(|at| end(world, at));
                    format!("{} of the {} {first}–{second}", spoken(name), kind(coupling))
                }
                None => return key.to_string(),
            }
        }
        ["compensation", index, name] => {
            let all = station.map_or(&[][..], |station| &station.world.compensations);
            match index.parse::<usize>().ok().and_then(|index| all.get(index)) {
                Some(compensation) => format!("{} of {} compensated", spoken(name), compensation.of.name()),
                None => return key.to_string(),
            }
        }
        _ => return key.to_string(),
    };
    words + &of_station
}

/// A value that lies on its axis.
pub fn within(axis: &Axis, value: Option<f64>) -> Option<f64> {
    let (low, high) = (axis.from.min(axis.to), axis.from.max(axis.to));
    value.filter(|value| (low..=high).contains(value))
}
