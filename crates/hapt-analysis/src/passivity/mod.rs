//! Passivity against every passive hand: the damping that it takes, what stays unproved, and the worst hand.

pub(crate) mod curve;
pub(crate) mod proof;
pub mod quantisation;
mod required;
pub(crate) mod supremum;
pub mod worst_grip;

pub use required::*;
