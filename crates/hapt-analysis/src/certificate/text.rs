//! A check as text: what `hapt check` prints.

use std::fmt::Write as _;

use hapt_model::Sampling;

use crate::certificate::check::Check;
use crate::certificate::proposal::{Proposal, number};
use crate::stability::{NOT_SEARCHED, Stability};

impl Check {
    /// The answer, the world that it is about, a line each for held, free and passive, and the remedies or margins that `proposed` has. With
    /// `why` the eigenvalues, reasons and notes instead of these lines.
    pub fn text(&self, title: &str, sampling: &Sampling, proposed: Option<&Proposal>, why: bool) -> String {
        let proposed = proposed.map_or(String::new(), |proposed| proposal(proposed, self.certified.holds()));
        let verdicts = if why { verdicts(self) } else { self.summary() };
        format!(
            "{}\n\nworld     {title}: {} at {} a sample{}, torque from the {} of the step{}\n{verdicts}{proposed}",
            self.headline(),
            self.method,
            time(self.period_s),
            rates(sampling),
            self.output,
            late(sampling)
        )
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

/// At which samples the bodies step, as a clause after the period; empty where they step at each.
pub fn rates(sampling: &Sampling) -> String {
    match sampling.bodies_every {
        1 => String::new(),
        every => format!(", the bodies at every {every} samples"),
    }
}

/// How late the torque comes, as a clause after the loop; empty where it comes at once.
pub fn late(sampling: &Sampling) -> String {
    match sampling.delay_s() {
        0.0 => String::new(),
        delay => format!(", {} late", time(delay)),
    }
}

/// A growth rate; below a billionth it is rounding.
pub fn rate(growth: f64) -> String {
    if growth.abs() < 1e-9 { "0".into() } else { number(growth) }
}

fn proposal(proposal: &Proposal, certified: bool) -> String {
    let name = if certified { "margins" } else { "remedies" };
    let lines = proposal.lines();
    let end = if lines.is_empty() { "" } else { ":" };
    let indented = |line: &String| if line.is_empty() { "\n".to_string() } else { format!("  {line}\n") };
    let lines: String = lines.iter().map(indented).collect();
    format!("{name:<9} {}{end}\n{lines}", proposal.heading)
}

fn verdicts(check: &Check) -> String {
    let mut text = format!("verdict   {}\n", check.verdict_sentence());
    about(&mut text, check, "held", &check.sentence(), &check.held);
    about(&mut text, check, "free", &check.free_sentence(), &check.free);
    let _ = writeln!(text, "passive   {}", check.passivity_sentence());
    for reason in &check.passivity.not_proved {
        let _ = writeln!(text, "          not proved: {reason}");
    }
    if let Some(uneven) = check.uneven_sentence() {
        let _ = writeln!(text, "uneven    {uneven}");
        for reason in &check.uneven.not_proved {
            let _ = writeln!(text, "          not proved: {reason}");
        }
    }
    if let Some(counts) = check.quantisation_sentence() {
        let _ = writeln!(text, "counts    {counts}");
    }
    for note in &check.notes {
        let _ = writeln!(text, "note      {note}");
    }
    text
}

/// The verdict on the held world or the free loop, and its numbers.
fn about(text: &mut String, check: &Check, name: &str, sentence: &str, of: &Stability) {
    let _ = writeln!(text, "{name:<9} {sentence}");
    if let Some(growth) = of.growth_per_s {
        let _ = writeln!(text, "          growth {} per second, largest |λ| = {}", rate(growth), of.spectral_radius);
    }
    let critical = match (of.critical_period_s, of.critical_period_reason) {
        (Some(period), _) => format!("critical period {}", time(period)),
        (None, Some("never")) if name == "free" || check.has_handle => {
            "critical period: none, unstable at the shortest that was looked at".into()
        }
        (None, Some("never")) => "critical period: none, unstable from 0 on".into(),
        (None, Some(NOT_SEARCHED)) => "critical period: not searched".into(),
        (None, _) => "critical period: none, never unstable".into(),
    };
    let _ = writeln!(text, "          {critical}");
    for (i, mode) in of.modes.iter().enumerate() {
        let name = if i == 0 { "modes" } else { "" };
        let _ =
            write!(text, "{name:<9} {} Hz, damping ratio {}", number(mode.frequency_hz), number(mode.damping_ratio));
        let _ = match (mode.discrete_frequency_hz, mode.discrete_damping_ratio) {
            (Some(frequency), Some(ratio)) => {
                writeln!(text, "; in this loop {} Hz, {}", number(frequency), number(ratio))
            }
            _ => writeln!(text, "; in this loop it does not swing"),
        };
    }
}
