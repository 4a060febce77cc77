//! Arguments of the commands that simulate a world and show the results.

use std::path::PathBuf;

use clap::{Subcommand, ValueEnum};
use hapt_sweep::Shard;

use super::{FigureArgs, WorldArgs};

#[derive(Debug, clap::Args)]
pub struct SimArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// Run this scenario only; repeatable.
    #[arg(long = "scenario", value_name = "NAME", allow_hyphen_values = true)]
    pub scenarios: Vec<String>,
    /// Write NAME.csv (or .mcap, .parquet) for each scenario into this folder; without it, print a summary.
    #[arg(short, long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Replace runs of another world in this folder; .hapt-runs.json there says what made each.
    #[arg(long, requires = "out")]
    pub force: bool,
    /// The format of the files; repeatable. mcap and parquet need --out.
    #[arg(long = "format", value_name = "FORMAT", value_enum, default_value = "csv")]
    pub formats: Vec<Format>,
}

/// A file format for runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// One line a sample, SI units in the header.
    Csv,
    /// A log, with the world and its certificate, as Foxglove and PlotJuggler read it.
    Mcap,
    /// A table, units in the columns' metadata.
    Parquet,
}

#[derive(Debug, clap::Args)]
pub struct ReportArgs {
    /// The world files; - is standard input, @NAME a built-in world (hapt worlds lists them).
    #[arg(value_name = "WORLD", required = true)]
    pub worlds: Vec<PathBuf>,
    /// Override a key of every world by its dotted path, such as loop.period=2ms; repeatable.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// Write NAME.html, NAME-FIGURE.svg and live/NAME.html, an interactive page, for each world into this folder, and index.html for
    /// several.
    #[arg(short, long, value_name = "DIR")]
    pub out: PathBuf,
}

#[derive(Debug, clap::Args)]
pub struct PlotArgs {
    /// Runs of hapt sim --out, or logs; - is standard input. Several are overlaid.
    #[arg(value_name = "CSV or LOG", required = true)]
    pub runs: Vec<PathBuf>,
    /// Draw from this time on, such as '0.5 s'.
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    pub from: Option<String>,
    /// Draw up to this time.
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    pub to: Option<String>,
    /// Draw only these, separated by commas: position, velocity, torque.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub signals: Vec<String>,
    /// The motor's limit, such as '822.25 N mm', to draw it and to mark where it is exceeded; a log has its own.
    #[arg(long, value_name = "Q", allow_hyphen_values = true)]
    pub limit: Option<String>,
    /// Write the figure here; default: standard output.
    #[arg(short, long, value_name = "FILE.svg|png|pdf")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub figure: FigureArgs,
}

#[derive(Debug, Subcommand)]
pub enum LogCommand {
    /// Run a log's inputs through the present core and compare the torques bit by bit.
    #[command(after_help = "\
Examples:
  hapt log replay runs/step.mcap                     exit code 1 if not the same
  hapt log replay runs/step.mcap --json              with the first difference")]
    Replay(ReplayArgs),
    /// Convert a log to CSV or Parquet, or repair a truncated log.
    #[command(after_help = "\
Examples:
  hapt log convert runs/step.mcap -o step.csv        the bytes of hapt sim's own
  hapt log convert runs/step.mcap -o step.parquet    units as metadata
  hapt log convert runs/step.mcap -o whole.mcap      a truncated one repaired")]
    Convert(ConvertArgs),
}

#[derive(Debug, clap::Args)]
pub struct ReplayArgs {
    /// A log of hapt sim, hapt run or hapt live; - is standard input.
    #[arg(value_name = "LOG")]
    pub log: PathBuf,
    /// Print the outcome as JSON.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, clap::Args)]
pub struct ConvertArgs {
    /// A log of hapt sim, hapt run or hapt live; - is standard input.
    #[arg(value_name = "LOG")]
    pub log: PathBuf,
    /// The output: FILE.csv, FILE.parquet or FILE.mcap.
    #[arg(short, long, value_name = "FILE")]
    pub out: PathBuf,
    /// Only the samples of this plan: worlds are numbered from 0, one more with each change while the loop ran.
    #[arg(long, value_name = "N")]
    pub plan: Option<u32>,
}

#[derive(Debug, clap::Args)]
pub struct SweepArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// A key and its values, such as loop.period=1ms..10ms:50, or :50:log for equal ratios; repeatable, the last varies fastest.
    #[arg(long = "vary", value_name = "KEY=FROM..TO:N[:log]", required = true)]
    pub axes: Vec<String>,
    /// The measures, separated by commas; --measure help lists them.
    #[arg(long = "measure", value_name = "NAME,...", value_delimiter = ',', required = true)]
    pub measures: Vec<String>,
    /// The scenario to run, if the world has several.
    #[arg(long, value_name = "NAME", allow_hyphen_values = true)]
    pub scenario: Option<String>,
    /// Write the table here: FILE.csv or FILE.parquet.
    #[arg(short, long, value_name = "FILE")]
    pub out: PathBuf,
    /// Draw the first measure: a curve over one axis, a map over two.
    #[arg(long, value_name = "FILE.svg|png|pdf")]
    pub plot: Option<PathBuf>,
    #[command(flatten)]
    pub figure: FigureArgs,
    /// Continue an interrupted sweep into the same file.
    #[arg(long)]
    pub resume: bool,
    /// Compute only shard I of N, from 0/N to N-1/N. The shards in order are the table; the first has the CSV's header.
    #[arg(long, value_name = "I/N", conflicts_with = "plot")]
    pub shard: Option<Shard>,
    /// Threads; default: all cores. The bytes do not depend on it.
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
}

#[derive(Debug, Subcommand)]
pub enum ExportCommand {
    /// Write an FMU: the loop, or with --whole the loop on its device, for co-simulation.
    #[command(after_help = "\
Examples:
  hapt export fmu wheel.toml -o wheel.fmu            the loop, by FMI 2.0
  hapt export fmu wheel.toml -o wheel3.fmu --fmi 3   by FMI 3.0
  hapt export fmu wheel.toml -o whole.fmu --whole    with its exact device")]
    Fmu(FmuArgs),
    /// Write one C99 file and its header: the loop and its supervisor, with the bits of hapt's own, for any board.
    #[command(after_help = "\
Examples:
  hapt export c @devices/magnets -o knob.c                    knob.c and knob.h
  hapt export c @devices/magnets -o knob.c --float f64        in double
  hapt export c @devices/magnets -o knob.c --arduino Knob     for the Arduino IDE
  hapt export c @devices/magnets -o knob.c --tune all         with knob_set()")]
    C(CArgs),
}

#[derive(Debug, clap::Args)]
pub struct CArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// The output: FILE.c. Its name begins all names in it.
    #[arg(short, long, value_name = "FILE")]
    pub out: PathBuf,
    /// The header; default: FILE.h.
    #[arg(long, value_name = "FILE")]
    pub header: Option<PathBuf>,
    /// The numbers that it computes with.
    #[arg(long, value_name = "f32|f64", value_parser = ["f32", "f64"], default_value = "f32")]
    pub float: String,
    /// The device measures the velocity: a step takes it, where the estimator is exact.
    #[arg(long)]
    pub velocity: bool,
    /// Write a world that is not certified.
    #[arg(long)]
    pub uncertified: bool,
    /// A number of a coupling that the C may change within its certified range, such as couplings.0.stiffness; repeatable. `all`: all that can
    /// be.
    #[arg(long = "tune", value_name = "KEY")]
    pub tunes: Vec<String>,
    /// Write an Arduino library with examples into this folder too.
    #[arg(long, value_name = "DIR")]
    pub arduino: Option<PathBuf>,
}

#[derive(Debug, clap::Args)]
pub struct FmuArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// The output: FILE.fmu.
    #[arg(short, long, value_name = "FILE")]
    pub out: PathBuf,
    /// The version of the standard.
    #[arg(long, value_name = "2|3", value_parser = ["2", "3"], default_value = "2")]
    pub fmi: String,
    /// The loop on its device: from the hand's torque to the columns of a run.
    #[arg(long)]
    pub whole: bool,
    /// Add a library that was built for another platform, such as hapt_fmi.dll; repeatable.
    #[arg(long = "platform", value_name = "LIBRARY")]
    pub platforms: Vec<PathBuf>,
}
