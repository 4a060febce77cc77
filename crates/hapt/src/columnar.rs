//! A table of numbers as Parquet: a sweep's from its CSV, or row by row.
//!
//! The columns go to Parquet's own writer. Arrow's would do the same, but links every type of Arrow into the program: a tenth of its build
//! time, and relocations before a command can begin.

use std::fs::File;
use std::io::{self, BufRead, Write};
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Repetition, Type as Physical};
use parquet::data_type::DoubleType;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::record::RowAccessor;
use parquet::schema::types::Type;

use hapt_sweep::table::{self, Column};

/// Rows in memory at once, and in a row group.
const GROUP: usize = 1 << 16;

/// Writes rows as they come, in the same memory however many there are.
pub struct Writer<W: Write + Send> {
    file: SerializedFileWriter<W>,
    columns: Vec<Values>,
    rows: usize,
}

/// The values of a column in the present group.
#[derive(Clone, Default)]
struct Values {
    values: Vec<f64>,
    /// Of each row: 1 where there is a value, 0 where it is null. Parquet's definition levels.
    there: Vec<i16>,
}

impl<W: Write + Send> Writer<W> {
    /// Begins a table. The file's metadata has the unit of the column NAME under `unit.NAME`: Parquet itself has no field for it.
    ///
    /// # Errors
    /// Those of `out`, here and below.
    pub fn new(columns: &[Column], out: W) -> io::Result<Self> {
        let field = |column: &Column| {
            let field = Type::primitive_type_builder(&column.name, Physical::DOUBLE);
            field.with_repetition(Repetition::OPTIONAL).build().map(Arc::new)
        };
        let fields: Result<Vec<_>, _> = columns.iter().map(field).collect();
        let schema = fields.and_then(|fields| Type::group_type_builder("schema").with_fields(fields).build());
        let unit = |column: &Column| KeyValue::new(format!("unit.{}", column.name), column.unit.clone());
        // The bytes are those of the rows, whenever and wherever they are written.
        let properties = WriterProperties::builder()
            .set_created_by(format!("hapt {}", env!("CARGO_PKG_VERSION")))
            .set_key_value_metadata(Some(columns.iter().map(unit).collect()))
            .build();
        let file = schema.and_then(|schema| SerializedFileWriter::new(out, Arc::new(schema), properties.into()));
        let file = file.map_err(io::Error::other)?;
        Ok(Writer { file, columns: vec![Values::default(); columns.len()], rows: 0 })
    }

    /// Writes a row, one value per column. A missing value is null.
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

    /// Writes the present group.
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

    /// Writes the last group and the end; returns the output.
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
        let row = table::read(&line, columns.len()).ok_or_else(|| {
            io::Error::new(io::ErrorKind::InvalidData, format!("{line:?} is not a row of this sweep"))
        })?;
        writer.write(row)?;
    }
    writer.finish()
}

/// How many rows a table has, and the values of the first one; none where it has no row.
pub type FirstRow = (u64, Vec<Option<f64>>);

/// The rows of a finished table of these columns; `None`: it is another file.
///
/// # Errors
/// The file cannot be read.
pub fn rows(path: &Path, columns: &[Column]) -> io::Result<Option<FirstRow>> {
    let file = File::open(path)?;
    // A file that is no Parquet file, or whose rows cannot be decoded, is another file.
    let Ok(file) = SerializedFileReader::new(file) else { return Ok(None) };
    let fields = file.metadata().file_metadata().schema_descr().columns();
    if !fields.iter().map(|field| field.name()).eq(columns.iter().map(|column| &column.name)) {
        return Ok(None);
    }
    let count = file.metadata().file_metadata().num_rows().unsigned_abs();
    let first = match file.into_iter().next() {
        None => Vec::new(),
        Some(Ok(row)) => (0..columns.len()).map(|i| row.get_double(i).ok()).collect(),
        Some(Err(_)) => return Ok(None),
    };
    Ok(Some((count, first)))
}

#[cfg(test)]
mod tests {
    use hapt_model::Source;
    use hapt_sweep::{Measure, Sweep};

    use super::*;

    const WHEEL: &str = r#"
[loop]
period = "1 ms"
method = "forward-euler"
output = "start"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
encoder = 4000
[bodies.wheel]
inertia = "0.0258 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "17.8 N mm/deg"
[[couplings]]
kind = "damper"
between = ["wheel", "ground"]
damping = "compensating"
[scenarios.let-go]
duration = "0.3 s"
hand = { kind = "step", to = "45 deg", release = "0.1 s" }
"#;

    #[test]
    fn a_table_reads_back_and_goes_to_parquet_with_units() {
        let axes = ["loop.period=1ms..5ms:5".to_string()];
        let sweep =
            Sweep::new(&Source::from_text("wheel.toml", WHEEL), &[], &axes, &[Measure::PeakTorque], None).unwrap();
        let columns = table::columns(&sweep);
        let rows = sweep.rows(0..5);
        let mut text = String::new();
        rows.iter().for_each(|row| table::line(row, &mut text));
        text.push_str("0.25,\n");
        for (line, row) in text.lines().zip(&rows) {
            assert_eq!(table::read(line, 2).as_deref(), Some(row));
        }
        let bytes = write(&columns, text.as_bytes(), Vec::new()).unwrap();
        let file = std::env::temp_dir().join(format!("hapt-sweep-{}.parquet", std::process::id()));
        std::fs::write(&file, bytes).unwrap();
        let reader = SerializedFileReader::new(std::fs::File::open(&file).unwrap()).unwrap();
        let units = reader.metadata().file_metadata().key_value_metadata().unwrap();
        let unit = |name: &str| units.iter().find(|entry| entry.key == name).and_then(|entry| entry.value.clone());
        assert_eq!(unit("unit.loop.period").as_deref(), Some("s"));
        assert_eq!(unit("unit.peak_torque").as_deref(), Some("N m"));
        let read: Vec<_> = reader.get_row_iter(None).unwrap().map(|row| row.unwrap().get_double(1).ok()).collect();
        std::fs::remove_file(&file).unwrap();
        assert_eq!(read[..5], rows.iter().map(|row| row[1]).collect::<Vec<_>>());
        assert_eq!(read[5..], [None]);
    }

    #[test]
    fn a_table_of_several_row_groups_reads_back_row_by_row() {
        let columns = ["a", "b"].map(|name| table::Column { name: name.into(), unit: "s".into() });
        // Each third number of the second column is missing.
        let value = |row: usize| (!row.is_multiple_of(3)).then_some(1.0 / row as f64);
        let rows = (1 << 17) + 5;
        let mut writer = Writer::new(&columns, Vec::new()).unwrap();
        for row in 0..rows {
            writer.write([Some(row as f64), value(row)]).unwrap();
        }
        let file = std::env::temp_dir().join(format!("hapt-sweep-groups-{}.parquet", std::process::id()));
        std::fs::write(&file, writer.finish().unwrap()).unwrap();
        let reader = SerializedFileReader::new(std::fs::File::open(&file).unwrap()).unwrap();
        assert_eq!(reader.metadata().num_row_groups(), 3);
        let mut read = 0;
        for (i, row) in reader.get_row_iter(None).unwrap().enumerate() {
            let row = row.unwrap();
            assert_eq!(row.get_double(0).unwrap(), i as f64);
            assert_eq!(row.get_double(1).ok(), value(i));
            read += 1;
        }
        std::fs::remove_file(&file).unwrap();
        assert_eq!(read, rows);
    }
}
