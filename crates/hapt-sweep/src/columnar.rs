//! Tables of numbers as Parquet: a sweep's from its CSV, a run's row by row.

use std::collections::HashMap;
use std::io::{self, BufRead, Write};
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, RecordBatch};
use arrow_schema::{DataType, Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::file::properties::WriterProperties;

use crate::table::{self, Column};

/// Rows that become columns at once.
const BATCH: usize = 1 << 16;
/// Bytes in memory at which a group of rows is written.
const GROUP: usize = 32 << 20;

/// Writes rows as they come, in the same memory however many there are.
pub struct Writer<W: Write + Send> {
    writer: ArrowWriter<W>,
    schema: Arc<Schema>,
    values: Vec<Vec<Option<f64>>>,
}

impl<W: Write + Send> Writer<W> {
    /// Begins a table, with each column's unit in its metadata under `unit`.
    ///
    /// # Errors
    /// Those of `out`, here and below.
    pub fn new(columns: &[Column], out: W) -> io::Result<Self> {
        let field = |column: &Column| {
            let unit = [("unit".to_string(), column.unit.clone())];
            Field::new(&column.name, DataType::Float64, true).with_metadata(HashMap::from(unit))
        };
        let schema = Arc::new(Schema::new(columns.iter().map(field).collect::<Vec<_>>()));
        // The bytes are those of the rows, whenever and wherever they are written.
        let properties =
            WriterProperties::builder().set_created_by(format!("hapt {}", env!("CARGO_PKG_VERSION"))).build();
        let writer = ArrowWriter::try_new(out, Arc::clone(&schema), Some(properties)).map_err(io::Error::other)?;
        Ok(Writer { writer, schema, values: vec![Vec::with_capacity(BATCH); columns.len()] })
    }

    /// Writes a row, a value a column. A value that is not there is null.
    pub fn write(&mut self, row: impl IntoIterator<Item = Option<f64>>) -> io::Result<()> {
        self.values.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
        match self.values.first() {
            Some(column) if column.len() == BATCH => self.put(),
            _ => Ok(()),
        }
    }

    fn put(&mut self) -> io::Result<()> {
        let arrays =
            self.values.iter_mut().map(|column| Arc::new(Float64Array::from_iter(column.drain(..))) as ArrayRef);
        let batch = RecordBatch::try_new(Arc::clone(&self.schema), arrays.collect()).map_err(io::Error::other)?;
        self.writer.write(&batch).map_err(io::Error::other)?;
        if self.writer.in_progress_size() > GROUP {
            self.writer.flush().map_err(io::Error::other)?;
        }
        Ok(())
    }

    /// Writes what waits, and the end; gives the output back.
    pub fn finish(mut self) -> io::Result<W> {
        self.put()?;
        self.writer.into_inner().map_err(io::Error::other)
    }
}

/// Writes the rows of `csv`, whose header has been read.
///
/// # Errors
/// Of reading, of writing, and `InvalidData` for a line that is no row of these columns.
pub fn write<W: Write + Send>(columns: &[Column], csv: impl BufRead, out: W) -> io::Result<W> {
    let mut writer = Writer::new(columns, out)?;
    for line in csv.lines() {
        let line = line?;
        let row = table::read(&line, columns.len())
            .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidData, format!("{line:?} is no row of this sweep")))?;
        writer.write(row)?;
    }
    writer.finish()
}
