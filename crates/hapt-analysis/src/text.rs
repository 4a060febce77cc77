//! Numbers as text for people.

use hapt_model::Motion;
use hapt_model::keys::Measure;

/// Six significant digits, no trailing zeros.
pub fn number(x: f64) -> String {
    if x == 0.0 {
        return "0".into();
    }
    let exponent = x.abs().log10().floor();
    if !(-4.0..=8.0).contains(&exponent) {
        // 5.64400e-7 is 5.644e-7.
        let text = format!("{x:.5e}");
        return match text.split_once('e') {
            Some((digits, power)) => format!("{}e{power}", digits.trim_end_matches('0').trim_end_matches('.')),
            None => text,
        };
    }
    let text = format!("{x:.*}", (5.0 - exponent).max(0.0) as usize);
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').into(),
        false => text,
    }
}

/// A rate or a time for people: four digits, no trailing zeros.
pub(crate) fn short(x: f64) -> String {
    let digits = if x == 0.0 { 3 } else { (3 - x.abs().log10().floor() as i32).clamp(0, 12) };
    let text = format!("{x:.*}", digits as usize);
    let scientific = x != 0.0 && !(1e-4..1e5).contains(&x.abs());
    if scientific {
        format!("{x:.3e}")
    } else if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_string()
    } else {
        text
    }
}

/// A quantity for people: a number as [`short`] has it, with its SI unit.
pub(crate) fn with_unit(x: f64, measure: Measure, motion: Motion) -> String {
    format!("{} {}", short(x), measure.dimension(motion).symbol())
}

/// A time for people.
pub(crate) fn time(s: f64) -> String {
    match s {
        s if s < 1e-3 => format!("{} us", short(s * 1e6)),
        s if s < 1.0 => format!("{} ms", short(s * 1e3)),
        s => format!("{} s", short(s)),
    }
}
