//! Tables for Arrow's PyCapsule interface, which pyarrow, pandas, Polars and DuckDB read.
//!
//! <https://arrow.apache.org/docs/format/CDataInterface/PyCapsuleInterface.html>

use std::sync::Arc;

use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{ArrayRef, Float64Array, RecordBatch, RecordBatchIterator};
use arrow_schema::{DataType, Field, Schema};
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyCapsule;

use crate::error::{internal, value};

/// The columns, of equal lengths, as a stream of one batch of doubles; NaN is null. The values are copied once.
#[pyfunction]
pub fn arrow_stream<'py>(
    py: Python<'py>,
    columns: Vec<(String, PyReadonlyArray1<'py, f64>)>,
) -> PyResult<Bound<'py, PyCapsule>> {
    let fields: Vec<Field> = columns.iter().map(|(name, _)| Field::new(name, DataType::Float64, true)).collect();
    let schema = Arc::new(Schema::new(fields));
    let arrays = columns.iter().map(|(_, column)| -> ArrayRef {
        let column = column.as_array();
        match column.iter().any(|x| x.is_nan()) {
            true => Arc::new(column.iter().map(|&x| (!x.is_nan()).then_some(x)).collect::<Float64Array>()),
            false => Arc::new(Float64Array::from(column.to_vec())),
        }
    });
    let batch = RecordBatch::try_new(Arc::clone(&schema), arrays.collect()).map_err(value)?;
    let stream = FFI_ArrowArrayStream::new(Box::new(RecordBatchIterator::new([Ok(batch)], schema)));
    PyCapsule::new_with_value(py, stream, c"arrow_array_stream").map_err(internal)
}
