//! The picture of a sweep: its first measure as a curve over one axis, or as a map over two.

use std::io::BufRead;
use std::path::Path;

use hapt_report::figure::{self, Figure, Panel, Shape, Style};
use hapt_report::{Extremes, Map, Scale, Width};
use hapt_sweep::{Axis, Measure, Sweep, table};

use crate::axis::{DisplayedAxis, within};
use crate::boundary::own_name;
use crate::failure::Failure;
use crate::format;
use crate::messages;
use crate::picture::FigureFile;

/// The most columns and rows that a map shows.
const ROOM: (usize, usize) = (360, 240);

/// Draws the rows into `target`; `typed` are the axes as they were, and `own` the file's own values of them, where it has some.
pub fn draw(
    sweep: &Sweep,
    typed: &[String],
    own: &[Option<f64>],
    rows: impl BufRead,
    target: &Path,
    file: FigureFile,
) -> Result<(), Failure> {
    let failed = |error| Failure::write(target.display(), error);
    let columns = table::columns(sweep).len();
    let shown: Vec<_> =
        sweep.grid.axes.iter().zip(typed).map(|(axis, typed)| DisplayedAxis::new(&sweep.system, axis, typed)).collect();
    let axes = sweep.grid.axes.len();
    let rows = rows.lines().map(|line| {
        let line = line.map_err(|error| Failure::System(format!("cannot read the rows: {error}")))?;
        let row = table::read(&line, columns);
        row.ok_or_else(|| Failure::System(format!("cannot read the rows: {line:?} is not one")))
    });
    let values = rows.map(|row| row.map(|row| row.get(axes).copied().flatten()));
    let figure = match (&sweep.grid.axes[..], &shown[..]) {
        ([axis], [shown]) => curve(sweep, axis, shown, own.first().copied().flatten(), values)?,
        (_, [slow, fast]) => map(sweep, [slow, fast], own, values.collect::<Result<_, _>>()?),
        _ => return Ok(()),
    };
    let draft = file.draft(target, &figure)?;
    messages::say(format_args!("wrote {}", draft.finish().map_err(failed)?.display()));
    Ok(())
}

/// The measure that is drawn: its name for people, and its unit.
fn measured(sweep: &Sweep) -> (String, &'static str) {
    let measure = sweep.measures[0];
    let name = measure.name().trim_end_matches("_per_s").replace('_', " ");
    (name, measure.unit(sweep.system.motion))
}

/// The value at which the meaning of a measure changes.
fn edge(measure: Measure) -> Option<f64> {
    match measure {
        Measure::HeldGrowth | Measure::FreeGrowth => Some(hapt_analysis::MARGINAL),
        // Stable and marginal are on one side.
        Measure::HeldVerdict | Measure::FreeVerdict | Measure::Certified => Some(0.5),
        Measure::FixedPassive => Some(0.5),
        Measure::DampingMargin => Some(0.0),
        Measure::StiffnessScale => Some(1.0),
        Measure::PeakTorque
        | Measure::FinalEnergy
        | Measure::SettlingTime
        | Measure::RequiredDamping
        | Measure::EnergyDrawn
        | Measure::Releases => None,
    }
}

fn title(sweep: &Sweep) -> String {
    sweep.system.title.clone().unwrap_or_else(|| measured(sweep).0)
}

fn curve(
    sweep: &Sweep,
    axis: &Axis,
    shown: &DisplayedAxis,
    own: Option<f64>,
    values: impl Iterator<Item = Result<Option<f64>, Failure>>,
) -> Result<Figure, Failure> {
    let (name, unit) = measured(sweep);
    let mut extremes = Extremes::new(Width::Wide.stretches());
    let (mut seen, mut all) = (0_u64, 0);
    for (i, value) in values.enumerate() {
        all += 1;
        if let Some(value) = value? {
            seen += 1;
            extremes.add(axis.value(i as u64) / shown.size, value);
        }
    }
    let edge = edge(sweep.measures[0]);
    let range = extremes.range();
    let y = figure::Axis::around(&name, unit, range.into_iter().flat_map(|(low, high)| [low, high]).chain(edge));
    let mut panel = Panel::new("", shown.figure(0.0), y);
    panel.curve("", Style::Signal(0), extremes.points(Width::Wide.stretches()));
    if let Some(own) = within(axis, own) {
        panel.mark(own_name(&sweep.system), Shape::Line, Style::Limit, vec![(own / shown.size, 0.0)]);
    }
    let values = range.map_or("no value".to_string(), |(low, high)| {
        format!("from {} to {} {unit}", format::number(low), format::number(high))
    });
    let alt = format!(
        "{name} over {} from {} to {} {}: {values}; {seen} of {all} cells have a value.",
        axis.key, axis.from, axis.to, axis.unit
    );
    Ok(Figure { title: title(sweep), alt, panels: vec![panel], columns: 1 })
}

/// The first axis runs to the right and the second up, as in the picture of a boundary.
fn map(sweep: &Sweep, shown: [&DisplayedAxis; 2], own: &[Option<f64>], mut values: Vec<Option<f64>>) -> Figure {
    let [slow, fast] = [0, 1].map(|i| &sweep.grid.axes[i]);
    let (name, unit) = measured(sweep);
    // An axis that falls is drawn rising.
    if fast.to < fast.from {
        values.chunks_mut(fast.count as usize).for_each(<[_]>::reverse);
    }
    if slow.to < slow.from {
        let rows: Vec<_> = values.chunks(fast.count as usize).rev().flatten().copied().collect();
        values = rows;
    }
    let (columns, rows) = (slow.count as usize, fast.count as usize);
    let values: Vec<_> = (0..values.len()).map(|i| values[i % columns * rows + i / columns]).collect();
    let numbers = values.iter().flatten().copied();
    let range = numbers
        .clone()
        .fold(None, |range: Option<(f64, f64)>, x| Some(range.map_or((x, x), |(low, high)| (low.min(x), high.max(x)))));
    let edge = edge(sweep.measures[0]);
    let scale = match sweep.measures[0] {
        // Whichever of them the map has.
        Measure::Certified => Scale::Named(&[(0.0, "not certified"), (1.0, "certified")]),
        Measure::HeldVerdict | Measure::FreeVerdict => {
            Scale::Named(&[(1.0, "unstable"), (0.0, "marginal"), (-1.0, "stable")])
        }
        Measure::FixedPassive => Scale::Named(&[(0.0, "not passive at fixed times"), (1.0, "passive at fixed times")]),
        Measure::EnergyDrawn
        | Measure::Releases
        | Measure::DampingMargin
        | Measure::StiffnessScale
        | Measure::PeakTorque
        | Measure::FinalEnergy
        | Measure::SettlingTime
        | Measure::HeldGrowth
        | Measure::FreeGrowth
        | Measure::RequiredDamping => Scale::of(numbers),
    };
    let map = Map { columns, scale, values, edge };
    let in_unit = if unit.is_empty() { String::new() } else { format!(" ({unit})") };
    let mut panel = Panel::new(&(name.clone() + &in_unit), spread(shown[0], slow), spread(shown[1], fast));
    panel.map = Some(map.reduced(ROOM.0, ROOM.1));
    if let [x, y] = own
        && let (Some(x), Some(y)) = (within(slow, *x), within(fast, *y))
    {
        panel.mark(own_name(&sweep.system), Shape::Ring, Style::Edge(0), vec![(x / shown[0].size, y / shown[1].size)]);
    }
    let seen = range.map_or("no value".to_string(), |(low, high)| {
        format!("from {} to {} {unit}", format::number(low), format::number(high))
    });
    let alt = format!("A map of {name} over {} to the right and {} upwards: {seen}.", slow.key, fast.key);
    Figure { title: title(sweep), alt, panels: vec![panel], columns: 1 }
}

/// From half a cell before the first value to half a cell after the last.
fn spread(shown: &DisplayedAxis, axis: &Axis) -> figure::Axis {
    shown.figure(0.5 / (axis.count.max(2) - 1) as f64)
}
