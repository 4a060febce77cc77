//! Stability of the linear loop, held and free: eigenvalues, growth, modes, critical period.

pub mod clamped;
pub mod critical;
mod delayed;
pub mod free;
pub mod held;
pub mod multiplier;
pub mod patterns;
pub(crate) mod roots;
pub(crate) mod single_body;
mod verdict;

pub use verdict::*;
