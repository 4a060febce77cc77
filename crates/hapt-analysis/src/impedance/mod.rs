//! The impedance at the puck: of the sampled world, of the loop as the hand feels it, and of the ideal world.

pub(crate) mod ideal;
pub mod rendered;
mod transfer;

pub(crate) use transfer::*;
