//! `hapt sim`: the scenarios of a world or network, as files or as a summary.

use std::borrow::Cow;
use std::io::{Write, stdout};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use hapt_log::{Header, Origin};
use hapt_model::{Scenario, Source, Station, System, World};
use hapt_sim::{Error, Run, StationRow, Summary, SystemSummary};

use crate::args::{Format, SimArgs};
use crate::failure::Failure;
use crate::format::{self, Effort};
use crate::messages;
use crate::output;
use crate::progress::Progress;
use crate::provenance::{Made, Provenance};
use crate::table::Table;
use crate::world::{inputs, read_system, source};

pub fn run(args: &SimArgs) -> Result<ExitCode, Failure> {
    let file_only = args.formats.iter().find(|format| **format != Format::Csv);
    if let (None, Some(format)) = (&args.out, file_only) {
        let name = format.ending();
        return Err(Failure::input(format!(
            "--format {name}: without --out a summary is printed; add --out DIR for files"
        )));
    }
    let source = source(&args.world.path)?;
    let system = read_system(&source, &args.world.sets)?;
    let scenarios = named(&system, &args.scenarios)?;
    // All errors come before the first file is written.
    system.stations.iter().try_for_each(|station| hapt_sim::check(&station.world))?;
    let runs = scenarios.iter().map(|name| Played::new(&system, name)).collect::<Result<Vec<_>, Failure>>()?;
    match &args.out {
        Some(folder) => write_all(&system, &source, runs, folder, args)?,
        None => print_all(&system, &source, runs)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// A scenario that is to be run.
struct Played<'s> {
    name: &'s str,
    system: Cow<'s, System>,
    run: Run,
}

impl<'s> Played<'s> {
    fn new(system: &'s System, name: &'s str) -> Result<Self, Failure> {
        let system = hapt_analysis::played(system, name)?;
        let run = Run::new(&system, name)?;
        Ok(Played { name, system, run })
    }
}

/// The scenarios named, each once, in file order; all when none is.
fn named<'s>(system: &'s System, names: &[String]) -> Result<Vec<&'s str>, Failure> {
    let all = system.scenarios();
    if all.is_empty() {
        let (whose, example) = match system.world() {
            Some(_) => ("the world has no scenario", "step"),
            None => ("no station's world has a scenario", "push"),
        };
        return Err(Failure::input(format!(
            "{whose} to run; add one, such as [scenarios.{example}] with a duration and a hand"
        )));
    }
    names.iter().try_for_each(|name| system.find_scenario(name))?;
    Ok(all.into_iter().filter(|name| names.is_empty() || names.iter().any(|wanted| wanted == name)).collect())
}

/// Takes a run of the scenario `name` to its end, giving each row to `each`. `Err` of the inside: it stopped being finite there.
pub fn rows<E>(
    run: &mut Run,
    name: &str,
    mut each: impl FnMut(&StationRow<'_>) -> Result<(), E>,
) -> Result<Result<(), Error>, E> {
    let mut progress = Progress::new(name, "samples", run.rows(), 0);
    let mut done = 0;
    let ended = run.try_for_each(|row| {
        if let Err(error) = each(row) {
            return ControlFlow::Break(error);
        }
        done += 1;
        progress.at(done);
        ControlFlow::Continue(())
    });
    match ended {
        Ok(ControlFlow::Continue(())) => Ok(Ok(())),
        Ok(ControlFlow::Break(error)) => Err(error),
        Err(error) => Ok(Err(error)),
    }
}

/// The file of a scenario: in a network one for each station.
fn target(folder: &Path, scenario: &str, station: &Station, format: Format) -> PathBuf {
    let of = if station.name.is_empty() { String::new() } else { format!(".{}", station.name) };
    folder.join(format!("{scenario}{of}.{}", format.ending()))
}

/// A file a scenario, station and format. A run that stops being finite keeps its rows up to there, and the others still run.
fn write_all(
    system: &System,
    source: &Source,
    runs: Vec<Played<'_>>,
    folder: &Path,
    args: &SimArgs,
) -> Result<(), Failure> {
    let is_network = system.world().is_none();
    if let Some(format) = args.formats.iter().find(|format| is_network && **format != Format::Csv) {
        let message = format!("--format {}: the stations of a network are written as csv", format.ending());
        return Err(Failure::input(message));
    }
    output::folder("--out", folder)?;
    let formats: Vec<Format> = [Format::Csv, Format::Mcap, Format::Parquet]
        .into_iter()
        .filter(|format| args.formats.contains(format))
        .collect();
    let files = || system.stations.iter().flat_map(|station| formats.iter().map(move |format| (station, *format)));
    let of = |played: &Played<'_>| {
        files().map(|(station, format)| target(folder, played.name, station, format)).collect::<Vec<_>>()
    };
    let targets: Vec<PathBuf> = runs.iter().flat_map(of).collect();
    let outputs: Vec<_> = targets.iter().map(|path| ("--out", path.as_path())).collect();
    output::apart(&outputs, &inputs(&args.world.path, system))?;
    let made = Made::by(&args.world.path, source, system.title.as_deref(), &args.world.sets);
    let provenance = Provenance::check(folder, made, &targets, args.force)?;
    let headers: Vec<Header> = system
        .stations
        .iter()
        .map(|Station { world, source, sets, .. }| {
            let header = header(world, source, sets, formats.contains(&Format::Mcap));
            Header { linked: is_network, ..header }
        })
        .collect();
    let mut written = Vec::new();
    let ended = write_runs(system, runs, folder, &formats, &headers, &mut written);
    // Once for all files: the list is read and written as a whole.
    provenance.add(&written)?;
    ended
}

/// The runs' files; those that are in their places are added to `written`.
fn write_runs(
    system: &System,
    runs: Vec<Played<'_>>,
    folder: &Path,
    formats: &[Format],
    headers: &[Header],
    written: &mut Vec<PathBuf>,
) -> Result<(), Failure> {
    let mut first_failure = None;
    for Played { name, mut run, .. } in runs {
        let mut tables = Vec::new();
        for (station, header) in system.stations.iter().zip(headers) {
            let header = Header { scenario: Some(name.to_string()), ..header.clone() };
            let table = |format: &Format| {
                Table::new(*format, target(folder, name, station, *format), &station.world, &header, Origin::Run)
            };
            tables.push(formats.iter().map(table).collect::<Result<Vec<_>, _>>()?);
        }
        let end = rows(&mut run, name, |row| tables[row.station].iter_mut().try_for_each(|table| table.row(row)))?;
        for table in tables.into_iter().flatten() {
            let rows = table.rows;
            let path = table.finish()?;
            match &end {
                Ok(()) => messages::say(format_args!("wrote {}, {} rows", path.display(), format::count(rows))),
                Err(error) => {
                    let message = format!("scenario {name}: {error}; {} ends before", path.display());
                    first_failure = first_failure.or(Some(Failure::System(message)));
                }
            }
            written.push(path);
        }
    }
    first_failure.map_or(Ok(()), Err)
}

/// The header of a log; with the certificate only on request.
pub fn header(world: &World, source: &Source, sets: &[String], certified: bool) -> Header {
    let check = certified.then(|| hapt_analysis::check(world).ok()).flatten();
    Header {
        world_text: source.text.clone(),
        overrides: sets.to_vec(),
        certificate_json: check.and_then(|check| serde_json::to_string_pretty(&check).ok()),
        device: "sim".into(),
        ..Header::default()
    }
}

fn print_all(system: &System, source: &Source, runs: Vec<Played<'_>>) -> Result<(), Failure> {
    let mut out = stdout().lock();
    let mut first_failure = None;
    writeln!(out, "{}", system.title_or(source)).map_err(Failure::stdout)?;
    for Played { name, system: played, mut run } in runs {
        let mut summary = SystemSummary::new(&played, &run);
        let end = rows(&mut run, name, |row| {
            summary.add(row);
            Ok::<(), Failure>(())
        })?;
        let text = match (system.stations.as_slice(), summary.stations.as_slice()) {
            ([station], [summary]) if system.world().is_some() => of_world(station, name, summary)?,
            (_, stations) => linked(system, name, stations, &run),
        };
        out.write_all(text.as_bytes()).map_err(Failure::stdout)?;
        if let Err(error) = end {
            let message = format!("scenario {name}: {error}");
            first_failure = first_failure.or(Some(Failure::System(message)));
        }
    }
    out.flush().map_err(Failure::stdout)?;
    first_failure.map_or(Ok(()), Err)
}

/// A network's run: a line for each station, and for each link that released.
fn linked(system: &System, scenario: &str, stations: &[Summary<'_>], run: &Run) -> String {
    let mut text = format!("\nscenario {scenario}\n");
    for (station, seen) in system.stations.iter().zip(stations) {
        text += &format!(
            "  {}: {} samples, peak command {}, of the links at most {}; the hand gave {}\n",
            station.name,
            format::count(seen.rows),
            format::effort(seen.peak_command, system.motion),
            format::effort(seen.peak_link, system.motion),
            format::energy(seen.ledger.hand),
        );
    }
    for (link, [first, second]) in system.links.iter().zip(run.releases()).filter(|(_, times)| *times != [0, 0]) {
        let [one, other] = link.between.map(|at| &system.stations[at].name);
        let times = |n: u64| if n == 1 { "once".to_string() } else { format!("{n} times") };
        text += &format!("  link {one} to {other}: let go {} at {one}, {} at {other}\n", times(first), times(second));
    }
    text
}

/// A world's run in full.
fn of_world(station: &Station, name: &str, summary: &Summary<'_>) -> Result<String, Failure> {
    let world = &station.world;
    // Torques in the unit of the file.
    let own = Effort::of(&hapt_model::parameters_of(world, &station.source, &station.sets)?, world.motion);
    // Only a held world's growth has a prediction to compare with.
    let predicted = match summary.fitted_growth() {
        Some(_) => hapt_analysis::check(world).ok().and_then(|check| check.held.growth_per_s),
        None => None,
    };
    Ok(text(world, own.as_ref(), world.scenario(name)?, summary, predicted))
}

fn text(world: &World, own: Option<&Effort>, scenario: &Scenario, summary: &Summary, predicted: Option<f64>) -> String {
    let sampling = &world.sampling;
    let effort = |x| own.map_or_else(|| format::effort(x, world.motion), |own| own.say(x));
    let mut lines = vec![format!(
        "\nscenario {}: {} at {} a sample{}, {}, torque from the {} of the step{}",
        scenario.name,
        format::time(scenario.duration),
        format::time(sampling.period),
        format::rates(sampling),
        sampling.method.name(),
        sampling.output.name(),
        format::late(sampling),
    )];
    let mut line = |name: &str, value: String| lines.push(format!("  {name:<13} {value}"));
    line("peak torque", format!("{} at {}", effort(summary.peak_torque), format::time(summary.peak_time)));
    line(
        "motor",
        match (world.device.limit, summary.first_clipped) {
            (None, _) => "no limit given".into(),
            (Some(limit), None) => format!("never beyond its limit, {}", effort(limit)),
            (Some(limit), Some((sample, time))) => format!(
                "beyond its limit, {}, at {} of {} samples, first at sample {sample} ({})",
                effort(limit),
                format::count(summary.clipped),
                format::count(summary.rows),
                format::time(time),
            ),
        },
    );
    line("world", format!("stores {} at the end", format::energy(summary.final_energy())));
    if summary.unsettled > 0 {
        let steps = format::count(u64::from(summary.unsettled));
        line(
            "bodies",
            format!(
                "{steps} steps found no torques of all nonlinear couplings that agree, and lost energy; a shorter period has them"
            ),
        );
    }
    let ledger = summary.ledger;
    let shaft = match world.device.handle {
        Some(_) => format!(", the shaft took {}", format::energy(ledger.shaft)),
        None => String::new(),
    };
    let own = match world.device.torque.is_none() {
        false => format!(", gravity and cogging gave {}", format::energy(ledger.field)),
        true => String::new(),
    };
    let stops = match world.device.stops {
        Some(_) => format!(", the stops took {}", format::energy(ledger.stops)),
        None => String::new(),
    };
    line(
        "device",
        format!(
            "hand gave {}, motor gave {}{own}; damping took {}, friction took {}{stops}{shaft}",
            format::energy(ledger.hand),
            format::energy(ledger.motor),
            format::energy(ledger.damping),
            format::energy(ledger.friction),
        ),
    );
    if let Some(fitted) = summary.fitted_growth() {
        let prediction =
            predicted.map_or("none predicted".into(), |growth| format!("{} predicted", format::rate(growth)));
        line("growth", format!("{} per second fitted to the run, {prediction}", format::rate(fitted)));
    }
    lines.join("\n") + "\n"
}
