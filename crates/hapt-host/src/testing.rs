//! The common functions of this crate's tests.

use hapt_core::Phase;
use hapt_model::{Source, World};
use hapt_rt::{BODIES, Record};
pub use hapt_testing::WHEEL;

pub fn world() -> World {
    World::read(&Source::from_text("wheel.toml", WHEEL), &[]).unwrap()
}

/// A sample of a loop at rest, modified by `change`.
pub fn record(sample: u64, change: impl FnOnce(&mut Record)) -> Record {
    let mut record = Record {
        sample,
        due: sample * 1_000_000,
        plan: 0,
        position: 0.0,
        velocity: 0.0,
        zero: 0.0,
        measured: 0.0,
        measured_velocity: 0.0,
        torque: 0.0,
        link: 0.0,
        command: 0.0,
        output: 0.0,
        applied: 0.0,
        phase: Phase::Running,
        reason: None,
        warning: None,
        latency: 0,
        computation: 0,
        outside: 0,
        missed: 0,
        bodies: [(0.0, 0.0); BODIES],
        announced: false,
        late: 0.0,
        silent: 0.0,
        request: None,
    };
    change(&mut record);
    record
}
