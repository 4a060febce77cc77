//! The certificate of a world, what would earn it, and how far each number may go.

mod certified;
pub mod check;
pub mod proposal;
pub mod remedies;
mod sentences;

pub use certified::*;
