//! The loop in real time: a thread that knows clock, device and core, and nothing else.
//!
//! [`Engine::start`] takes a [`Plan`] (a world compiled) and a [`Device`], and runs one sample a period on a thread of its own.
//! [`Order`]s reach that thread and [`Record`]s leave it through bounded rings without locks; the thread itself never allocates, locks,
//! prints, opens or waits on anything but the clock and the device.

mod engine;
mod plan;
mod simulated;

use hapt_core::{Phase, Reason, Request};

pub use engine::{Engine, Error};
pub use plan::Plan;
pub use simulated::{Simulated, Touch};

/// Bodies that a record has room for.
pub const BODIES: usize = 32;

/// Something with an encoder and a motor. Called on the loop's thread: it never allocates, and waits on nothing but itself.
pub trait Device: Send {
    /// What it says about the puck at a sample.
    fn read(&mut self) -> Result<Position, Failure>;

    /// The torque to hold from now on, in N·m (linear: N).
    fn write(&mut self, torque: f64) -> Result<(), Failure>;

    /// Periods have passed since the last sample: 1, or more when samples were missed.
    fn passed(&mut self, _periods: u32) {}
}

/// The puck as a device sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// In rad (linear: m), before the loop's own rounding to counts.
    pub position: f64,
    /// In rad/s (m/s) where the device knows it, else 0.
    pub velocity: f64,
    /// A prescribed jump of a simulated hand falls on this sample.
    pub announced: bool,
}

/// Why a device could not be read or written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Failure {
    /// It says nothing more.
    #[error("the device has gone silent")]
    Gone,
    /// Its recording has ended.
    #[error("the recording has ended")]
    Ended,
}

/// What reaches the loop between two samples.
pub enum Order {
    /// To the supervisor.
    Request(Request),
    /// Another world, compiled; whole, or not at all.
    Swap(Box<Plan>),
    /// Whoever holds the link is there.
    Alive,
}

/// One sample, as it leaves the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// k, counted from the start, missed ones too.
    pub sample: u64,
    /// Which plan made it: counted from 0 with each swap.
    pub plan: u32,
    /// The puck's position as the device gave it, rad (linear: m).
    pub position: f64,
    /// And velocity.
    pub velocity: f64,
    /// z_k, after the encoder.
    pub measured: f64,
    /// v_k, by the estimator.
    pub measured_velocity: f64,
    /// From the couplings, before levels and limit.
    pub torque: f64,
    /// After levels and limit.
    pub command: f64,
    /// What the motor was asked for: after the supervisor.
    pub output: f64,
    /// The supervisor's.
    pub phase: Phase,
    /// Why it is faulted.
    pub reason: Option<Reason>,
    /// From the sample's instant to when it was taken, in ns.
    pub latency: u32,
    /// From there to when the device had its command, in ns.
    pub computation: u32,
    /// Samples missed since the last record.
    pub missed: u32,
    /// x_k: positions and velocities of the bodies; those beyond the world's are 0.
    pub bodies: [(f64, f64); BODIES],
    /// A prescribed jump of a simulated hand fell on this sample.
    pub announced: bool,
}
