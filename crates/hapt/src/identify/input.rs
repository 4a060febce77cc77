//! The record in a file: a log of hapt's, or a table of any program's.

use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use hapt_host::DeviceAddress;
use hapt_identify::{Columns, MatTable, Read as Table, Record, is_mat, mat_table, text_of};
use hapt_log::Log;
use hapt_model::keys::Measure;
use hapt_model::{Dimension, Motion, World};

use super::{Given, guided, positive};
use crate::args::IdentifyArgs;
use crate::failure::Failure;
use crate::format;
use crate::log::{self, Opened};
use crate::messages;
use crate::suggest;

/// A larger table is refused: 256 MiB.
const LARGEST: u64 = 256 << 20;
/// A log of more samples is refused: as many as a table of that size may have.
const MAX_SAMPLES: usize = 1 << 23;
/// The places of the values in every log.
const TIME: usize = 0;
const PUCK: usize = 1;
const MEASURED: usize = 3;
const COMMAND: usize = 6;

/// Times, positions, torques.
type Lists = [Vec<f64>; 3];

pub fn read(args: &IdentifyArgs, world: Option<World>) -> Result<Given, Failure> {
    let path = Path::new(&args.what);
    if args.what != "-" && !path.exists() {
        let what = &args.what;
        let missing = format!("cannot read {what}: there is no such file");
        return Err(Failure::input(match (suggest::file(path), what.parse::<DeviceAddress>()) {
            (none, Err(wrong)) if none.is_empty() && what.contains(':') => format!("{missing}; {wrong}"),
            (none, _) if none.is_empty() => format!("{missing}, and {what} is not a device either"),
            (meant, _) => missing + &meant,
        }));
    }
    let (name, from) = log::reader(path)?;
    let mut from = BufReader::with_capacity(1 << 16, from);
    let first = from.fill_buf().map_err(|error| Failure::input(format!("cannot read {name}: {error}")))?;
    let (lists, motion, world, forces, back_damping) = if hapt_log::is_log(first) {
        let named = [&args.columns, &args.time, &args.position, &args.torque, &args.force, &args.spring];
        let numbers = [args.torque_constant, args.resistance, args.ratio];
        if named.into_iter().any(Option::is_some) || numbers.into_iter().any(|number| number.is_some()) {
            return Err(Failure::input(
                "--columns, --time, --position, --torque, --force, --spring, --torque-constant, --resistance and --ratio are for tables; a log has its columns and torques",
            ));
        }
        let log = Log::read(Box::new(from) as Box<dyn Read>).map_err(|error| log::failure(&name, error))?;
        let (lists, motion, world) = logged(Opened { name: name.clone(), log }, world, args.coast)?;
        (lists, motion, world, None, 0.0)
    } else {
        let Table { times, positions, torques, forces, motion, back_damping, .. } = table(args, &name, from)?;
        ([times, positions, torques], motion, world, forces, back_damping)
    };
    let (lists, forces) = cut(args, lists, forces)?;
    let [times, positions, torques] = lists;
    let wrong = |error| Failure::input(format!("{name}: {error}"));
    let mut record = Record::with_gaps(times, positions, torques).map_err(wrong)?;
    if let Some(forces) = forces {
        record = record.with_force(forces).map_err(wrong)?;
    }
    Ok(Given { name, record, motion, world, back_damping })
}

/// The most labels of a file's signals in a message.
const LABELS: usize = 12;

/// A table with a header.
fn table(args: &IdentifyArgs, name: &str, from: impl Read) -> Result<Table, Failure> {
    let mut bytes = Vec::new();
    let read = from.take(LARGEST + 1).read_to_end(&mut bytes);
    read.map_err(|error| Failure::input(format!("cannot read {name}: {error}")))?;
    if bytes.len() as u64 > LARGEST {
        return Err(Failure::input(format!(
            "{name} is larger than 256 MiB; expected a shorter record, such as every tenth line of it"
        )));
    }
    let wrong = |error| Failure::input(format!("{name}: {error}"));
    let MatTable { text, labels } = match is_mat(&bytes) {
        true => mat_table(&bytes).map_err(wrong)?,
        false => MatTable { text: text_of(bytes).map_err(wrong)?, labels: Vec::new() },
    };
    let labels: Vec<String> = labels.iter().take(LABELS).map(|(name, label)| format!("{name} {label:?}")).collect();
    let wrong = |error| match &labels[..] {
        [] => Failure::input(format!("{name}: {error}")),
        labels => Failure::input(format!("{name}: {error}; the file's labels are {}", labels.join(", "))),
    };
    let mut columns = Columns::parse(args.columns.as_deref().unwrap_or_default())
        .map_err(|error| Failure::input(format!("--columns: {error}")))?;
    let places = [
        ("--time", &args.time, &mut columns.time),
        ("--position", &args.position, &mut columns.position),
        ("--torque", &args.torque, &mut columns.torque),
        ("--force", &args.force, &mut columns.force),
    ];
    for (flag, given, place) in places.into_iter().filter(|(_, given, _)| given.is_some()) {
        if place.is_some() && place != given {
            return Err(Failure::input(format!("{flag} and --columns name two columns; expected one of the two")));
        }
        place.clone_from(given);
    }
    for (flag, value) in [
        ("--counts", args.counts),
        ("--torque-constant", args.torque_constant),
        ("--resistance", args.resistance),
        ("--ratio", args.ratio),
    ] {
        if value.is_some_and(|value| !(value > 0.0 && value.is_finite())) {
            return Err(Failure::input(format!("{flag}: expected a positive number")));
        }
    }
    (columns.counts, columns.coasts) = (args.counts, args.coast);
    (columns.torque_constant, columns.resistance, columns.ratio) = (args.torque_constant, args.resistance, args.ratio);
    let spring = |motion| args.spring.as_ref().map(|text| positive("--spring", text, Measure::Stiffness, motion));
    // The position's unit decides whether it is a torsional spring.
    columns.spring = spring(Motion::Rotary).transpose().or_else(|error| match spring(Motion::Linear) {
        Some(Ok(linear)) => Ok(Some(linear)),
        _ => Err(error),
    })?;
    let table = columns.read_all(&text).map_err(wrong)?;
    let [missing, all] = table.missing;
    if missing > 0 {
        messages::say(format_args!(
            "note: {missing} of {all} lines have no number in a column that is used; where only the position is missing, the torque acts"
        ));
    }
    if let Some(period) = table.period {
        messages::say(format_args!(
            "note: more than a tenth of the lines repeat the time before with other numbers, so the times are rounded; those of an even clock \
             are used, {} apart",
            format::time(period)
        ));
    }
    spring(table.motion).transpose()?;
    Ok(table)
}

/// A log of hapt: the commands of a run; the output of the supervisor of a loop in real time, from which delay and lag are counted.
fn logged(mut opened: Opened, named: Option<World>, coasts: bool) -> Result<(Lists, Motion, Option<World>), Failure> {
    let plan = std::sync::Arc::clone(opened.log.plan());
    let is_simulated = opened.log.is_live() && opened.log.header.device == "sim";
    let place = if opened.log.is_live() { PUCK } else { MEASURED };
    let mut lists = Lists::default();
    while let Some(sample) = opened.log.next().map_err(|error| log::failure(&opened.name, error))? {
        if lists[0].len() == MAX_SAMPLES {
            let most = format::count(MAX_SAMPLES as u64);
            return Err(Failure::input(format!(
                "{} has more than {most} samples; expected a shorter log",
                opened.name
            )));
        }
        let at = |place: usize| sample.values.get(place).copied().unwrap_or(f64::NAN);
        lists[0].push(at(TIME));
        lists[1].push(if is_simulated { guided::counted(&plan.world, at(PUCK)) } else { at(place) });
        let torque = sample.inputs().map_or_else(|| at(COMMAND), |inputs| inputs.output);
        lists[2].push(if coasts { 0.0 } else { torque });
    }
    opened.say_ending(lists[0].len() as u64, lists[0].last().copied().unwrap_or(0.0));
    let world = named.unwrap_or_else(|| plan.world.clone());
    Ok((lists, plan.world.motion, Some(world)))
}

/// The part between --from and --to.
fn cut(args: &IdentifyArgs, lists: Lists, forces: Option<Vec<f64>>) -> Result<(Lists, Option<Vec<f64>>), Failure> {
    let bound = |flag: &str, text: &Option<String>| {
        text.as_deref().map(|text| format::quantity(flag, text, Dimension::TIME)).transpose()
    };
    let from = bound("--from", &args.from)?.unwrap_or(f64::NEG_INFINITY);
    let to = bound("--to", &args.to)?.unwrap_or(f64::INFINITY);
    if from >= to {
        return Err(Failure::input("--from must be before --to"));
    }
    let keep: Vec<bool> = lists[0].iter().map(|t| !(*t < from || *t > to)).collect();
    let kept = |list: Vec<f64>| list.into_iter().zip(&keep).filter_map(|(x, keep)| keep.then_some(x)).collect();
    Ok((lists.map(kept), forces.map(kept)))
}
