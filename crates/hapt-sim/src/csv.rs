//! A run as CSV.

use std::io::{self, Write};

use hapt_model::World;

use crate::row::{Row, SIGNALS, columns};

/// Writes the rows of a run, one line each; numbers read back to the same double.
///
/// ```
/// use hapt_model::{Source, World};
/// use hapt_sim::{CsvWriter, Simulation};
///
/// let file = r#"
/// loop.period = "1 ms"
/// device.inertia = "6.4e-4 kg m^2"
/// scenarios.rest = { duration = "2 ms", hand = { kind = "step", to = 0 } }
/// "#;
/// let world = World::read(&Source::from_text("rest.toml", file), &[])?;
/// let mut run = Simulation::new(&world, world.scenario("rest")?)?;
/// let mut csv = CsvWriter::new(Vec::new(), &world)?;
/// while let Some(row) = run.next() {
///     csv.write(row?)?;
/// }
/// let text = String::from_utf8(csv.finish()?)?;
/// assert!(text.starts_with("time_s,"));
/// assert_eq!(text.lines().count(), 1 + 3); // the header, and samples at 0, 1 and 2 ms
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct CsvWriter<W> {
    out: W,
    /// The line so far, followed by unused room.
    line: Vec<u8>,
}

/// The longest number, -2.2250738585072014e-308, and a comma.
const MAX_NUMBER_CHARS: usize = 25;

impl<W: Write> CsvWriter<W> {
    /// Writes the header. `out` is written a line at a time: pass a buffered one.
    pub fn new(out: W, world: &World) -> io::Result<Self> {
        let names: Vec<String> = columns(world).into_iter().map(|column| column.name).collect();
        CsvWriter::with_columns(out, &names)
    }

    /// The same with columns of these names, for [`CsvWriter::write_numbers`].
    pub fn with_columns(mut out: W, names: &[String]) -> io::Result<Self> {
        writeln!(out, "{}", names.join(","))?;
        Ok(CsvWriter { out, line: Vec::new() })
    }

    /// Writes a line of numbers, one for each column, at least one.
    pub fn write_numbers(&mut self, numbers: &[f64]) -> io::Result<()> {
        let room = MAX_NUMBER_CHARS * numbers.len();
        if self.line.len() < room {
            self.line.resize(room, 0);
        }
        let rest = numbers.iter().fold(&mut self.line[..], |rest, x| number(rest, *x));
        let unused = rest.len();
        self.end(unused)
    }

    /// Writes one row.
    pub fn write(&mut self, row: &Row) -> io::Result<()> {
        let room = MAX_NUMBER_CHARS * (SIGNALS.len() + 2 * row.bodies.len() + 2);
        if self.line.len() < room {
            self.line.resize(room, 0);
        }
        let mut rest = &mut self.line[..];
        for signal in &SIGNALS {
            rest = number(rest, (signal.get)(row));
        }
        for (position, velocity) in row.pairs() {
            rest = number(number(rest, position), velocity);
        }
        let unused = rest.len();
        self.end(unused)
    }

    /// Writes the used part of the line.
    #[inline]
    fn end(&mut self, unused: usize) -> io::Result<()> {
        let end = self.line.len() - unused;
        // The last comma.
        self.line[end - 1] = b'\n';
        self.out.write_all(&self.line[..end])
    }

    /// Flushes and gives the output back.
    pub fn finish(mut self) -> io::Result<W> {
        self.out.flush()?;
        Ok(self.out)
    }
}

/// Writes a number and a comma; returns the room after them.
#[inline]
fn number(line: &mut [u8], x: f64) -> &mut [u8] {
    let mut digits = zmij::Buffer::new();
    let text = digits.format(x).as_bytes();
    // Whole numbers need no ".0" to read back.
    let text = text.strip_suffix(b".0").unwrap_or(text);
    let (place, rest) = line.split_at_mut(text.len() + 1);
    place[..text.len()].copy_from_slice(text);
    place[text.len()] = b',';
    rest
}
