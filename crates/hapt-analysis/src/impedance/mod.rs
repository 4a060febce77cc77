//! The impedance at the puck: the transfer function of the sampled world, the rendered and the ideal impedance.

pub(crate) mod ideal;
pub mod rendered;
mod transfer;

pub(crate) use transfer::*;
