//! The fit of a device to its records, against the exact device.

mod bounds;
mod device;
mod disturbed;
mod rig;
