//! `hapt plot`: a run's figure, from its CSV or from a log.

use std::io::{BufRead, BufReader, Write, stdout};
use std::process::ExitCode;

use hapt_log::Log;
use hapt_model::keys::Measure;
use hapt_model::{Motion, parse_quantity};
use hapt_report::{Traces, Width, read_csv};
use hapt_sim::Row;

use crate::args::PlotArgs;
use crate::failure::Failure;
use crate::log::{self, Opened};
use crate::output;
use crate::people;

pub fn run(args: &PlotArgs) -> Result<ExitCode, Failure> {
    output::figure_format("--out", args.out.as_deref())?;
    let piped = args.csv.as_os_str() == "-";
    let (name, from) = log::reader(&args.csv)?;
    let mut from = BufReader::with_capacity(1 << 16, from);
    let limit = |motion: Motion| match &args.limit {
        None => Ok(None),
        Some(text) => match parse_quantity(text, Measure::Torque.dimension(motion)) {
            Ok(limit) if limit > 0.0 => Ok(Some(limit)),
            Ok(_) => Err(format!("--limit: \"{text}\" must be positive")),
            Err(error) => Err(format!("--limit: {error}")),
        },
    };
    let mut title = match piped {
        true => "run".into(),
        false => args.csv.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
    };
    let first = from.fill_buf().map_err(|error| Failure::input(format!("cannot read {name}: {error}")))?;
    let traces = if hapt_log::is_log(first) {
        let log = Log::read(Box::new(from) as Box<dyn std::io::Read>).map_err(|error| log::failure(&name, error))?;
        title = log.header.scenario.clone().unwrap_or(title);
        logged(Opened { name, log }, limit)?
    } else {
        read_csv(from, limit).map_err(|error| match error {
            hapt_report::CsvError::Limit(message) => Failure::input(message),
            error => Failure::input(format!("{name}, {error}")),
        })?
    };
    let svg = traces.figure(&title, None, Width::Wide, Width::Wide.stretches()).svg(Width::Wide, true) + "\n";
    match &args.out {
        None => {
            let mut out = stdout().lock();
            out.write_all(svg.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
        }
        Some(target) => {
            let failed = |error| Failure::write(target.display(), error);
            let draft = output::figure("--out", target, &svg)?;
            people::say(format_args!("wrote {}", draft.finish().map_err(failed)?.display()));
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// The traces of a log.
fn logged(mut opened: Opened, limit: impl Fn(Motion) -> Result<Option<f64>, String>) -> Result<Traces, Failure> {
    let plan = std::sync::Arc::clone(opened.log.plan());
    let world = &plan.world;
    let limit = limit(world.motion).map_err(Failure::input)?.or(world.device.limit);
    let mut traces = Traces::new(world.motion, &world.names, limit);
    let (mut row, mut samples, mut last) = (Row::default(), 0, f64::NEG_INFINITY);
    while let Some(sample) = opened.log.next().map_err(|error| log::failure(&opened.name, error))? {
        if sample.plan.columns != plan.columns {
            let (name, number) = (&opened.name, sample.plan.number);
            return Err(Failure::input(format!(
                "{name}: plan {number} has other columns than those before it; hapt convert --plan {number} gives it alone"
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
