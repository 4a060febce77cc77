//! The arguments of the command line.

mod devices;
mod groups;
mod runs;
mod usage;
mod verdicts;

use std::path::PathBuf;

use clap::{Parser, Subcommand, ValueEnum};

pub use devices::*;
pub use runs::*;
pub use usage::*;
pub use verdicts::*;

/// Haptic rendering for one-axis devices: simulate a virtual world, certify its stability and passivity before the motor is
/// on, and run it in real time.
///
/// Without a command: the notes' virtual wheel, built in, under four methods.
#[derive(Debug, Parser)]
#[command(
    name = "hapt",
    // On Windows the file is hapt.exe.
    bin_name = "hapt",
    version,
    max_term_width = 100,
    help_template = groups::TEMPLATE,
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

// The arguments of a command are built only when it is used.
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
    /// Certify a world: stability held and hands-off, passivity, and remedies.
    #[command(after_help = "\
Examples:
  hapt check wheel.toml                              exit code 1 when refused
  hapt check wheel.toml --json                       in numbers
  hapt check wheel.toml --proof proof.json           what others can check it by
  hapt check wheel.toml --set loop.method=trapezoidal")]
    Check(CheckArgs),
    /// Compute stiffness, inertia and compensating damping from a specification, as a world file.
    #[command(after_help = "\
Examples:
  hapt design --travel 45deg --torque 800Nmm --frequency 1Hz > wheel.toml
  hapt design --travel 30deg --torque 1Nm --frequency 2Hz --period 0.5ms --json")]
    Design(DesignArgs),
    /// Write a page a world: diagram, verdict, eigenvalues, motion, torque and energy over time.
    #[command(after_help = "\
Examples:
  hapt report wheel.toml --out report                    a page, and figures
  hapt report @notes/euler @notes/damped --out report    and an index
  hapt report wheel.toml --set loop.period=5ms --out report")]
    Report(ReportArgs),
    /// Draw position, velocity and torque over time, from a run's CSV or from a log.
    #[command(after_help = "\
Examples:
  hapt plot runs/step.csv > step.svg                 as hapt sim wrote it
  hapt plot runs/step.mcap --out step.svg            with its motor's limit
  hapt plot runs/step.csv --limit 822.25Nmm --out step.svg
  hapt plot runs/step.csv --width '88 mm' --out step.pdf
  hapt plot runs/step.csv runs/step.mcap --to 0.2s --signals torque > both.svg")]
    Plot(PlotArgs),
    /// Replay a log through the present core, or convert it to CSV or Parquet.
    #[command(after_help = "\
Examples:
  hapt log replay runs/step.mcap                     exit code 1 if not the same
  hapt log convert runs/step.mcap -o step.csv        the bytes of hapt sim's own")]
    Log {
        #[command(subcommand)]
        command: LogCommand,
    },
    /// Export a world for the simulators and the boards of others.
    #[command(after_help = "\
Examples:
  hapt export fmu wheel.toml -o wheel.fmu            the loop as an FMU
  hapt export c @devices/magnets -o knob.c           as one C file")]
    Export {
        #[command(subcommand)]
        command: ExportCommand,
    },
    /// Measure every combination of a few numbers of a world, as a table and a picture.
    #[command(after_help = "\
Examples:
  hapt sweep wheel.toml --vary loop.period=0.1ms..10ms:50:log \\
      --measure held_growth_per_s --out growth.csv
  hapt sweep wheel.toml --vary loop.period=1ms..20ms:40 \\
      --vary device.damping=0..0.01:40 --measure peak_torque,settling_time \\
      --scenario step --out map.parquet --plot map.svg")]
    Sweep(SweepArgs),
    /// Trace the exact edges of stability and passivity in the plane of two keys.
    #[command(after_help = "\
Examples:
  hapt boundary wheel.toml --vary loop.period=0.1ms..10ms:log \\
      --vary device.damping=0..0.01 --out edges.csv --plot edges.svg
  hapt boundary @devices/eth-wall --vary couplings.0.damping=0..0.02 \\
      --vary couplings.0.stiffness=0..20 --of free,passive
  hapt boundary pair.toml --vary links.0.stiffness=0..1 \\
      --vary links.0.age_max=8ms..40ms                   a network of stations")]
    Boundary(BoundaryArgs),
    /// Compute the rendered impedance against frequency, or the Z-width of a device.
    #[command(after_help = "\
Examples:
  hapt impedance @notes/default                      up to which frequency
  hapt impedance wheel.toml --from 1Hz --to 100Hz --out felt.csv --plot felt.svg
  hapt impedance wheel.toml --z-width --plot z.svg   the walls it can stand for")]
    Impedance(ImpedanceArgs),
    /// Search for the passive hand that extracts most energy from the loop.
    #[command(after_help = "\
Examples:
  hapt worst wheel.toml                              exit code 1 when broken
  hapt worst wheel.toml --set loop.output=start --out broken.toml || \\
      hapt sim broken.toml --scenario worst")]
    Worst(WorstArgs),
    /// Run a world in real time on a device, and remove the torque at the end.
    #[command(after_help = "\
Examples:
  hapt run wheel.toml --duration 1s                  on the simulated device
  hapt run wheel.toml --scenario step                with a hand that plays it
  hapt sim wheel.toml --out runs && \\
      hapt run wheel.toml --device replay:runs/step.csv
  hapt run wheel.toml --device hapt:/dev/ttyACM0     the loop on a board")]
    Run(RunArgs),
    /// Certify a world, send it to a board with hapt's firmware, and verify it there.
    #[command(after_help = "\
Examples:
  hapt flash wheel.toml --device hapt:/dev/ttyACM0
  hapt run wheel.toml --device hapt:/dev/ttyACM0     then it turns")]
    Flash(FlashArgs),
    /// Identify a device from a log or an experiment: inertia, friction, lag, delay.
    #[command(after_help = "\
Examples:
  hapt identify sim --world wheel.toml --duration 2s --log wheel.mcap
  hapt identify wheel.mcap --plot fit.svg            from a log, with a picture
  hapt identify wheel.mcap --against wheel.toml      is it the file's device?
  hapt log convert wheel.mcap -o log.csv && \\
      hapt identify log.csv \\
      --columns time=time_s,position=measured_rad,torque=output_Nm")]
    Identify(Box<IdentifyArgs>),
    /// List serial ports and CAN interfaces, and the drives that may be behind them.
    #[command(after_help = "\
Examples:
  hapt devices                                       what --device may name")]
    Devices,
    /// Simulate a motor drive and its wheel on a serial port or a CAN bus.
    #[command(after_help = "\
Examples:
  hapt simulate-drive moteus --pty --duration 1s     its port is the first line
  hapt simulate-drive odrive --pty --duration 1s     behind an slcan adapter
  hapt simulate-drive simplefoc --pty --duration 1s   a board with SimpleFOC
  hapt simulate-drive moteus --pty @notes/wheel --duration 1s --lockstep")]
    SimulateDrive(SimulateDriveArgs),
    /// Measure how well this machine keeps a loop's time.
    #[command(after_help = "\
Examples:
  hapt latency --duration 1s                         the notes' wheel at 1 ms
  hapt latency wheel.toml --duration 1s --spin 100us --json")]
    Latency(LatencyArgs),
    /// Run the loop in real time behind a page with the wheel and its numbers.
    #[command(after_help = "\
Examples:
  hapt live                                          the notes' wheel, certified
  hapt live wheel.toml --port 0                      another world, any port
  hapt live @notes/euler --set loop.period=5ms
  hapt live @knob                                    several to choose from
  hapt live wheel.toml --device hapt:/dev/ttyACM0    a board, and its page")]
    Live(LiveArgs),
    /// Show the device to this computer as a force-feedback wheel for games (Linux).
    #[command(after_help = "\
Examples:
  hapt wheel                                         a simulated one, as root
  hapt wheel --device moteus:/dev/ttyACM0 --set device.inertia='0.03 kg m^2'
  hapt wheel wheel.toml --range '540 deg'            with a world of its own
  hapt wheel --page --port 0                         turn it on a page
  hapt wheel --conform --yes --out wheel.html        judge any wheel")]
    Wheel(WheelArgs),
    /// Write a commented world file to start from, and its schema for editors.
    #[command(after_help = "\
Examples:
  hapt init                                          a spring and a mass, here
  hapt init my-wall --template wall                  in a folder of its own")]
    Init(InitArgs),
    /// List the built-in worlds, each with its verdict.
    #[command(after_help = "\
Examples:
  hapt worlds
  hapt sim @notes/euler                              one of them")]
    Worlds,
    /// Explain a term of a message or a verdict; print the schema, manual, completions, licences.
    #[command(after_help = "\
Examples:
  hapt explain                                       the topics
  hapt explain critical-period
  hapt explain schema > hapt.schema.json             for editors
  hapt explain completions bash > hapt.bash          then: . ./hapt.bash")]
    Explain(ExplainArgs),
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

// The size of a figure. Not a comment of documentation: the help of the command would begin with it.
#[derive(Debug, clap::Args)]
pub struct FigureArgs {
    /// The figure's format; default: by its file's ending, SVG without one.
    #[arg(long, value_name = "FORMAT", value_enum, help_heading = FIGURE)]
    pub format: Option<FigureFormat>,
    /// The figure's look; default: a screen's, and with --width a paper's.
    #[arg(long, value_name = "STYLE", value_enum, help_heading = FIGURE)]
    pub style: Option<FigureStyle>,
    /// The figure's width, such as '88 mm' or '3.5 in'; default: 88 mm of a paper's, 254 mm of a slide's.
    #[arg(long, value_name = "Q", allow_hyphen_values = true, help_heading = FIGURE)]
    pub width: Option<String>,
    /// The size of its text in points; default: 8 of a paper's, 14 of a slide's.
    #[arg(long, value_name = "PT", help_heading = FIGURE)]
    pub font_size: Option<f64>,
    /// The pixels of a PNG in an inch, 50 to 600; default: 300 of a paper's, else 192.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(50..=600), help_heading = FIGURE)]
    pub dpi: Option<u16>,
}

const FIGURE: &str = "Figure";

/// A format of figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FigureFormat {
    /// Lines and text, for pages and editors.
    Svg,
    /// Pixels.
    Png,
    /// Lines and text with its fonts, for papers.
    Pdf,
}

impl FigureFormat {
    /// As it is typed.
    pub fn name(self) -> &'static str {
        match self {
            FigureFormat::Svg => "svg",
            FigureFormat::Png => "png",
            FigureFormat::Pdf => "pdf",
        }
    }
}

/// A look of figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FigureStyle {
    /// Thin lines, small type, no title: the caption is the paper's.
    Paper,
    /// Heavy lines, large type, 16:9.
    Slide,
}
