//! The command line: wires between the crates, and nothing else.

mod args;
mod builtin;
mod check;
mod design;
mod failure;
mod notes;
mod output;
mod people;
mod progress;
mod sim;
mod world;

use std::process::ExitCode;

use clap::Parser;

use args::{Args, Command};

fn main() -> ExitCode {
    output::watch_for_signals();
    let args = match Args::try_parse() {
        Ok(args) => args,
        Err(usage) => return failure::usage(&usage),
    };
    let done = match &args.command {
        None => notes::run(),
        Some(Command::Sim(args)) => sim::run(args),
        Some(Command::Check(args)) => check::run(args),
        Some(Command::Design(args)) => design::run(args),
    };
    match done {
        Ok(code) => code,
        Err(failure) => failure.report(),
    }
}
