//! A sweep's table as Parquet, from its CSV.

use std::io::{self, BufRead, Write};
use std::sync::Arc;

use arrow_array::{ArrayRef, Float64Array, RecordBatch};
use arrow_schema::{DataType, Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::file::properties::WriterProperties;

use crate::table::{self, Column};

/// Rows in memory at once.
const BATCH: usize = 1 << 16;

/// Writes the rows of `csv`, whose header has been read, with each column's unit in its metadata under `unit`. A value that is
/// not there is null.
///
/// # Errors
/// Of reading, of writing, and `InvalidData` for a line that is no row of these columns.
pub fn write<W: Write + Send>(columns: &[Column], csv: impl BufRead, out: W) -> io::Result<W> {
    let field = |column: &Column| {
        let unit = [("unit".to_string(), column.unit.clone())];
        Field::new(&column.name, DataType::Float64, true).with_metadata(std::collections::HashMap::from(unit))
    };
    let schema = Arc::new(Schema::new(columns.iter().map(field).collect::<Vec<_>>()));
    // The bytes are those of the rows, whenever and wherever they are written.
    let properties = WriterProperties::builder().set_created_by(format!("hapt {}", env!("CARGO_PKG_VERSION"))).build();
    let mut writer = ArrowWriter::try_new(out, Arc::clone(&schema), Some(properties)).map_err(io::Error::other)?;
    let mut values: Vec<Vec<Option<f64>>> = vec![Vec::with_capacity(BATCH); columns.len()];
    let mut put = |values: &mut Vec<Vec<Option<f64>>>| -> io::Result<()> {
        let arrays = values.iter_mut().map(|column| Arc::new(Float64Array::from_iter(column.drain(..))) as ArrayRef);
        let batch = RecordBatch::try_new(Arc::clone(&schema), arrays.collect()).map_err(io::Error::other)?;
        writer.write(&batch).map_err(io::Error::other)
    };
    for line in csv.lines() {
        let line = line?;
        let row = table::read(&line, columns.len())
            .ok_or_else(|| io::Error::new(io::ErrorKind::InvalidData, format!("{line:?} is no row of this sweep")))?;
        values.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
        if values.first().is_some_and(|column| column.len() == BATCH) {
            put(&mut values)?;
        }
    }
    put(&mut values)?;
    writer.into_inner().map_err(io::Error::other)
}
