//! Numbers with their units, as people read and type them.

pub use hapt_analysis::certificate::text::{late, rate, rates, time};
pub use hapt_analysis::proposal::number;
use hapt_model::unit;
use hapt_model::{Dimension, Motion, Parameter, Quantity, parse_positive, parse_quantity};

use crate::failure::Failure;
use crate::messages::say;

/// The value of `flag` in SI. One without a unit is taken as SI, with a note on standard error.
pub fn quantity(flag: &str, text: &str, wanted: Dimension) -> Result<f64, Failure> {
    let value = parse_quantity(text, wanted).map_err(|error| Failure::input(format!("{flag}: {error}")))?;
    if let Some(line) = assumed(flag, text, wanted) {
        say(line);
    }
    Ok(value)
}

/// The same, above 0.
pub fn positive(flag: &str, text: &str, wanted: Dimension) -> Result<f64, Failure> {
    parse_positive(text, wanted).map_err(|error| Failure::input(format!("{flag}: {error}")))?;
    quantity(flag, text, wanted)
}

/// The assumed unit of a number without one, and the spelling of the probably intended unit.
pub fn assumed(flag: &str, text: &str, wanted: Dimension) -> Option<String> {
    let bare = Quantity::parse(text).ok().filter(|quantity| quantity.dimension.is_none() && quantity.value != 0.0)?;
    let unit = wanted.symbol();
    // Quantities that are always given in SI need no note.
    let usual = match wanted {
        Dimension::ANGLE => "deg",
        Dimension::TIME => "ms",
        Dimension::LENGTH => "mm",
        Dimension::TORQUE => "N mm",
        _ => return None,
    };
    let number = number(bare.value);
    let text = text.trim();
    Some(format!(
        "hapt: {flag} {text} has no unit and is taken as {number} {unit}; write '{number} {usual}' where that is meant"
    ))
}

/// The unit of torques (linear: forces) in a world's file, and its number per SI unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Effort {
    unit: String,
    per_si: f64,
}

impl Effort {
    /// That of the motor's limit, else of the first torque in the file, else of the first stiffness; else by size.
    pub fn of(parameters: &[Parameter], motion: Motion) -> Option<Effort> {
        let wanted = match motion {
            Motion::Rotary => Dimension::TORQUE,
            Motion::Linear => Dimension::FORCE,
        };
        let direct = |parameter: &&Parameter| parameter.given && parameter.unit == wanted.symbol();
        let limit = parameters.iter().find(|parameter| parameter.path == "device.limit").filter(direct);
        let first = limit.or_else(|| parameters.iter().find(direct)).map(|parameter| unit(&parameter.written));
        // The part of "17.8 N mm/deg" before the angle.
        let stiffness = |parameter: &&Parameter| parameter.given && parameter.path.ends_with(".stiffness");
        let through = || {
            let written = unit(&parameters.iter().find(stiffness)?.written);
            Some(written.rsplit_once('/')?.0.trim().to_string())
        };
        let unit = first.filter(|unit| !unit.is_empty()).or_else(through)?;
        let size = parse_quantity(&format!("1 {unit}"), wanted).ok()?;
        Some(Effort { unit, per_si: 1.0 / size })
    }

    /// A torque as the file would write it.
    pub fn say(&self, x: f64) -> String {
        format!("{} {}", number(x * self.per_si), self.unit)
    }
}

/// A torque in N mm up to 10 N m, as usual for such devices; or a force in N. For values without a unit of a file.
pub fn effort(x: f64, motion: Motion) -> String {
    match motion {
        Motion::Rotary if x.abs() < 10.0 => format!("{} N mm", number(1e3 * x)),
        Motion::Rotary => format!("{} N m", number(x)),
        Motion::Linear => format!("{} N", number(x)),
    }
}

/// An energy in the unit that suits it; below 10 fJ it is rounding. That of a loop that has run away may leave the range of numbers.
pub fn energy(x: f64) -> String {
    if !x.is_finite() {
        return "more than 1e308 J".into();
    }
    let x = if x.abs() < 1e-14 { 0.0 } else { x };
    if x == 0.0 || x.abs() >= 1.0 { format!("{} J", number(x)) } else { format!("{} mJ", number(1e3 * x)) }
}

/// A count with its digits in groups of three.
pub fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(' ');
        }
        out.push(digit);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_without_a_unit_is_answered_with_the_unit_that_was_assumed() {
        assert_eq!(
            assumed("--travel", "45", Dimension::ANGLE).as_deref(),
            Some("hapt: --travel 45 has no unit and is taken as 45 rad; write '45 deg' where that is meant")
        );
        assert!(
            assumed("--period", "2", Dimension::TIME)
                .is_some_and(|line| line.contains("taken as 2 s") && line.contains("'2 ms'"))
        );
        for (text, wanted) in
            [("45 deg", Dimension::ANGLE), ("0", Dimension::TIME), ("3", Dimension::NONE), ("x", Dimension::TIME)]
        {
            assert_eq!(assumed("--flag", text, wanted), None);
        }
    }

    #[test]
    fn torques_are_said_in_the_units_of_their_file() {
        let shown = |limit: &str, stiffness: &str| {
            let text = format!(
                "loop.period = \"1 ms\"\ndevice = {{ inertia = 1{limit} }}\n[[couplings]]\nkind = \"spring\"\n\
                 between = [\"puck\", \"ground\"]\nstiffness = {stiffness}"
            );
            let list = hapt_model::parameters(&hapt_model::Source::from_text("w", text), &[]).unwrap();
            Effort::of(&list, Motion::Rotary).map(|effort| effort.say(0.75))
        };
        assert_eq!(shown(", limit = \"2 N m\"", "\"1 N mm/deg\"").as_deref(), Some("0.75 N m"));
        assert_eq!(shown(", limit = \"2000 mNm\"", "1").as_deref(), Some("750 mNm"));
        assert_eq!(shown("", "\"20 N mm/deg\"").as_deref(), Some("750 N mm"));
        assert_eq!(shown("", "\"20 N m/rad\"").as_deref(), Some("0.75 N m"));
        assert_eq!(shown(", limit = 2", "1"), None);
    }

    #[test]
    fn numbers_keep_six_digits_and_no_more() {
        for (x, text) in [
            (822.25, "822.25"),
            (0.019738764, "0.0197388"),
            (1.0, "1"),
            (100000.0, "100000"),
            (1234567.0, "1234567"),
            (-0.25, "-0.25"),
            (1e-9, "1e-9"),
            (0.0, "0"),
        ] {
            assert_eq!(number(x), text);
        }
        assert_eq!(time(1e-3), "1 ms");
        assert_eq!(count(10001), "10 001");
        assert_eq!(count(7), "7");
    }
}
