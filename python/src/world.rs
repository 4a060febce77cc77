//! Worlds: read, changed, asked.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;

use hapt_analysis::Slopes;
use hapt_model::{Scenario, Source, Timing, World as Model};
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

/// A key's path, value in SI, text as it is written, unit, meaning, and whether the file has it.
type Parameter = (String, Option<f64>, String, String, &'static str, bool);

/// A world with the text that it was read from and the changes made to it.
#[pyclass(frozen, module = "hapt._hapt")]
pub struct World {
    source: Source,
    sets: Vec<String>,
    model: Arc<Model>,
}

/// Reads a world: of `text`, or of the file `path`.
#[pyfunction]
#[pyo3(signature = (name, text=None, folder=None, sets=vec![], path=None))]
pub fn read(
    py: Python<'_>,
    name: &str,
    text: Option<String>,
    folder: Option<PathBuf>,
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
    let mut source = opened.map_err(|error| of_world(py, error, "set"))?;
    if let Some(folder) = folder {
        source.folder = folder;
    }
    World::new(py, source, sets)
}

impl World {
    fn new(py: Python<'_>, source: Source, sets: Vec<String>) -> PyResult<World> {
        let model = Model::read(&source, &sets).map_err(|error| of_world(py, error, "set"))?;
        Ok(World { source, sets, model: Arc::new(model) })
    }

    /// A scenario as it runs. The search for the worst pattern of its samples may take long.
    fn played<'a>(&self, py: Python<'_>, scenario: &'a Scenario) -> PyResult<Cow<'a, Scenario>> {
        if scenario.timing != Timing::Worst {
            return Ok(Cow::Borrowed(scenario));
        }
        let (model, searched) = (Arc::clone(&self.model), scenario.clone());
        let work = move || hapt_analysis::with_worst_pattern(&model, &searched).map(Cow::into_owned);
        let until = move |stop: &Stop| hapt_analysis::until(stop.flag(), work);
        Ok(Cow::Owned(interruptible(py, until)?.ok_or_else(unwanted)?.map_err(value)?))
    }

    /// What `self` is called.
    fn title(&self) -> &str {
        self.model.title.as_deref().unwrap_or(&self.source.name)
    }
}

#[pymethods]
impl World {
    /// A changed copy; `value` is spelled as in a world file or on the command line.
    fn set(&self, py: Python<'_>, key: &str, value: &str) -> PyResult<World> {
        // The last of a key wins: an earlier one would only be in the way of the limit on their number.
        let same = |set: &String| set.split_once('=').is_some_and(|(old, _)| old == key);
        let mut sets: Vec<String> = self.sets.iter().filter(|set| !same(set)).cloned().collect();
        sets.push(format!("{key}={value}"));
        World::new(py, self.source.clone(), sets)
    }

    /// Every key of the world.
    fn parameters(&self, py: Python<'_>) -> PyResult<Vec<Parameter>> {
        let list = hapt_model::parameters(&self.source, &self.sets).map_err(|error| of_world(py, error, "set"))?;
        Ok(list.into_iter().map(|p| (p.path, p.si, p.written, p.unit, p.doc, p.given)).collect())
    }

    /// What is wrong with a key that no parameter has, with the nearest name.
    fn no_such_key(&self, py: Python<'_>, key: &str) -> PyResult<PyErr> {
        let names: Vec<String> = self.parameters(py)?.into_iter().map(|parameter| parameter.0).collect();
        let hint = hapt_model::did_you_mean(key, names.iter().map(String::as_str));
        Ok(PyKeyError::new_err(format!("the world has no key {key:?}{hint}")))
    }

    /// Whether a number may stand under this key, so that an absent one is None.
    fn takes(&self, key: &str) -> bool {
        self.model.key(key).is_some()
    }

    /// `(name, text, folder, sets)`, of which `read` makes the same world.
    fn parts(&self) -> (String, String, PathBuf, Vec<String>) {
        (self.source.name.clone(), self.source.text.clone(), self.source.folder.clone(), self.sets.clone())
    }

    /// The world as a file, changes applied.
    fn to_toml(&self) -> String {
        self.model.to_toml()
    }

    #[getter]
    fn name(&self) -> &str {
        self.title()
    }

    #[getter]
    fn is_linear(&self) -> bool {
        self.model.motion == hapt_model::Motion::Linear
    }

    #[getter]
    fn period(&self) -> f64 {
        self.model.sampling.period
    }

    /// The bodies' names in file order.
    #[getter]
    fn bodies(&self) -> Vec<String> {
        self.model.names.clone()
    }

    /// The scenarios' names in file order.
    #[getter]
    fn scenarios(&self) -> Vec<String> {
        self.model.scenarios.iter().map(|scenario| scenario.name.clone()).collect()
    }

    /// `(columns, summary, why it ended early)` of a run.
    #[allow(clippy::type_complexity)] // A tuple of mappings for Python to name.
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        name: String,
    ) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyDict>, Option<String>)> {
        let scenario = self.model.scenario(&name).map_err(|error| of_world(py, error, "simulate"))?;
        let played = self.played(py, scenario)?;
        let run = asking(py, |is_over| simulate(&self.model, &played, is_over))?;
        let run = run.map_err(|failure| match failure {
            Failure::Input(message) => value(message),
            Failure::Memory(bytes) => PyMemoryError::new_err(too_large(bytes)),
        })?;
        let (columns, summary) = (PyDict::new(py), PyDict::new(py));
        for (name, values) in run.names.into_iter().zip(run.values) {
            columns.set_item(name, values.into_pyarray(py))?;
        }
        summary.set_item("rows", run.rows)?;
        summary.set_item("clipped", run.clipped)?;
        for (name, value) in run.summary {
            summary.set_item(name, value)?;
        }
        Ok((columns, summary, run.ended))
    }

    /// `(JSON, text)` of the check.
    fn check(&self, py: Python<'_>, remedies: bool) -> PyResult<(String, String)> {
        let (model, source, sets) = (Arc::clone(&self.model), self.source.clone(), self.sets.clone());
        let title = self.title().to_string();
        let work = move || -> Result<_, Box<dyn std::error::Error + Send + Sync>> {
            let mut check = hapt_analysis::check(&model)?;
            let mut proposed = None;
            if remedies {
                let found = hapt_analysis::remedies(&model)?;
                proposed = hapt_analysis::proposal(&model, &source, &sets, &check, &found)?;
                check.remedies = Some(found);
            }
            let text = check.text(&title, &model.sampling, proposed.as_ref(), false);
            Ok((serde_json::to_string(&check), text))
        };
        let until = move |stop: &Stop| hapt_analysis::until(stop.flag(), work);
        let (json, text) = interruptible(py, until)?.ok_or_else(unwanted)?.map_err(value)?;
        Ok((json.map_err(internal)?, text))
    }

    /// The rows of the impedance as columns, and the rest as JSON.
    fn impedance<'py>(
        &self,
        py: Python<'py>,
        low: Option<f64>,
        high: Option<f64>,
        points: usize,
        steep: bool,
    ) -> PyResult<(Bound<'py, PyDict>, String)> {
        let model = Arc::clone(&self.model);
        let slopes = if steep { Slopes::Steep } else { Slopes::Flat };
        let work = move |stop: &Stop| analyses::impedance(&model, &slopes, low, high, points, stop);
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

    /// The worst hand found, as JSON, and the world with the scenario that shows it where no file is needed beside it.
    fn worst(&self, py: Python<'_>) -> PyResult<(String, Option<String>)> {
        let model = Arc::clone(&self.model);
        let found = in_parallel(py, 0, move |stop| {
            let watch = |_| if stop.is_set() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
            hapt_sweep::worst::search_watched(&model, &watch).map(|worst| (serde_json::to_string(&worst), worst, model))
        })?;
        let (json, worst, model) = found.map_err(value)?;
        let shown = Model { scenarios: vec![worst.scenario], ..(*model).clone() };
        Ok((json.map_err(internal)?, worst.motion.is_none().then(|| shown.to_toml())))
    }

    /// Whether a record agrees with the world, as JSON.
    fn against(
        &self,
        py: Python<'_>,
        times: PyReadonlyArray1<'_, f64>,
        positions: PyReadonlyArray1<'_, f64>,
        torques: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<String> {
        analyses::against(py, Arc::clone(&self.model), &times, &positions, &torques)
    }

    /// A grid of this world; each axis its key and values in SI.
    fn sweep(
        &self,
        py: Python<'_>,
        axes: Vec<(String, Vec<f64>)>,
        measures: Vec<String>,
        scenario: Option<&str>,
    ) -> PyResult<Sweep> {
        Sweep::new(py, &self.source, &self.sets, &axes, &measures, scenario)
    }

    /// The loop alone.
    fn running(&self) -> PyResult<Loop> {
        Loop::new(Arc::clone(&self.model))
    }

    /// The device alone, with the hand of a scenario or none.
    fn device(&self, py: Python<'_>, scenario: Option<&str>) -> PyResult<Device> {
        let scenario = scenario.map(|name| self.model.scenario(name)).transpose();
        let scenario = scenario.map_err(|error| of_world(py, error, "device"))?;
        if let Some(scenario) = scenario.filter(|scenario| scenario.timing != Timing::Even) {
            let name = &scenario.name;
            return Err(PyValueError::new_err(format!(
                "scenario {name:?} has a timing, and step() takes a period each; simulate() plays it as it is"
            )));
        }
        Ok(Device::new(&self.model, scenario))
    }

    /// The matrices of world, device and estimator as JSON, see [`analyses::state_spaces`].
    fn state_spaces(&self) -> PyResult<String> {
        Ok(analyses::state_spaces(&self.model).map_err(value)?.to_string())
    }
}
