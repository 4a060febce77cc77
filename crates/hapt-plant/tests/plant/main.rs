//! The device against solutions that share no code with it.

mod fields;
mod friction_by_position;
mod pieces;
mod reference;
mod shafts;
mod stops;
