//! The device against solutions that share no code with it.

mod fields;
mod pieces;
mod reference;
mod shafts;
mod stops;
