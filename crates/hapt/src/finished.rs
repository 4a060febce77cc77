//! A finished table at the place where a sweep is to be resumed: it may be another part of the table, which must not be lost.

use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::ops::Range;
use std::path::Path;

use hapt_sweep::table::{self, Column};
use hapt_sweep::{Shard, Sweep};

use crate::columnar;
use crate::failure::Failure;
use crate::format;

/// The rows of a finished table.
#[derive(Debug, PartialEq)]
struct Rows {
    count: u64,
    /// The values of the first row; empty: there is none.
    first: Vec<Option<f64>>,
}

/// Refuses `--resume` where `target` holds other rows than those of `cells`: finishing would replace them.
pub fn check(
    target: &Path,
    sweep: &Sweep,
    shard: Option<Shard>,
    cells: &Range<u64>,
    columns: &[Column],
) -> Result<(), Failure> {
    if !target.exists() {
        return Ok(());
    }
    let read = if target.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("parquet")) {
        columnar::rows(target, columns).map(|read| read.map(|(count, first)| Rows { count, first }))
    } else {
        lines(target, columns)
    };
    let found = read.map_err(|error| Failure::System(format!("cannot read {}: {error}", target.display())))?;
    let wanted = Rows {
        count: cells.end - cells.start,
        first: if cells.is_empty() { Vec::new() } else { sweep.grid.values(cells.start).map(Some).collect() },
    };
    let axes = sweep.grid.axes.len();
    let there = match &found {
        Some(rows) if rows.count == wanted.count && rows.first.iter().take(axes).eq(&wanted.first) => return Ok(()),
        Some(rows) => format!("it holds {}", described(rows, sweep)),
        None => "it is a file that is no table of this sweep".into(),
    };
    let (what, right) = match shard {
        None => ("the sweep", String::new()),
        Some(_) => ("the shard", format!(": each shard has a file of its own, such as {}", own(target, cells))),
    };
    Err(Failure::input(format!(
        "--out {}: {there}, and {what} is {}; --resume continues a table and replaces no other. Expected another name{right}",
        target.display(),
        described(&wanted, sweep),
    )))
}

/// `50 rows from loop.period = 0.001 on`.
fn described(rows: &Rows, sweep: &Sweep) -> String {
    let values = sweep.grid.axes.iter().zip(rows.first.iter().flatten());
    let values: Vec<String> =
        values.map(|(axis, value)| format!("{} = {}", axis.key, format::number(*value))).collect();
    let from = if values.is_empty() { String::new() } else { format!(" from {} on", values.join(", ")) };
    format!("{} rows{from}", format::count(rows.count))
}

/// A name for the shard next to `target`.
fn own(target: &Path, cells: &Range<u64>) -> String {
    let ending = target.extension().unwrap_or_default().to_string_lossy();
    target.with_extension(format!("{}.{ending}", cells.start)).display().to_string()
}

/// The rows of a CSV, with or without a header; `None`: it is another file.
fn lines(path: &Path, columns: &[Column]) -> io::Result<Option<Rows>> {
    let mut rows = Rows { count: 0, first: Vec::new() };
    for (i, line) in BufReader::new(File::open(path)?).lines().enumerate() {
        let line = match line {
            Err(error) if error.kind() == io::ErrorKind::InvalidData => return Ok(None),
            line => line?,
        };
        if i == 0 && line == table::header(columns).trim_end() {
            continue;
        }
        let Some(row) = table::read(&line, columns.len()) else { return Ok(None) };
        if rows.count == 0 {
            rows.first = row;
        }
        rows.count += 1;
    }
    Ok(Some(rows))
}
