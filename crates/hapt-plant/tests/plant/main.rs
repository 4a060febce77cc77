//! The device against solutions that share nothing with it.

mod fields;
mod pieces;
mod reference;
mod shafts;
mod stops;
