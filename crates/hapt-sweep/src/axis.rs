//! The axes of a grid: keys of the world file and their values.

use hapt_model::keys::{Key, Takes, in_samples};
use hapt_model::{Motion, Source, System, parse_quantity};

use crate::error::Error;

/// The largest number of axes of a grid.
const MAX_AXES: usize = 8;
/// The largest number of cells of a grid: that of the samples of a scenario.
const MAX_CELLS: u64 = 10_000_000_000;
/// The largest number of values of an axis that are kept with their text.
const MAX_LABELLED_VALUES: u64 = 1 << 16;

/// A key and its values, in SI.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// The dotted path: `loop.period`.
    pub key: String,
    /// The key's unit in SI; empty for a plain number.
    pub unit: String,
    /// The first value.
    pub from: f64,
    /// The last value.
    pub to: f64,
    /// The number of values, at least 1; a single one is `from`.
    pub count: u64,
    /// Whether neighbours have the same ratio instead of the same difference.
    pub logarithmic: bool,
    /// A list of values instead of a rule; `from` and `to` are then the least and the largest.
    pub listed: Vec<f64>,
}

impl Axis {
    /// The i-th value, FROM + i (TO - FROM)/(N - 1) or FROM (TO/FROM)^(i/(N - 1)), the ends exact; or the i-th of a list.
    pub fn value(&self, i: u64) -> f64 {
        if let Some(value) = self.listed.get(i as usize) {
            return *value;
        }
        let last = self.count.saturating_sub(1);
        if i == 0 {
            self.from
        } else if i >= last {
            self.to
        } else if self.logarithmic {
            self.from * libm::pow(self.to / self.from, i as f64 / last as f64)
        } else {
            self.from + i as f64 * (self.to - self.from) / last as f64
        }
    }

    /// The value at an end of the axis: `from`, or the last one; of a list the least or the largest.
    fn end(&self, last: bool) -> f64 {
        match (last, self.listed.is_empty()) {
            (false, false) => self.from,
            (true, false) => self.to,
            (last, true) => self.value(if last { self.count - 1 } else { 0 }),
        }
    }
}

/// The form of axes: those of a grid have a number of values, those of a plane only ends.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Form {
    Grid,
    Plane,
}

impl Form {
    fn wanted(self) -> &'static str {
        match self {
            Form::Grid => "expected KEY=FROM..TO:N, such as loop.period=0.1ms..10ms:50:log",
            Form::Plane => "expected KEY=FROM..TO, such as loop.period=0.1ms..10ms or, by ratio, 0.1ms..10ms:log",
        }
    }
}

/// The pieces of `KEY=FROM..TO:N[:log]`, or without `:N`.
struct Written<'a> {
    key: &'a str,
    from: &'a str,
    to: &'a str,
    count: &'a str,
    logarithmic: bool,
}

fn written(text: &str, form: Form) -> Option<Written<'_>> {
    let (key, range) = text.split_once('=')?;
    let (range, logarithmic) = match range.strip_suffix(":log") {
        Some(range) => (range, true),
        None => (range, false),
    };
    let (ends, count) = match form {
        Form::Grid => range.rsplit_once(':')?,
        Form::Plane if range.contains(':') => return None,
        Form::Plane => (range, "2"),
    };
    let (from, to) = ends.split_once("..")?;
    Some(Written { key: key.trim(), from: from.trim(), to: to.trim(), count: count.trim(), logarithmic })
}

/// Every combination of the axes' values, the last axis varying fastest.
///
/// ```
/// use hapt_model::Source;
/// use hapt_sweep::Grid;
///
/// let source = Source::from_text("free.toml", "loop.period = \"1 ms\"\ndevice.inertia = \"6.4e-4 kg m^2\"\n");
/// let axes = ["loop.period=1ms..4ms:3:log", "device.damping=0..2e-3:2"].map(String::from);
/// let (grid, system) = Grid::new(&source, &[], &axes)?;
/// assert_eq!((grid.cells, system.number("loop.period")), (6, Some(1e-3)));
/// let cells: Vec<Vec<f64>> = (0..grid.cells).map(|cell| grid.values(cell).collect()).collect();
/// assert_eq!(cells[1], [1e-3, 2e-3], "1 ms, 2e-3 N m s/rad");
/// assert_eq!(cells[2], [2e-3, 0.0], "equal ratios: the middle of 1 ms and 4 ms is 2 ms");
/// # Ok::<(), hapt_sweep::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// Slowest first.
    pub axes: Vec<Axis>,
    /// The number of cells.
    pub cells: u64,
}

impl Grid {
    /// Reads the axes, each `KEY=FROM..TO:N[:log]`, against the world or network in `source`, and that itself at the grid's first
    /// cell. Every corner of the grid is read as a file is, with all its checks.
    ///
    /// # Errors
    /// [`Error::Axis`] for an invalid axis, [`Error::Model`] for a file, or a corner, that cannot be read.
    pub fn new(source: &Source, sets: &[String], axes: &[String]) -> Result<(Grid, System), Error> {
        if axes.is_empty() || axes.len() > MAX_AXES {
            let message =
                format!("a sweep varies 1 to {MAX_AXES} keys, and {} are given: --vary KEY=FROM..TO:N", axes.len());
            return Err(Error::Axis(message));
        }
        Grid::read(source, sets, axes, Form::Grid)
    }

    /// The same with the values of each axis one by one, in SI.
    ///
    /// # Errors
    /// As [`Grid::new`]; also for an axis without a value, or with one that is not finite.
    pub fn listed(source: &Source, sets: &[String], axes: &[(String, Vec<f64>)]) -> Result<(Grid, System), Error> {
        if let Some((key, _)) =
            axes.iter().find(|(_, values)| values.is_empty() || values.iter().any(|x| !x.is_finite()))
        {
            return Err(Error::Axis(format!("{key}: an axis takes finite numbers, at least one")));
        }
        let ends = |values: &[f64]| {
            let from = values.iter().copied().fold(f64::INFINITY, f64::min);
            (from, values.iter().copied().fold(f64::NEG_INFINITY, f64::max))
        };
        let spelled = axes.iter().map(|(key, values)| {
            let (from, to) = ends(values);
            format!("{key}={}..{}:1", plain(from), plain(to))
        });
        let (mut grid, system) = Grid::new(source, sets, &spelled.collect::<Vec<_>>())?;
        let mut cells = 1u64;
        for (axis, (key, values)) in grid.axes.iter_mut().zip(axes) {
            axis.count = values.len() as u64;
            axis.listed.clone_from(values);
            if let Some(Takes::Whole { step, .. }) = system.key(key).map(|key| key.takes) {
                whole(axis, step).map_err(|message| Error::Axis(format!("{key}: {message}")))?;
            }
            cells = cells
                .checked_mul(axis.count)
                .filter(|cells| *cells <= MAX_CELLS)
                .ok_or_else(|| Error::Axis(format!("{key}: the grid has more than {MAX_CELLS} cells")))?;
        }
        grid.cells = cells;
        grid.corners(source, sets)?;
        Ok((grid, system))
    }

    /// The same for a plane: two axes, each `KEY=FROM..TO[:log]`, with their ends as the only values.
    ///
    /// # Errors
    /// As [`Grid::new`].
    pub fn plane(source: &Source, sets: &[String], axes: &[String]) -> Result<(Grid, System), Error> {
        if axes.len() != 2 {
            let message =
                format!("an edge is drawn over 2 keys, and {} are given: --vary KEY=FROM..TO, twice", axes.len());
            return Err(Error::Axis(message));
        }
        Grid::read(source, sets, axes, Form::Plane)
    }

    fn read(source: &Source, sets: &[String], axes: &[String], form: Form) -> Result<(Grid, System), Error> {
        let wrong = |text: &str, message: String| Error::Axis(format!("--vary {text}: {message}"));
        // Errors of the file come before those of an axis.
        System::read(source, sets)?;
        let mut all = Vec::new();
        let mut base = sets.to_vec();
        for text in axes {
            let Some(parts) = written(text, form) else { return Err(wrong(text, form.wanted().into())) };
            if all.iter().any(|(axis, _): &(Written<'_>, &String)| axis.key == parts.key) {
                return Err(wrong(text, format!("{} is varied twice", parts.key)));
            }
            base.push(format!("{}={}", parts.key, parts.from));
            all.push((parts, text));
        }
        let system = System::read(source, &base).map_err(varied)?;
        let mut grid = Grid { axes: Vec::new(), cells: 1 };
        for (parts, text) in all {
            let Some(key) = system.key(parts.key) else {
                return Err(wrong(
                    text,
                    format!(
                        "{} takes no number; {} varies numbers",
                        parts.key,
                        if form == Form::Grid { "a sweep" } else { "a boundary" }
                    ),
                ));
            };
            if form == Form::Plane && matches!(key.takes, Takes::Whole { .. }) {
                let message =
                    format!("{} takes whole numbers, between which no edge can lie: hapt sweep varies it", parts.key);
                return Err(wrong(text, message));
            }
            let axis = axis(&parts, key, system.motion).map_err(|message| wrong(text, message))?;
            let cells = grid.cells.checked_mul(axis.count).filter(|cells| *cells <= MAX_CELLS);
            grid.cells = match cells {
                Some(cells) => cells,
                None => return Err(wrong(text, format!("the grid has more than {MAX_CELLS} cells"))),
            };
            grid.axes.push(axis);
        }
        grid.corners(source, sets)?;
        Ok((grid, system))
    }

    /// Reads the file at every corner but the first. The ranges of keys, and conditions between two keys, are bounds that a grid
    /// violates at a corner or nowhere.
    fn corners(&self, source: &Source, sets: &[String]) -> Result<(), Error> {
        for corner in 1..1u32 << self.axes.len() {
            let value = |(i, axis): (usize, &Axis)| format!("{}={}", axis.key, plain(axis.end(corner >> i & 1 == 1)));
            let values = self.axes.iter().enumerate().map(value);
            let sets: Vec<String> = sets.iter().cloned().chain(values).collect();
            System::read(source, &sets).map_err(varied)?;
        }
        Ok(())
    }

    /// The values of a cell, one per axis.
    pub fn values(&self, cell: u64) -> impl Iterator<Item = f64> {
        let place = Place::new(self, cell);
        self.axes.iter().zip(place.at).map(|(axis, i)| axis.value(i))
    }
}

/// The values of a grid's axes with their text, computed once for many cells. An axis of very many values is computed cell by cell.
#[derive(Clone, Debug)]
pub struct Ticks<'g> {
    grid: &'g Grid,
    axes: Vec<Option<Labelled>>,
}

/// The values of an axis, and their text in one piece.
#[derive(Clone, Debug)]
struct Labelled {
    values: Vec<f64>,
    text: String,
    /// Where the text of each value ends.
    ends: Vec<usize>,
}

impl Labelled {
    fn new(axis: &Axis) -> Self {
        let values: Vec<f64> = (0..axis.count).map(|i| axis.value(i)).collect();
        let (mut text, mut buffer) = (String::new(), zmij::Buffer::new());
        let ends = values.iter().map(|value| {
            text.push_str(buffer.format(*value));
            text.len()
        });
        let ends = ends.collect();
        Labelled { values, text, ends }
    }

    fn text(&self, i: usize) -> &str {
        let from = if i == 0 { 0 } else { self.ends[i - 1] };
        &self.text[from..self.ends[i]]
    }
}

impl<'g> Ticks<'g> {
    /// The values of the grid's axes.
    pub fn new(grid: &'g Grid) -> Self {
        // An axis with more values than the grid has cells is computed cell by cell, to save memory.
        let few = |axis: &Axis| axis.count <= MAX_LABELLED_VALUES.min(grid.cells);
        Ticks { grid, axes: grid.axes.iter().map(|axis| few(axis).then(|| Labelled::new(axis))).collect() }
    }

    /// The i-th value of the j-th axis.
    pub(crate) fn value(&self, j: usize, i: u64) -> f64 {
        self.axes[j].as_ref().map_or_else(|| self.grid.axes[j].value(i), |axis| axis.values[i as usize])
    }

    /// Appends its text, which reads back to the same double.
    pub(crate) fn write(&self, j: usize, i: u64, out: &mut String) {
        match &self.axes[j] {
            Some(axis) => out.push_str(axis.text(i as usize)),
            None => out.push_str(zmij::Buffer::new().format(self.grid.axes[j].value(i))),
        }
    }
}

/// A cell's index on every axis, cell after cell.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    /// For each axis, the number of its value.
    pub at: Vec<u64>,
}

impl Place {
    pub fn new(grid: &Grid, cell: u64) -> Self {
        let mut below = grid.cells;
        let at = grid.axes.iter().map(|axis| {
            below /= axis.count;
            cell / below % axis.count
        });
        Place { at: at.collect() }
    }

    /// Advances to the next cell; the first follows the last.
    pub fn advance(&mut self, grid: &Grid) {
        for (at, axis) in self.at.iter_mut().zip(&grid.axes).rev() {
            *at += 1;
            if *at < axis.count {
                return;
            }
            *at = 0;
        }
    }
}

/// A number that reads back to the same one; a whole number's key takes no 4000.0.
fn plain(value: f64) -> String {
    let text = format!("{value:?}");
    text.strip_suffix(".0").map(str::to_string).unwrap_or(text)
}

/// The file itself is valid, so the error is in the axis.
fn varied(mut error: hapt_model::Error) -> hapt_model::Error {
    if let Some(location) = &mut error.location {
        location.source = "--vary".into();
    }
    error
}

fn axis(parts: &Written<'_>, key: &Key, motion: Motion) -> Result<Axis, String> {
    let number = |text: &str| match key.takes.quantity() {
        // A column has one unit: seconds, or samples, where another axis changes the period.
        Some(_) if key.takes == Takes::TimeOrSamples && in_samples(text).is_some() => {
            Err(format!("{text:?} is in samples; an axis takes {} as a time, such as \"1.5 ms\"", parts.key))
        }
        Some((measure, _)) => parse_quantity(text, measure.dimension(motion)).map_err(|error| format!("{error}")),
        None => text.parse::<f64>().ok().filter(|x| x.is_finite()).ok_or_else(|| format!("{text:?} is not a number")),
    };
    let unit = key.takes.quantity().map(|(measure, _)| measure.dimension(motion).symbol()).unwrap_or_default();
    let count = parts.count.parse::<u64>().ok().filter(|count| *count > 0);
    let count = count.ok_or_else(|| format!("{:?} is not a number of values, such as 50", parts.count))?;
    let (from, to) = (number(parts.from)?, number(parts.to)?);
    if parts.logarithmic && (from == 0.0 || (from < 0.0) != (to < 0.0) || to == 0.0) {
        return Err(format!("equal ratios need both ends on one side of 0, not {} and {}", parts.from, parts.to));
    }
    let axis =
        Axis { key: parts.key.into(), unit, from, to, count, logarithmic: parts.logarithmic, listed: Vec::new() };
    if let Takes::Whole { step, .. } = key.takes {
        whole(&axis, step)?;
    }
    Ok(axis)
}

/// Whether all values of a whole number's axis are whole multiples of `step`. With equal steps two values suffice.
fn whole(axis: &Axis, step: u64) -> Result<(), String> {
    let looked = if axis.logarithmic || !axis.listed.is_empty() { axis.count } else { axis.count.min(2) };
    let bad = (0..looked).map(|i| axis.value(i)).find(|value| value % step as f64 != 0.0);
    match bad {
        None => Ok(()),
        Some(value) if step == 2 => Err(format!(
            "{value} is not an even number; expected {} values from {} to {} that are",
            axis.count, axis.from, axis.to
        )),
        Some(value) => Err(format!("{value} is not a whole number: choose N so that all values are")),
    }
}
