//! A table of numbers as Parquet: a sweep's from its CSV, or row by row.
//!
//! The columns go to Parquet's own writer. Arrow's would do the same, but brings every type that it knows into the program, and a
//! loader has to relocate them all before a command can begin.

use std::collections::HashMap;
use std::io::{self, BufRead, Write};

use arrow_schema::{DataType, Field, Schema};
use parquet::arrow::{ArrowSchemaConverter, add_encoded_arrow_schema_to_metadata};
use parquet::data_type::DoubleType;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;

use crate::table::{self, Column};

/// Rows in memory at once, and in a row group.
const GROUP: usize = 1 << 16;

/// Writes rows as they come, in the same memory however many there are.
pub struct Writer<W: Write + Send> {
    file: SerializedFileWriter<W>,
    columns: Vec<Values>,
    rows: usize,
}

/// What a column has in the group at hand.
#[derive(Clone, Default)]
struct Values {
    values: Vec<f64>,
    /// Of each row: 1 where there is a value, 0 where it is null. Parquet's definition levels.
    there: Vec<i16>,
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
        let schema = Schema::new(columns.iter().map(field).collect::<Vec<_>>());
        // The bytes are those of the rows, whenever and wherever they are written.
        let created_by = format!("hapt {}", env!("CARGO_PKG_VERSION"));
        let mut properties = WriterProperties::builder().set_created_by(created_by).build();
        // The units: Parquet itself has no place for a column's metadata.
        add_encoded_arrow_schema_to_metadata(&schema, &mut properties);
        let schema = ArrowSchemaConverter::new().convert(&schema).map_err(io::Error::other)?;
        let file =
            SerializedFileWriter::new(out, schema.root_schema_ptr(), properties.into()).map_err(io::Error::other)?;
        Ok(Writer { file, columns: vec![Values::default(); columns.len()], rows: 0 })
    }

    /// Writes a row, a value a column. A value that is not there is null.
    ///
    /// # Errors
    /// Those of the output.
    pub fn write(&mut self, row: impl IntoIterator<Item = Option<f64>>) -> io::Result<()> {
        for (column, value) in self.columns.iter_mut().zip(row) {
            column.values.extend(value);
            column.there.push(value.is_some().into());
        }
        self.rows += 1;
        if self.rows == GROUP { self.put().map_err(io::Error::other) } else { Ok(()) }
    }

    /// Writes the group at hand.
    fn put(&mut self) -> Result<(), ParquetError> {
        let mut group = self.file.next_row_group()?;
        for column in &mut self.columns {
            if let Some(mut writer) = group.next_column()? {
                writer.typed::<DoubleType>().write_batch(&column.values, Some(&column.there), None)?;
                writer.close()?;
            }
            column.values.clear();
            column.there.clear();
        }
        self.rows = 0;
        group.close().map(drop)
    }

    /// Writes what waits, and the end; gives the output back.
    ///
    /// # Errors
    /// Those of the output.
    pub fn finish(mut self) -> io::Result<W> {
        if self.rows > 0 {
            self.put().map_err(io::Error::other)?;
        }
        self.file.into_inner().map_err(io::Error::other)
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
