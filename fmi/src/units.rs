//! Units in a model description: the SI units of the variables with their display units.

use std::collections::BTreeMap;

use hapt_model::{Dimension, Unit};

use crate::variable::Variable;

/// The display units offered for a dimension, in addition to those of the world file.
const DISPLAY_UNITS: &[&str] = &["ms", "deg", "rev", "deg/s", "rpm", "mm", "mm/s", "N mm", "N mm/deg"];

/// An SI unit with its display units.
#[derive(Clone, Debug, PartialEq)]
pub struct Definition {
    /// The exponents of the base units.
    pub dimension: Dimension,
    /// Names, each with its number per SI unit.
    pub display: BTreeMap<String, f64>,
}

/// The units of these variables by name. `written` are texts of quantities, whose units are added to the display units.
pub fn definitions<'a>(variables: &[Variable], written: impl Iterator<Item = &'a str>) -> BTreeMap<String, Definition> {
    let mut all = BTreeMap::new();
    for variable in variables.iter().filter(|variable| !variable.unit.is_empty()) {
        if let Ok(unit) = Unit::parse(&variable.unit) {
            let definition = Definition { dimension: unit.dimension(), display: BTreeMap::new() };
            all.entry(variable.unit.clone()).or_insert(definition);
        }
    }
    for name in DISPLAY_UNITS.iter().copied().chain(written.filter_map(unit_of)) {
        for (own, definition) in &mut all {
            if let Some(size) = size(name, definition.dimension).filter(|_| own != name) {
                definition.display.insert(name.to_string(), size.recip());
            }
        }
    }
    all
}

/// The unit in a quantity's text: `N mm/deg` of `17.8 N mm/deg`.
pub fn unit_of(text: &str) -> Option<&str> {
    let begins = |(at, _): (usize, char)| {
        let rest = &text[at..];
        let is_exponent = rest.strip_prefix(['e', 'E']).is_some_and(|rest| {
            rest.strip_prefix(['+', '-']).unwrap_or(rest).starts_with(|digit: char| digit.is_ascii_digit())
        });
        !is_exponent
    };
    let at = text.char_indices().find(|&(at, c)| (c.is_alphabetic() || c == '°') && begins((at, c)))?.0;
    Some(text[at..].trim()).filter(|unit| Unit::parse(unit).is_ok())
}

/// The number of SI units in a unit of this dimension.
fn size(name: &str, dimension: Dimension) -> Option<f64> {
    let unit = Unit::parse(name).ok().filter(|unit| dimension.accepts(unit.dimension()))?;
    Some(unit.factor() * 10_f64.powi(i32::try_from(unit.decimal_exponent()).ok()?))
}
