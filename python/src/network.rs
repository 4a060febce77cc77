//! Networks of stations: read, changed, asked.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;

use hapt_model::{Source, System};
use hapt_sim::{Run as SystemRun, station_columns};
use hapt_sweep::worst::search_together;
use numpy::IntoPyArray;
use pyo3::exceptions::{PyMemoryError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::analyses::{self, Edges};
use crate::error::{internal, of_world, value};
use crate::interrupt::{Stop, asking, in_parallel, interruptible, unwanted};
use crate::simulate::{CHUNK, Failure, columns_with_room, too_large};
use crate::sweep::Sweep;

/// A network with the file that it was read from and the changes made to it.
#[pyclass(frozen, module = "hapt._hapt")]
pub struct Network {
    source: Source,
    sets: Vec<String>,
    model: Arc<System>,
}

/// The texts of files that come with a network, by the names that it has for them.
type Files = BTreeMap<String, String>;

/// Reads a network: of `text` with `files`, or of the file `path`.
#[pyfunction]
#[pyo3(signature = (name, text=None, folder=None, files=Files::new(), sets=vec![], path=None))]
pub fn read_network(
    py: Python<'_>,
    name: &str,
    text: Option<String>,
    folder: Option<PathBuf>,
    files: Files,
    sets: Vec<String>,
    path: Option<PathBuf>,
) -> PyResult<Network> {
    let opened = match (text, path) {
        (None, Some(path)) => Source::open(path),
        (text, _) => Source::from_bytes(name, text.unwrap_or_default().into_bytes()),
    };
    let opened = opened.map_err(|error| of_world(py, error, "set"))?;
    let folder = folder.unwrap_or(opened.folder);
    Network::new(py, Source { folder, files, ..opened }, sets)
}

impl Network {
    fn new(py: Python<'_>, source: Source, sets: Vec<String>) -> PyResult<Network> {
        let model = System::read_network(&source, &sets).map_err(|error| of_world(py, error, "set"))?;
        Ok(Network { source, sets, model: Arc::new(model) })
    }

    fn title(&self) -> &str {
        self.model.title.as_deref().unwrap_or(&self.source.name)
    }
}

/// The columns of each station, and why the run ended early.
type Run = (Vec<Vec<Vec<f64>>>, Option<String>);

fn run(model: &System, scenario: &str, is_over: &mut dyn FnMut() -> bool) -> Result<Run, Failure> {
    let mut run = SystemRun::new(model, scenario).map_err(|error| Failure::Input(error.to_string()))?;
    let mut tables = Vec::new();
    for (at, station) in run.stations().enumerate() {
        let (rows, columns) = (station.rows(), station_columns(model, at).len());
        let bytes = rows.saturating_mul(8 * columns as u64);
        tables.push(columns_with_room(rows, columns).ok_or(Failure::Memory(bytes))?);
    }
    let (mut ended, mut done, mut values) = (None, 0_u64, Vec::new());
    while let Some(row) = run.next() {
        match row {
            Ok(row) => {
                row.numbers(&mut values);
                tables[row.station].iter_mut().zip(&values).for_each(|(column, value)| column.push(*value));
            }
            Err(error) => ended = Some(error.to_string()),
        }
        done += 1;
        if done.is_multiple_of(CHUNK) && is_over() {
            break;
        }
    }
    Ok((tables, ended))
}

#[pymethods]
impl Network {
    /// A changed copy; `value` is spelled as in the file or on the command line.
    fn set(&self, py: Python<'_>, key: &str, value: &str) -> PyResult<Network> {
        // The last of a key wins: an earlier one would only be in the way of the limit on their number.
        let same = |set: &String| set.split_once('=').is_some_and(|(old, _)| old == key);
        let mut sets: Vec<String> = self.sets.iter().filter(|set| !same(set)).cloned().collect();
        sets.push(format!("{key}={value}"));
        Network::new(py, self.source.clone(), sets)
    }

    /// `(whether there may be a number under this key, the number in the key's SI unit)`.
    fn number(&self, key: &str) -> (bool, Option<f64>) {
        (self.model.key(key).is_some(), self.model.number(key))
    }

    /// `(name, text, folder, files, sets)`, of which `read_network` makes the same network.
    fn parts(&self) -> (String, String, PathBuf, Files, Vec<String>) {
        let Source { name, text, folder, files } = self.source.clone();
        (name, text, folder, files, self.sets.clone())
    }

    #[getter]
    fn name(&self) -> &str {
        self.title()
    }

    /// The stations' names in file order.
    #[getter]
    fn stations(&self) -> Vec<String> {
        self.model.stations.iter().map(|station| station.name.clone()).collect()
    }

    /// The scenarios' names.
    #[getter]
    fn scenarios(&self) -> Vec<String> {
        self.model.scenarios().into_iter().map(String::from).collect()
    }

    /// `(JSON, text)` of the check.
    fn check(&self, py: Python<'_>) -> PyResult<(String, String)> {
        let (model, title) = (Arc::clone(&self.model), self.title().to_string());
        let work = move || -> Result<_, hapt_analysis::Error> {
            let check = hapt_analysis::check_network(&model)?.with_remedies(&model, true)?;
            Ok((serde_json::to_string(&check), check.text(&title, false)))
        };
        let until = move |stop: &Stop| hapt_analysis::until(stop.flag(), work);
        let (json, text) = interruptible(py, until)?.ok_or_else(unwanted)?.map_err(value)?;
        Ok((json.map_err(internal)?, text))
    }

    /// See [`analyses::boundary`].
    fn boundary<'py>(&self, py: Python<'py>, axes: Vec<String>, claims: Vec<String>) -> PyResult<Edges<'py>> {
        analyses::boundary(py, self.source.clone(), self.sets.clone(), axes, &claims)
    }

    /// A grid of this network; each axis its key and values in SI.
    fn sweep(
        &self,
        py: Python<'_>,
        axes: Vec<(String, Vec<f64>)>,
        measures: Vec<String>,
        scenario: Option<&str>,
    ) -> PyResult<Sweep> {
        Sweep::new(py, &self.source, &self.sets, &axes, &measures, scenario)
    }

    /// The worst hands found, as JSON, and the network with the scenario that shows them.
    fn worst(&self, py: Python<'_>) -> PyResult<(String, Network)> {
        let model = Arc::clone(&self.model);
        let found = in_parallel(py, 0, move |stop| {
            let watch = |_| if stop.is_set() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
            search_together(&model, &watch).map(|worst| (serde_json::to_string(&worst), worst.network))
        })?;
        let (json, shown) = found.map_err(value)?;
        let names: Vec<String> = shown.stations.iter().map(|station| format!("{}.toml", station.name)).collect();
        let worlds = shown.stations.iter().map(|station| station.stated_world().to_toml());
        let files = names.iter().cloned().zip(worlds).collect();
        let source = Source { files, ..Source::from_text("worst", shown.to_toml(&names)) };
        Ok((json.map_err(internal)?, Network::new(py, source, Vec::new())?))
    }

    /// `(columns by station, why it ended early)` of a run.
    fn run<'py>(&self, py: Python<'py>, scenario: &str) -> PyResult<(Bound<'py, PyDict>, Option<String>)> {
        let names = self.model.scenarios();
        if !names.contains(&scenario) {
            let hint = hapt_model::did_you_mean(scenario, names.iter().copied());
            return Err(PyValueError::new_err(format!("no station's world has a scenario {scenario:?}{hint}")));
        }
        let (tables, ended) =
            asking(py, |is_over| run(&self.model, scenario, is_over))?.map_err(|failure| match failure {
                Failure::Input(message) => value(message),
                Failure::Memory(bytes) => PyMemoryError::new_err(too_large(bytes)),
            })?;
        let stations = PyDict::new(py);
        for (at, (station, table)) in self.model.stations.iter().zip(tables).enumerate() {
            let columns = PyDict::new(py);
            for (column, values) in station_columns(&self.model, at).into_iter().zip(table) {
                columns.set_item(column.name, values.into_pyarray(py))?;
            }
            stations.set_item(&station.name, columns)?;
        }
        Ok((stations, ended))
    }
}
