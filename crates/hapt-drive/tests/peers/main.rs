//! Programs of others against ours: ODrive's DBC files, a client of theirs, and the makers' library for the moteus.
//!
//! A test program of its own: it needs Python with packages, which `cargo xtask test` installs.
#![cfg(target_os = "linux")]

mod cansimple;
mod odrive_client;
mod official;
mod python;
#[path = "../drive/rig.rs"]
mod rig;
