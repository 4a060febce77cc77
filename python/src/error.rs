//! Errors of the crates as Python's exceptions.

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

pyo3::create_exception!(
    hapt,
    WorldError,
    PyValueError,
    "A world, or a change of one, that cannot be read.\n\n\
     The text shows the line with a caret under the mistake. `key` is the dotted path of the key or '', `kind` the sort of mistake; \
     `line` and `column` count from 1, and are None where the mistake is in no text."
);

/// A [`WorldError`]; an error in an override is reported as one in `change`, the name of the Python call that made it.
pub fn of_world(py: Python<'_>, mut error: hapt_model::Error, change: &str) -> PyErr {
    let kind = format!("{:?}", error.kind).to_lowercase();
    if let Some(location) = error.location.as_mut().filter(|location| location.source.starts_with("--")) {
        location.source = change.into();
    }
    let made = WorldError::new_err(error.to_string());
    let place = error.location.map(|location| (location.line, location.column));
    let instance = made.value(py);
    let set = instance
        .setattr("key", error.key)
        .and_then(|()| instance.setattr("kind", kind))
        .and_then(|()| instance.setattr("line", place.map(|(line, _)| line)))
        .and_then(|()| instance.setattr("column", place.map(|(_, column)| column)));
    set.map_or_else(|error| error, |()| made)
}

/// The error of a request of `call`, a sweep or a boundary.
pub fn of_sweep(py: Python<'_>, error: hapt_sweep::Error, call: &str) -> PyErr {
    match error {
        hapt_sweep::Error::Model(error) => of_world(py, error, call),
        other => PyValueError::new_err(other.to_string().replace("--vary ", "").replace("--measure", "measures")),
    }
}

/// An error of a crate as ValueError, such as that of an analysis without a result.
pub fn value(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// A defect, reported as an exception instead of an abort.
pub fn internal(error: impl std::fmt::Display) -> PyErr {
    PyRuntimeError::new_err(format!("internal error of hapt: {error}"))
}
