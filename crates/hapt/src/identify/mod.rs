//! `hapt identify`: the parameters of a device, from a log, or from an experiment on it.

mod against;
mod figure;
mod guided;
mod handle;
mod input;
mod print;
mod richer;

use std::io::{Write, stdout};
use std::path::Path;
use std::process::ExitCode;

use hapt_host::DeviceAddress;
use hapt_identify::{Error, Known, Record, fit_torque, identify_with};
use hapt_model::keys::Measure;
use hapt_model::{Motion, World};

use crate::args::IdentifyArgs;
use crate::failure::Failure;
use crate::format;
use crate::messages;
use crate::output::{self, Draft};
use crate::picture::FigureFile;
use crate::signals;
use crate::world::{files, read_world, source};

use figure::Drawn;

/// A motion, and where it comes from.
pub struct Given {
    /// A file's name, or a device's.
    pub name: String,
    pub record: Record,
    pub motion: Motion,
    /// The world that ran, or the one that --world names.
    pub world: Option<World>,
    /// The damping that a motor on a voltage adds, in N·m·s/rad (N·s/m).
    pub back_damping: f64,
}

pub fn run(args: &IdentifyArgs) -> Result<ExitCode, Failure> {
    for (flag, file, format) in [("--write", &args.write, "toml"), ("--log", &args.log, "mcap")] {
        file.as_deref().map_or(Ok(""), |file| output::format(flag, file, &[format]))?;
    }
    figure_file(args)?;
    let world = named_world(args)?;
    let mut inputs = match (args.world.as_ref().or(args.against.as_ref()), &world) {
        (Some(path), Some(world)) => files(path, world),
        _ => Vec::new(),
    };
    inputs.push(("what is read", args.what.clone().into()));
    let outputs = [("--write", &args.write), ("--plot", &args.plot), ("--log", &args.log)];
    output::apart(&output::given(&outputs), &inputs)?;
    if world.is_none() && !args.sets.is_empty() {
        return Err(Failure::input("--set needs --world or --against: it changes a key of that world"));
    }
    let given = match device(&args.what) {
        Some(_) if [&args.time, &args.position, &args.force].into_iter().any(Option::is_some) => {
            return Err(Failure::input(
                "--time, --position and --force name columns of a table; an experiment has none",
            ));
        }
        Some(device) => match (guided::experiment(args, &device, world), signals::signalled()) {
            (_, Some(code)) => return Ok(ExitCode::from(code)),
            (given, None) => given?,
        },
        None => input::read(args, world)?,
    };
    if args.handle
        && let Some(found) = handle::found(&given)?
    {
        return handle::run(args, &given, &found);
    }
    if args.against.is_some() {
        return against::run(args, &given);
    }
    let known = Known {
        inertia: inertia(args, given.motion)?,
        is_linear: given.motion == Motion::Linear,
        back_damping: given.back_damping,
        ..Known::default()
    };
    let by_torque = fit_torque(&given.record, &known);
    // With a second torque the motion does not follow from the commanded one.
    if given.record.forces().is_some() {
        let none = || Failure::input(format!("{}: {}", given.name, Error::Unexplained));
        let fit = by_torque.ok_or_else(none)?;
        return richer::run(args, &given, &fit, None);
    }
    let found = match (identify_with(&given.record, &known, by_torque.as_ref()), &by_torque) {
        (Ok(found), _) => found,
        // The device is richer than the model: the fit to the torque is the answer.
        (Err(error @ (Error::Residual(_) | Error::Unexplained)), Some(fit)) => {
            // With --handle the reason was given.
            return richer::run(args, &given, fit, Some(&error).filter(|_| !args.handle));
        }
        (Err(error), _) => return Err(Failure::input(format!("{}: {error}", given.name))),
    };
    for warning in found.warnings().into_iter().chain(print::unmodelled(&given, &found)) {
        messages::say(format_args!("warning: {warning}"));
    }
    if let Some(words) = by_torque.as_ref().and_then(|fit| print::sides(&given, &found, fit)) {
        messages::say(format_args!("warning: {words}"));
    }
    if found.sign.is_none() && known.inertia.is_none() && !given.record.is_driven() {
        messages::say(
            "note: without a torque only damping/inertia and friction/inertia show; --inertia gives the rest",
        );
    }
    let corrected = |gain: f64| given.name.parse::<DeviceAddress>().ok()?.corrected(gain);
    if let Some(device) = found.gain.and_then(|gain| corrected(gain.value)) {
        messages::say(format_args!("note: with this gain the motor's constant is that of {device}"));
    }
    let table = print::table(&given, &found);
    let drawn = Drawn::of(&given, &found, by_torque.as_ref());
    let drafts = [
        args.write.as_deref().map(|target| output::draft(target, table.as_bytes())).transpose()?,
        plot(args, &given, &drawn)?,
    ];
    written(drafts)?;
    let text = if args.json {
        print::pretty(&found.json(by_torque.as_ref()))?
    } else {
        let table = if args.write.is_some() { String::new() } else { format!("\n{table}") };
        print::text(&given, &found, known.inertia.is_some()) + &print::certificate(&given, &found)? + &table
    };
    print_text(&text)
}

/// Prints the answer.
fn print_text(text: &str) -> Result<ExitCode, Failure> {
    let mut out = stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    Ok(ExitCode::SUCCESS)
}

/// The device that LOG_OR_DEVICE names, where it does not name a file.
fn device(what: &str) -> Option<DeviceAddress> {
    let path = Path::new(what);
    // A folder is no record: one called sim does not hide the device.
    if path.exists() && !path.is_dir() { None } else { what.parse().ok() }
}

fn named_world(args: &IdentifyArgs) -> Result<Option<World>, Failure> {
    let read = |path: &std::path::PathBuf| read_world(&source(path)?, &args.sets);
    args.world.as_ref().or(args.against.as_ref()).map(read).transpose()
}

/// The value of --inertia.
fn inertia(args: &IdentifyArgs, motion: Motion) -> Result<Option<f64>, Failure> {
    let Some(text) = &args.inertia else { return Ok(None) };
    positive("--inertia", text, Measure::Inertia, motion).map(Some)
}

/// A positive quantity in SI.
fn positive(flag: &str, text: &str, measure: Measure, motion: Motion) -> Result<f64, Failure> {
    format::positive(flag, text, measure.dimension(motion))
}

fn figure_file(args: &IdentifyArgs) -> Result<FigureFile, Failure> {
    FigureFile::of("--plot", args.plot.as_deref(), &args.figure)
}

/// The picture of `--plot`.
fn plot(args: &IdentifyArgs, given: &Given, drawn: &Drawn) -> Result<Option<Draft>, Failure> {
    let file = figure_file(args)?;
    let draft = |target| file.draft(target, &figure::figure(given, drawn));
    args.plot.as_deref().map(draft).transpose()
}

/// Puts the files in their places.
fn written(drafts: impl IntoIterator<Item = Option<Draft>>) -> Result<(), Failure> {
    for draft in drafts.into_iter().flatten() {
        let path = draft.finish().map_err(|error| Failure::write("the file", error))?;
        messages::say(format_args!("wrote {}", path.display()));
    }
    Ok(())
}
