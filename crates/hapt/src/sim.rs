//! `hapt sim`: the scenarios of a world, as files or as a summary.

use std::io::{Write, stdout};
use std::path::Path;
use std::process::ExitCode;

use hapt_log::{Header, Origin};
use hapt_model::{Scenario, World};
use hapt_sim::{Error, Row, Simulation, Summary};

use crate::args::{Format, SimArgs};
use crate::failure::Failure;
use crate::format::{self, Effort};
use crate::messages;
use crate::network;
use crate::output;
use crate::progress::Progress;
use crate::provenance::{Made, Provenance};
use crate::table::Table;
use crate::world::{Loaded, files, source};

pub fn run(args: &SimArgs) -> Result<ExitCode, Failure> {
    let file_only = args.formats.iter().find(|format| **format != Format::Csv);
    if let (None, Some(format)) = (&args.out, file_only) {
        let name = format.ending();
        return Err(Failure::input(format!(
            "--format {name}: without --out a summary is printed; add --out DIR for files"
        )));
    }
    let source = source(&args.world.path)?;
    if hapt_model::is_network(&source) {
        return network::sim(&source, args);
    }
    let loaded = Loaded::of(source, &args.world)?;
    let scenarios = named(&loaded.world, &args.scenarios)?;
    // All errors come before the first file is written.
    hapt_sim::check(&loaded.world)?;
    match &args.out {
        Some(folder) => write_all(&loaded, &scenarios, folder, args)?,
        None => print_all(&loaded, &args.world.sets, &scenarios)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// The scenarios named, each once, in file order; all when none is.
fn named<'w>(world: &'w World, names: &[String]) -> Result<Vec<&'w Scenario>, Failure> {
    if world.scenarios.is_empty() {
        let wanted = "add one, such as [scenarios.step] with a duration and a hand";
        return Err(Failure::input(format!("the world has no scenario to run; {wanted}")));
    }
    for name in names {
        world.scenario(name)?;
    }
    let wanted = |scenario: &&Scenario| names.is_empty() || names.contains(&scenario.name);
    Ok(world.scenarios.iter().filter(wanted).collect())
}

/// Takes a run of the scenario `name` to its end, giving each row to `each`. `Err` of the inside: it stopped being finite there.
pub fn rows<E>(
    mut run: Simulation,
    name: &str,
    mut each: impl FnMut(&Row) -> Result<(), E>,
) -> Result<Result<u64, Error>, E> {
    let mut progress = Progress::new(name, "samples", run.rows(), 0);
    let mut done = 0;
    while let Some(row) = run.next() {
        match row {
            Ok(row) => each(row)?,
            Err(error) => return Ok(Err(error)),
        }
        done += 1;
        progress.at(done);
    }
    Ok(Ok(done))
}

/// A file a scenario and format. A run that stops being finite keeps its rows up to there, and the others still run.
fn write_all(loaded: &Loaded, scenarios: &[&Scenario], folder: &Path, args: &SimArgs) -> Result<(), Failure> {
    output::folder("--out", folder)?;
    let world = &loaded.world;
    let formats: Vec<Format> = [Format::Csv, Format::Mcap, Format::Parquet]
        .into_iter()
        .filter(|format| args.formats.contains(format))
        .collect();
    let target = |name: &str, format: &Format| folder.join(format!("{name}.{}", format.ending()));
    let targets: Vec<_> =
        scenarios.iter().flat_map(|scenario| formats.iter().map(|format| target(&scenario.name, format))).collect();
    let outputs: Vec<_> = targets.iter().map(|path| ("--out", path.as_path())).collect();
    output::apart(&outputs, &files(&args.world.path, world))?;
    let made = Made::by(&args.world.path, &loaded.source, world.title.as_deref(), &args.world.sets);
    let provenance = Provenance::check(folder, made, &targets, args.force)?;
    let mut header = header(loaded, &args.world.sets, formats.contains(&Format::Mcap));
    let mut first_failure = None;
    for scenario in scenarios {
        header.scenario = Some(scenario.name.clone());
        let table = |format: &Format| Table::new(*format, target(&scenario.name, format), world, &header, Origin::Run);
        let mut tables = formats.iter().map(table).collect::<Result<Vec<_>, _>>()?;
        let played = hapt_analysis::with_worst_pattern(world, scenario)?;
        let run = Simulation::new(world, &played)?;
        let end = rows(run, &scenario.name, |row| tables.iter_mut().try_for_each(|table| table.row(row)))?;
        let mut written = Vec::new();
        for table in tables {
            let path = table.finish()?;
            written.push(path.clone());
            match &end {
                Ok(rows) => messages::say(format_args!("wrote {}, {} rows", path.display(), format::count(*rows))),
                Err(error) => {
                    let message = format!("scenario {}: {error}; {} ends before", scenario.name, path.display());
                    first_failure = first_failure.or(Some(Failure::System(message)));
                }
            }
        }
        provenance.add(&written)?;
    }
    first_failure.map_or(Ok(()), Err)
}

/// The header of a log; with the certificate only on request.
pub fn header(loaded: &Loaded, sets: &[String], certified: bool) -> Header {
    let check = certified.then(|| hapt_analysis::check(&loaded.world).ok()).flatten();
    Header {
        world_text: loaded.source.text.clone(),
        overrides: sets.to_vec(),
        certificate_json: check.and_then(|check| serde_json::to_string_pretty(&check).ok()),
        device: "sim".into(),
        ..Header::default()
    }
}

fn print_all(loaded: &Loaded, sets: &[String], scenarios: &[&Scenario]) -> Result<(), Failure> {
    let world = &loaded.world;
    // Torques in the unit that the file has them in.
    let own = Effort::of(&hapt_model::parameters_of(world, &loaded.source, sets)?, world.motion);
    let mut out = stdout().lock();
    let mut first_failure = None;
    writeln!(out, "{}", loaded.title()).map_err(Failure::stdout)?;
    for scenario in scenarios {
        let played = hapt_analysis::with_worst_pattern(world, scenario)?;
        let run = Simulation::new(world, &played)?;
        let mut summary = Summary::new(world, &run);
        let end = rows(run, &scenario.name, |row| {
            summary.add(row);
            Ok::<(), Failure>(())
        })?;
        // Only a held world's growth has a prediction to stand beside.
        let predicted = match summary.fitted_growth() {
            Some(_) => hapt_analysis::check(world).ok().and_then(|check| check.held.growth_per_s),
            None => None,
        };
        out.write_all(text(world, own.as_ref(), scenario, &summary, predicted).as_bytes()).map_err(Failure::stdout)?;
        if let Err(error) = end {
            let message = format!("scenario {}: {error}", scenario.name);
            first_failure = first_failure.or(Some(Failure::System(message)));
        }
    }
    out.flush().map_err(Failure::stdout)?;
    first_failure.map_or(Ok(()), Err)
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
    line(
        "device",
        format!(
            "hand gave {}, motor gave {}{own}; damping took {}, friction took {}{shaft}",
            format::energy(ledger.hand),
            format::energy(ledger.motor),
            format::energy(ledger.damping),
            format::energy(ledger.friction),
        ),
    );
    if let Some(fitted) = summary.fitted_growth() {
        let beside = predicted.map_or("none predicted".into(), |growth| format!("{} predicted", format::rate(growth)));
        line("growth", format!("{} per second fitted to the run, {beside}", format::rate(fitted)));
    }
    lines.join("\n") + "\n"
}
