//! `hapt._hapt`: the computations of the Python package `hapt`, by the Rust crates. The package's own modules adapt them to Python's
//! conventions.
//!
//! Every call that may take long runs on its own thread with the interpreter's lock released, see `interrupt`.

mod analyses;
mod arrow;
mod error;
mod interrupt;
mod running;
mod simulate;
mod sweep;
mod world;

use pyo3::prelude::*;

/// The native module.
#[pymodule(gil_used = false)]
mod _hapt {
    use numpy::{IntoPyArray, PyArrayMethods};
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::analyses::{coupling_keys, design, hand_keys, identify, measures};
    #[pymodule_export]
    use super::arrow::arrow_stream;
    #[pymodule_export]
    use super::error::WorldError;
    #[pymodule_export]
    use super::running::{Device, Loop};
    #[pymodule_export]
    use super::sweep::Sweep;
    #[pymodule_export]
    use super::world::{World, read};

    /// The version of the crates.
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");

    /// NumPy's functions are looked up once, by the first array. That is done here: Ctrl-C during the lookup is a panic, and it is calls that
    /// people interrupt.
    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        let array = vec![0.0].into_pyarray(module.py());
        array.try_readonly()?;
        Ok(())
    }
}
