//! Passivity against every passive hand: required damping, proof, quantisation, worst hand.

pub(crate) mod curve;
pub(crate) mod proof;
pub mod quantisation;
pub(crate) mod required;
pub(crate) mod supremum;
pub(crate) mod timing;
pub(crate) mod two_rates;
pub(crate) mod uneven;
mod verdict;
pub mod worst_grip;

pub use required::*;
pub use uneven::{Uneven, uneven, uneven_damping};
pub use verdict::*;
