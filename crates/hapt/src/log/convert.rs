//! `hapt log convert`: a log in another form.

use std::process::ExitCode;

use hapt_log::{Column, Header};

use crate::args::{ConvertArgs, Format};
use crate::failure::Failure;
use crate::table::Table;
use crate::{format, log, messages};

pub fn run(args: &ConvertArgs) -> Result<ExitCode, Failure> {
    let format = Format::of(&args.out).ok_or_else(|| {
        let out = args.out.display();
        Failure::input(format!("--out {out}: expected FILE.csv, FILE.parquet or FILE.mcap"))
    })?;
    let mut opened = log::open(&args.log)?;
    let (header, origin) = (opened.log.header.clone(), opened.log.origin);
    let mut table: Option<(Table, Vec<Column>)> = None;
    let mut last = 0.0;
    while let Some(sample) = opened.log.next().map_err(|error| log::failure(&opened.name, error))? {
        if args.plan.is_some_and(|plan| plan != sample.plan.number) {
            continue;
        }
        let (number, columns) = (sample.plan.number, &sample.plan.columns);
        if table.is_none() {
            let header = Header { plan: number, ..header.clone() };
            let begun = Table::new(format, args.out.clone(), &sample.plan.world, &header, origin)?;
            table = Some((begun, columns.clone()));
        }
        let Some((table, begun)) = &mut table else { continue };
        if begun != columns && format != Format::Mcap {
            let name = &opened.name;
            return Err(Failure::input(format!(
                "{name}: plan {number} has other columns than those before it; --plan {number} converts it alone"
            )));
        }
        table.sample(&sample)?;
        last = sample.values.first().copied().unwrap_or(0.0);
    }
    let Some((table, _)) = table else {
        let plan = args.plan.unwrap_or(0);
        return Err(Failure::input(format!("{}: it has no samples of plan {plan}", opened.name)));
    };
    let samples = table.rows;
    let path = table.finish()?;
    opened.say_ending(samples, last);
    messages::say(format_args!("wrote {}, {} rows", path.display(), format::count(samples)));
    Ok(ExitCode::SUCCESS)
}
