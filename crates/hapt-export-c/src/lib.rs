//! A world as one C99 file and its header: the compiled world as constants, one sample of the loop, and the supervisor.
//!
//! The numbers are those of [`hapt_core`]'s compiled world, and the C text of each law and method is in `parts/`, written only there: a
//! test compiles random worlds and compares state and torque with the core's, to the bit.
//!
//! The C allocates nothing, has no recursion, and needs no library: it carries the functions of libm that it calls.
#![forbid(unsafe_code)]
#![warn(clippy::wildcard_enum_match_arm)]

mod arduino;
mod compose;
mod data;
mod error;
mod names;
mod numbers;
mod template;
mod tune;

pub use arduino::{DRIVE_SKETCH, library};
pub use compose::{MARK, export};
pub use error::Error;
pub use names::Prefix;
pub use tune::Tune;

/// The numbers that the C computes with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Float {
    /// `float`
    F32,
    /// `double`
    F64,
}

/// The description of its world in a file, in the world's own words.
#[derive(Clone, Debug, Default)]
pub struct About {
    /// The world's title.
    pub title: String,
    /// Whether its motion is a length in m rather than an angle in rad.
    pub is_linear: bool,
    /// The bodies' names, in the order of the spec.
    pub bodies: Vec<String>,
    /// Each coupling in words, in the order of the spec.
    pub couplings: Vec<String>,
    /// Whether the world is certified.
    pub is_certified: bool,
    /// The certificate, line by line.
    pub certificate: Vec<String>,
    /// A hash of the world and its limits.
    pub hash: u32,
    /// The numbers that the C may change.
    pub tunes: Vec<Tune>,
}

/// The two texts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exported {
    /// The C file.
    pub source: String,
    /// Its header.
    pub header: String,
}
