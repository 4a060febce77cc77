//! `hapt design`: the notes' specification (2.1) made a world.

use std::io::{Write, stdout};
use std::process::ExitCode;

use hapt_analysis::design::Specification;
use hapt_model::Dimension;

use crate::args::DesignArgs;
use crate::failure::Failure;
use crate::format;
use crate::messages;

pub fn run(args: &DesignArgs) -> Result<ExitCode, Failure> {
    let DesignArgs { travel, torque, frequency, period, json } = args;
    let wheel = Specification { travel, torque, frequency, period }.wheel("--").map_err(Failure::input)?;
    for (flag, text, dimension) in [
        ("--travel", travel, Dimension::ANGLE),
        ("--torque", torque, Dimension::TORQUE),
        ("--period", period, Dimension::TIME),
    ] {
        // JSON is in SI.
        if let Some(line) = format::assumed(flag, text, dimension).filter(|_| !json) {
            messages::say(line);
        }
    }
    let text = if *json {
        let json = serde_json::to_string_pretty(&wheel.design).map_err(|error| Failure::System(error.to_string()))?;
        json + "\n"
    } else {
        wheel.file
    };
    if let Some(note) = wheel.note {
        messages::say(format_args!("hapt: {note}"));
    }
    let mut out = stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(ExitCode::SUCCESS)
}
