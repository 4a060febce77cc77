//! Arguments of the commands that analyse a loop, or create one.

use std::path::PathBuf;

use clap::ValueEnum;

use super::{FigureArgs, WorldArgs};

#[derive(Debug, clap::Args)]
pub struct CheckArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// Omit the search for remedies and margins.
    #[arg(long)]
    pub no_remedies: bool,
    /// Print eigenvalues, modes, reasons and notes too.
    #[arg(long, conflicts_with = "json")]
    pub why: bool,
    /// Print the numbers as JSON.
    #[arg(long)]
    pub json: bool,
    /// Write what makes its claims checkable without hapt here.
    #[arg(long, value_name = "FILE.json")]
    pub proof: Option<PathBuf>,
}

#[derive(Debug, clap::Args)]
pub struct DesignArgs {
    /// The travel of the wheel, such as '45 deg'.
    #[arg(long, value_name = "Q", allow_hyphen_values = true)]
    pub travel: String,
    /// The torque at that travel, such as '800 N mm'.
    #[arg(long, value_name = "Q", allow_hyphen_values = true)]
    pub torque: String,
    /// The natural frequency of the virtual wheel, such as '1 Hz'.
    #[arg(long, value_name = "Q", allow_hyphen_values = true)]
    pub frequency: String,
    /// The loop's period.
    #[arg(long, value_name = "Q", allow_hyphen_values = true, default_value = "1 ms")]
    pub period: String,
    /// Print the numbers as JSON instead of a world file.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, clap::Args)]
pub struct WorstArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// Write the world with the scenario `worst` here; default: print the scenario.
    #[arg(short, long, value_name = "FILE.toml")]
    pub out: Option<PathBuf>,
    /// Print the numbers as JSON.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, clap::Args)]
pub struct ImpedanceArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// The lowest frequency; default: below the slowest mode of the world.
    #[arg(long, value_name = "HZ", allow_hyphen_values = true)]
    pub from: Option<String>,
    /// The highest frequency; default: half of the sampling rate.
    #[arg(long, value_name = "HZ", allow_hyphen_values = true)]
    pub to: Option<String>,
    /// The number of rows, spaced by equal ratios; default: 200, for a Z-width 80.
    #[arg(long, value_name = "N")]
    pub points: Option<usize>,
    /// The slope of nonlinear couplings.
    #[arg(long, value_name = "WHICH", value_enum, default_value = "steep")]
    pub slopes: SlopesArg,
    /// Compute the springs and dampers to ground that the device can render, passive and stable hands-off, in place of the world.
    #[arg(long, conflicts_with_all = ["from", "to", "slopes"])]
    pub z_width: bool,
    /// Write the rows here, and print no summary.
    #[arg(short, long, value_name = "FILE.csv")]
    pub out: Option<PathBuf>,
    /// Draw them.
    #[arg(long, value_name = "FILE.svg|png|pdf")]
    pub plot: Option<PathBuf>,
    #[command(flatten)]
    pub figure: FigureArgs,
    /// Print the numbers as JSON.
    #[arg(long)]
    pub json: bool,
}

/// The slope of a wall, a detent or a bristle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SlopesArg {
    /// The steepest rise: walls in contact.
    Steep,
    /// None: walls out of contact.
    Flat,
}

#[derive(Debug, clap::Args)]
pub struct BoundaryArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// A key and its range, such as loop.period=1ms..10ms, or 1ms..10ms:log; twice: horizontal and vertical axis.
    #[arg(long = "vary", value_name = "KEY=FROM..TO[:log]", required = true)]
    pub axes: Vec<String>,
    /// The edges, separated by commas; default, all of them: held,free,passive,certified, and of a network passive,fixed.
    #[arg(long = "of", value_name = "NAME,...", value_delimiter = ',')]
    pub claims: Vec<String>,
    /// Write the edges' points here; default: standard output.
    #[arg(short, long, value_name = "FILE.csv")]
    pub out: Option<PathBuf>,
    /// Draw the plane, each side of each edge in its colour.
    #[arg(long, value_name = "FILE.svg|png|pdf")]
    pub plot: Option<PathBuf>,
    #[command(flatten)]
    pub figure: FigureArgs,
}
