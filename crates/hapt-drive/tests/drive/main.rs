//! Motor drives, simulated, over a serial line: the loop on them, and what goes wrong there.
#![cfg(target_os = "linux")]

mod middle;
mod moteus;
mod odrive;
mod others;
mod rig;
