//! The command line as its users see it: input, output, and exit codes.
#![cfg_attr(not(unix), allow(dead_code, unused_imports))] // What tests of signals and of a shell take.

#[cfg(unix)]
mod bad_inputs;
#[cfg(unix)]
mod blocked;
#[cfg(unix)]
mod board;
mod boundary;
mod commands;
mod common;
mod contract;
mod drives;
mod endings;
mod export;
mod first_steps;
mod help;
mod identify;
mod impedance;
mod live;
mod logs;
mod lookups;
mod network;
mod odrive;
mod outputs;
mod proof;
mod realtime;
mod refusals;
mod report;
mod runs;
mod schema;
mod simplefoc;
mod spelling;
mod station;
mod station_can;
mod sweep;
#[cfg(target_os = "linux")]
mod wheel;
mod worst;
