//! `hapt plot`: a run's figure, from its CSV.

use std::fs::File;
use std::io::{BufRead, BufReader, Write, stdin, stdout};
use std::process::ExitCode;

use hapt_model::keys::Measure;
use hapt_model::{Motion, parse_quantity};
use hapt_report::{Width, read_csv};

use crate::args::PlotArgs;
use crate::failure::Failure;
use crate::output::Draft;
use crate::people;

pub fn run(args: &PlotArgs) -> Result<ExitCode, Failure> {
    let piped = args.csv.as_os_str() == "-";
    let name = if piped { "<stdin>".to_string() } else { args.csv.display().to_string() };
    let from: Box<dyn BufRead> = if piped {
        Box::new(stdin().lock())
    } else {
        let file = File::open(&args.csv).map_err(|error| Failure::input(format!("cannot read {name}: {error}")))?;
        Box::new(BufReader::with_capacity(1 << 16, file))
    };
    let limit = |motion: Motion| match &args.limit {
        None => Ok(None),
        Some(text) => match parse_quantity(text, Measure::Torque.dimension(motion)) {
            Ok(limit) if limit > 0.0 => Ok(Some(limit)),
            Ok(_) => Err(format!("--limit: \"{text}\" must be positive")),
            Err(error) => Err(format!("--limit: {error}")),
        },
    };
    let traces = read_csv(from, limit).map_err(|error| match error {
        hapt_report::CsvError::Limit(message) => Failure::input(message),
        error => Failure::input(format!("{name}, {error}")),
    })?;
    let title = if piped { "run".into() } else { args.csv.file_stem().unwrap_or_default().to_string_lossy() };
    let svg = traces.figure(&title, None, Width::Wide, Width::Wide.stretches()).svg(Width::Wide, true) + "\n";
    match &args.out {
        None => {
            let mut out = stdout().lock();
            out.write_all(svg.as_bytes()).and_then(|()| out.flush()).map_err(Failure::stdout)?;
        }
        Some(target) => {
            let failed = |error| Failure::write(target.display(), error);
            let mut draft = Draft::new(target.clone()).map_err(failed)?;
            draft.write_all(svg.as_bytes()).map_err(failed)?;
            people::say(format_args!("wrote {}", draft.finish().map_err(failed)?.display()));
        }
    }
    Ok(ExitCode::SUCCESS)
}
