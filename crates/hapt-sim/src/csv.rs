//! A run as CSV.

use std::io::{self, Write};

use hapt_model::World;

use crate::row::{Row, SIGNALS, columns};

/// Writes the rows of a run, one line each; numbers read back to the same double.
#[derive(Debug)]
pub struct CsvWriter<W> {
    out: W,
    line: String,
}

impl<W: Write> CsvWriter<W> {
    /// Writes the header. `out` is written a line at a time: hand in a buffered one.
    pub fn new(mut out: W, world: &World) -> io::Result<Self> {
        let names: Vec<String> = columns(world).into_iter().map(|column| column.name).collect();
        writeln!(out, "{}", names.join(","))?;
        Ok(CsvWriter { out, line: String::new() })
    }

    /// Writes one row.
    pub fn write(&mut self, row: &Row) -> io::Result<()> {
        let mut digits = zmij::Buffer::new();
        self.line.clear();
        let mut number = |x: f64| {
            if !self.line.is_empty() {
                self.line.push(',');
            }
            let text = digits.format(x);
            // Whole numbers need no ".0" to read back.
            self.line.push_str(text.strip_suffix(".0").unwrap_or(text));
        };
        for signal in &SIGNALS {
            number((signal.get)(row));
        }
        for &(position, velocity) in &row.bodies {
            number(position);
            number(velocity);
        }
        self.line.push('\n');
        self.out.write_all(self.line.as_bytes())
    }

    /// Flushes and gives the output back.
    pub fn finish(mut self) -> io::Result<W> {
        self.out.flush()?;
        Ok(self.out)
    }
}
