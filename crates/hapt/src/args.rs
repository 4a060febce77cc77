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
  hapt sim @notes/euler                    run a world's scenarios
  hapt check @notes/euler                  whether its loop holds
  hapt init my-world                       a world file to start from
  hapt design --travel 45deg --torque 800Nmm --frequency 1Hz > wheel.toml"
)]
pub struct Args {
    #[command(subcommand)]
    pub command: Option<Command>,
}

// A command's own arguments are made when it is the one.
#[derive(Debug, Subcommand)]
#[command(defer = true)]
pub enum Command {
    /// Run the scenarios of a world on an exact simulation of device and hand.
    #[command(after_help = "\
Examples:
  hapt sim wheel.toml                                a summary of every scenario
  hapt sim wheel.toml --scenario step --out runs     runs/step.csv
  hapt sim wheel.toml --out runs --format mcap       runs/step.mcap, a log
  hapt sim wheel.toml --set loop.period=2ms          the same at another period
  hapt design --travel 45deg --torque 800Nmm --frequency 1Hz | hapt sim -")]
    Sim(SimArgs),
    /// The certificate: stable held and let go, passive; and what would make it so.
    #[command(after_help = "\
Examples:
  hapt check wheel.toml                              exit code 1 when refused
  hapt check wheel.toml --json                       in numbers
  hapt check wheel.toml --set loop.method=trapezoidal")]
    Check(CheckArgs),
    /// Stiffness, inertia and compensating damping from a specification, as a world file.
    #[command(after_help = "\
Examples:
  hapt design --travel 45deg --torque 800Nmm --frequency 1Hz > wheel.toml
  hapt design --travel 30deg --torque 1Nm --frequency 2Hz --period 0.5ms --json")]
    Design(DesignArgs),
    /// A page a world: diagram, verdict, eigenvalues, motion, torque and energy over time.
    #[command(after_help = "\
Examples:
  hapt report wheel.toml --out report                    a page, and figures
  hapt report @notes/euler @notes/damped --out report    and an index
  hapt report wheel.toml --set loop.period=5ms --out report")]
    Report(ReportArgs),
    /// Position, velocity and torque over time as an SVG, from a run's CSV or from a log.
    #[command(after_help = "\
Examples:
  hapt plot runs/step.csv > step.svg                 as hapt sim wrote it
  hapt plot runs/step.mcap --out step.svg            with its motor's limit
  hapt plot runs/step.csv --limit 822.25Nmm --out step.svg")]
    Plot(PlotArgs),
    /// A log's inputs through today's core: are the torques the same bits?
    #[command(after_help = "\
Examples:
  hapt replay runs/step.mcap                         exit code 1 if not
  hapt replay runs/step.mcap --json                  with the first difference")]
    Replay(ReplayArgs),
    /// A log as CSV or Parquet; or as a log, whole again where it was cut.
    #[command(after_help = "\
Examples:
  hapt convert runs/step.mcap -o step.csv            the bytes of hapt sim's own
  hapt convert runs/step.mcap -o step.parquet        units as metadata")]
    Convert(ConvertArgs),
    /// Every combination of a few numbers of a world, measured: a table, a picture.
    #[command(after_help = "\
Examples:
  hapt sweep wheel.toml --vary loop.period=0.1ms..10ms:50:log \\
      --measure held_growth_per_s --out growth.csv
  hapt sweep wheel.toml --vary loop.period=1ms..20ms:40 \\
      --vary device.damping=0..0.01:40 --measure peak_torque,settling_time \\
      --scenario step --out map.parquet --plot map.svg")]
    Sweep(SweepArgs),
    /// Where in the plane of two keys a loop stops being stable or passive, exactly.
    #[command(after_help = "\
Examples:
  hapt boundary wheel.toml --vary loop.period=0.1ms..10ms:log \\
      --vary device.damping=0..0.01 --out edges.csv --plot edges.svg
  hapt boundary @devices/eth-wall --vary couplings.0.damping=0..0.02 \\
      --vary couplings.0.stiffness=0..20 --of free,passive")]
    Boundary(BoundaryArgs),
    /// What the hand feels against frequency, and the Z-width of a device.
    #[command(after_help = "\
Examples:
  hapt impedance @notes/default                      up to which frequency
  hapt impedance wheel.toml --from 1Hz --to 100Hz --out felt.csv --plot felt.svg
  hapt impedance wheel.toml --z-width --plot z.svg   the walls it can stand for")]
    Impedance(ImpedanceArgs),
    /// The passive hand that draws most energy from the loop, and whether it breaks it.
    #[command(after_help = "\
Examples:
  hapt worst wheel.toml                              exit code 1 when broken
  hapt worst wheel.toml --set loop.output=start --out broken.toml || \\
      hapt sim broken.toml --scenario worst")]
    Worst(WorstArgs),
    /// A world in real time on a device, the torque off at the end.
    #[command(after_help = "\
Examples:
  hapt run wheel.toml --duration 1s                  on the simulated device
  hapt run wheel.toml --scenario step                with a hand that plays it
  hapt sim wheel.toml --out runs && \\
      hapt run wheel.toml --device replay:runs/step.csv
  hapt run wheel.toml --device hapt:/dev/ttyACM0     the loop on a board")]
    Run(RunArgs),
    /// A world onto a board that runs hapt's firmware: checked, sent, verified.
    #[command(after_help = "\
Examples:
  hapt flash wheel.toml --device hapt:/dev/ttyACM0
  hapt run wheel.toml --device hapt:/dev/ttyACM0     then it turns")]
    Flash(FlashArgs),
    /// What a device is made of, from a log or an experiment: inertia, friction, delay.
    #[command(after_help = "\
Examples:
  hapt identify sim --world wheel.toml --duration 2s --log wheel.mcap
  hapt identify wheel.mcap --plot fit.svg            from a log, with a picture
  hapt convert wheel.mcap -o log.csv && \\
      hapt identify log.csv \\
      --columns time=time_s,position=measured_rad,torque=applied_Nm")]
    Identify(IdentifyArgs),
    /// Serial ports and CAN interfaces, and the drives that may be behind them.
    #[command(after_help = "\
Examples:
  hapt devices                                       what --device may name")]
    Devices,
    /// A motor drive and its wheel, simulated, on a serial port or a CAN bus.
    #[command(after_help = "\
Examples:
  hapt simulate-drive moteus --pty --duration 1s     its port is the first line
  hapt simulate-drive odrive --pty --duration 1s     behind an slcan adapter
  hapt simulate-drive moteus --pty @notes/wheel --duration 1s --lockstep")]
    SimulateDrive(SimulateDriveArgs),
    /// How well this machine keeps a loop's time, and what would help.
    #[command(after_help = "\
Examples:
  hapt latency --duration 1s                         the notes' wheel at 1 ms
  hapt latency wheel.toml --duration 1s --spin 100us --json")]
    Latency(LatencyArgs),
    /// The loop in real time behind a page: grab the wheel and turn its numbers.
    #[command(after_help = "\
Examples:
  hapt live                                          the notes' wheel
  hapt live wheel.toml --port 0                      another world, any port
  hapt live @notes/euler --set loop.period=5ms")]
    Live(LiveArgs),
    /// A world file to start from, with comments, and its schema for editors.
    #[command(after_help = "\
Examples:
  hapt init                                          a spring and a mass, here
  hapt init my-wall --template wall                  in a folder of its own")]
    Init(InitArgs),
    /// List the built-in worlds, which go wherever a world file does.
    #[command(after_help = "\
Examples:
  hapt worlds
  hapt sim @notes/euler                              one of them")]
    Worlds,
    /// What a word in a message or a verdict means.
    #[command(after_help = "\
Examples:
  hapt explain                                       the topics
  hapt explain critical-period")]
    Explain(ExplainArgs),
    /// The JSON schema of world files, by which editors complete keys and check units.
    #[command(after_help = "\
Examples:
  hapt schema > hapt.schema.json                     as hapt init does")]
    Schema,
    /// A script by which a shell completes the command line.
    #[command(after_help = "\
Examples:
  hapt completions bash > hapt.bash                  then: . ./hapt.bash
  hapt completions fish > hapt.fish                  where fish looks")]
    Completions(CompletionsArgs),
    /// The manual page, or a page for each command.
    #[command(after_help = "\
Examples:
  hapt man > hapt.1                                  then: man -l hapt.1
  hapt man --out man                                 a page for each command")]
    Man(ManArgs),
}

// The world, as every command takes it. Flattened arguments have no doc comment: it would become the command's own.
#[derive(Debug, clap::Args)]
pub struct WorldArgs {
    /// The world file; - is standard input, @NAME a built-in world (hapt worlds lists them).
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
    /// Write NAME.csv (or .mcap, .parquet) for each scenario into this folder; without it, print a summary.
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
    /// A log, with the world and its certificate, as Foxglove and PlotJuggler read it.
    Mcap,
    /// A table, units in the columns' metadata.
    Parquet,
}

#[derive(Debug, clap::Args)]
pub struct CheckArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// Do not look for what would certify it, or for its margins.
    #[arg(long)]
    pub no_remedies: bool,
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

#[derive(Debug, clap::Args)]
pub struct ReportArgs {
    /// The world files; - is standard input, @NAME a built-in world (hapt worlds lists them).
    #[arg(value_name = "WORLD", required = true)]
    pub worlds: Vec<PathBuf>,
    /// Override a key of every world by its dotted path, such as loop.period=2ms; repeatable.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub sets: Vec<String>,
    /// Write NAME.html, NAME-FIGURE.svg and live/NAME.html, a page to grab it on, for each world into this folder, and index.html for
    /// several.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
}

#[derive(Debug, clap::Args)]
pub struct PlotArgs {
    /// A run as hapt sim --out writes it, or a log; - is standard input.
    #[arg(value_name = "CSV or LOG")]
    pub csv: PathBuf,
    /// The motor's limit, such as '822.25 N mm', to draw in and to mark what goes beyond; a log knows its own.
    #[arg(long, value_name = "Q")]
    pub limit: Option<String>,
    /// Write the figure here; without it, to standard output.
    #[arg(long, value_name = "FILE.svg")]
    pub out: Option<PathBuf>,
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
    /// Write it here: FILE.csv, FILE.parquet or FILE.mcap.
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
    /// What to measure: names with commas between; --measure help lists them.
    #[arg(long = "measure", value_name = "NAME,...", value_delimiter = ',', required = true)]
    pub measures: Vec<String>,
    /// The scenario that is run, where the world has several.
    #[arg(long, value_name = "NAME")]
    pub scenario: Option<String>,
    /// Write the table here: FILE.csv or FILE.parquet.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Draw the first measure: a curve over one axis, a map over two.
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
    /// Go on where the same sweep into the same file was interrupted.
    #[arg(long)]
    pub resume: bool,
    /// Threads; all cores without it. The bytes are the same.
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
}

#[derive(Debug, clap::Args)]
pub struct WorstArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// Write the world with the scenario `worst` here; without it, the scenario is printed.
    #[arg(long, value_name = "FILE.toml")]
    pub out: Option<PathBuf>,
    /// Print the numbers as JSON.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, clap::Args)]
pub struct ImpedanceArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// The lowest frequency; without it, below the slowest swing of the world.
    #[arg(long, value_name = "HZ")]
    pub from: Option<String>,
    /// The highest frequency; without it, half of the sampling rate.
    #[arg(long, value_name = "HZ")]
    pub to: Option<String>,
    /// Rows, equal ratios apart: 200; dampers of a Z-width: 80.
    #[arg(long, value_name = "N")]
    pub points: Option<usize>,
    /// On which slope nonlinear couplings are taken.
    #[arg(long, value_name = "WHICH", value_enum, default_value = "steep")]
    pub slopes: SlopesArg,
    /// In place of the world, the springs and dampers to ground that the device can stand for, passive and stable let go.
    #[arg(long, conflicts_with_all = ["from", "to", "slopes"])]
    pub z_width: bool,
    /// Write the rows here, and print no summary.
    #[arg(long, value_name = "FILE.csv")]
    pub out: Option<PathBuf>,
    /// Draw them.
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
    /// Print the numbers as JSON.
    #[arg(long)]
    pub json: bool,
}

/// The slope of a wall, a detent or a bristle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SlopesArg {
    /// The steepest rise: a wall is touched.
    Steep,
    /// None: no wall is touched.
    Flat,
}

#[derive(Debug, clap::Args)]
pub struct BoundaryArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// A key and its range, such as loop.period=1ms..10ms, or 1ms..10ms:log; twice: to the right, and up.
    #[arg(long = "vary", value_name = "KEY=FROM..TO[:log]", required = true)]
    pub axes: Vec<String>,
    /// Whose edges: held, free, passive, with commas between.
    #[arg(long = "of", value_name = "NAME,...", value_delimiter = ',', default_value = "held,free,passive")]
    pub claims: Vec<String>,
    /// Write the edges' points here; without it, to standard output.
    #[arg(long, value_name = "FILE.csv")]
    pub out: Option<PathBuf>,
    /// Draw the plane, each side of each edge in its colour.
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
}

#[derive(Debug, clap::Args)]
pub struct RunArgs {
    #[command(flatten)]
    pub world: WorldArgs,
    /// The device: sim, replay:FILE with the CSV of a run or a log, a drive (moteus:PATH, moteus:canX#ID, odrive:...), or hapt:PATH with
    /// the serial port of a board that runs the loop.
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
    /// The board: hapt:PATH with its serial port.
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
    #[arg(long, value_name = "FILE.svg")]
    pub plot: Option<PathBuf>,
    /// Print the numbers as JSON.
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub realtime: RealtimeArgs,
}

#[derive(Debug, clap::Args)]
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
    #[arg(long, required_unless_present = "can")]
    pub pty: bool,
    /// On this CAN interface, such as vcan0.
    #[arg(long, value_name = "IF", conflicts_with = "pty")]
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

#[derive(Debug, clap::Args)]
pub struct InitArgs {
    /// The folder for world.toml and hapt.schema.json; made when it is not there.
    #[arg(value_name = "DIR", default_value = ".")]
    pub folder: PathBuf,
    /// What to start from: spring-mass, wall, detents, damper, inertia, friction, end-stops or two-wheels.
    #[arg(long, value_name = "NAME", default_value = "spring-mass")]
    pub template: String,
}

#[derive(Debug, clap::Args)]
pub struct ExplainArgs {
    /// A word from a message or a verdict, such as growth; without it, the list of topics.
    #[arg(value_name = "TOPIC")]
    pub topic: Option<String>,
}

#[derive(Debug, clap::Args)]
pub struct CompletionsArgs {
    /// The shell.
    #[arg(value_name = "SHELL", value_enum)]
    pub shell: clap_complete::Shell,
}

#[derive(Debug, clap::Args)]
pub struct ManArgs {
    /// Write hapt.1 and a page for each command into this folder.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}
