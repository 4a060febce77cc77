//! The fit of a device to its records, against the exact device.

mod against;
mod bounds;
mod device;
mod disturbed;
mod handle;
mod lever;
mod loaded;
mod mat;
mod misfit;
mod released;
mod richer;
mod rig;
mod stops;
mod tables;
mod terms;
