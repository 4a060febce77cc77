//! `hapt design`: the notes' specification (2.1) made a world.

use std::io::{Write, stdout};
use std::process::ExitCode;

use hapt_analysis::Design;
use hapt_model::{Dimension, Source, World, parse_quantity};

use crate::args::DesignArgs;
use crate::failure::Failure;
use crate::format::{self, number};
use crate::messages;

pub fn run(args: &DesignArgs) -> Result<ExitCode, Failure> {
    let travel = positive("--travel", &args.travel, Dimension::ANGLE)?;
    let torque = positive("--torque", &args.torque, Dimension::TORQUE)?;
    let frequency = positive("--frequency", &args.frequency, Dimension::FREQUENCY)?;
    let period = positive("--period", &args.period, Dimension::TIME)?;
    let design = Design::new(travel, torque, frequency, period)?;
    for (flag, text, dimension) in [
        ("--travel", &args.travel, Dimension::ANGLE),
        ("--torque", &args.torque, Dimension::TORQUE),
        ("--period", &args.period, Dimension::TIME),
    ] {
        // JSON is in SI.
        if let Some(line) = format::assumed(flag, text, dimension).filter(|_| !args.json) {
            messages::say(line);
        }
    }
    let file = world_file(args, &design, travel, period);
    // A number may leave the physical range only here, where it is computed.
    if let Err(refused) = World::read(&Source::from_text("the world", file.as_str()), &[]) {
        return Err(Failure::input(format!(
            "these numbers make no world that hapt reads: {}: {}",
            refused.key, refused.message
        )));
    }
    let text = if args.json {
        let json = serde_json::to_string_pretty(&design).map_err(|error| Failure::System(error.to_string()))?;
        json + "\n"
    } else {
        file
    };
    if std::f64::consts::TAU * frequency * period >= 2.0 {
        messages::say("hapt: at this period the damper b = Tk no longer balances forward Euler (it does for ωT < 2)");
    }
    let mut out = stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(ExitCode::SUCCESS)
}

fn positive(flag: &str, text: &str, dimension: Dimension) -> Result<f64, Failure> {
    let value = parse_quantity(text, dimension).map_err(|error| Failure::input(format!("{flag}: {error}")))?;
    if value > 0.0 { Ok(value) } else { Err(Failure::input(format!("{flag}: \"{text}\" must be positive"))) }
}

/// The quantity as it was given; a bare number gets its SI unit.
fn given(text: &str, value: f64, unit: &str) -> String {
    if text.trim().parse::<f64>().is_ok() { format!("{value} {unit}") } else { text.trim().into() }
}

fn world_file(args: &DesignArgs, design: &Design, travel: f64, period: f64) -> String {
    let degree = std::f64::consts::PI / 180.0;
    let travel = given(&args.travel, travel, "rad");
    format!(
        r#"# {travel} and {torque} at {frequency}: the notes' specification, sections 2.1 to 2.4.
#
#   k   = torque/travel  = {k_mm} N mm/deg
#   J_w = k/(2π f)²      = {j_mm} N mm/(deg/s^2)
#   b   = T k            = {b} N m s/rad, which undoes forward Euler's growth
title = "Virtual wheel on a torsional spring"

[loop]
period = "{period}"
method = "forward-euler"
output = "start"                        # the torque from x_k, as the notes' diagrams have it

[device]                                # University of Michigan haptic wheel
inertia  = "6.4e-4 kg m^2"
damping  = "1.2e-3 N m s/rad"
limit    = "822.25 N mm"
encoder  = 4000                         # rounds the travel to a count of 0.09 deg

[bodies.wheel]
inertia = "{j} kg m^2"

[[couplings]]
kind      = "spring"
between   = ["puck", "wheel"]
stiffness = "{k} N m/rad"

[[couplings]]
kind    = "damper"
between = ["puck", "wheel"]
damping = "compensating"                # b = T k, at whatever period

[scenarios.step]
duration = "10 s"
hand     = {{ kind = "step", to = "{travel}" }}
"#,
        torque = given(&args.torque, design.peak_torque, "N m"),
        frequency = given(&args.frequency, design.natural_frequency_hz, "Hz"),
        period = given(&args.period, period, "s"),
        k_mm = number(design.stiffness * 1e3 * degree),
        j_mm = number(design.inertia * 1e3 * degree),
        b = number(design.compensating_damping),
        j = design.inertia,
        k = design.stiffness,
    )
}
