//! The certificate of a world, its remedies, and the margins of a certified world.

mod certified;
mod change;

pub mod check;
mod headline;
pub mod proof;
pub mod proposal;
pub mod remedies;
pub(crate) mod rounding;
mod sentences;
pub mod text;

pub use certified::*;
