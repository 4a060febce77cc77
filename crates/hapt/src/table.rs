//! Rows as a file: CSV, Parquet, or a log.

use std::io;
use std::path::{Path, PathBuf};

use hapt_log::{Column, Header, LogWriter, Origin, Sample};
use hapt_model::World;
use hapt_sim::{CsvWriter, StationRow};

use crate::args::Format;
use crate::columnar;
use crate::failure::Failure;
use crate::output::{self, Draft};

/// A table that is being written.
pub struct Table {
    target: PathBuf,
    to: To,
    /// The values of a row.
    values: Vec<f64>,
    /// How many rows have been written.
    pub rows: u64,
}

enum To {
    Csv(CsvWriter<Draft>),
    Parquet(Box<columnar::Writer<Draft>>),
    Mcap(Box<LogWriter<Draft>>),
}

impl Format {
    /// The ending of its files.
    pub fn ending(self) -> &'static str {
        match self {
            Format::Csv => "csv",
            Format::Mcap => "mcap",
            Format::Parquet => "parquet",
        }
    }

    /// The format of a file's ending.
    pub fn of(path: &Path) -> Option<Format> {
        let ending = path.extension().and_then(|ending| ending.to_str())?.to_lowercase();
        [Format::Csv, Format::Mcap, Format::Parquet].into_iter().find(|format| format.ending() == ending)
    }
}

impl Table {
    /// Starts a table of `world`; `header` is that of a log.
    pub fn new(
        format: Format,
        target: PathBuf,
        world: &World,
        header: &Header,
        origin: Origin,
    ) -> Result<Table, Failure> {
        output::built("--out", &target)?;
        let columns = hapt_log::columns(world, origin != Origin::Run, header.linked);
        let begin = || -> io::Result<To> {
            let draft = Draft::new(target.clone())?;
            Ok(match format {
                Format::Csv => {
                    let names: Vec<String> = columns.iter().map(|column| column.name.clone()).collect();
                    To::Csv(CsvWriter::with_columns(draft, &names)?)
                }
                Format::Parquet => {
                    let column = |column: &Column| hapt_sweep::table::Column {
                        name: column.name.clone(),
                        unit: column.unit.into(),
                    };
                    let columns: Vec<_> = columns.iter().map(column).collect();
                    To::Parquet(Box::new(columnar::Writer::new(&columns, draft)?))
                }
                Format::Mcap => To::Mcap(Box::new(LogWriter::new(draft, world, header, origin)?)),
            })
        };
        let to = begin().map_err(|error| Failure::write(target.display(), error))?;
        Ok(Table { target, to, values: Vec::new(), rows: 0 })
    }

    /// Writes a row of a run. A log has no torque of links.
    pub fn row(&mut self, row: &StationRow<'_>) -> Result<(), Failure> {
        self.rows += 1;
        let written = match &mut self.to {
            To::Csv(csv) if !row.is_linked => csv.write(row.row),
            To::Csv(csv) => {
                row.numbers(&mut self.values);
                csv.write_numbers(&self.values)
            }
            To::Parquet(parquet) => {
                row.numbers(&mut self.values);
                parquet.write(self.values.iter().copied().map(Some))
            }
            To::Mcap(log) => log.write_row(row.row),
        };
        written.map_err(|error| Failure::write(self.target.display(), error))
    }

    /// Writes a sample of a log, with its world where that is another.
    pub fn sample(&mut self, sample: &Sample) -> Result<(), Failure> {
        self.rows += 1;
        let written = match &mut self.to {
            To::Csv(csv) => csv.write_numbers(sample.values),
            To::Parquet(parquet) => parquet.write(sample.values.iter().copied().map(Some)),
            To::Mcap(log) => log.write_sample(sample),
        };
        written.map_err(|error| Failure::write(self.target.display(), error))
    }

    /// Puts the file in its place.
    pub fn finish(self) -> Result<PathBuf, Failure> {
        let draft = match self.to {
            To::Csv(csv) => csv.finish(),
            To::Parquet(parquet) => parquet.finish(),
            To::Mcap(log) => log.finish(),
        };
        draft.and_then(Draft::finish).map_err(|error| Failure::write(self.target.display(), error))
    }
}
