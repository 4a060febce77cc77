//! Worlds and networks: reading, changing, analysing, running.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;

use hapt_analysis::Slopes;
use hapt_live::standalone::{Page, PageInput, Place, single};
use hapt_model::keys::Takes;
use hapt_model::{Parameter, Source, System, Timing, World as Model};
use hapt_sweep::worst::{Worst, search};
use numpy::{IntoPyArray, PyReadonlyArray1};
use pyo3::exceptions::{PyKeyError, PyMemoryError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::analyses::{self, Edges};
use crate::error::{internal, of_world, value};
use crate::interrupt::{Stop, asking, in_parallel, interruptible, unwanted};
use crate::running::{Device, Loop};
use crate::simulate::{Failure, simulate, too_large};
use crate::sweep::Sweep;

/// A key's value.
#[derive(IntoPyObject)]
pub enum Value {
    /// In SI.
    Number(f64),
    Whole(i64),
    Text(String),
}

impl Value {
    fn of(Parameter { si, written, takes, .. }: Parameter) -> Value {
        let number = || si.or_else(|| written.parse().ok());
        let value = match takes {
            Takes::Quantity(..) | Takes::QuantityOr(..) | Takes::TimeOrSamples => number().map(Value::Number),
            // The reader has checked that it is whole.
            Takes::Whole { .. } => number().map(|number| Value::Whole(number as i64)),
            Takes::Text
            | Takes::Name(_)
            | Takes::Numbers { .. }
            | Takes::Ends(_)
            | Takes::Table
            | Takes::Named { .. }
            | Takes::List { .. } => None,
        };
        value.unwrap_or(Value::Text(written))
    }
}

/// A world or network with the text that it was read from and the changes made to it.
#[pyclass(frozen, module = "hapt._hapt")]
pub struct World {
    source: Source,
    sets: Vec<String>,
    model: Arc<System>,
}

/// The texts of a network's world files, by the names that the network has for them.
type Files = BTreeMap<String, String>;

/// Reads a world or network: from `text` with `files`, or from the file `path`.
#[pyfunction]
#[pyo3(signature = (name, text=None, folder=None, files=Files::new(), sets=vec![], path=None))]
pub fn read(
    py: Python<'_>,
    name: &str,
    text: Option<String>,
    folder: Option<PathBuf>,
    files: Files,
    sets: Vec<String>,
    path: Option<PathBuf>,
) -> PyResult<World> {
    let opened = match (text, path) {
        (None, Some(path)) if path.to_string_lossy().starts_with('@') => {
            hapt_model::builtin::source(&path.to_string_lossy())
        }
        (None, Some(path)) => Source::open(path),
        (text, _) => Source::from_bytes(name, text.unwrap_or_default().into_bytes()),
    };
    let opened = opened.map_err(|error| of_world(py, error, "set"))?;
    let folder = folder.unwrap_or(opened.folder);
    World::new(py, Source { folder, files, ..opened }, sets)
}

impl World {
    fn new(py: Python<'_>, source: Source, sets: Vec<String>) -> PyResult<World> {
        let model = System::read(&source, &sets).map_err(|error| of_world(py, error, "set"))?;
        Ok(World { source, sets, model: Arc::new(model) })
    }

    /// The world. Raises ValueError for a network.
    fn world(&self) -> PyResult<&Model> {
        self.model
            .world()
            .ok_or_else(|| value(format!("{} is a network; this needs a world", self.model.title_or(&self.source))))
    }

    /// The system with its scenario's sample times. For `Timing::Worst` their search may take long.
    fn played(&self, py: Python<'_>, name: &str) -> PyResult<Arc<System>> {
        if !self.model.scenario(name).into_iter().flatten().any(|scenario| scenario.timing == Timing::Worst) {
            return Ok(Arc::clone(&self.model));
        }
        let (model, name) = (Arc::clone(&self.model), name.to_string());
        let work = move || hapt_analysis::played(&model, &name).map(Cow::into_owned);
        let until = move |stop: &Stop| hapt_analysis::until(stop.flag(), work);
        Ok(Arc::new(interruptible(py, until)?.ok_or_else(unwanted)?.map_err(value)?))
    }
}

#[pymethods]
impl World {
    /// A copy in which `key` has another value, written as in a world file or on the command line.
    fn set(&self, py: Python<'_>, key: &str, value: &str) -> PyResult<World> {
        // Only the last value of a key is used; earlier ones would count towards the limit on the number of changes.
        let same = |set: &String| set.split_once('=').is_some_and(|(old, _)| old == key);
        let mut sets: Vec<String> = self.sets.iter().filter(|set| !same(set)).cloned().collect();
        sets.push(format!("{key}={value}"));
        World::new(py, self.source.clone(), sets)
    }

    /// Every key of the world, or of the stations' worlds, with its value.
    fn parameters(&self, py: Python<'_>) -> PyResult<Vec<(String, Value)>> {
        let mut all = Vec::new();
        for station in &self.model.stations {
            let list = hapt_model::parameters(&station.source, &station.sets);
            let list = list.map_err(|error| of_world(py, error, "set"))?;
            let prefix = if station.name.is_empty() { String::new() } else { format!("stations.{}.", station.name) };
            all.extend(list.into_iter().map(|p| (format!("{prefix}{}", p.path), Value::of(p))));
        }
        Ok(all)
    }

    /// The KeyError for an unknown key, with the nearest known key.
    fn no_such_key(&self, py: Python<'_>, key: &str) -> PyResult<PyErr> {
        let names: Vec<String> = self.parameters(py)?.into_iter().map(|parameter| parameter.0).collect();
        let hint = hapt_model::did_you_mean(key, names.iter().map(String::as_str));
        Ok(PyKeyError::new_err(format!("the {} has no key {key:?}{hint}", self.model.kind())))
    }

    /// `(whether the key may have a number, the number in the key's SI unit)`.
    fn number(&self, key: &str) -> (bool, Option<f64>) {
        (self.model.key(key).is_some(), self.model.number(key))
    }

    /// `(name, text, folder, files, sets)`, the arguments with which `read` gives an equal world.
    fn parts(&self) -> (String, String, PathBuf, Files, Vec<String>) {
        let Source { name, text, folder, files } = self.source.clone();
        (name, text, folder, files, self.sets.clone())
    }

    /// The text of a world file with all changes applied. Raises ValueError for a network, which has several files.
    fn to_toml(&self) -> PyResult<String> {
        Ok(self.world()?.to_toml())
    }

    /// A text that is equal for equal worlds and networks.
    fn identity(&self) -> String {
        self.model.world().map_or_else(|| format!("{:?}", self.model), Model::to_toml)
    }

    #[getter]
    fn name(&self) -> &str {
        self.model.title_or(&self.source)
    }

    /// The names of a network's stations in file order; empty for a world.
    #[getter]
    fn stations(&self) -> Vec<String> {
        self.model.stations.iter().map(|station| station.name.clone()).filter(|name| !name.is_empty()).collect()
    }

    /// The two stations of each link of a network, in file order.
    #[getter]
    fn links(&self) -> Vec<(String, String)> {
        let name = |at: usize| self.model.stations[at].name.clone();
        self.model.links.iter().map(|link| (name(link.between[0]), name(link.between[1]))).collect()
    }

    /// The names of the bodies in file order. Raises ValueError for a network.
    #[getter]
    fn bodies(&self) -> PyResult<Vec<String>> {
        Ok(self.world()?.names.clone())
    }

    /// The names of the scenarios in file order.
    #[getter]
    fn scenarios(&self) -> Vec<String> {
        self.model.scenarios().into_iter().map(String::from).collect()
    }

    /// Runs a scenario: `(each station's columns and summary, the reason for an early end or None)`.
    #[allow(clippy::type_complexity)] // A tuple of mappings for Python to name.
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        name: String,
    ) -> PyResult<(Vec<(Bound<'py, PyDict>, Bound<'py, PyDict>)>, Option<String>)> {
        self.model.find_scenario(&name).map_err(|error| of_world(py, error, "simulate"))?;
        let played = self.played(py, &name)?;
        let run = asking(py, |is_over| simulate(&played, &name, is_over))?;
        let run = run.map_err(|failure| match failure {
            Failure::Input(message) => value(message),
            Failure::Memory(bytes) => PyMemoryError::new_err(too_large(bytes)),
        })?;
        let mut stations = Vec::new();
        for station in run.stations {
            let (columns, summary) = (PyDict::new(py), PyDict::new(py));
            for (name, values) in station.names.into_iter().zip(station.values) {
                columns.set_item(name, values.into_pyarray(py))?;
            }
            summary.set_item("rows", station.rows)?;
            summary.set_item("clipped", station.clipped)?;
            for (name, value) in station.summary {
                summary.set_item(name, value)?;
            }
            stations.push((columns, summary));
        }
        Ok((stations, run.ended))
    }

    /// The check as `(JSON, text)`.
    fn check(&self, py: Python<'_>, remedies: bool) -> PyResult<(String, String)> {
        let (model, title) = (Arc::clone(&self.model), self.model.title_or(&self.source).to_string());
        let work = move || -> Result<_, Box<dyn std::error::Error + Send + Sync>> {
            let check = hapt_analysis::check_system(&model, remedies)?;
            Ok((serde_json::to_string(&check), check.text(&model, &title, false)?))
        };
        let until = move |stop: &Stop| hapt_analysis::until(stop.flag(), work);
        let (json, text) = interruptible(py, until)?.ok_or_else(unwanted)?.map_err(value)?;
        Ok((json.map_err(internal)?, text))
    }

    /// The page that runs the world or network in a browser without a server, as one HTML document.
    fn page(&self, py: Python<'_>) -> PyResult<String> {
        let (model, source, sets) = (Arc::clone(&self.model), self.source.clone(), self.sets.clone());
        let work = move || -> Result<_, Box<dyn std::error::Error + Send + Sync>> {
            let check = hapt_analysis::check_system(&model, true)?;
            let page = Page::new(&source, sets, &model, &check)?;
            let proposal = check.proposal(&model)?;
            let title = model.title_or(&source);
            Ok(single(&PageInput { page: &page, title, proposal: proposal.as_ref(), place: Place::Notebook }))
        };
        let until = move |stop: &Stop| hapt_analysis::until(stop.flag(), work);
        interruptible(py, until)?.ok_or_else(unwanted)?.map_err(value)
    }

    /// The impedance: its columns, and the rest as JSON.
    fn impedance<'py>(
        &self,
        py: Python<'py>,
        low: Option<String>,
        high: Option<String>,
        points: usize,
        steep: bool,
    ) -> PyResult<(Bound<'py, PyDict>, String)> {
        let model = self.world()?.clone();
        let slopes = if steep { Slopes::Steep } else { Slopes::Flat };
        let work =
            move |stop: &Stop| analyses::impedance(&model, &slopes, low.as_deref(), high.as_deref(), points, stop);
        let (columns, json) = interruptible(py, work)?.map_err(value)?.ok_or_else(unwanted)?;
        let dict = PyDict::new(py);
        for (name, values) in columns {
            dict.set_item(name, values.into_pyarray(py))?;
        }
        Ok((dict, json.to_string()))
    }

    /// See [`analyses::boundary`].
    fn boundary<'py>(&self, py: Python<'py>, axes: Vec<String>, claims: Vec<String>) -> PyResult<Edges<'py>> {
        analyses::boundary(py, self.source.clone(), self.sets.clone(), axes, &claims)
    }

    /// The worst hands found, as JSON, and the system with the scenario that repeats them; None where the hand is a prescribed motion.
    fn worst(&self, py: Python<'_>) -> PyResult<(String, Option<World>)> {
        let model = Arc::clone(&self.model);
        let found = in_parallel(py, 0, move |stop| {
            let watch = |_| if stop.is_set() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
            search(&model, &watch).map(|worst| (serde_json::to_string(&worst), worst))
        })?;
        let (json, worst) = found.map_err(value)?;
        let (text, files) = match worst {
            Worst::World(worst) if worst.motion.is_some() => return Ok((json.map_err(internal)?, None)),
            Worst::World(worst) => {
                (Model { scenarios: vec![worst.scenario], ..self.world()?.clone() }.to_toml(), Files::new())
            }
            Worst::Network(worst) => {
                let stations = || worst.network.stations.iter();
                let names: Vec<String> = stations().map(|station| format!("{}.toml", station.name)).collect();
                let worlds = stations().map(|station| station.stated_world().to_toml());
                (worst.network.to_toml(&names), names.into_iter().zip(worlds).collect())
            }
        };
        let source = Source { files, ..Source::from_text("worst", text) };
        Ok((json.map_err(internal)?, Some(World::new(py, source, Vec::new())?)))
    }

    /// The comparison of a record with the world's device, as JSON.
    fn against(
        &self,
        py: Python<'_>,
        times: PyReadonlyArray1<'_, f64>,
        positions: PyReadonlyArray1<'_, f64>,
        torques: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<String> {
        analyses::against(py, Arc::new(self.world()?.clone()), &times, &positions, &torques)
    }

    /// A grid of this world; each axis is a key and its values in SI.
    fn sweep(
        &self,
        py: Python<'_>,
        axes: Vec<(String, Vec<f64>)>,
        measures: Vec<String>,
        scenario: Option<&str>,
    ) -> PyResult<Sweep> {
        Sweep::new(py, &self.source, &self.sets, &axes, &measures, scenario)
    }

    /// The loop without its device.
    fn running(&self) -> PyResult<Loop> {
        Loop::new(Arc::new(self.world()?.clone()))
    }

    /// The device without the loop, with the hand of a scenario or without.
    fn device(&self, py: Python<'_>, scenario: Option<&str>) -> PyResult<Device> {
        let world = self.world()?;
        let scenario = scenario.map(|name| world.scenario(name)).transpose();
        let scenario = scenario.map_err(|error| of_world(py, error, "device"))?;
        if let Some(scenario) = scenario.filter(|scenario| scenario.timing != Timing::Even) {
            let name = &scenario.name;
            return Err(PyValueError::new_err(format!(
                "scenario {name:?} has a timing, but step() always takes one period; simulate() runs it with its times"
            )));
        }
        Ok(Device::new(world, scenario))
    }

    /// The matrices of world, device and estimator as JSON, see [`analyses::state_spaces`].
    fn state_spaces(&self) -> PyResult<String> {
        Ok(analyses::state_spaces(self.world()?).map_err(value)?.to_string())
    }
}
