//! The command line, which connects the crates.
// Every match names all variants, so that a new one does not compile by default.
#![warn(clippy::wildcard_enum_match_arm)]

mod answer;
mod args;
#[cfg(target_os = "linux")]
mod attached;
#[cfg(not(target_os = "linux"))]
#[path = "no_wheel.rs"]
mod attached;
mod axis;
mod boundary;
mod check;
mod colour;
#[cfg(feature = "parquet")]
mod columnar;
#[cfg(not(feature = "parquet"))]
#[path = "no_parquet.rs"]
mod columnar;
#[cfg(target_os = "linux")]
mod conform;
mod design;
mod drives;
mod explain;
mod export;
mod export_c;
mod failure;
mod finished;
mod flash;
mod format;
mod host;
mod identify;
mod impedance;
mod init;
mod latency;
mod live;
mod log;
mod messages;
mod notes;
mod output;
mod phone;
mod picture;
mod plot;
mod progress;
mod provenance;
mod report;
mod run;
mod signals;
mod sim;
mod station;
mod suggest;
mod sweep;
mod sweep_plot;
mod table;
#[cfg(target_os = "linux")]
mod wheel;
mod world;
mod worlds;
mod worst;

use std::process::ExitCode;

use clap::Parser;

use args::{Args, Command};
use failure::Failure;

fn main() -> ExitCode {
    signals::watch();
    if sweep::asks_for_measures(std::env::args_os()) {
        return sweep::list_measures().unwrap_or_else(Failure::report);
    }
    let args = match Args::try_parse() {
        Ok(args) => args,
        Err(usage) => return failure::usage(&usage),
    };
    let done = match &args.command {
        None => notes::run(),
        Some(Command::Sim(args)) => sim::run(args),
        Some(Command::Check(args)) => check::run(args),
        Some(Command::Design(args)) => design::run(args),
        Some(Command::Report(args)) => report::run(args),
        Some(Command::Plot(args)) => plot::run(args),
        Some(Command::Log { command }) => log::run(command),
        Some(Command::Export { command }) => export::run(command),
        Some(Command::Sweep(args)) => sweep::run(args),
        Some(Command::Impedance(args)) => impedance::run(args),
        Some(Command::Boundary(args)) => boundary::run(args),
        Some(Command::Worst(args)) => worst::run(args),
        Some(Command::Run(args)) => run::run(args),
        Some(Command::Flash(args)) => flash::run(args),
        Some(Command::Identify(args)) => identify::run(args),
        Some(Command::Latency(args)) => latency::run(args),
        Some(Command::Devices) => drives::devices(),
        Some(Command::SimulateDrive(args)) => drives::simulate(args),
        Some(Command::Live(args)) => live::run(args),
        #[cfg(target_os = "linux")]
        Some(Command::Wheel(args)) => wheel::run(args),
        #[cfg(not(target_os = "linux"))]
        Some(Command::Wheel(_)) => Err(attached::missing()),
        Some(Command::Init(args)) => init::run(args),
        Some(Command::Worlds) => worlds::run(),
        Some(Command::Explain(args)) => explain::run(args),
    };
    let code = match done {
        Ok(code) => code,
        // A command may fail in any way after a signal.
        Err(failure) => {
            output::remove_unfinished();
            let code = failure.report();
            signals::signalled().map_or(code, ExitCode::from)
        }
    };
    messages::settle();
    code
}
