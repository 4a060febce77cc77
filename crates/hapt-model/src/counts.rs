//! Counts as a unit: `100 count`, `0.2 mNm/count`, `5000 count/s` of the file's encoder.

use std::f64::consts::TAU;

use crate::dimension::Dimension;
use crate::document::{Document, Value};
use crate::kinds::Motion;
use crate::quantity::{Number, QuantityError, parse_in_unit, parse_with_unit};
use crate::unit::{Unit, without_counts};

/// A quantity in counts as one in rad or m, and the power that a count has in it: -1 in `0.2 mNm/count`.
pub(crate) struct InCounts {
    written: String,
    text: String,
    power: i32,
}

impl InCounts {
    /// `None` where the text contains no count, or its unit is invalid.
    pub fn find(text: &str, motion: Motion) -> Option<InCounts> {
        let text = text.trim();
        let (_, unit) = Number::split(text)?;
        let number = text.strip_suffix(unit)?;
        let name = match motion {
            Motion::Rotary => "rad",
            Motion::Linear => "m",
        };
        let (plain, angle_or_length) = (without_counts(unit, "1")?, without_counts(unit, name)?);
        let power = |text: &str| {
            let dimension = Unit::parse(text).ok()?.dimension();
            Some(i32::from(match motion {
                Motion::Rotary => dimension.angle,
                Motion::Linear => dimension.length,
            }))
        };
        let power = power(&angle_or_length)? - power(&plain)?;
        Some(InCounts { written: text.to_string(), text: format!("{number} {angle_or_length}"), power })
    }

    /// In SI, for one count of `size` (rad or m).
    pub fn value(&self, size: f64, wanted: Dimension) -> Result<f64, QuantityError> {
        let value = parse_with_unit(&self.text, wanted);
        let value = value.map_err(|error| QuantityError { text: self.written.clone(), ..error })?;
        Ok(value * size.powi(self.power))
    }
}

/// One count of a file's encoder in rad or m. `None` without an encoder.
pub(crate) fn size(document: &Document, motion: Motion) -> Option<f64> {
    let find = |path: &[&str]| document.find(path).map(|node| &node.value);
    let number = |path: &[&str]| match find(path)? {
        Value::Number(text) => parse_in_unit(text, Unit::ONE),
        _ => None,
    };
    let size = match motion {
        Motion::Rotary => {
            let at_the_motor =
                || Some(at_the_puck(number(&["device", "motor", "encoder"])?, number(&["device", "motor", "ratio"])?));
            TAU / number(&["device", "encoder"]).or_else(at_the_motor)?
        }
        Motion::Linear => match find(&["device", "encoder"])? {
            Value::Text(text) => parse_with_unit(text, Dimension::LENGTH).ok()?,
            Value::Number(text) => parse_in_unit(text, Unit::ONE)?,
            _ => return None,
        },
    };
    Some(size).filter(|size| size.is_finite() && *size > 0.0)
}

/// The counts in a turn of the puck, a whole number: the fraction that a ratio leaves is less than half a count in a turn.
pub(crate) fn at_the_puck(encoder: f64, ratio: f64) -> f64 {
    (ratio * encoder).round().max(1.0)
}
