//! The device against solutions that share nothing with it.

mod fields;
mod reference;
mod shafts;
mod stops;
