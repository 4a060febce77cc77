//! The table of a sweep: its columns, and its rows as CSV.

use crate::sweep::Sweep;

/// A column.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// A key's dotted path, or a measure's name.
    pub name: String,
    /// In SI; empty for a plain number.
    pub unit: String,
}

/// The axes, slowest first, then the measures.
pub fn columns(sweep: &Sweep) -> Vec<Column> {
    let axes = sweep.grid.axes.iter().map(|axis| Column { name: axis.key.clone(), unit: axis.unit.clone() });
    let motion = sweep.system.motion;
    let measures = sweep
        .measures
        .iter()
        .map(|measure| Column { name: measure.name().to_string(), unit: measure.unit(motion).to_string() });
    axes.chain(measures).collect()
}

/// The first line, with its end.
pub fn header(columns: &[Column]) -> String {
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    names.join(",") + "\n"
}

/// A row's line, with its end; a missing value is empty. Numbers read back to the same double.
pub fn line(row: &[Option<f64>], out: &mut String) {
    let mut buffer = zmij::Buffer::new();
    for (i, value) in row.iter().enumerate() {
        if i > 0 {
            out.push(',');
        }
        if let Some(value) = value {
            out.push_str(buffer.format(*value));
        }
    }
    out.push('\n');
}

/// The text of a column's numbers. Neighbours often have the same number, such as a verdict: its text is kept.
#[derive(Clone, Debug, Default)]
pub(crate) struct Text {
    number: Option<f64>,
    text: String,
}

impl Text {
    /// Appends a number as [`line()`] writes it.
    pub fn write(&mut self, number: Option<f64>, out: &mut String) {
        let Some(value) = number else { return };
        // By their bits: 0 and -0 differ in text.
        if self.number.map(f64::to_bits) != Some(value.to_bits()) {
            self.number = number;
            self.text.clear();
            self.text.push_str(zmij::Buffer::new().format(value));
        }
        out.push_str(&self.text);
    }
}

/// Parses a line as a row of this many columns; `None` for text that [`line()`] has not written.
pub fn read(line: &str, columns: usize) -> Option<Vec<Option<f64>>> {
    let row: Option<Vec<Option<f64>>> = line
        .split(',')
        .map(|field| if field.is_empty() { Some(None) } else { field.parse::<f64>().ok().map(Some) })
        .collect();
    row.filter(|row| row.len() == columns)
}
