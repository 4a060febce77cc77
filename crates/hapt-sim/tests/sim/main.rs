//! Runs: the real loop on the exact device, in the hand.

mod closed_forms;
mod common;
mod device;
mod energy;
mod felt;
mod gripped;
mod guarded;
mod linearisation;
mod notes;
mod published;
mod side;
mod switching;
mod virtual_device;
