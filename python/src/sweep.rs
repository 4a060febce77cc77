//! Measures over a grid of a world, computed in parts.

use std::sync::Arc;

use hapt_model::{Source, did_you_mean};
use hapt_sweep::{Grid, Measure};
use numpy::{IntoPyArray, PyArray1};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;

use crate::error::{internal, of_sweep};
use crate::interrupt::in_parallel;

/// A grid with its measures.
#[pyclass(frozen, module = "hapt._hapt")]
pub struct Sweep {
    sweep: Arc<hapt_sweep::Sweep>,
}

impl Sweep {
    pub fn new(
        py: Python<'_>,
        source: &Source,
        sets: &[String],
        axes: &[(String, Vec<f64>)],
        names: &[String],
        scenario: Option<&str>,
    ) -> PyResult<Sweep> {
        let measures = names.iter().map(|name| measure(name)).collect::<PyResult<Vec<_>>>()?;
        let made = Grid::listed(source, sets, axes)
            .and_then(|(grid, world)| hapt_sweep::Sweep::of_grid(grid, world, &measures, scenario));
        Ok(Sweep { sweep: Arc::new(made.map_err(|error| of_sweep(py, error, "sweep"))?) })
    }
}

fn measure(name: &str) -> PyResult<Measure> {
    Measure::from_name(name).ok_or_else(|| {
        let names = Measure::ALL.map(Measure::name);
        let hint = match did_you_mean(name, names) {
            hint if hint.is_empty() => format!("; there are {}", names.join(", ")),
            hint => hint,
        };
        PyValueError::new_err(format!("there is no measure {name:?}{hint}"))
    })
}

#[pymethods]
impl Sweep {
    /// The number of cells of the grid.
    #[getter]
    fn cells(&self) -> u64 {
        self.sweep.cells()
    }

    /// Everything that the rows depend on, as text: the world with the contents of the files that it names, the grid, the measures.
    fn content(&self) -> String {
        format!("{:?}", self.sweep)
    }

    /// The measures of the cells from `start` up to `end`, one cell after the other; NaN where there is no value.
    fn rows<'py>(&self, py: Python<'py>, start: u64, end: u64, threads: usize) -> PyResult<Bound<'py, PyArray1<f64>>> {
        if start > end || end > self.sweep.cells() {
            return Err(PyIndexError::new_err(format!("the grid has {} cells", self.sweep.cells())));
        }
        let sweep = Arc::clone(&self.sweep);
        let axes = sweep.grid.axes.len();
        // An interrupted call has raised an exception: its rows are not used.
        let rows = in_parallel(py, threads, move |stop| sweep.rows_until(start..end, &|| stop.is_set()))?;
        let rows = rows.ok_or_else(|| internal("rows are missing"))?;
        let measured = rows.iter().flat_map(|row| row[axes..].iter().map(|value| value.unwrap_or(f64::NAN)));
        Ok(measured.collect::<Vec<f64>>().into_pyarray(py))
    }
}
