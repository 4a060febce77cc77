//! One function per target: arbitrary bytes are the input, and a violated property is a panic.
//!
//! libFuzzer drives the targets for as long as one likes, on nightly; `bounded` drives them on stable for a few seconds each.
//! Every input has a second of processor time and a bound on its memory (`limits.rs`), with every driver.

mod core;
mod dictionary;
mod limits;
mod link;
mod live;
mod log;
mod messages;
mod mutate;
mod path;
mod pid;
mod quantity;
mod seeds;
mod set;
mod wire;
mod world;

pub use dictionary::words;
pub use limits::{judged, watch};
pub use mutate::Mutator;

/// A target and its inputs.
pub struct Target {
    /// As typed.
    pub name: &'static str,
    /// Runs an input; the number identifies the outcome, so that an input with a new one is kept and mutated.
    pub run: fn(&[u8]) -> u64,
    /// Good inputs, and contrived ones that once were slow or wrong.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// The longest input that the drivers make.
    pub longest: usize,
}

/// All targets.
pub const TARGETS: [Target; 11] = [
    Target { name: "world", run: world::run, seeds: seeds::worlds, longest: 1 << 16 },
    Target { name: "set", run: set::run, seeds: seeds::sets, longest: 1 << 12 },
    Target { name: "quantity", run: quantity::run, seeds: seeds::quantities, longest: 1 << 10 },
    Target { name: "path", run: path::run, seeds: seeds::paths, longest: 1 << 14 },
    Target { name: "core", run: core::run, seeds: seeds::cores, longest: 1 << 11 },
    Target { name: "log", run: log::run, seeds: seeds::logs, longest: 1 << 14 },
    Target { name: "live", run: live::run, seeds: seeds::messages, longest: 1 << 12 },
    Target { name: "wire", run: wire::run, seeds: wire::seeds, longest: 1 << 11 },
    Target { name: "pid", run: pid::run, seeds: pid::seeds, longest: 1 << 11 },
    Target { name: "link", run: link::run, seeds: link::seeds, longest: 1 << 11 },
    Target { name: "link_can", run: link::run_can, seeds: link::seeds, longest: 1 << 11 },
];

/// The target of this name.
///
/// # Panics
/// There is none.
pub fn target(name: &str) -> &'static Target {
    TARGETS.iter().find(|target| target.name == name).unwrap_or_else(|| panic!("no target {name}"))
}
