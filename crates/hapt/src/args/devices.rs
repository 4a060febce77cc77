//! Arguments of the commands that use or simulate a device.

use std::path::PathBuf;

use hapt_host::DeviceAddress;

use super::{FigureArgs, WorldArgs};
use crate::failure::Failure;

/// The value of `--device`.
pub fn device(text: &str) -> Result<DeviceAddress, Failure> {
    text.parse().map_err(|wrong| Failure::input(format!("--device {text}: {wrong}")))
}

#[derive(Debug, clap::Args)]
pub struct RunArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// The device: sim, replay:FILE with the CSV of a run or a log, a drive (moteus:PATH, moteus:canX#ID, odrive:PATH@250k,
    /// simplefoc:PATH?volts-per-torque=20, ...), or hapt:PATH or hapt:PATH@BAUD with the serial port of a board that runs the loop.
    #[arg(long, value_name = "SPEC", default_value = "sim")]
    pub device: String,
    /// The scenario of the simulated device's hand, started after the fade-in.
    #[arg(long, value_name = "NAME", allow_hyphen_values = true)]
    pub scenario: Option<String>,
    /// The time at full torque; default: the scenario's duration, or until Ctrl-C.
    #[arg(long, value_name = "Q", allow_hyphen_values = true)]
    pub duration: Option<String>,
    /// Write every sample into this log.
    #[arg(long, value_name = "FILE.mcap")]
    pub log: Option<PathBuf>,
    /// Run a world that is not certified on a real device.
    #[arg(long)]
    pub uncertified: bool,
    #[command(flatten)]
    pub station: StationArgs,
    #[command(flatten)]
    pub realtime: RealtimeArgs,
}

// The arguments of a station on the others. A comment for the help would replace the command's.
#[derive(Debug, Default, clap::Args)]
pub struct StationArgs {
    /// The station of a network file that runs here.
    #[arg(long, value_name = "NAME")]
    pub station: Option<String>,
    /// Where this station receives the others' messages: over UDP, such as 0.0.0.0:7000, or on a CAN bus that all stations share, such as
    /// can:can0 or can:/dev/ttyACM0@500k with an slcan adapter; can:can0#RANGE with another range of identifiers than 256 of 1 to 511.
    #[arg(long, value_name = "IP:PORT|can:BUS", requires = "station")]
    pub listen: Option<String>,
    /// Over UDP: where another station receives its messages; once for each that a link joins to this one.
    #[arg(long = "peer", value_name = "NAME=HOST:PORT", requires = "station")]
    pub peers: Vec<String>,
    /// Over UDP: the file with the key that all stations share: 16 bytes or more, as random as those of `head -c 32 /dev/urandom`.
    #[arg(long, value_name = "FILE", requires = "station")]
    pub key: Option<PathBuf>,
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
    /// A log or a run's CSV (- is standard input), another program's CSV, or a device of hapt run.
    #[arg(value_name = "LOG_OR_DEVICE")]
    pub what: String,
    /// The columns of a CSV, with units after their last underscore; default: the usual names.
    #[arg(long, value_name = "time=NAME,position=NAME,torque=NAME")]
    pub columns: Option<String>,
    /// The time's column, as in --columns; a unit in brackets behind the name is the column's.
    #[arg(long, value_name = "COLUMN")]
    pub time: Option<String>,
    /// The position's column.
    #[arg(long, value_name = "COLUMN")]
    pub position: Option<String>,
    /// The column of a second torque on the device, from a sensor; its sign and scale are found.
    #[arg(long, value_name = "COLUMN", conflicts_with_all = ["coast", "handle", "against"])]
    pub force: Option<String>,
    /// The spring to ground of the recorded loop, for a CSV without torques.
    #[arg(long, value_name = "Q", allow_hyphen_values = true, conflicts_with = "coast")]
    pub spring: Option<String>,
    /// The record is a coast-down without torque.
    #[arg(long)]
    pub coast: bool,
    /// A known inertia; the motor's gain is then estimated in its place.
    #[arg(long, value_name = "Q", allow_hyphen_values = true)]
    pub inertia: Option<String>,
    /// Fit a handle on a flexible shaft too: its inertia, the shaft's stiffness and damping.
    #[arg(long, conflicts_with_all = ["world", "against", "write", "inertia", "coast", "plot"])]
    pub handle: bool,
    /// Counts a revolution, for positions in counts.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub counts: Option<f64>,
    /// The motor's torque constant in N m/A (linear: N/A), for a torque column in A, mA, V or mV.
    #[arg(long, value_name = "N_M_PER_A", allow_hyphen_values = true)]
    pub torque_constant: Option<f64>,
    /// The motor's winding resistance in ohm, for a torque column in V or mV: its torque is k/R (u - k w).
    #[arg(long, value_name = "OHM", allow_hyphen_values = true, conflicts_with = "inertia")]
    pub resistance: Option<f64>,
    /// Turns of the motor for one of the handle, where the torque column is of the motor's side.
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub ratio: Option<f64>,
    /// Use the record from this time on.
    #[arg(long, value_name = "Q", allow_hyphen_values = true)]
    pub from: Option<String>,
    /// Use the record up to this time.
    #[arg(long, value_name = "Q", allow_hyphen_values = true)]
    pub to: Option<String>,
    /// The world to certify with the result, and for a device its loop and limits.
    #[arg(long, value_name = "WORLD")]
    pub world: Option<PathBuf>,
    /// Compare the record with the device of this world's file: exit code 1 where it contradicts it.
    #[arg(long, value_name = "WORLD", conflicts_with_all = ["world", "write", "inertia"])]
    pub against: Option<PathBuf>,
    /// Override a key of that world by its dotted path, such as loop.period=2ms; repeatable.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// A table's column of torques; for an experiment its largest torque, by default a tenth of the motor's limit.
    #[arg(long, value_name = "COLUMN|Q", allow_hyphen_values = true)]
    pub torque: Option<String>,
    /// The duration of the experiment.
    #[arg(long, value_name = "Q", allow_hyphen_values = true, default_value = "5 s")]
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
    /// Draw positions, fit and residuals.
    #[arg(long, value_name = "FILE.svg|png|pdf")]
    pub plot: Option<PathBuf>,
    #[command(flatten)]
    pub figure: FigureArgs,
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
    /// moteus, odrive or simplefoc; simplefoc?torque-constant=0.05 controls a current.
    #[arg(value_name = "DRIVE")]
    pub make: String,
    /// The world whose puck the drive moves; default: the notes' wheel (@notes/wheel).
    #[arg(value_name = "WORLD")]
    pub world: Option<PathBuf>,
    /// Override a key of the world file by its dotted path, such as device.inertia=1e-3; repeatable.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// Use a new serial port, whose path is the first line on standard output.
    #[arg(long)]
    pub pty: bool,
    /// Use this CAN interface, such as vcan0.
    #[arg(long, value_name = "IF")]
    pub can: Option<String>,
    /// Its identifier on the bus.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub id: u8,
    /// The scenario of a hand on the wheel, from the start.
    #[arg(long, value_name = "NAME", allow_hyphen_values = true)]
    pub scenario: Option<String>,
    /// The loop advances the time: one period of the world at each query of the position.
    #[arg(long)]
    pub lockstep: bool,
    /// The duration; default: until Ctrl-C.
    #[arg(long, value_name = "Q", allow_hyphen_values = true)]
    pub duration: Option<String>,
}

#[derive(Debug, clap::Args)]
pub struct LatencyArgs {
    /// The world file; default: the notes' wheel (@notes/default).
    #[arg(value_name = "WORLD")]
    pub world: Option<PathBuf>,
    /// Override a key of the world file by its dotted path, such as loop.period=2ms; repeatable.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// The duration.
    #[arg(long, value_name = "Q", allow_hyphen_values = true, default_value = "10 s")]
    pub duration: String,
    #[command(flatten)]
    pub realtime: RealtimeArgs,
    /// Print the numbers as JSON.
    #[arg(long)]
    pub json: bool,
}

// Scheduling of the loop's thread. (A doc comment would become the command's own description.)
#[derive(Clone, Debug, clap::Args)]
pub struct RealtimeArgs {
    /// Poll the clock for this time before each sample instead of sleeping, such as 100us.
    #[arg(long, value_name = "Q", allow_hyphen_values = true)]
    pub spin: Option<String>,
    /// The loop's priority under SCHED_FIFO, from 1 to 99; 0: an ordinary thread.
    #[arg(long, value_name = "N", default_value_t = 80, value_parser = clap::value_parser!(u8).range(0..=99))]
    pub priority: u8,
}

#[derive(Debug, clap::Args)]
pub struct WheelArgs {
    /// The world file, - or @NAME, with the end stops and the feel without a game; default: two soft stops.
    #[arg(value_name = "WORLD")]
    pub path: Option<PathBuf>,
    /// Override a key of the world file by its dotted path, such as loop.period=2ms; repeatable.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// The device: sim, or a drive of hapt run.
    #[arg(long, value_name = "SPEC", default_value = "sim")]
    pub device: String,
    /// From one end of the steering to the other; the default world's stops are there.
    #[arg(long, value_name = "Q", allow_hyphen_values = true, default_value = "900 deg")]
    pub range: String,
    /// The time at full torque; default: the scenario's duration, or until Ctrl-C.
    #[arg(long, value_name = "Q", allow_hyphen_values = true)]
    pub duration: Option<String>,
    /// Write every sample into this log.
    #[arg(long, value_name = "FILE.mcap")]
    pub log: Option<PathBuf>,
    /// The scenario of the simulated wheel's hand, started after the fade-in.
    #[arg(long, value_name = "NAME", allow_hyphen_values = true, conflicts_with_all = ["page", "conform"])]
    pub scenario: Option<String>,
    /// Only measure the loop that a game closes over the wheel: add no damping and hold nothing back.
    #[arg(long)]
    pub dry: bool,
    /// Show the wheel, its effects and its pedals on a page, as hapt live does; the page records.
    #[arg(long, conflicts_with_all = ["duration", "log"])]
    pub page: bool,
    /// The port of the page; 0: any free port.
    #[arg(long, value_name = "N", default_value_t = hapt_live::PORT, requires = "page")]
    pub port: u16,
    #[command(flatten)]
    pub conform: ConformArgs,
    #[command(flatten)]
    pub realtime: RealtimeArgs,
}

/// The parameters of a wheel for games.
#[derive(Clone, Copy, Debug)]
pub struct Steering {
    /// From one end to the other, rad.
    pub range: f64,
    /// The loop that a game closes is measured only.
    pub dry: bool,
}

// Judging a wheel that is there. (A doc comment would become the command's own description.)
#[derive(Debug, clap::Args)]
pub struct ConformArgs {
    /// Judge a wheel that this computer has, whoever made it: play each effect, and compare its motion with the standard's meaning.
    #[arg(
        long,
        value_name = "DEVICE",
        num_args = 0..=1,
        conflicts_with_all = ["path", "sets", "device", "range", "duration", "log", "dry", "page", "spin", "priority"]
    )]
    pub conform: Option<Option<PathBuf>>,
    /// Move the wheel without asking.
    #[arg(long, requires = "conform")]
    pub yes: bool,
    /// The largest torque of an effect, in % of the wheel's; making it swing takes up to twice that.
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u8).range(5..=50), requires = "conform")]
    pub level: u8,
    /// Run only these cases, by their names in the table.
    #[arg(long, value_name = "CASE,...", value_delimiter = ',', requires = "conform")]
    pub only: Vec<String>,
    /// Write a page with every case and its curves.
    #[arg(short, long, value_name = "FILE.html", requires = "conform")]
    pub out: Option<PathBuf>,
}

#[derive(Debug, clap::Args)]
pub struct LiveArgs {
    /// World files, - or @NAME, or a folder or group (@knob) of them: the page switches between several; default: the notes' wheel.
    #[arg(value_name = "WORLD")]
    pub paths: Vec<PathBuf>,
    /// Override a key of the world files by its dotted path, such as loop.period=2ms; repeatable.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// The port of the page; 0: any free port.
    #[arg(long, value_name = "N", default_value_t = hapt_live::PORT)]
    pub port: u16,
    /// The device: sim, the exact simulation with a hand from the page, or a device of hapt run.
    #[arg(long, value_name = "SPEC", default_value = "sim")]
    pub device: String,
    /// Run a world that is not certified on a real device.
    #[arg(long)]
    pub uncertified: bool,
    /// Listen on this address for other machines; clients then need the token in the printed link.
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
