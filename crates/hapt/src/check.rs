//! `hapt check`: the certificate, and what would make it so.

use std::fmt::Write as _;
use std::io::{Write, stdout};
use std::process::ExitCode;

use hapt_analysis::{Check, Proposal, Stability};
use hapt_model::Sampling;

use crate::args::CheckArgs;
use crate::colour;
use crate::failure::Failure;
use crate::format;
use crate::world::load;

pub fn run(args: &CheckArgs) -> Result<ExitCode, Failure> {
    let loaded = load(&args.world)?;
    let mut check = hapt_analysis::check(&loaded.world)?;
    if !args.no_remedies {
        check.remedies = Some(hapt_analysis::remedies(&loaded.world)?);
    }
    let text = if args.json {
        let json = serde_json::to_string_pretty(&check).map_err(|error| Failure::System(error.to_string()))?;
        json + "\n"
    } else {
        let proposed = match &check.remedies {
            Some(remedies) => {
                hapt_analysis::proposal(&loaded.world, &loaded.source, &args.world.sets, &check, remedies)?
            }
            None => None,
        };
        let proposed = proposed.map_or(String::new(), |proposed| proposal(&proposed, check.certified));
        format!("{}\n\n{}{proposed}", loaded.title(), text(&loaded.world.sampling, &check))
    };
    let mut out = stdout().lock();
    out.write_all(colour::for_stdout(&text).as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(if check.certified { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

fn proposal(proposal: &Proposal, certified: bool) -> String {
    let name = if certified { "margins" } else { "remedies" };
    let lines = proposal.lines();
    let end = if lines.is_empty() { "" } else { ":" };
    let indented = |line: &String| if line.is_empty() { "\n".to_string() } else { format!("  {line}\n") };
    let lines: String = lines.iter().map(indented).collect();
    format!("{name:<9} {}{end}\n{lines}", proposal.heading)
}

fn text(sampling: &Sampling, check: &Check) -> String {
    let mut text = format!(
        "loop      {} at {} a sample, torque from the {} of the step{}\n",
        check.method,
        format::time(check.period_s),
        check.output,
        format::late(sampling)
    );
    let _ = writeln!(text, "verdict   {}", check.verdict_sentence());
    about(&mut text, "held", &check.sentence(), &check.held);
    about(&mut text, "free", &check.free_sentence(), &check.free);
    let _ = writeln!(text, "passive   {}", check.passivity_sentence());
    for reason in &check.passivity.not_proved {
        let _ = writeln!(text, "          not proved: {reason}");
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
fn about(text: &mut String, name: &str, sentence: &str, of: &Stability) {
    let _ = writeln!(text, "{name:<9} {sentence}");
    if let Some(growth) = of.growth_per_s {
        let _ = writeln!(
            text,
            "          growth {} per second, largest |λ| = {}",
            crate::sim::rate(growth),
            of.spectral_radius
        );
    }
    let critical = match (of.critical_period_s, of.critical_period_reason) {
        (Some(period), _) => format!("critical period {}", format::time(period)),
        (None, Some("never")) if name == "free" => {
            "critical period: none, unstable at the shortest that was looked at".into()
        }
        (None, Some("never")) => "critical period: none, unstable from 0 on".into(),
        (None, _) => "critical period: none, never unstable".into(),
    };
    let _ = writeln!(text, "          {critical}");
    for (i, mode) in of.modes.iter().enumerate() {
        let name = if i == 0 { "modes" } else { "" };
        let _ = write!(
            text,
            "{name:<9} {} Hz, damping ratio {}",
            format::number(mode.frequency_hz),
            format::number(mode.damping_ratio)
        );
        let _ = match (mode.discrete_frequency_hz, mode.discrete_damping_ratio) {
            (Some(frequency), Some(ratio)) => {
                writeln!(text, "; in this loop {} Hz, {}", format::number(frequency), format::number(ratio))
            }
            _ => writeln!(text, "; in this loop it does not swing"),
        };
    }
}
