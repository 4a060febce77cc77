//! Numbers as text for people.

use hapt_model::Motion;
use hapt_model::keys::Measure;

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
