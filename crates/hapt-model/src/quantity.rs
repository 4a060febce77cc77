//! Quantities: a number and a unit, or a bare number in SI.

use std::fmt;

use crate::dimension::Dimension;
use crate::unit::{Unit, UnitError};
use crate::words;

/// A number with its unit, in SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity {
    /// In rad, m, kg, s and their products; finite.
    pub value: f64,
    /// Of the unit; `None` when there is none: a bare number, in the SI unit of the expected dimension.
    pub dimension: Option<Dimension>,
}

/// A text that is not the expected quantity.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct QuantityError {
    /// As it was written.
    pub text: String,
    /// The fault.
    pub fault: Fault,
    /// The expected dimension, where that is known.
    pub wanted: Option<Dimension>,
}

/// The faults of a quantity.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// No finite decimal number at its start.
    #[error("does not begin with a finite number")]
    Number,
    /// `0,5`: the decimal separator is a point in every country here.
    #[error("has a comma for its decimal point")]
    Comma,
    /// `−5`, `1e–3`: a typographic dash for the minus sign.
    #[error("has a typographic dash for its minus sign, not -")]
    Minus,
    /// The unit does not read.
    #[error(transparent)]
    Unit(#[from] UnitError),
    /// A number without a unit, where one is needed.
    #[error("has no unit")]
    NoUnit,
    /// In SI beyond the largest double.
    #[error("is too large for a double")]
    Overflow,
    /// In SI nearer to 0 than the smallest double, and not 0.
    #[error("is too small for a double")]
    Underflow,
    /// A unit of this dimension, where another one is expected.
    #[error("is {0}")]
    Dimension(Dimension),
    /// 0 or less, where a positive one is needed.
    #[error("must be positive")]
    NotPositive,
}

impl fmt::Display for QuantityError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", words::quoted(&self.text), self.fault)?;
        match self.wanted {
            Some(wanted) => write!(f, "; expected {wanted}, such as {:?}", wanted.example()),
            None => Ok(()),
        }
    }
}

impl Quantity {
    /// Reads a number and its unit, which may stand directly against it: `1 ms`, `45°`, `-1.5e-3 N m/rad`, `3`.
    ///
    /// Decimal units are exact: `1.1 ms` is the double nearest to 0.0011. Others (deg, rev, rpm, in, kgf, lbf, oz) are one multiplication.
    ///
    /// # Errors
    /// No finite number at the start, an unknown or malformed unit, or a value that overflows or underflows in SI.
    pub fn parse(text: &str) -> Result<Quantity, QuantityError> {
        let dash = text.contains(['\u{2212}', '\u{2013}', '\u{2012}']);
        let error = |fault| {
            let fault = if dash { Fault::Minus } else { fault };
            QuantityError { text: text.to_string(), fault, wanted: None }
        };
        let (number, unit) = Number::split(text.trim()).ok_or_else(|| error(Fault::Number))?;
        if unit.is_empty() {
            let value = number.times(Unit::ONE).map_err(error)?;
            return Ok(Quantity { value, dimension: None });
        }
        if unit.starts_with(',') {
            return Err(error(Fault::Comma));
        }
        let unit = Unit::parse(unit).map_err(|fault| error(fault.into()))?;
        let value = number.times(unit).map_err(error)?;
        Ok(Quantity { value, dimension: Some(unit.dimension()) })
    }
}

/// Reads a quantity of the dimension `wanted`, as on the command line: a bare number is SI. Returns the value in SI.
///
/// ```
/// use hapt_model::{Dimension, parse_quantity};
///
/// assert_eq!(parse_quantity("1.5 ms", Dimension::TIME)?, 0.0015);
/// assert_eq!(parse_quantity("0.0015", Dimension::TIME)?, 0.0015);
/// assert!(parse_quantity("1.5 kg", Dimension::TIME).is_err());
/// # Ok::<(), hapt_model::QuantityError>(())
/// ```
///
/// # Errors
/// As [`Quantity::parse`], and for any other dimension; the message names the one given and the one wanted.
pub fn parse_quantity(text: &str, wanted: Dimension) -> Result<f64, QuantityError> {
    let error = |fault| QuantityError { text: text.to_string(), fault, wanted: Some(wanted) };
    let quantity = Quantity::parse(text).map_err(|failure| error(failure.fault))?;
    match quantity.dimension {
        Some(given) if !wanted.accepts(given) => Err(error(Fault::Dimension(given))),
        _ => Ok(quantity.value),
    }
}

/// The same of a quantity above 0.
///
/// # Errors
/// As [`parse_quantity`], and for 0 or less.
pub fn parse_positive(text: &str, wanted: Dimension) -> Result<f64, QuantityError> {
    let value = parse_quantity(text, wanted)?;
    let error = || QuantityError { text: text.to_string(), fault: Fault::NotPositive, wanted: None };
    if value > 0.0 { Ok(value) } else { Err(error()) }
}

/// The same as [`parse_quantity`] for a string in a file, where a number must have its unit.
pub(crate) fn parse_with_unit(text: &str, wanted: Dimension) -> Result<f64, QuantityError> {
    let value = parse_quantity(text, wanted)?;
    match Quantity::parse(text) {
        Ok(Quantity { dimension: Some(_), .. }) => Ok(value),
        _ => Err(QuantityError { text: text.to_string(), fault: Fault::NoUnit, wanted: Some(wanted) }),
    }
}

/// A plain decimal number in a unit that is known already, as in the columns of a table. `None`: not a finite number, or out of range.
pub(crate) fn parse_in_unit(text: &str, unit: Unit) -> Option<f64> {
    let (number, rest) = Number::split(text.trim())?;
    if rest.is_empty() { number.times(unit).ok() } else { None }
}

/// The two sides of a quantity's `±`, which `+-` and `+/-` stand for too; `None` where there is none.
pub(crate) fn split_tolerance(text: &str) -> Option<(&str, &str)> {
    let (at, sign) = ["±", "+/-", "+-"].iter().filter_map(|sign| Some((text.find(sign)?, sign))).min()?;
    Some((text.get(..at)?.trim(), text.get(at + sign.len()..)?.trim()))
}

/// A quantity with its tolerance, as [`split_tolerance`] parted them: the middle, with its unit, and the half width as a fraction of it.
/// `None` where it does not read; the middle's own mistakes are found when it is read.
pub(crate) fn tolerance(middle: &str, width: &str, wanted: Dimension) -> Option<(String, f64)> {
    if let Some(percent) = width.strip_suffix('%') {
        return Some((middle.to_string(), parse_percent(percent)?));
    }
    let unit = Number::split(width)?.1;
    // "1.2 ± 0.2 N": the unit after the tolerance is that of both.
    let middle = if Number::split(middle)?.1.is_empty() { format!("{middle} {unit}") } else { middle.to_string() };
    let (value, width) = (parse_with_unit(&middle, wanted).ok()?, parse_with_unit(width, wanted).ok()?);
    Some((middle, if width == 0.0 { 0.0 } else { width / value.abs() }))
}

/// A percentage as a fraction.
fn parse_percent(text: &str) -> Option<f64> {
    match Number::split(text.trim())? {
        (Number { mantissa, exponent }, "") => {
            format!("{mantissa}e{}", exponent - 2).parse().ok().filter(|fraction: &f64| fraction.is_finite())
        }
        _ => None,
    }
}

/// A fraction as a percentage that reads back to it.
pub(crate) fn percent(fraction: f64) -> String {
    let digits = format!("{fraction:e}");
    let (mantissa, exponent) = digits.split_once('e').unwrap_or((&digits, "0"));
    let exact = format!("{mantissa}e{}", exponent.parse::<i64>().unwrap_or(0) + 2);
    let short = exact.parse::<f64>().map_or(String::new(), |percent| percent.to_string());
    if parse_percent(&short) == Some(fraction) { short } else { exact }
}

/// A decimal number as text, so that a decimal unit can move its point before anything is rounded.
pub(crate) struct Number<'a> {
    /// Sign, digits and point.
    mantissa: &'a str,
    exponent: i64,
}

impl<'a> Number<'a> {
    /// The longest number that `text` begins with, and what follows it. `None` if there is none.
    pub fn split(text: &'a str) -> Option<(Number<'a>, &'a str)> {
        let digits = |text: &str| text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
        let unsigned = text.strip_prefix(['+', '-']).unwrap_or(text);
        let whole = digits(unsigned);
        let after_point = unsigned.get(whole..)?.strip_prefix('.');
        let fraction = after_point.map_or(0, digits);
        if whole + fraction == 0 {
            return None;
        }
        let length = text.len() - unsigned.len() + whole + after_point.map_or(0, |_| 1 + fraction);
        let (mantissa, rest) = text.split_at(length);

        if let Some(power) = rest.strip_prefix(['e', 'E']) {
            let unsigned = power.strip_prefix(['+', '-']).unwrap_or(power);
            let length = power.len() - unsigned.len() + digits(unsigned);
            if digits(unsigned) > 0 {
                let (power, rest) = power.split_at(length);
                // Beyond nine digits it overflows or underflows with any unit.
                let bound = if power.starts_with('-') { -999_999_999 } else { 999_999_999 };
                let exponent = power.parse::<i64>().map_or(bound, |exponent| exponent.clamp(-999_999_999, 999_999_999));
                return Some((Number { mantissa, exponent }, rest.trim_start()));
            }
        }
        Some((Number { mantissa, exponent: 0 }, rest.trim_start()))
    }

    fn times(&self, unit: Unit) -> Result<f64, Fault> {
        let decimal = format!("{}e{}", self.mantissa, self.exponent + unit.decimal_exponent());
        let shifted: f64 = decimal.parse().map_err(|_| Fault::Number)?;
        let value = shifted * unit.factor();
        if !value.is_finite() {
            Err(Fault::Overflow)
        } else if value == 0.0 && self.mantissa.contains(|c| matches!(c, '1'..='9')) {
            Err(Fault::Underflow)
        } else {
            Ok(value)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;
    use std::f64::consts::{PI, TAU};

    fn si(text: &str) -> f64 {
        Quantity::parse(text).unwrap_or_else(|error| panic!("{error}")).value
    }

    #[test]
    fn every_unit_has_its_value_in_si() {
        let table = [
            ("rad", 1.0, Dimension::ANGLE),
            ("mrad", 0.001, Dimension::ANGLE),
            ("deg", PI / 180.0, Dimension::ANGLE),
            ("°", PI / 180.0, Dimension::ANGLE),
            ("rev", TAU, Dimension::ANGLE),
            ("rpm", TAU / 60.0, Dimension::ANGULAR_VELOCITY),
            ("in", 0.0254, Dimension::LENGTH),
            ("m", 1.0, Dimension::LENGTH),
            ("cm", 0.01, Dimension::LENGTH),
            ("mm", 0.001, Dimension::LENGTH),
            ("um", 1e-6, Dimension::LENGTH),
            ("\u{b5}m", 1e-6, Dimension::LENGTH),
            ("\u{3bc}m", 1e-6, Dimension::LENGTH),
            ("s", 1.0, Dimension::TIME),
            ("ms", 0.001, Dimension::TIME),
            ("us", 1e-6, Dimension::TIME),
            ("\u{b5}s", 1e-6, Dimension::TIME),
            ("\u{3bc}s", 1e-6, Dimension::TIME),
            ("ns", 1e-9, Dimension::TIME),
            ("Hz", 1.0, Dimension::FREQUENCY),
            ("kHz", 1e3, Dimension::FREQUENCY),
            ("N", 1.0, Dimension::FORCE),
            ("mN", 1e-3, Dimension::FORCE),
            ("kgf", 9.80665, Dimension::FORCE),
            ("gf", 9.80665e-3, Dimension::FORCE),
            ("lbf", 4.448_221_615_260_5, Dimension::FORCE),
            ("oz", 4.448_221_615_260_5 / 16.0, Dimension::FORCE),
            ("ozf", 4.448_221_615_260_5 / 16.0, Dimension::FORCE),
            ("kg", 1.0, Dimension::MASS),
            ("g", 1e-3, Dimension::MASS),
            ("J", 1.0, Dimension::TORQUE),
            ("Nm", 1.0, Dimension::TORQUE),
            ("Ncm", 1e-2, Dimension::TORQUE),
            ("Nmm", 1e-3, Dimension::TORQUE),
            ("mNm", 1e-3, Dimension::TORQUE),
            ("mNmm", 1e-6, Dimension::TORQUE),
        ];
        for (unit, value, dimension) in table {
            let Quantity { value: read, dimension: given } = Quantity::parse(&format!("1 {unit}")).unwrap();
            assert_eq!(given, Some(dimension), "{unit}");
            // A decimal unit is exact; the others are products of at most three roundings.
            assert!((read / value - 1.0).abs() < 1e-15, "{unit}: {read}");
            if Unit::parse(unit).unwrap().factor() == 1.0 {
                assert_eq!(read, value, "{unit}");
            }
        }
        assert_eq!(table.len(), crate::unit::UNITS.len());
    }

    #[test]
    fn a_half_turn_is_pi() {
        assert_eq!(si("1 deg") * 180.0, PI);
        assert_eq!(si("180 deg"), si("0.5 rev"));
        assert_eq!(si("60 rpm"), si("1 rev/s"));
    }

    #[test]
    fn decimal_units_give_the_double_nearest_to_the_decimal_number() {
        assert_eq!(si("1.1 ms"), 0.0011);
        assert_eq!(si("0.7 us"), 7e-7);
        assert_eq!(si("822.25 N mm"), 0.82225);
        assert_eq!(si("6.4 g cm^2"), 6.4e-7);
        assert_eq!(si("33.3 kHz"), 33300.0);
        assert_eq!(si("1e99 ms^33"), 1.0);
    }

    #[test]
    fn a_number_may_stand_against_its_unit() {
        assert_eq!(si("2ms"), 0.002);
        assert_eq!(si("45°"), si("45 deg"));
        assert_eq!(si("2e-3s"), 0.002);
        assert_eq!(si(".5m"), 0.5);
        assert_eq!(si("5.m"), 5.0);
        assert_eq!(si("+5 /s"), 5.0);
        assert_eq!(si("50 1/s"), 50.0);
    }

    #[test]
    fn numbers_out_of_a_doubles_range_are_errors() {
        let fault = |text: &str| Quantity::parse(text).unwrap_err().fault;
        assert_eq!(fault("1e400 s"), Fault::Overflow);
        assert_eq!(fault("1e308 kHz"), Fault::Overflow);
        assert_eq!(fault("1e99999999999999999999 s"), Fault::Overflow);
        assert_eq!(fault("1e-400 s"), Fault::Underflow);
        assert_eq!(fault("1e-320 um"), Fault::Underflow);
        assert_eq!(si("0e400 s"), 0.0);
        assert_eq!(si("0e-99999999999999999999 s"), 0.0);
        for text in ["nan s", "inf s", "", "s", "-", ".", "--1 s", "e5", "∞ s"] {
            assert_eq!(fault(text), Fault::Number, "{text}");
        }
        // From a PDF: the minus sign and the two short dashes.
        for text in ["−5 deg", "–5 deg", "1e−3 s", "5 kg m^−1", "‒1 s"] {
            assert_eq!(fault(text), Fault::Minus, "{text}");
        }
    }

    #[test]
    fn messages_say_what_was_given_and_what_is_wanted() {
        let message = |text: &str, wanted| parse_with_unit(text, wanted).unwrap_err().to_string();
        assert_eq!(message("1 kg", Dimension::TIME), "\"1 kg\" is a mass (kg); expected a time (s), such as \"1 ms\"");
        assert_eq!(
            message("5 N m", Dimension::ANGULAR_STIFFNESS),
            "\"5 N m\" is a torque (N m); expected a torsional stiffness (N m/rad), such as \"20 N mm/deg\""
        );
        assert_eq!(
            message("5 N m/rad", Dimension::TORQUE),
            "\"5 N m/rad\" is a torsional stiffness (N m/rad); expected a torque (N m), such as \"5 N mm\""
        );
        assert_eq!(
            message("3 kg m/s", Dimension::FORCE),
            "\"3 kg m/s\" is in kg m/s; expected a force (N), such as \"2 N\""
        );
        assert_eq!(message("5", Dimension::TIME), "\"5\" has no unit; expected a time (s), such as \"1 ms\"");
    }

    #[test]
    fn an_argument_without_a_unit_is_si() {
        assert_eq!(parse_quantity("0.002", Dimension::TIME), Ok(0.002));
        assert_eq!(parse_quantity("2 ms", Dimension::TIME), Ok(0.002));
    }

    #[test]
    fn an_inertia_reads_with_and_without_the_angle() {
        assert_eq!(parse_with_unit("2 kg m^2", Dimension::INERTIA), Ok(2.0));
        assert_eq!(parse_with_unit("2 N m s^2/rad", Dimension::INERTIA), Ok(2.0));
        assert!(parse_with_unit("2 N m s/rad", Dimension::INERTIA).is_err());
    }

    #[test]
    fn a_tolerance_is_a_fraction_of_the_middle_however_it_is_written() {
        let read = |text: &str| {
            let (middle, width) = split_tolerance(text)?;
            let (middle, fraction) = tolerance(middle, width, Dimension::ANGULAR_DAMPING)?;
            Some((parse_with_unit(&middle, Dimension::ANGULAR_DAMPING).ok()?, fraction))
        };
        for text in [
            "1.2e-3 N m s/rad ± 25 %",
            "1.2e-3 N m s/rad±25%",
            "1.2e-3 N m s/rad +- 25 %",
            "1.2e-3 N m s/rad +/- 25 %",
            "1.2e-3 ± 0.3e-3 N m s/rad",
            "1.2e-3 N m s/rad ± 0.3 N mm s/rad",
        ] {
            let (middle, fraction) = read(text).unwrap_or_else(|| panic!("{text}"));
            assert!(middle == 1.2e-3 && (fraction - 0.25).abs() < 1e-15, "{text}: {middle} {fraction}");
        }
        assert_eq!(read("0 N m s/rad ± 0 %"), Some((0.0, 0.0)));
        for text in
            ["1 N m s/rad ±", "± 20 %", "1 N m s/rad ± 1 s", "1 N m s/rad ± 0.2", "1 N m s/rad ± 2 % N", "1 ± 20 %"]
        {
            assert_eq!(read(text), None, "{text}");
        }
        assert_eq!(split_tolerance("-1.5e-3 N m"), None);
    }

    proptest! {
        #[test]
        fn every_fraction_reads_back_from_its_percentage(fraction in 0.0f64..=1.0) {
            prop_assert_eq!(parse_percent(&percent(fraction)), Some(fraction));
            prop_assert_eq!(percent(0.2), "20");
        }

        #[test]
        fn every_double_reads_back(value in any::<f64>().prop_filter("finite", |value| value.is_finite())) {
            prop_assert_eq!(si(&format!("{value:?} N m/rad")), value);
        }

        #[test]
        fn no_text_panics(text in "\\PC*") {
            let _ = Quantity::parse(&text);
        }

        #[test]
        fn nothing_like_a_quantity_panics(text in "[-+0-9.eE]{0,8}[ a-zA-Z°µ/^*·()²0-9-]{0,24}") {
            if let Ok(quantity) = Quantity::parse(&text) {
                prop_assert!(quantity.value.is_finite());
            }
        }
    }
}
