//! Runs: the real loop on the exact device, in the hand.

mod batch;
mod closed_forms;
mod common;
mod device;
mod device_friction;
mod device_stops;
mod device_torque;
mod energy;
mod felt;
mod gripped;
mod guarded;
mod handle;
mod lag;
mod linearisation;
mod network;
mod notes;
mod published;
mod settled;
mod switching;
mod uneven;
mod virtual_device;
