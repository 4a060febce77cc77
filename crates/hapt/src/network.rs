//! Runs of networks of stations.

use std::io::{Write, stdout};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use hapt_model::{Source, System};
use hapt_sim::{CsvWriter, Error, Run, StationRow, SystemSummary, station_columns};

use crate::args::{Format, SimArgs};
use crate::failure::Failure;
use crate::format;
use crate::messages;
use crate::output::{self, Draft};
use crate::progress::Progress;
use crate::provenance::{Made, Provenance};
use crate::world::inputs;

/// `hapt sim` of a network.
pub fn sim(source: &Source, args: &SimArgs) -> Result<ExitCode, Failure> {
    let network = System::read(source, &args.world.sets)?;
    let scenarios = named(&network, &args.scenarios)?;
    for station in &network.stations {
        hapt_sim::check(&station.world)?;
    }
    match &args.out {
        Some(folder) => write_all(&network, source, &scenarios, folder, args)?,
        None => print_all(&network, source, &scenarios)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// The scenarios named, each once, in the order of the stations; all when none is.
fn named<'n>(network: &'n System, names: &[String]) -> Result<Vec<&'n str>, Failure> {
    let all = network.scenarios();
    if all.is_empty() {
        return Err(Failure::input(
            "no station's world has a scenario to run; add one, such as [scenarios.push] with a duration and a hand",
        ));
    }
    for name in names {
        if !all.contains(&name.as_str()) {
            let hint = hapt_model::did_you_mean(name, all.iter().copied());
            let known = if hint.is_empty() { format!("; there is {}", all.join(", ")) } else { hint };
            return Err(Failure::input(format!("no station's world has a scenario {name:?}{known}")));
        }
    }
    Ok(all.into_iter().filter(|name| names.is_empty() || names.iter().any(|wanted| wanted == name)).collect())
}

/// Takes a run to its end. `Err` of the inside: it stopped being finite there.
pub fn rows(
    run: &mut Run,
    name: &str,
    mut each: impl FnMut(&StationRow<'_>) -> Result<(), Failure>,
) -> Result<Result<(), Error>, Failure> {
    let mut progress = Progress::new(name, "samples", run.rows(), 0);
    let mut done = 0;
    while let Some(row) = run.next() {
        match row {
            Ok(row) => each(&row)?,
            Err(error) => return Ok(Err(error)),
        }
        done += 1;
        progress.at(done);
    }
    Ok(Ok(()))
}

/// A file a scenario and station.
fn write_all(
    network: &System,
    source: &Source,
    scenarios: &[&str],
    folder: &Path,
    args: &SimArgs,
) -> Result<(), Failure> {
    if let Some(format) = args.formats.iter().find(|format| **format != Format::Csv) {
        return Err(Failure::input(format!(
            "--format {}: the stations of a network are written as csv",
            format.ending()
        )));
    }
    output::folder("--out", folder)?;
    let target = |scenario: &str, station: &str| folder.join(format!("{scenario}.{station}.csv"));
    let stations = || network.stations.iter();
    let targets: Vec<PathBuf> =
        scenarios.iter().flat_map(|name| stations().map(|station| target(name, &station.name))).collect();
    let outputs: Vec<_> = targets.iter().map(|path| ("--out", path.as_path())).collect();
    output::apart(&outputs, &inputs(&args.world.path, network))?;
    let made = Made::by(&args.world.path, source, network.title.as_deref(), &args.world.sets);
    let provenance = Provenance::check(folder, made, &targets, args.force)?;
    let mut first_failure = None;
    for name in scenarios {
        let mut run = Run::new(network, name)?;
        let mut tables = stations()
            .enumerate()
            .map(|(at, station)| {
                let path = target(name, &station.name);
                let columns: Vec<String> = station_columns(network, at).into_iter().map(|column| column.name).collect();
                let begin = || CsvWriter::with_columns(Draft::new(path.clone())?, &columns);
                begin().map(|table| (table, 0)).map_err(|error| Failure::write(path.display(), error))
            })
            .collect::<Result<Vec<_>, Failure>>()?;
        let mut values = Vec::new();
        let end = rows(&mut run, name, |row| {
            row.numbers(&mut values);
            let station = row.station;
            let (table, rows) = &mut tables[station];
            *rows += 1;
            let path = || target(name, &network.stations[station].name);
            table.write_numbers(&values).map_err(|error| Failure::write(path().display(), error))
        })?;
        let mut written = Vec::new();
        for ((table, rows), station) in tables.into_iter().zip(stations()) {
            let path = target(name, &station.name);
            let finished = table.finish().and_then(Draft::finish);
            let path = finished.map_err(|error| Failure::write(path.display(), error))?;
            messages::say(format_args!("wrote {}, {} rows", path.display(), format::count(rows)));
            written.push(path);
        }
        provenance.add(&written)?;
        if let Err(error) = end {
            let message = format!("scenario {name}: {error}; its files end before");
            first_failure = first_failure.or(Some(Failure::System(message)));
        }
    }
    first_failure.map_or(Ok(()), Err)
}

fn print_all(network: &System, source: &Source, scenarios: &[&str]) -> Result<(), Failure> {
    let mut text = format!("{}\n", network.title.as_deref().unwrap_or(&source.name));
    let mut first_failure = None;
    for name in scenarios {
        let mut run = Run::new(network, name)?;
        let mut summary = SystemSummary::new(network, &run);
        let end = rows(&mut run, name, |row| {
            summary.add(row);
            Ok(())
        })?;
        text += &format!("\nscenario {name}\n");
        for (station, seen) in network.stations.iter().zip(&summary.stations) {
            text += &format!(
                "  {}: {} samples, peak command {}, of the links at most {}; the hand gave {}\n",
                station.name,
                format::count(seen.rows),
                format::effort(seen.peak_command, network.motion),
                format::effort(seen.peak_link, network.motion),
                format::energy(seen.ledger.hand),
            );
        }
        for (link, [first, second]) in network.links.iter().zip(run.let_go()) {
            let [one, other] = link.between.map(|at| &network.stations[at].name);
            let times = |n: u64| if n == 1 { "once".to_string() } else { format!("{n} times") };
            if first + second > 0 {
                text += &format!(
                    "  link {one} to {other}: let go {} at {one}, {} at {other}\n",
                    times(first),
                    times(second)
                );
            }
        }
        if let Err(error) = end {
            let message = format!("scenario {name}: {error}");
            first_failure = first_failure.or(Some(Failure::System(message)));
        }
    }
    let mut out = stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
    first_failure.map_or(Ok(()), Err)
}
