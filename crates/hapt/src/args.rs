//! What can be typed.

use std::path::PathBuf;

use clap::{Parser, Subcommand, ValueEnum};

/// Virtual worlds for wheels that push back: see how one moves, what it asks of the motor, and whether it holds, before the
/// motor is on.
///
/// Without a command: the notes' virtual wheel, built in, under four methods.
#[derive(Debug, Parser)]
#[command(
    name = "hapt",
    version,
    max_term_width = 100,
    after_help = "\
Examples:
  hapt                                     the notes' wheel under four methods
  hapt sim worlds/notes/euler.toml         run a world's scenarios
  hapt check worlds/notes/euler.toml       whether its loop holds
  hapt design --travel 45deg --torque 800Nmm --frequency 1Hz > wheel.toml"
)]
pub struct Args {
    #[command(subcommand)]
    pub command: Option<Command>,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run the scenarios of a world on an exact simulation of device and hand.
    #[command(after_help = "\
Examples:
  hapt sim wheel.toml                                a summary of every scenario
  hapt sim wheel.toml --scenario step --out runs     runs/step.csv
  hapt sim wheel.toml --set loop.period=2ms          the same at another period
  hapt design --travel 45deg --torque 800Nmm --frequency 1Hz | hapt sim -")]
    Sim(SimArgs),
    /// Whether the loop holds: eigenvalues, growth, critical period.
    #[command(after_help = "\
Examples:
  hapt check wheel.toml                              exit code 1 when unstable
  hapt check wheel.toml --json                       in numbers
  hapt check wheel.toml --set loop.method=trapezoidal")]
    Check(CheckArgs),
    /// Stiffness, inertia and compensating damping from a specification, as a world file.
    #[command(after_help = "\
Examples:
  hapt design --travel 45deg --torque 800Nmm --frequency 1Hz > wheel.toml
  hapt design --travel 30deg --torque 1Nm --frequency 2Hz --period 0.5ms --json")]
    Design(DesignArgs),
}

/// The world, as every command takes it.
#[derive(Debug, clap::Args)]
pub struct WorldArgs {
    /// The world file; - is standard input.
    #[arg(value_name = "WORLD")]
    pub path: PathBuf,
    /// Override a key of the world file by its dotted path, such as loop.period=2ms; repeatable.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
}

#[derive(Debug, clap::Args)]
pub struct SimArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// Run this scenario only; repeatable.
    #[arg(long = "scenario", value_name = "NAME")]
    pub scenarios: Vec<String>,
    /// Write NAME.csv for each scenario into this folder; without it, print a summary.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// The format of the files; repeatable.
    #[arg(long = "format", value_name = "FORMAT", value_enum, default_value = "csv")]
    pub formats: Vec<Format>,
}

/// A file format for runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// One line a sample, SI units in the header.
    Csv,
}

#[derive(Debug, clap::Args)]
pub struct CheckArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// Print the numbers as JSON.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, clap::Args)]
pub struct DesignArgs {
    /// How far the wheel is turned, such as '45 deg'.
    #[arg(long, value_name = "Q")]
    pub travel: String,
    /// The torque asked for there, such as '800 N mm'.
    #[arg(long, value_name = "Q")]
    pub torque: String,
    /// The natural frequency of the virtual wheel, such as '1 Hz'.
    #[arg(long, value_name = "Q")]
    pub frequency: String,
    /// The loop's period.
    #[arg(long, value_name = "Q", default_value = "1 ms")]
    pub period: String,
    /// Print the numbers as JSON instead of a world file.
    #[arg(long)]
    pub json: bool,
}
