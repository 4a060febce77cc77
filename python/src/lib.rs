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
}
