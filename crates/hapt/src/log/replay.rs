//! `hapt log replay`: a log's inputs through today's core, and whether the torques are the same bits.

use std::fmt::Write as _;
use std::io::{Write, stdout};
use std::process::ExitCode;

use hapt_log::{Ending, Header, Replay};
use serde_json::json;

use crate::args::ReplayArgs;
use crate::failure::Failure;
use crate::format;
use crate::log;
use crate::messages;

pub fn run(args: &ReplayArgs) -> Result<ExitCode, Failure> {
    let mut opened = log::open(&args.log)?;
    let replay = hapt_log::replay(&mut opened.log).map_err(|error| log::failure(&opened.name, error))?;
    let (header, ending) = (&opened.log.header, opened.log.ending());
    let text = if args.json { document(&replay, header, ending) } else { text(&opened.name, &replay, header) };
    let mut out = stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    if *ending != Ending::Whole {
        messages::say(format_args!("{}: {ending}; what is there was replayed", opened.name));
    }
    Ok(ExitCode::from(u8::from(replay.first.is_some())))
}

fn text(name: &str, replay: &Replay, header: &Header) -> String {
    let scenario = header.scenario.as_ref().map_or(String::new(), |scenario| format!(", scenario {scenario}"));
    let by = match header.version.as_str() {
        "" => "its version and device are not in it".to_string(),
        version => format!("by hapt {version} on device {}{scenario}", header.device),
    };
    let mut text = format!("{name}: {by}\n");
    let compared = format::count(replay.compared);
    let _ = match &replay.first {
        None => writeln!(text, "same       all torques of {compared} samples, to the bit"),
        Some(first) => writeln!(
            text,
            "different  {} of {compared} samples, first sample {} ({}): {}\n\
             \x20          {} ({:016x}) in the log\n\
             \x20          {} ({:016x}) from today's core",
            format::count(replay.different),
            first.sample,
            format::time(first.time),
            first.column,
            first.logged,
            first.logged.to_bits(),
            first.replayed,
            first.replayed.to_bits(),
        ),
    };
    if replay.skipped > 0 {
        let skipped = format::count(replay.skipped);
        let _ = writeln!(text, "skipped    {skipped} samples, as the log lacks the loop's state before them");
    }
    if replay.gaps > 0 {
        let _ = writeln!(text, "gaps       {}, where samples were lost while recording", format::count(replay.gaps));
    }
    text
}

fn document(replay: &Replay, header: &Header, ending: &Ending) -> String {
    let first = replay.first.as_ref().map(|first| {
        json!({
            "sample": first.sample,
            "time_s": first.time,
            "column": first.column,
            "logged": first.logged,
            "logged_bits": format!("{:016x}", first.logged.to_bits()),
            "replayed": first.replayed,
            "replayed_bits": format!("{:016x}", first.replayed.to_bits()),
        })
    });
    let document = json!({
        "same": first.is_none(),
        "compared": replay.compared,
        "different": replay.different,
        "first": first,
        "skipped": replay.skipped,
        "gaps": replay.gaps,
        "whole": *ending == Ending::Whole,
        "ending": ending.to_string(),
        "version": header.version,
        "device": header.device,
        "scenario": header.scenario,
    });
    format!("{document:#}\n")
}
