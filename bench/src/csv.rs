//! The numbers of a run of 10 s as text, in memory.

use std::io::Write;

use anyhow::{Result, bail};
use hapt_sim::{CsvWriter, SIGNALS, Simulation};

use crate::{run, timed};

/// hapt's CSV; the same numbers by its float printer alone, not even put together; or by `format!`'s machinery.
pub fn time(printer: &str, repeats: usize) -> Result<()> {
    let world = run::world("released")?;
    let mut run = Simulation::new(&world, world.scenario("step")?)?;
    let mut rows = Vec::new();
    while let Some(row) = run.next() {
        rows.push(row?.clone());
    }
    let mut numbers = Vec::new();
    for row in &rows {
        numbers.extend(SIGNALS.iter().map(|signal| (signal.get)(row)));
        numbers.extend(row.bodies.iter().flat_map(|&(w, v)| [w, v]));
    }
    let mut out: Vec<u8> = Vec::with_capacity(32 * numbers.len());
    timed(repeats, numbers.len(), || {
        out.clear();
        match printer {
            "hapt" => {
                let mut csv = CsvWriter::new(&mut out, &world)?;
                rows.iter().try_for_each(|row| csv.write(row))?;
            }
            "zmij" => {
                let mut digits = zmij::Buffer::new();
                for &x in &numbers {
                    std::hint::black_box(digits.format(x));
                }
            }
            "format" => {
                for x in &numbers {
                    write!(out, "{x},")?;
                }
            }
            _ => bail!("hapt, zmij or format?"),
        }
        Ok(())
    })
}
