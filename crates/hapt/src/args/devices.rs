//! What the commands take that speak to a device, or are one.

use std::path::PathBuf;

use super::WorldArgs;

#[derive(Debug, clap::Args)]
pub struct RunArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// The device: sim, replay:FILE with the CSV of a run or a log, a drive (moteus:PATH, moteus:canX#ID, odrive:PATH@250k, ...), or
    /// hapt:PATH or hapt:PATH@BAUD with the serial port of a board that runs the loop.
    #[arg(long, value_name = "SPEC", default_value = "sim")]
    pub device: String,
    /// The scenario that the simulated device's hand plays once the torque is all there.
    #[arg(long, value_name = "NAME")]
    pub scenario: Option<String>,
    /// How long at full torque; without it the scenario's, or until Ctrl-C.
    #[arg(long, value_name = "Q")]
    pub duration: Option<String>,
    /// Write every sample into this log.
    #[arg(long, value_name = "FILE.mcap")]
    pub log: Option<PathBuf>,
    /// Run a world that is not certified on a real device.
    #[arg(long)]
    pub uncertified: bool,
    #[command(flatten)]
    pub realtime: RealtimeArgs,
}

#[derive(Debug, clap::Args)]
pub struct FlashArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// The board: hapt:PATH or hapt:PATH@BAUD with its serial port.
    #[arg(long, value_name = "SPEC")]
    pub device: String,
    /// Send a world that is not certified.
    #[arg(long)]
    pub uncertified: bool,
}

#[derive(Debug, clap::Args)]
pub struct IdentifyArgs {
    /// A log or a run's CSV (- is standard input), another program's CSV, or a device as hapt run takes it.
    #[arg(value_name = "LOG_OR_DEVICE")]
    pub what: String,
    /// The columns of a CSV, units behind their last underscore; without it, by the usual names.
    #[arg(long, value_name = "time=NAME,position=NAME,torque=NAME")]
    pub columns: Option<String>,
    /// The spring to ground that a loop ran, where the CSV has no torques.
    #[arg(long, value_name = "Q", conflicts_with = "coast")]
    pub spring: Option<String>,
    /// No torque was on: the puck coasted down.
    #[arg(long)]
    pub coast: bool,
    /// The inertia, where it is known: then the motor's gain is found in its place.
    #[arg(long, value_name = "Q")]
    pub inertia: Option<String>,
    /// Counts a revolution, for positions in counts.
    #[arg(long, value_name = "N")]
    pub counts: Option<f64>,
    /// Only what is from this time on.
    #[arg(long, value_name = "Q")]
    pub from: Option<String>,
    /// Only what is up to this time.
    #[arg(long, value_name = "Q")]
    pub to: Option<String>,
    /// The world whose certificate is asked for, and for a device its loop and limits.
    #[arg(long, value_name = "WORLD")]
    pub world: Option<PathBuf>,
    /// Override a key of that world by its dotted path, such as loop.period=2ms; repeatable.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// The experiment's largest torque; a tenth of the motor's limit without it.
    #[arg(long, value_name = "Q")]
    pub torque: Option<String>,
    /// How long the experiment takes.
    #[arg(long, value_name = "Q", default_value = "5 s")]
    pub duration: String,
    /// Move a real device without asking.
    #[arg(long)]
    pub yes: bool,
    /// Write every sample of the experiment into this log.
    #[arg(long, value_name = "FILE.mcap")]
    pub log: Option<PathBuf>,
    /// Write the device table here.
    #[arg(long, value_name = "FILE.toml")]
    pub write: Option<PathBuf>,
    /// Draw positions, fit and what it leaves.
    #[arg(long, value_name = "FILE.svg|png")]
    pub plot: Option<PathBuf>,
    /// Print the numbers as JSON.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub realtime: RealtimeArgs,
}

#[derive(Debug, clap::Args)]
#[group(skip)]
#[command(group = clap::ArgGroup::new("place").required(true).args(["pty", "can"]))]
pub struct SimulateDriveArgs {
    /// moteus or odrive.
    #[arg(value_name = "DRIVE")]
    pub make: String,
    /// The world whose puck hangs on it; the notes' wheel (@notes/wheel) without it.
    #[arg(value_name = "WORLD")]
    pub world: Option<PathBuf>,
    /// Override a key of the world file by its dotted path, such as device.inertia=1e-3; repeatable.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// At the end of a new serial port, whose path is the first line on standard output.
    #[arg(long)]
    pub pty: bool,
    /// On this CAN interface, such as vcan0.
    #[arg(long, value_name = "IF")]
    pub can: Option<String>,
    /// Its identifier on the bus.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub id: u8,
    /// The scenario that a hand on the wheel plays from the start.
    #[arg(long, value_name = "NAME")]
    pub scenario: Option<String>,
    /// Time passes by the loop: a period of the world each time that it asks for the position.
    #[arg(long)]
    pub lockstep: bool,
    /// For how long; without it until Ctrl-C.
    #[arg(long, value_name = "Q")]
    pub duration: Option<String>,
}

#[derive(Debug, clap::Args)]
pub struct LatencyArgs {
    /// The world file; the notes' wheel (@notes/default) without it.
    #[arg(value_name = "WORLD")]
    pub world: Option<PathBuf>,
    /// Override a key of the world file by its dotted path, such as loop.period=2ms; repeatable.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// How long.
    #[arg(long, value_name = "Q", default_value = "10 s")]
    pub duration: String,
    #[command(flatten)]
    pub realtime: RealtimeArgs,
    /// Print the numbers as JSON.
    #[arg(long)]
    pub json: bool,
}

// What the loop's thread asks of the system. (A doc comment would be the command's own description.)
#[derive(Debug, clap::Args)]
pub struct RealtimeArgs {
    /// Watch the clock for the last so long before each sample instead of sleeping, such as 100us.
    #[arg(long, value_name = "Q")]
    pub spin: Option<String>,
    /// The loop's priority under SCHED_FIFO, from 1 to 99; 0: as any other program.
    #[arg(long, value_name = "N", default_value_t = 80, value_parser = clap::value_parser!(u8).range(0..=99))]
    pub priority: u8,
}

#[derive(Debug, clap::Args)]
pub struct LiveArgs {
    /// The world file, - or @NAME; without it, the notes' wheel.
    #[arg(value_name = "WORLD")]
    pub path: Option<PathBuf>,
    /// Override a key of the world file by its dotted path, such as loop.period=2ms; repeatable.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// The port of the page; 0 takes one that is free.
    #[arg(long, value_name = "N", default_value_t = hapt_live::PORT)]
    pub port: u16,
    /// What the loop drives: sim, the exact simulation with a hand from the page; or what hapt run drives.
    #[arg(long, value_name = "SPEC", default_value = "sim")]
    pub device: String,
    /// Run a world that is not certified on a real device.
    #[arg(long)]
    pub uncertified: bool,
    /// Listen on this address of the machine, for other machines too; pages then need the token in the printed link.
    #[arg(long, value_name = "ADDRESS")]
    pub listen: Option<String>,
    /// The folder for recordings.
    #[arg(long, value_name = "DIR", default_value = ".")]
    pub log_dir: PathBuf,
    /// Open the page in the browser.
    #[arg(long)]
    pub open: bool,
    #[command(flatten)]
    pub realtime: RealtimeArgs,
}
