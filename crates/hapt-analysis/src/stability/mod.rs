//! Stability of the linear loop, held and free: eigenvalues, growth, modes, critical period.

pub mod clamped;
pub mod critical;
mod delayed;
pub(crate) mod fall;
pub mod free;
pub mod held;
mod modal_loop;
pub mod multiplier;
mod near_circle;
pub mod pairs;
pub(crate) mod patterns;
pub(crate) mod poles;
pub(crate) mod roots;
pub(crate) mod single_body;
mod verdict;

pub use verdict::*;
