//! Design of a wheel on a spring, and what it does exactly.

pub mod closed_form;
mod specification;

pub use specification::*;
