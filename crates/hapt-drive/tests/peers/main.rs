//! Interoperation with other programs: ODrive's DBC files, a client for ODrives, and the manufacturer's library for the moteus.
//!
//! This is a separate test program: it needs Python with packages, which `cargo xtask test` installs.
#![cfg(target_os = "linux")]

#[path = "../drive/bench.rs"]
mod bench;
mod cansimple;
mod odrive_client;
mod official;
mod python;
