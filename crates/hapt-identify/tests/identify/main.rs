//! The fit of a device to its records, against the exact device.

mod device;
mod disturbed;
mod rig;
