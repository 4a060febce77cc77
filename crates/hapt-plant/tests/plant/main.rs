//! The device against solutions that share nothing with it.

mod reference;
mod shafts;
mod stops;
