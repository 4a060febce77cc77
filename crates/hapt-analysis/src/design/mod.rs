//! Design of a wheel on a spring, and its exact responses.

pub mod closed_form;
mod specification;

pub use specification::*;
