//! `hapt plot`: the figure of a run, or of several over each other, from CSVs or logs.

use std::io::{BufRead, BufReader, Write, stdout};
use std::path::Path;
use std::process::ExitCode;

use hapt_log::Log;
use hapt_model::keys::Measure;
use hapt_model::{Motion, did_you_mean};
use hapt_report::{CsvError, Signal, Traces, read_csv};
use hapt_sim::Row;

use crate::args::PlotArgs;
use crate::failure::Failure;
use crate::format;
use crate::log::{self, Opened};
use crate::messages;
use crate::output;
use crate::picture::FigureFile;

/// The most runs drawn over each other: more are not distinguishable.
const MOST_RUNS: usize = 12;

pub fn run(args: &PlotArgs) -> Result<ExitCode, Failure> {
    let file = FigureFile::of("--out", args.out.as_deref(), &args.figure)?;
    if args.runs.len() > MOST_RUNS {
        return Err(Failure::input(format!(
            "{} runs in one figure: at most {MOST_RUNS} are distinguishable",
            args.runs.len()
        )));
    }
    let inputs: Vec<_> = args.runs.iter().map(|run| ("the run", run.clone())).collect();
    output::apart(&output::given(&[("--out", &args.out)]), &inputs)?;
    let window = window(args)?;
    let signals = signals(&args.signals)?;
    let mut runs: Vec<(String, Traces)> = Vec::new();
    for path in &args.runs {
        let (name, traces) = read(path, args.limit.as_deref(), window)?;
        if traces.is_empty() {
            let until = if window.1.is_finite() { format!(" to {}", format::time(window.1)) } else { " on".into() };
            return Err(Failure::input(format!("{}: no rows from {}{until}", path.display(), format::time(window.0))));
        }
        if runs.first().is_some_and(|(_, first)| first.motion() != traces.motion()) {
            return Err(Failure::input(format!("{}: a rotary and a linear run cannot share axes", path.display())));
        }
        runs.push((name, traces));
    }
    // Runs of the same name are labelled with their paths.
    let names: Vec<String> = runs.iter().map(|(name, _)| name.clone()).collect();
    for ((name, _), path) in runs.iter_mut().zip(&args.runs) {
        if names.iter().filter(|other| *other == name).count() > 1 {
            *name = path.display().to_string();
        }
    }
    let names: Vec<String> = runs.iter().map(|(name, _)| name.clone()).collect();
    let title = title(&names);
    let figure = Traces::overlay(&title, &runs, &signals, file.width);
    match &args.out {
        None => {
            let mut out = stdout().lock();
            out.write_all(&file.bytes(&figure, "standard output")?)
                .and_then(|()| out.flush())
                .map_err(Failure::stdout)?;
        }
        Some(target) => {
            let failed = |error| Failure::write(target.display(), error);
            let draft = file.draft(target, &figure)?;
            messages::say(format_args!("wrote {}", draft.finish().map_err(failed)?.display()));
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// The names of the runs, as many as fit in the line above the figure.
fn title(names: &[String]) -> String {
    const WIDTH: usize = 72;
    let all = names.join(", ");
    match names {
        [first, others @ ..] if others.len() > 1 && all.chars().count() > WIDTH => {
            format!("{first} and {} other runs", others.len())
        }
        _ => all,
    }
}

/// From when to when, in s.
fn window(args: &PlotArgs) -> Result<(f64, f64), Failure> {
    let time = |flag, text: &Option<String>, without| match text {
        Some(text) => format::quantity(flag, text, Measure::Time.dimension(Motion::Rotary)),
        None => Ok(without),
    };
    let (from, to) = (time("--from", &args.from, 0.0)?, time("--to", &args.to, f64::INFINITY)?);
    if to <= from {
        return Err(Failure::input(format!("--to: {} is not after --from, {}", format::time(to), format::time(from))));
    }
    Ok((from, to))
}

/// The signals to draw, in the given order; all of them by default.
fn signals(names: &[String]) -> Result<Vec<Signal>, Failure> {
    if names.is_empty() {
        return Ok(Signal::ALL.to_vec());
    }
    let named = |name: &String| {
        let name = if name.trim() == "force" { "torque" } else { name.trim() };
        Signal::from_name(name).ok_or_else(|| {
            let known = Signal::ALL.map(Signal::name);
            let hint = did_you_mean(name, known);
            Failure::input(format!("--signals: there is no {name:?}{hint} (there are {})", known.join(", ")))
        })
    };
    names.iter().map(named).collect()
}

/// A run and its name.
fn read(path: &Path, limit: Option<&str>, window: (f64, f64)) -> Result<(String, Traces), Failure> {
    let piped = path.as_os_str() == "-";
    let (name, from) = log::reader(path)?;
    let mut from = BufReader::with_capacity(1 << 16, from);
    let limit = |motion: Motion| match limit {
        None => Ok(None),
        Some(text) => format::positive("--limit", text, Measure::Torque.dimension(motion)).map(Some),
    };
    let title = match piped {
        true => "run".into(),
        false => path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
    };
    let first = from.fill_buf().map_err(|error| Failure::input(format!("cannot read {name}: {error}")))?;
    if hapt_log::is_log(first) {
        let log = Log::read(Box::new(from) as Box<dyn std::io::Read>).map_err(|error| log::failure(&name, error))?;
        let title = log.header.scenario.clone().unwrap_or(title);
        return Ok((title, logged(Opened { name, log }, limit, window)?));
    }
    let limit_of = |motion| limit(motion).map_err(Failure::message);
    let traces = read_csv(from, limit_of, window).map_err(|error| {
        Failure::input(match error {
            CsvError::Limit(message) => message,
            CsvError::Unreadable { .. } | CsvError::Wrong { .. } => format!("{name}, {error}"),
        })
    })?;
    Ok((title, traces))
}

/// The traces of a log.
fn logged(
    mut opened: Opened,
    limit: impl Fn(Motion) -> Result<Option<f64>, Failure>,
    window: (f64, f64),
) -> Result<Traces, Failure> {
    let plan = std::sync::Arc::clone(opened.log.plan());
    let world = &plan.world;
    let limit = limit(world.motion)?.or(world.device.limit);
    let mut traces = Traces::new(world.motion, &world.names, limit).within(window);
    let (mut row, mut samples, mut last) = (Row::default(), 0, f64::NEG_INFINITY);
    while let Some(sample) = opened.log.next().map_err(|error| log::failure(&opened.name, error))? {
        if sample.plan.columns != plan.columns {
            let (name, number) = (&opened.name, sample.plan.number);
            return Err(Failure::input(format!(
                "{name}: plan {number} has other columns than those before it; hapt log convert --plan {number} gives it alone"
            )));
        }
        sample.fill(&mut row);
        if !(row.time > last && row.time.is_finite()) {
            let (name, time) = (&opened.name, row.time);
            return Err(Failure::input(format!("{name}: time_s is {time} after {last}; it must increase")));
        }
        last = row.time;
        let puck = std::iter::once((row.puck, row.puck_velocity));
        traces.add(row.time, puck.chain(row.bodies.iter().copied()), row.torque, row.applied);
        samples += 1;
    }
    opened.say_ending(samples, row.time);
    Ok(traces)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_title_of_many_runs_fits_above_the_figure() {
        let names = |count: usize| -> Vec<String> { (0..count).map(|i| format!("a-long-name-of-run-{i}")).collect() };
        assert_eq!(title(&names(2)), "a-long-name-of-run-0, a-long-name-of-run-1");
        assert_eq!(title(&names(12)), "a-long-name-of-run-0 and 11 other runs");
    }
}
