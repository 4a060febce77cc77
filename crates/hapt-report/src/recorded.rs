//! A run's signals for the interactive plots of a page, which can be panned and zoomed (web/src/report.ts).

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use hapt_model::{Motion, World};
use hapt_sim::{Signal, body_columns};
use serde_json::{Value, json};

use crate::units::Unit;

/// The largest number of intervals while a run streams.
const ROOM: usize = 4096;
/// The size of a plot whose signals are 0, in its unit.
const FLAT: f64 = 1.0;

/// The built script and style of web/ that make a figure interactive, as embedded in a page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlotScript<'a> {
    /// The script, safe to embed in an element.
    pub script: &'a str,
    /// The SHA-256 of the script in base64: a browser runs no other.
    pub sum: &'a str,
    /// Its style.
    pub style: &'a str,
}

/// Signals row by row, reduced while they stream: of each interval of rows the last, the smallest and the largest value of each column.
///
/// The intervals double whenever there are too many, so that the memory does not depend on the number of rows.
#[derive(Clone, Debug)]
pub(crate) struct Recorded {
    columns: usize,
    /// Rows per interval.
    rows: u64,
    /// Rows in the last interval.
    filled: u64,
    /// Of the last row of each interval, in s.
    times: Vec<f64>,
    /// Last, smallest, largest: the columns of one interval after the other.
    values: Vec<[f64; 3]>,
}

/// A plot over time, of some columns.
#[derive(Clone, Debug)]
pub(crate) struct PlotPanel {
    pub title: String,
    pub unit: Unit,
    pub traces: Vec<Trace>,
    /// Dashed lines, in SI.
    pub lines: Vec<f64>,
    /// The size of its signals, in SI.
    pub size: f64,
}

/// A column in a plot.
#[derive(Clone, Debug)]
pub(crate) struct Trace {
    pub name: String,
    pub column: usize,
    /// Its name in a run's file.
    pub file: String,
    pub style: CurveStyle,
}

/// Positions and velocities of a world's puck and bodies. Their columns come first: position and velocity of one after the other.
pub(crate) fn moving(world: &World) -> [Vec<Trace>; 2] {
    let names = || std::iter::once("puck").chain(world.names.iter().map(String::as_str));
    let own = [Signal::PUCK, Signal::PUCK_VELOCITY].map(|signal| signal.column(world.motion).name);
    let files: Vec<String> = own.into_iter().chain(body_columns(world).map(|column| column.name)).collect();
    [0, 1].map(|shift| {
        let trace = |(i, (name, file)): (usize, (&str, &String))| Trace {
            name: name.into(),
            column: 2 * i + shift,
            file: file.clone(),
            style: CurveStyle::Signal(i),
        };
        names().zip(files.iter().skip(shift).step_by(2)).enumerate().map(trace).collect()
    })
}

/// A torque of a run on its puck, in this column.
pub(crate) fn torque(motion: Motion, name: &str, column: usize, signal: Signal, style: CurveStyle) -> Trace {
    Trace { name: name.into(), column, file: signal.column(motion).name, style }
}

/// The style of a column's curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum CurveStyle {
    /// The n-th signal.
    Signal(usize),
    /// A signal that another one mostly covers.
    Dashed(usize),
    /// A prediction, which does not affect the axis's range.
    Predicted,
}

impl Recorded {
    pub fn new(columns: usize) -> Self {
        Recorded { columns, rows: 1, filled: 0, times: Vec::new(), values: Vec::new() }
    }

    /// Adds a row: its time, and the value of each column.
    pub fn add(&mut self, time: f64, row: impl IntoIterator<Item = f64>) {
        if self.filled == self.rows && self.times.len() == ROOM {
            self.halve();
        }
        if self.filled == self.rows || self.times.is_empty() {
            self.times.push(time);
            self.values.extend(row.into_iter().map(|value| [value; 3]).take(self.columns));
            self.filled = 1;
            return;
        }
        self.filled += 1;
        if let Some(last) = self.times.last_mut() {
            *last = time;
        }
        let begin = self.values.len().saturating_sub(self.columns);
        for (all, value) in self.values[begin..].iter_mut().zip(row) {
            *all = joined(*all, [value; 3]);
        }
    }

    /// Joins pairs of neighbours. ROOM is even, and the last interval full.
    fn halve(&mut self) {
        let columns = self.columns;
        for to in 0..self.times.len() / 2 {
            self.times[to] = self.times[2 * to + 1];
            for column in 0..columns {
                let [one, other] = [2 * to, 2 * to + 1].map(|from| self.values[from * columns + column]);
                self.values[to * columns + column] = joined(one, other);
            }
        }
        self.times.truncate(self.times.len() / 2);
        self.values.truncate(self.times.len() * columns);
        self.rows *= 2;
        self.filled = self.rows;
    }

    /// The largest absolute value of a column.
    pub fn size(&self, column: usize) -> f64 {
        let intervals = self.values.iter().skip(column).step_by(self.columns);
        intervals.map(|[_, low, high]| low.abs().max(high.abs())).fold(0.0, f64::max)
    }

    /// A plot of these columns, in a unit suitable for them.
    pub fn panel(&self, title: &str, traces: Vec<Trace>, unit: impl Fn(f64) -> Unit, lines: &[f64]) -> PlotPanel {
        let drawn = traces.iter().filter(|trace| trace.style != CurveStyle::Predicted);
        let size = drawn.map(|trace| self.size(trace.column)).fold(0.0, f64::max);
        PlotPanel { title: title.into(), unit: unit(size), traces, lines: lines.to_vec(), size }
    }

    /// Sets a column to a function of the time.
    pub fn set(&mut self, column: usize, formula: impl Fn(f64) -> f64) {
        let columns = self.columns;
        for (interval, time) in self.values.chunks_mut(columns).zip(&self.times) {
            interval[column] = [formula(*time); 3];
        }
    }

    /// The run in the form of the page's script, in about `bytes` bytes. `name` is the name of its files.
    pub fn data(&self, name: &str, panels: &[PlotPanel], bytes: usize) -> Value {
        let traces = || panels.iter().flat_map(|panel| panel.traces.iter().map(move |trace| (panel, trace)));
        // Three numbers of four bytes per column, eight for the time; four letters for three bytes.
        let most = bytes * 3 / 4 / (12 * traces().count() + 8);
        let mut of = self.clone();
        while of.times.len() > most.max(2) {
            of.thin();
        }
        let (mut names, mut factors, mut columns) = (Vec::new(), Vec::new(), Vec::new());
        for (panel, trace) in traces() {
            names.push(&trace.file);
            factors.push(panel.unit.per_si);
            let parts = [0, 1, 2].map(|part| of.encoded(trace.column, part));
            let is_plain = parts[0] == parts[1] && parts[0] == parts[2];
            columns.push(parts.into_iter().take(if is_plain { 1 } else { 3 }).collect::<Vec<_>>());
        }
        let mut next = 0;
        let panels: Vec<Value> = panels.iter().map(|panel| panel.data(&mut next)).collect();
        let time = STANDARD.encode(of.times.iter().flat_map(|time| time.to_le_bytes()).collect::<Vec<_>>());
        json!({ "name": name, "panels": panels, "names": names, "factors": factors, "time": time, "columns": columns })
    }

    /// Joins neighbours, also of an odd number of intervals.
    fn thin(&mut self) {
        let columns = self.columns;
        let pairs = self.times.len().div_ceil(2);
        for to in 0..pairs {
            let (one, other) = (2 * to, (2 * to + 1).min(self.times.len() - 1));
            self.times[to] = self.times[other];
            for column in 0..columns {
                self.values[to * columns + column] =
                    joined(self.values[one * columns + column], self.values[other * columns + column]);
            }
        }
        self.times.truncate(pairs);
        self.values.truncate(pairs * columns);
    }

    fn encoded(&self, column: usize, part: usize) -> String {
        let values = self.values.iter().skip(column).step_by(self.columns);
        STANDARD.encode(values.flat_map(|all| (all[part] as f32).to_le_bytes()).collect::<Vec<_>>())
    }
}

/// An interval and the one after it.
fn joined(one: [f64; 3], other: [f64; 3]) -> [f64; 3] {
    [other[0], one[1].min(other[1]), one[2].max(other[2])]
}

impl PlotPanel {
    /// The plot in the form of web/src/plots.ts; its columns are `next` and those after it.
    fn data(&self, next: &mut usize) -> Value {
        let traces: Vec<Value> = self.traces.iter().map(|trace| trace.data(next)).collect();
        let lines: Vec<f64> = self.lines.iter().map(|line| line * self.unit.per_si).collect();
        let size = self.size * self.unit.per_si;
        let least = if size > 0.0 && size.is_finite() { 0.01 * size } else { FLAT };
        json!({
            "title": self.title,
            "unit": { "name": self.unit.name, "per": self.unit.per_si },
            "traces": traces,
            "lines": lines,
            "least": least,
        })
    }
}

impl Trace {
    fn data(&self, next: &mut usize) -> Value {
        let column = *next;
        *next += 1;
        let colour = |n: usize| format!("c{}", n % 7);
        match self.style {
            CurveStyle::Signal(n) => json!({ "name": self.name, "column": column, "colour": colour(n) }),
            CurveStyle::Dashed(n) => {
                json!({ "name": self.name, "column": column, "colour": colour(n), "dash": [6, 3] })
            }
            CurveStyle::Predicted => {
                json!({ "name": self.name, "column": column, "colour": "c6", "dash": [2, 3], "guide": true })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    fn panel(columns: usize) -> PlotPanel {
        let trace =
            |column| Trace { name: "a".into(), column, file: "a_rad".into(), style: CurveStyle::Signal(column) };
        let traces = (0..columns).map(trace).collect();
        PlotPanel {
            title: "position".into(),
            unit: Unit { name: "rad", per_si: 1.0 },
            traces,
            lines: Vec::new(),
            size: 1.0,
        }
    }

    fn numbers(text: &Value) -> Vec<f32> {
        let bytes = STANDARD.decode(text.as_str().unwrap()).unwrap();
        bytes.chunks(4).map(|four| f32::from_le_bytes(four.try_into().unwrap())).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn no_extreme_and_no_end_disappears(
            values in prop::collection::vec(-1e6..1e6f64, 1..10_000), bytes in 200usize..500_000,
        ) {
            let mut recorded = Recorded::new(2);
            for (k, &value) in values.iter().enumerate() {
                recorded.add(k as f64, [value, -value]);
            }
            let data = recorded.data("run", &[panel(2)], bytes);
            let column = |n: usize, part: usize| data["columns"][n].get(part).map_or_else(|| numbers(&data["columns"][n][0]), numbers);
            let (last, low, high) = (column(0, 0), column(0, 1), column(0, 2));
            let least = values.iter().copied().fold(f64::INFINITY, f64::min) as f32;
            let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max) as f32;
            prop_assert_eq!(low.iter().copied().fold(f32::INFINITY, f32::min), least);
            prop_assert_eq!(high.iter().copied().fold(f32::NEG_INFINITY, f32::max), most);
            prop_assert_eq!(*last.last().unwrap(), *values.last().unwrap() as f32);
            prop_assert_eq!(column(1, 2).into_iter().fold(f32::NEG_INFINITY, f32::max), -least);
            let times = STANDARD.decode(data["time"].as_str().unwrap()).unwrap();
            let times: Vec<f64> = times.chunks(8).map(|eight| f64::from_le_bytes(eight.try_into().unwrap())).collect();
            prop_assert!(times.windows(2).all(|pair| pair[0] < pair[1]) && times.len() == last.len());
            prop_assert_eq!(*times.last().unwrap(), (values.len() - 1) as f64);
            for (time, value) in times.iter().zip(&last) {
                prop_assert_eq!(values[*time as usize] as f32, *value);
            }
            prop_assert!(data.to_string().len() < bytes + 1200);
        }
    }

    #[test]
    fn a_short_run_is_kept_sample_by_sample() {
        let mut recorded = Recorded::new(1);
        for (k, value) in [0.0, 3.0, -1.0, 2.0].into_iter().enumerate() {
            recorded.add(k as f64, [value]);
        }
        let data = recorded.data("run", &[panel(1)], 10_000);
        assert_eq!(data["columns"][0].as_array().unwrap().len(), 1, "no extremes beside the samples themselves");
        assert_eq!(numbers(&data["columns"][0][0]), [0.0, 3.0, -1.0, 2.0]);
    }
}
