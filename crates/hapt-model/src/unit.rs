//! Units: a table of names, and products, quotients and powers of them.

use std::f64::consts::PI;

use crate::dimension::Dimension;
use crate::words;

/// Every power that a unit's text can reach stays within ±100; larger powers are rejected.
const HIGHEST_POWER: i16 = 100;
/// Parentheses inside parentheses.
const DEEPEST: u32 = 16;

/// A unit as a product of powers: of rad, m, kg and s, then of the numbers 10, π, 2, 180, 30, and of those of an inch, a pound and the
/// standard gravity. As the numbers stay separate until the end, the decimal ones are exact, and deg/deg cancels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unit([i16; 12]);

/// An inch in 1e-4 m, a pound in 1e-8 kg (both by the agreement of 1959), and the standard gravity in 1e-5 m/s² (CGPM 1901).
const INCH: f64 = 254.0;
const POUND: f64 = 45_359_237.0;
const GRAVITY: f64 = 980_665.0;

const fn si(angle: i16, length: i16, mass: i16, time: i16, ten: i16) -> Unit {
    Unit([angle, length, mass, time, ten, 0, 0, 0, 0, 0, 0, 0])
}

/// The units by name, those of one dimension together, SI first.
pub const UNITS: &[(&str, Unit)] = &[
    ("rad", si(1, 0, 0, 0, 0)),
    ("mrad", si(1, 0, 0, 0, -3)),
    ("deg", Unit([1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 0, 0])),
    ("°", Unit([1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 0, 0])),
    ("rev", Unit([1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0])),
    ("rpm", Unit([1, 0, 0, -1, 0, 1, 0, 0, -1, 0, 0, 0])),
    ("m", si(0, 1, 0, 0, 0)),
    ("cm", si(0, 1, 0, 0, -2)),
    ("mm", si(0, 1, 0, 0, -3)),
    ("um", si(0, 1, 0, 0, -6)),
    ("\u{b5}m", si(0, 1, 0, 0, -6)),
    ("\u{3bc}m", si(0, 1, 0, 0, -6)),
    ("in", Unit([0, 1, 0, 0, -4, 0, 0, 0, 0, 1, 0, 0])),
    ("s", si(0, 0, 0, 1, 0)),
    ("ms", si(0, 0, 0, 1, -3)),
    ("us", si(0, 0, 0, 1, -6)),
    ("\u{b5}s", si(0, 0, 0, 1, -6)),
    ("\u{3bc}s", si(0, 0, 0, 1, -6)),
    ("ns", si(0, 0, 0, 1, -9)),
    ("Hz", si(0, 0, 0, -1, 0)),
    ("kHz", si(0, 0, 0, -1, 3)),
    ("N", si(0, 1, 1, -2, 0)),
    ("mN", si(0, 1, 1, -2, -3)),
    // As in motors' data sheets: an ounce next to an inch is a force.
    ("kgf", Unit([0, 1, 1, -2, -5, 0, 0, 0, 0, 0, 0, 1])),
    ("gf", Unit([0, 1, 1, -2, -8, 0, 0, 0, 0, 0, 0, 1])),
    ("lbf", Unit([0, 1, 1, -2, -13, 0, 0, 0, 0, 0, 1, 1])),
    ("oz", Unit([0, 1, 1, -2, -13, 0, -4, 0, 0, 0, 1, 1])),
    ("ozf", Unit([0, 1, 1, -2, -13, 0, -4, 0, 0, 0, 1, 1])),
    ("kg", si(0, 0, 1, 0, 0)),
    ("g", si(0, 0, 1, 0, -3)),
    ("J", si(0, 2, 1, -2, 0)),
    ("Nm", si(0, 2, 1, -2, 0)),
    ("Ncm", si(0, 2, 1, -2, -2)),
    ("Nmm", si(0, 2, 1, -2, -3)),
    ("mNm", si(0, 2, 1, -2, -3)),
    ("mNmm", si(0, 2, 1, -2, -6)),
];

/// Units that exist, of another kind than the known ones that are spelled nearly so.
const OTHERS: &[&str] = &[
    "min", "h", "hr", "hour", "hours", "day", "W", "mW", "kW", "A", "mA", "V", "mV", "K", "C", "Pa", "kPa", "bar",
    "psi", "lb", "lbs", "inch", "ft",
];

/// The unit of an encoder, as in data sheets and logs.
const COUNTS: [&str; 4] = ["count", "counts", "tick", "ticks"];

/// Why a text is not a unit.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnitError {
    /// A name that is not in [`UNITS`].
    #[error("has the unknown unit {}{}", words::quoted(.name), nearest_known(*.nearest))]
    Unknown {
        /// As it was written.
        name: String,
        /// The known unit that takes the fewest edits, where that is near enough to have been meant.
        nearest: Option<&'static str>,
    },
    /// Something other than a unit, or nothing, where a unit belongs.
    #[error("has {found} where a unit is expected")]
    Expected {
        /// The character in quotes, or `an end`.
        found: String,
    },
    /// `counts`, where no encoder's are known.
    #[error("is in counts, and a count is no angle by itself: it is a revolution over the encoder's counts")]
    Counts,
    /// `m2` for `m^2`.
    #[error("has a digit after a unit; a power is written ^2")]
    BarePower,
    /// `^` without a whole number after it.
    #[error("has a ^ without a whole number after it")]
    Power,
    /// `(` without `)`, or the reverse.
    #[error("has an unmatched parenthesis")]
    Parenthesis,
    /// Parentheses nested more than 16 deep, or a power beyond ±100.
    #[error("has parentheses nested beyond 16, or a power beyond 100")]
    TooDeep,
}

impl Unit {
    /// The plain number 1.
    pub const ONE: Unit = Unit([0; 12]);

    /// Reads a unit: names from [`UNITS`] and the literal `1`; products by a space, `·` or `*`; quotients by `/`, left
    /// to right, so that `a/b c` is (a/b)·c; powers `^2`, `^-1`, `²`; parentheses.
    ///
    /// # Errors
    /// [`UnitError`] for anything else, the empty text among it.
    pub fn parse(text: &str) -> Result<Unit, UnitError> {
        let mut parser = Parser { rest: text.trim(), depth: 0 };
        // "5/s" stands for "5 1/s".
        let first = if parser.rest.starts_with('/') { Unit::ONE } else { parser.factor()? };
        let unit = parser.expression(first)?;
        if parser.rest.is_empty() { Ok(unit) } else { Err(UnitError::Parenthesis) }
    }

    /// The exponents of rad, m, kg and s.
    pub fn dimension(self) -> Dimension {
        let [angle, length, mass, time, ..] = self.0;
        // Within ±100 by construction.
        Dimension::new(angle as i8, length as i8, mass as i8, time as i8)
    }

    /// n in the unit's 10ⁿ.
    pub fn decimal_exponent(self) -> i64 {
        i64::from(self.0[4])
    }

    /// The factor in addition to the power of ten: π/180 for deg, exactly 1 for mm.
    pub fn factor(self) -> f64 {
        let [.., pi, two, half_turn, thirty, inch, pound, gravity] = self.0;
        let (mut above, mut below) = (1.0, 1.0);
        for (number, power) in
            [(2.0, two), (180.0, half_turn), (30.0, thirty), (INCH, inch), (POUND, pound), (GRAVITY, gravity), (PI, pi)]
        {
            let powered = f64::powi(number, i32::from(power.abs()));
            if power >= 0 { above *= powered } else { below *= powered }
        }
        above / below
    }

    fn times(self, other: Unit, power: i16) -> Result<Unit, UnitError> {
        let mut product = self.0;
        for (exponent, factor) in product.iter_mut().zip(other.0) {
            *exponent =
                factor.checked_mul(power).and_then(|term| exponent.checked_add(term)).ok_or(UnitError::TooDeep)?;
            if exponent.abs() > HIGHEST_POWER {
                return Err(UnitError::TooDeep);
            }
        }
        Ok(Unit(product))
    }
}

struct Parser<'a> {
    rest: &'a str,
    depth: u32,
}

impl Parser<'_> {
    /// The rest after the first factor, up to the end or a closing parenthesis.
    fn expression(&mut self, first: Unit) -> Result<Unit, UnitError> {
        let mut unit = first;
        loop {
            let touching = !self.rest.starts_with(char::is_whitespace);
            self.rest = self.rest.trim_start();
            let power = match self.rest.chars().next() {
                None | Some(')') => return Ok(unit),
                Some('/') => self.skip('/', -1),
                Some(product @ ('·' | '\u{22c5}' | '*')) => self.skip(product, 1),
                Some('0'..='9') if touching => return Err(UnitError::BarePower),
                Some(_) => 1,
            };
            let factor = self.factor()?;
            unit = unit.times(factor, power)?;
        }
    }

    fn skip(&mut self, symbol: char, power: i16) -> i16 {
        self.rest = self.rest.get(symbol.len_utf8()..).unwrap_or_default().trim_start();
        power
    }

    fn factor(&mut self) -> Result<Unit, UnitError> {
        let base = match self.rest.chars().next() {
            Some('(') => self.parenthesis()?,
            Some('1') => {
                self.skip('1', 1);
                Unit::ONE
            }
            Some(c) if is_letter(c) => {
                let end = self.rest.find(|c| !is_letter(c)).unwrap_or(self.rest.len());
                let (name, rest) = self.rest.split_at(end);
                self.rest = rest;
                named(name)?
            }
            Some(c) => return Err(UnitError::Expected { found: words::quoted(&c.to_string()) }),
            None => return Err(UnitError::Expected { found: "an end".to_string() }),
        };
        let power = self.power()?;
        Unit::ONE.times(base, power)
    }

    fn parenthesis(&mut self) -> Result<Unit, UnitError> {
        self.skip('(', 1);
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(UnitError::TooDeep);
        }
        let first = self.factor()?;
        let unit = self.expression(first)?;
        self.depth -= 1;
        self.rest = self.rest.strip_prefix(')').ok_or(UnitError::Parenthesis)?;
        Ok(unit)
    }

    fn power(&mut self) -> Result<i16, UnitError> {
        if let Some(rest) = self.rest.trim_start().strip_prefix('^') {
            let digits = rest.strip_prefix(['-', '+']).unwrap_or(rest);
            let length = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
            if length == 0 {
                return Err(UnitError::Power);
            }
            let (number, rest) = rest.split_at(rest.len() - digits.len() + length);
            self.rest = rest;
            return number.parse().map_err(|_| UnitError::TooDeep);
        }
        let raised = |c: char| "⁰¹²³⁴⁵⁶⁷⁸⁹⁻".chars().position(|raised| raised == c);
        let length = self.rest.find(|c| raised(c).is_none()).unwrap_or(self.rest.len());
        if length == 0 {
            return Ok(1);
        }
        let (number, rest) = self.rest.split_at(length);
        self.rest = rest;
        let plain: String = number.chars().filter_map(|c| "0123456789-".chars().nth(raised(c)?)).collect();
        plain.parse().map_err(|_| UnitError::Power)
    }
}

fn is_letter(c: char) -> bool {
    c.is_alphabetic() || c == '°'
}

/// A unit with `name` in place of counts; `None` without counts in it.
pub(crate) fn without_counts(unit: &str, name: &str) -> Option<String> {
    let words = unit.split_inclusive(|c| !is_letter(c));
    let replaced = words.map(|word| {
        let letters = word.trim_end_matches(|c| !is_letter(c));
        if COUNTS.contains(&letters) { word.replacen(letters, name, 1) } else { word.to_string() }
    });
    Some(replaced.collect::<String>()).filter(|replaced| replaced != unit)
}

fn named(name: &str) -> Result<Unit, UnitError> {
    if COUNTS.contains(&name) {
        return Err(UnitError::Counts);
    }
    let known = UNITS.iter().find(|(known, _)| *known == name);
    known.map(|&(_, unit)| unit).ok_or_else(|| UnitError::Unknown {
        name: name.to_string(),
        nearest: if OTHERS.contains(&name) { None } else { near(name) },
    })
}

/// The known unit that shares a letter with `name`, and takes the fewest edits.
fn near(name: &str) -> Option<&'static str> {
    let nearest = words::nearest(name, UNITS.iter().map(|(known, _)| *known))?;
    let (lower, known) = (name.to_ascii_lowercase(), nearest.to_ascii_lowercase());
    known.chars().any(|letter| lower.contains(letter)).then_some(nearest)
}

fn nearest_known(nearest: Option<&str>) -> String {
    nearest.map_or(String::new(), |nearest| format!("; the nearest known one is {}", words::quoted(nearest)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    fn unit(text: &str) -> Unit {
        Unit::parse(text).unwrap_or_else(|error| panic!("{text}: {error}"))
    }

    #[test]
    fn every_spelling_of_a_product_is_the_same_unit() {
        for spelling in ["N m", "Nm", "N·m", "N\u{22c5}m", "N*m", "m N", "(N)(m)", "N  m", "J", "N/(1/m)", "N m^1"] {
            assert_eq!(unit(spelling), unit("N m"), "{spelling}");
        }
        for spelling in ["N mm", "Nmm", "N·mm", "mNm", "mN m"] {
            assert_eq!(unit(spelling), unit("N mm"), "{spelling}");
        }
        assert_eq!(unit("mNmm"), unit("mN mm"));
        assert_eq!(unit("Ncm"), unit("N cm"));
    }

    #[test]
    fn quotients_go_left_to_right() {
        assert_eq!(unit("N m s/rad"), unit("N m/rad s"));
        assert_eq!(unit("m/s/s"), unit("m/s^2"));
        assert_ne!(unit("N/m s"), unit("N/(m s)"));
        assert_eq!(unit("N mm/(deg/s^2)"), unit("N mm s^2/deg"));
    }

    #[test]
    fn powers_have_three_spellings() {
        assert_eq!(unit("kg m²"), unit("kg m^2"));
        assert_eq!(unit("s^-1"), unit("Hz"));
        assert_eq!(unit("s⁻¹"), unit("1/s"));
        assert_eq!(unit("(m/s)^2"), unit("m^2/s^2"));
        assert_eq!(unit("m³"), unit("m m m"));
    }

    #[test]
    fn both_code_points_of_micro_read() {
        assert_eq!(unit("\u{b5}m"), unit("um"));
        assert_eq!(unit("\u{3bc}m"), unit("um"));
        assert_eq!(unit("\u{b5}s"), unit("us"));
        assert_eq!(unit("\u{3bc}s"), unit("us"));
    }

    #[test]
    fn numbers_that_cancel_leave_exactly_one() {
        assert_eq!(unit("deg/deg").factor(), 1.0);
        assert_eq!(unit("rev/deg").factor(), 360.0);
        assert_eq!(unit("rpm s/deg").factor(), 6.0);
    }

    #[test]
    fn units_of_data_sheets_are_as_large_as_their_definitions() {
        // NIST SP 811, appendix B.8; the torques in N m.
        for (text, size) in [
            ("oz in", 7.061_551_814_226_04e-3),
            ("ozf in", 7.061_551_814_226_04e-3),
            ("lbf in", 0.112_984_829_027_616),
            ("kgf cm", 0.098_066_5),
            ("gf cm", 9.806_65e-5),
            ("oz", 0.278_013_850_953_781),
            ("in", 0.0254),
        ] {
            let unit = unit(text);
            let si = unit.factor() * 10_f64.powi(unit.decimal_exponent() as i32);
            assert!((si / size - 1.0).abs() < 1e-12, "{text}: {si}");
        }
        // 16 ounces are a pound, and inches cancel.
        assert_eq!(unit("lbf/oz").factor(), 16.0);
        assert_eq!(unit("oz in/(lbf in)").factor(), 1.0 / 16.0);
        assert_eq!(unit("oz in s^2").dimension(), unit("kg m^2").dimension());
        assert_ne!(unit("oz in^2").dimension(), unit("kg m^2").dimension(), "an ounce is no mass here");
    }

    #[test]
    fn mistakes_are_named() {
        let message = |text: &str| Unit::parse(text).unwrap_err().to_string();
        assert_eq!(message("sek"), "has the unknown unit \"sek\"; the nearest known one is \"s\"");
        assert_eq!(message("HZ"), "has the unknown unit \"HZ\"; the nearest known one is \"Hz\"");
        for other in ["min", "W", "h", "bar", "lb", "§x", "ü"] {
            let Err(UnitError::Expected { .. } | UnitError::Unknown { nearest: None, .. }) = Unit::parse(other) else {
                panic!("{other}: {}", message(other));
            };
        }
        assert_eq!(message("min"), "has the unknown unit \"min\"");
        for counts in COUNTS {
            assert!(message(counts).contains("no angle by itself"), "{counts}");
        }
        assert_eq!(message("kg m2"), "has a digit after a unit; a power is written ^2");
        assert_eq!(message("m^"), "has a ^ without a whole number after it");
        assert_eq!(message("m⁻"), "has a ^ without a whole number after it");
        assert_eq!(message("N/"), "has an end where a unit is expected");
        assert_eq!(message("N/*m"), "has \"*\" where a unit is expected");
        assert_eq!(message("(N m"), "has an unmatched parenthesis");
        assert_eq!(message("N m)"), "has an unmatched parenthesis");
        assert_eq!(message("m^101"), "has parentheses nested beyond 16, or a power beyond 100");
        assert_eq!(message("m^99999999"), "has parentheses nested beyond 16, or a power beyond 100");
        assert!(Unit::parse(&format!("{}m{}", "(".repeat(16), ")".repeat(16))).is_ok());
        assert_eq!(Unit::parse(&format!("{}m{}", "(".repeat(17), ")".repeat(17))), Err(UnitError::TooDeep));
        assert_eq!(Unit::parse(&"(".repeat(1_000_000)), Err(UnitError::TooDeep));
        assert!(Unit::parse("").is_err());
        assert!(Unit::parse("12").is_err());
    }

    fn name() -> impl Strategy<Value = &'static str> {
        prop::sample::select(UNITS).prop_map(|(name, _)| name)
    }

    proptest! {
        #[test]
        fn a_product_is_the_product_of_its_factors(a in name(), b in name(), n in -6i16..7) {
            let product = unit(a).times(unit(b), n).unwrap();
            prop_assert_eq!(unit(&format!("{a} {b}^{n}")), product);
            prop_assert_eq!(unit(&format!("{a}/{b}")).times(unit(b), 1).unwrap(), unit(a));
        }

        #[test]
        fn no_text_panics(text in "[ \\PC()^/*·1-9a-zN²⁻°]{0,40}") {
            let _ = Unit::parse(&text);
        }
    }
}
