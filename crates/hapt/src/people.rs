//! Numbers as people read them, and lines for them to read.

use std::fmt::Display;
use std::io::{Write, stderr};

pub use hapt_analysis::proposal::number;
use hapt_model::Motion;

/// A line on standard error. Who has closed it wants no lines, and the command goes on.
pub fn say(line: impl Display) {
    let _ = writeln!(stderr(), "{line}");
}

/// A torque in N mm up to 10 N m, as such devices are spoken of; or a force in N.
pub fn effort(x: f64, motion: Motion) -> String {
    match motion {
        Motion::Rotary if x.abs() < 10.0 => format!("{} N mm", number(1e3 * x)),
        Motion::Rotary => format!("{} N m", number(x)),
        Motion::Linear => format!("{} N", number(x)),
    }
}

/// A time in the unit that suits it.
pub fn time(x: f64) -> String {
    match x.abs() {
        size if size == 0.0 || size >= 1.0 => format!("{} s", number(x)),
        size if size >= 0.9995e-3 => format!("{} ms", number(1e3 * x)),
        _ => format!("{} us", number(1e6 * x)),
    }
}

/// An energy in the unit that suits it; below 10 fJ it is rounding.
pub fn energy(x: f64) -> String {
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
