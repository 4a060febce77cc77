//! Simulated motor drives over a serial line: the loop on them, and its faults.
#![cfg(target_os = "linux")]

mod bench;
mod killed;
mod middle;
mod moteus;
mod odrive;
mod others;
mod simplefoc;
mod sketch;
mod uneven;
