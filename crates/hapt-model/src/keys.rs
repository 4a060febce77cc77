//! The table of keys: every key of the world file, its values, and its meaning.
//!
//! The file reader, `--set`, the schema and the book are made from [`KEYS`]; nothing else lists keys, defaults or ranges.

mod table;

pub(crate) use table::{COMPENSATING, DIRECTION, HANDLE, LINK_LOST, MOST_COUPLINGS, MOST_SAMPLES, WORLD_LEDGER};
pub use table::{KEYS, NETWORK, NETWORK_FILE, SAMPLES};

use crate::dimension::Dimension;
use crate::kinds::Motion;
use crate::quantity::parse_quantity;
use crate::words;

/// One row of the table. A key that means different things to different kinds has a row for each meaning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Key {
    /// The dotted path, `*` for a name or an index: `loop.period`, `couplings.*.stiffness`.
    pub path: &'static str,
    /// Where its name begins, so that a search of the table for every key of a file need not split the path each time.
    name_at: usize,
    /// The values that it takes.
    pub takes: Takes,
    /// Whether it is required, and its default when absent.
    pub presence: Presence,
    /// The kinds of coupling, hand or motion (the table's own `kind`) that it belongs to; empty: all.
    pub kinds: &'static [&'static str],
    /// The kinds of hand around a `moves` that it belongs to; empty: all.
    pub hands: &'static [&'static str],
    /// The motion that it belongs to; `None`: both.
    pub motion: Option<Motion>,
    /// The sizes that it has on usual devices, in SI, where they are not those of its measure ([`Key::usual`]).
    usual: Option<(f64, f64)>,
    /// Whether its quantity may carry a tolerance: `"1.2e-3 N m s/rad ± 20 %"`.
    pub tolerance: bool,
    /// Its meaning, with units, in one to three lines.
    pub doc: &'static str,
}

/// The values of a key.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Takes {
    /// Any text.
    Text,
    /// One of these names.
    Name(&'static [&'static str]),
    /// A string of a number and a unit, or a bare number in SI.
    Quantity(Measure, Range),
    /// The same, or this one word.
    QuantityOr(Measure, Range, &'static str),
    /// A time of 0 or more, or a number of periods: `"1.5 samples"`.
    TimeOrSamples,
    /// A whole number.
    Whole {
        /// The smallest.
        least: u64,
        /// The largest.
        most: u64,
        /// Every value is a multiple of this.
        step: u64,
    },
    /// An array of plain numbers from -1000 to 1000.
    Numbers {
        /// How many at least.
        least: usize,
        /// How many at most.
        most: usize,
    },
    /// An array of two different ends: `"puck"`, `"ground"` or a body's name; of a link, two stations' names.
    Ends([&'static str; 2]),
    /// A table of keys.
    Table,
    /// A table of tables that the user names.
    Named {
        /// How many at most.
        most: usize,
        /// What one of them is.
        what: &'static str,
        /// Whether a name begins with a letter: `[A-Za-z][A-Za-z0-9_-]*`; else it is `[A-Za-z0-9_-]+`.
        letter_first: bool,
        /// Names that are taken.
        reserved: &'static [&'static str],
    },
    /// An array of tables.
    List {
        /// How many at most.
        most: usize,
        /// What one of them is.
        what: &'static str,
    },
}

/// A quantity's meaning, from which its dimension follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// s
    Time,
    /// Hz
    Frequency,
    /// rad, in both motions
    Angle,
    /// rad, linear: m
    Position,
    /// rad/s, linear: m/s
    Velocity,
    /// rad/s^2, linear: m/s^2
    Acceleration,
    /// N m, linear: N
    Torque,
    /// N m/rad, linear: N/m
    Stiffness,
    /// N m s/rad, linear: N s/m
    Damping,
    /// kg m^2 (or N m s^2/rad), linear: kg
    Inertia,
    /// J, in both motions
    Energy,
    /// A plain number
    Ratio,
}

/// The range of a quantity; all values are finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// Any.
    Any,
    /// 0 and above.
    ZeroOrMore,
    /// Above 0.
    Positive,
    /// 0 to 1.
    Share,
}

/// Whether a key must be there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Presence {
    /// An error without it.
    Required,
    /// Nothing without it.
    Optional,
    /// This number, in SI, without it.
    Number(f64),
    /// This name without it.
    Name(&'static str),
    /// It depends on other keys, in these words.
    Depends(&'static str),
}

impl Measure {
    /// The dimension in a world of this motion.
    pub const fn dimension(self, motion: Motion) -> Dimension {
        match (self, motion) {
            (Measure::Ratio, _) => Dimension::NONE,
            (Measure::Time, _) => Dimension::TIME,
            (Measure::Frequency, _) => Dimension::FREQUENCY,
            (Measure::Angle, _) | (Measure::Position, Motion::Rotary) => Dimension::ANGLE,
            (Measure::Position, Motion::Linear) => Dimension::LENGTH,
            (Measure::Velocity, Motion::Rotary) => Dimension::ANGULAR_VELOCITY,
            (Measure::Velocity, Motion::Linear) => Dimension::VELOCITY,
            (Measure::Acceleration, Motion::Rotary) => Dimension::ANGULAR_ACCELERATION,
            (Measure::Acceleration, Motion::Linear) => Dimension::ACCELERATION,
            (Measure::Torque, Motion::Rotary) | (Measure::Energy, _) => Dimension::TORQUE,
            (Measure::Torque, Motion::Linear) => Dimension::FORCE,
            (Measure::Stiffness, Motion::Rotary) => Dimension::ANGULAR_STIFFNESS,
            (Measure::Stiffness, Motion::Linear) => Dimension::STIFFNESS,
            (Measure::Damping, Motion::Rotary) => Dimension::ANGULAR_DAMPING,
            (Measure::Damping, Motion::Linear) => Dimension::DAMPING,
            (Measure::Inertia, Motion::Rotary) => Dimension::INERTIA,
            (Measure::Inertia, Motion::Linear) => Dimension::MASS,
        }
    }
}

impl Measure {
    /// Its name: `a torque (N m)`.
    pub fn described(self, motion: Motion) -> String {
        match self {
            // N m is both, and a dimension has one name.
            Measure::Energy => "an energy (J)".to_string(),
            Measure::Time
            | Measure::Frequency
            | Measure::Angle
            | Measure::Position
            | Measure::Velocity
            | Measure::Acceleration
            | Measure::Torque
            | Measure::Stiffness
            | Measure::Damping
            | Measure::Inertia
            | Measure::Ratio => self.dimension(motion).to_string(),
        }
    }

    /// The least and the largest size that it has on usual devices, in SI: at least a hundred times beyond common ones. Positions and
    /// speeds may be as small as they are. `None` of a plain number.
    const fn usual(self, motion: Motion) -> Option<(f64, f64)> {
        Some(match (self, motion) {
            (Measure::Time, _) => (1e-6, 1e5),
            (Measure::Frequency, _) => (1e-3, 1e5),
            // Two turns.
            (Measure::Angle, _) | (Measure::Position, Motion::Rotary) => (0.0, 13.0),
            (Measure::Position, Motion::Linear) => (0.0, 2.0),
            (Measure::Velocity, Motion::Rotary) => (0.0, 1e3),
            (Measure::Velocity, Motion::Linear) => (0.0, 50.0),
            (Measure::Acceleration, Motion::Rotary) => (1e-1, 1e6),
            (Measure::Acceleration, Motion::Linear) => (1e-3, 1e4),
            (Measure::Torque, Motion::Rotary) => (1e-6, 100.0),
            (Measure::Torque, Motion::Linear) => (1e-5, 1e3),
            (Measure::Stiffness, Motion::Rotary) => (1e-6, 1e4),
            (Measure::Stiffness, Motion::Linear) => (1e-3, 1e6),
            (Measure::Damping, Motion::Rotary) => (1e-9, 100.0),
            (Measure::Damping, Motion::Linear) => (1e-6, 1e4),
            (Measure::Inertia, Motion::Rotary) => (1e-9, 100.0),
            (Measure::Inertia, Motion::Linear) => (1e-5, 1e3),
            (Measure::Energy, _) => (1e-6, 100.0),
            (Measure::Ratio, _) => return None,
        })
    }

    /// The units that it is written in, the largest first.
    const fn units(self, motion: Motion) -> &'static [&'static str] {
        match (self, motion) {
            (Measure::Time, _) => &["s", "ms", "us"],
            (Measure::Frequency, _) => &["kHz", "Hz"],
            (Measure::Angle, _) | (Measure::Position, Motion::Rotary) => &["rad", "deg"],
            (Measure::Position, Motion::Linear) => &["m", "mm", "um"],
            (Measure::Velocity, Motion::Rotary) => &["rad/s", "rpm", "deg/s"],
            (Measure::Velocity, Motion::Linear) => &["m/s", "mm/s"],
            (Measure::Acceleration, Motion::Rotary) => &["rad/s^2", "deg/s^2"],
            (Measure::Acceleration, Motion::Linear) => &["m/s^2", "mm/s^2"],
            (Measure::Torque, Motion::Rotary) => &["N m", "N mm"],
            (Measure::Torque, Motion::Linear) => &["N", "mN"],
            (Measure::Stiffness, Motion::Rotary) => &["N m/rad", "N mm/deg", "N mm/rad"],
            (Measure::Stiffness, Motion::Linear) => &["N/mm", "N/m"],
            (Measure::Damping, Motion::Rotary) => &["N m s/rad", "N mm s/deg", "N mm s/rad"],
            (Measure::Damping, Motion::Linear) => &["N s/mm", "N s/m"],
            (Measure::Inertia, Motion::Rotary) => &["kg m^2", "kg cm^2", "g cm^2"],
            (Measure::Inertia, Motion::Linear) => &["kg", "g"],
            (Measure::Energy, _) => &["J", "N mm"],
            (Measure::Ratio, _) => &[],
        }
    }

    /// A size in SI in the largest of its units that leaves it 1 or more: 1e-5 s as `10 us`.
    fn shown(self, motion: Motion, si: f64) -> String {
        let size = |unit: &str| parse_quantity(&format!("1 {unit}"), self.dimension(motion)).unwrap_or(1.0);
        let units = self.units(motion);
        let unit =
            units.iter().find(|unit| si.abs() >= size(unit) * (1.0 - 1e-9)).or(units.last()).copied().unwrap_or("");
        let number = format!("{:.2e}", si / size(unit)).parse().unwrap_or(si);
        format!("{number} {unit}")
    }

    /// A quantity of it as someone might write it.
    pub fn example(self, motion: Motion) -> String {
        if self == Measure::Energy { "0.05 J".to_string() } else { self.dimension(motion).example() }
    }
}

/// Between these, in SI, is every number above 0 that is a property of something physical. Far beyond them products of a few such numbers
/// leave double precision.
pub const PHYSICAL: std::ops::RangeInclusive<f64> = 1e-30..=1e30;

/// A bare number this many times beyond the usual range gives a warning.
const FAR: f64 = 10.0;

/// The plain numbers of an array: factors of a quantity, of the size of 1.
pub const NUMBERS: std::ops::RangeInclusive<f64> = -1e3..=1e3;

impl Range {
    /// Whether `value` is in it.
    pub fn contains(self, value: f64) -> bool {
        match self {
            Range::Any => value.is_finite(),
            Range::ZeroOrMore => value == 0.0 || PHYSICAL.contains(&value),
            Range::Positive => PHYSICAL.contains(&value),
            Range::Share => Range::ZeroOrMore.contains(value) && value <= 1.0,
        }
    }
}

impl Takes {
    /// The quantity's meaning and range; `None` for what is no quantity.
    pub const fn quantity(self) -> Option<(Measure, Range)> {
        match self {
            Takes::Quantity(measure, range) | Takes::QuantityOr(measure, range, _) => Some((measure, range)),
            Takes::TimeOrSamples => Some((Measure::Time, Range::ZeroOrMore)),
            Takes::Text
            | Takes::Name(_)
            | Takes::Whole { .. }
            | Takes::Numbers { .. }
            | Takes::Ends(_)
            | Takes::Table
            | Takes::Named { .. }
            | Takes::List { .. } => None,
        }
    }
}

/// The number of samples in a text: `"1.5 samples"`, `"1 sample"`; `None` where it has another unit, or none.
pub fn in_samples(text: &str) -> Option<f64> {
    let text = text.trim();
    let number = text.strip_suffix(SAMPLES).or_else(|| text.strip_suffix(SAMPLES.trim_end_matches('s')))?;
    crate::quantity::parse_in_unit(number, crate::unit::Unit::ONE)
}

impl Key {
    /// The table that it is in: `couplings.*` of `couplings.*.stiffness`; empty at the top.
    pub fn table(&self) -> &'static str {
        &self.path[..self.name_at.saturating_sub(1)]
    }

    /// Its name in that table: `stiffness`.
    pub fn name(&self) -> &'static str {
        &self.path[self.name_at..]
    }

    /// Whether it belongs to this `kind` of its table, under this kind of hand, in this motion.
    pub fn belongs(&self, kind: Option<&str>, hand: Option<&str>, motion: Motion) -> bool {
        let among =
            |names: &[&str], name: Option<&str>| names.is_empty() || name.is_some_and(|name| names.contains(&name));
        among(self.kinds, kind) && among(self.hands, hand) && self.motion.is_none_or(|only| only == motion)
    }

    /// The sizes that it has on usual devices, in SI; `None` of what is no quantity, and of plain numbers.
    pub fn usual(&self, motion: Motion) -> Option<(f64, f64)> {
        self.usual.or(self.takes.quantity()?.0.usual(motion))
    }

    /// A warning about a bare `number` at `path` that is far from what usual devices have there, with the unit that was probably meant;
    /// `None` where it is not: an invented world has round numbers.
    pub(crate) fn doubt(&self, motion: Motion, path: &str, number: &str) -> Option<String> {
        let ((least, largest), (measure, _)) = (self.usual(motion)?, self.takes.quantity()?);
        let (value, dimension) = (parse_quantity(number, Dimension::NONE).ok()?, measure.dimension(motion));
        let is_usual = |size: f64| size == 0.0 || (least..=largest).contains(&size.abs());
        // Positions and velocities have only a largest usual size, and degrees are 57 times radians.
        let far = if least > 0.0 { FAR } else { 1.0 };
        if value == 0.0 || (least / far..=largest * far).contains(&value.abs()) {
            return None;
        }
        let range = match least {
            0.0 => format!("at most {}", measure.shown(motion, largest)),
            least => format!("{} to {}", measure.shown(motion, least), measure.shown(motion, largest)),
        };
        let middle = if least > 0.0 { (least * largest).sqrt() } else { 1e-3 * largest };
        let distance = |size: f64| (size.abs() / middle).ln().abs();
        let meant = measure.units(motion).iter().filter_map(|unit| {
            let text = format!("{number} {unit}");
            let size = parse_quantity(&text, dimension).ok().filter(|size| *size != value && is_usual(*size))?;
            Some((distance(size), text))
        });
        let meant = meant.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, text)| text);
        let advice = match meant {
            Some(meant) => format!("Was {meant} meant? Write {path} = {meant:?}"),
            None => format!("Write it with its unit, such as {path} = {:?}", measure.example(motion)),
        };
        Some(format!("{path} = {number} is {number} {}; usual values are {range}. {advice}", dimension.symbol()))
    }

    /// Its values, as the end of an error message: expected `a time (s) above 0, such as "1 ms"`.
    pub fn wanted(&self, motion: Motion) -> String {
        let quantity = |measure: Measure, range: Range| {
            let range = match range {
                Range::Any => "",
                Range::ZeroOrMore => " of 0 or more",
                Range::Positive => " above 0",
                Range::Share => " of 0 to 1",
            };
            format!("expected {}{range}, such as {:?}", measure.described(motion), measure.example(motion))
        };
        match self.takes {
            Takes::Text => "expected text in quotes".to_string(),
            Takes::Name(names) => format!("expected {}", words::alternatives(names.iter().copied())),
            Takes::Quantity(measure, range) => quantity(measure, range),
            Takes::QuantityOr(measure, range, word) => format!("{}, or {word:?}", quantity(measure, range)),
            Takes::TimeOrSamples => {
                format!(
                    "{}, or a number of samples, such as {:?}",
                    quantity(Measure::Time, Range::ZeroOrMore),
                    format!("1.5 {SAMPLES}")
                )
            }
            Takes::Whole { least, most, step } => {
                let even = if step == 2 { "an even" } else { "a" };
                format!("expected {even} whole number from {least} to {most}")
            }
            Takes::Numbers { least, most } => {
                let largest = NUMBERS.end();
                format!(
                    "expected an array of {least} to {most} plain numbers from -{largest} to {largest}, such as [0.5, -1]"
                )
            }
            Takes::Ends(such) => format!("expected a pair of ends, such as {such:?}"),
            Takes::Table => "expected a table of keys".to_string(),
            Takes::Named { what, .. } => format!("expected a table for each {what}"),
            Takes::List { what, .. } => format!("expected an array of tables, one for each {what}"),
        }
    }
}

/// The number in SI that the key of a world file has where it is absent. It is for constants: a path without such a key does not compile.
pub(crate) const fn default_number(path: &str) -> f64 {
    let mut i = 0;
    while i < KEYS.len() {
        if let (true, Presence::Number(number)) = (is_same(KEYS[i].path, path), KEYS[i].presence) {
            return number;
        }
        i += 1;
    }
    panic!("no key of this path has a default number")
}

const fn is_same(one: &str, other: &str) -> bool {
    let (one, other) = (one.as_bytes(), other.as_bytes());
    let mut i = 0;
    while i < one.len() && i < other.len() && one[i] == other[i] {
        i += 1;
    }
    i == one.len() && i == other.len()
}

/// The rows of one table, such as `couplings.*`, in the order of [`KEYS`].
pub fn rows(table: &str) -> impl Iterator<Item = &'static Key> {
    KEYS.iter().chain(NETWORK).filter(move |key| key.table() == table)
}

/// The elements that the user names or numbers inside the table `path`, such as a body in `bodies`; `None` where hapt names the keys.
pub(crate) fn named_by_the_user(path: &str) -> Option<&'static str> {
    KEYS.iter().chain(NETWORK).find(|key| key.path == path).and_then(|key| match key.takes {
        Takes::Named { what, .. } | Takes::List { what, .. } => Some(what),
        _ => None,
    })
}

/// How many names the longest path has.
pub(crate) fn deepest() -> usize {
    KEYS.iter().chain(NETWORK).map(|key| key.path.split('.').count()).max().unwrap_or(0)
}

const fn key(path: &'static str, takes: Takes, presence: Presence, doc: &'static str) -> Key {
    let mut name_at = path.len();
    while name_at > 0 && path.as_bytes()[name_at - 1] != b'.' {
        name_at -= 1;
    }
    Key { path, name_at, takes, presence, kinds: &[], hands: &[], motion: None, usual: None, tolerance: false, doc }
}

impl Key {
    const fn of(self, kinds: &'static [&'static str]) -> Key {
        Key { kinds, ..self }
    }

    const fn under(self, hands: &'static [&'static str]) -> Key {
        Key { hands, ..self }
    }

    const fn only(self, motion: Motion) -> Key {
        Key { motion: Some(motion), ..self }
    }

    const fn within(self, least: f64, largest: f64) -> Key {
        Key { usual: Some((least, largest)), ..self }
    }

    const fn tolerated(self) -> Key {
        Key { tolerance: true, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_core::spec::CouplingKind;

    use crate::kinds::HandKind;

    #[test]
    fn one_row_at_most_speaks_for_a_key_of_a_kind() {
        let kinds = || [None].into_iter().chain(CouplingKind::NAMES.iter().chain(HandKind::NAMES).map(Some));
        for row in KEYS.iter().chain(NETWORK) {
            for kind in kinds() {
                for hand in [None, Some("torque"), Some("grip")] {
                    for motion in [Motion::Rotary, Motion::Linear] {
                        let same = KEYS.iter().chain(NETWORK).filter(|key| key.path == row.path);
                        let speaking = same.filter(|key| key.belongs(kind.copied(), hand, motion));
                        assert!(speaking.count() <= 1, "{} of {kind:?} under {hand:?}", row.path);
                    }
                }
            }
        }
    }

    /// A row of a kind that nothing reads would be a key without a meaning.
    #[test]
    fn every_kind_that_a_row_names_is_one_that_its_table_takes() {
        for row in KEYS {
            let of = |table: &str| rows(table).find(|row| row.name() == "kind").map(|row| row.takes);
            if !row.kinds.is_empty() {
                let Some(Takes::Name(names)) = of(row.table()) else { panic!("{} has no kind beside it", row.path) };
                assert!(row.kinds.iter().all(|kind| names.contains(kind)), "{} of {:?}", row.path, row.kinds);
            }
            assert!(row.hands.iter().all(|hand| HandKind::NAMES.contains(hand)), "{} under {:?}", row.path, row.hands);
        }
    }

    #[test]
    fn every_row_has_a_table_a_range_for_its_default_and_a_doc() {
        for row in KEYS.iter().chain(NETWORK) {
            let table = row.table().trim_end_matches(".*");
            let is_top = table.is_empty() || table == NETWORK_FILE;
            assert!(is_top || KEYS.iter().chain(NETWORK).any(|key| key.path == table), "{}", row.path);
            assert!(row.doc.ends_with('.'), "{}", row.path);
            match (row.takes, row.presence) {
                (Takes::Quantity(_, range), Presence::Number(default)) => {
                    assert!(range.contains(default), "{}", row.path)
                }
                (Takes::TimeOrSamples, Presence::Number(default)) => assert!(default == 0.0, "{}", row.path),
                (Takes::Whole { least, most, .. }, Presence::Number(default)) => {
                    assert!((least as f64..=most as f64).contains(&default))
                }
                (Takes::Name(names), Presence::Name(default)) => assert!(names.contains(&default), "{}", row.path),
                (_, Presence::Number(_) | Presence::Name(_)) => panic!("{} has a default of another type", row.path),
                _ => {}
            }
        }
    }
}
