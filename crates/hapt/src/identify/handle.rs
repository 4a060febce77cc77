//! `hapt identify --handle`: a device whose handle is on a flexible shaft.

use std::fmt::Write as _;
use std::io::{Write, stdout};
use std::process::ExitCode;

use hapt_identify::{Error, Interval, WithHandle, identify_handle};
use hapt_model::Motion;
use serde_json::{Value, json};

use super::Given;
use super::print::{self, effort, lag, sized, units};
use crate::args::IdentifyArgs;
use crate::failure::Failure;
use crate::format;
use crate::messages;

/// The device with a handle; `None` where the record's motion does not fit one, with a message: the result without a handle follows.
pub fn found(given: &Given) -> Result<Option<WithHandle>, Failure> {
    match identify_handle(&given.record) {
        Ok(found) => Ok(Some(found)),
        Err(Error::Residual(_) | Error::Unexplained) => {
            messages::say(
                "warning: no handle on a flexible shaft explains this record: a hand on the handle, or more than a shaft, is in its motion; what \
                 follows is without a handle",
            );
            Ok(None)
        }
        Err(error @ Error::Rigid) => {
            messages::say(format_args!("warning: {error}; what follows is without a handle"));
            Ok(None)
        }
        Err(error) => Err(Failure::input(format!("{}: {error}", given.name))),
    }
}

pub fn run(args: &IdentifyArgs, given: &Given, found: &WithHandle) -> Result<ExitCode, Failure> {
    for warning in found.warnings() {
        messages::say(format_args!("warning: {warning}"));
    }
    let text = if args.json { in_json(found)? } else { text(given, found) };
    let mut out = stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(ExitCode::SUCCESS)
}

fn in_json(found: &WithHandle) -> Result<String, Failure> {
    let value = |x: Interval| json!({ "value": x.value, "low": x.low, "high": x.high });
    let mut all: serde_json::Map<String, Value> =
        found.named().into_iter().map(|(name, interval)| (name.to_string(), value(interval))).collect();
    // A fit with a handle does not tell these.
    all.extend(["offset", "sign", "counts_per_rev", "misfit"].map(|name| (name.to_string(), Value::Null)));
    all.insert("resonance_hz".into(), json!(found.resonance_hz));
    print::pretty(&all)
}

fn text(given: &Given, found: &WithHandle) -> String {
    let [inertia, damping] = units(given.motion);
    let (effort, per_si) = effort(given.motion);
    let stiffness = if given.motion == Motion::Linear { "N/m" } else { "N m/rad" };
    let mut text = format!("{}: a device with a handle on a shaft\n\n", given.name);
    let mut line = |name: &str, words: String| {
        let _ = writeln!(text, "{name:<16} {words}");
    };
    line("inertia", sized(found.inertia, 1.0, &inertia));
    line("damping", sized(found.damping, 1.0, &damping));
    line("friction", sized(found.friction, per_si, effort));
    line("delay", sized(found.delay, 1e3, "ms"));
    line("lag", lag(found.lag));
    line("handle inertia", sized(found.handle_inertia, 1.0, &inertia));
    line("shaft stiffness", sized(found.stiffness, 1.0, stiffness));
    line("shaft damping", sized(found.shaft_damping, 1.0, &damping));
    line("resonance", format!("{} Hz, of both on the shaft, hands-off", format::number(found.resonance_hz)));
    let Interval { value, .. } = found.handle_inertia;
    let _ = write!(
        text,
        "\n[device.handle]\ninertia   = \"{} {inertia}\"\nstiffness = \"{} {stiffness}\"\ndamping   = \"{} {damping}\"\n",
        format::number(value),
        format::number(found.stiffness.value),
        format::number(found.shaft_damping.value)
    );
    text
}
