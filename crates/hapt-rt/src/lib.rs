//! The loop in real time: a thread that depends only on the clock, the device and the core.
//!
//! [`Engine::start`] takes a [`Plan`] (a world compiled) and a [`Device`], and takes one sample a period on a thread of its own.
//! [`LoopCommand`]s reach that thread and [`Record`]s leave it through bounded rings without locks; a [`LoopHandle`] stops it from any other
//! thread, ahead of all queued commands. The thread itself never allocates, locks, prints or opens anything, and waits only on the clock
//! and the device. [`Engine::stepped`] is the same without clock and thread, for a program with its own time, and [`Cycle`] without rings;
//! [`Timing`] computes statistics of the clock from the records.
//!
//! ```no_run
//! use hapt_core::{SafetyProfile, Request};
//! use hapt_model::{Source, World};
//! use hapt_rt::{Engine, LoopCommand, Plan, SimulatedDevice, Timing};
//!
//! let world = World::read(&Source::open("wheel.toml")?, &[])?;
//! let (device, _hands) = SimulatedDevice::new(&world);
//! let mut engine = Engine::start(Plan::new(&world, SafetyProfile::Simulated)?, Box::new(device))?;
//! let _ = engine.send(LoopCommand::Request(Request::Arm));
//! let mut timing = Timing::new();
//! while timing.samples() < 1000 {
//!     std::thread::sleep(std::time::Duration::from_millis(5));
//!     while let Ok(record) = engine.records.pop() {
//!         timing.add(&record);
//!     }
//! }
//! println!("{timing}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
// Every match names all variants, so that a new one does not compile by default.
#![warn(clippy::wildcard_enum_match_arm)]

mod clock;
mod cycle;
mod effects;
mod engine;
mod handle;
mod links;
mod outside;
mod pace;
mod plan;
mod replay;
mod schedule;
mod scheduling;
mod simulated;
mod snapshot;
mod timing;

use hapt_core::{Phase, Reason, Request};

pub use cycle::{Cycle, Moment};
pub use effects::{EffectsPort, EffectsSample, EffectsWire, effects};
pub use engine::{End, Engine, Error, SHORTEST_PERIOD, Settings, Stepper};
pub use handle::{Epoch, LoopHandle};
pub use links::{LinkPort, LinkSample, LinkTuning, LinkWire, link};
pub use outside::Outside;
pub use plan::{Change, Plan, PlanState};
pub use replay::Replay;
pub use scheduling::Realtime;
pub use simulated::{HandCommand, Hands, SimulatedDevice};
pub use snapshot::Snapshot;
pub use timing::{Bar, Certified, Quantiles, Timing};

/// Bodies that a record has room for.
pub const BODIES: usize = 32;

/// A device with an encoder and a motor. Its functions run on the loop's thread: they do not allocate, and wait only for the
/// hardware.
pub trait Device: Send {
    /// Reads the puck's position and velocity at a sample.
    fn read(&mut self) -> Result<Position, Failure>;

    /// Sets the torque to hold from now on, in N·m (linear: N).
    fn write(&mut self, torque: f64) -> Result<(), Failure>;

    /// Periods have passed since the last sample: 1, or more when samples were missed.
    fn passed(&mut self, _periods: u32) {}

    /// The number of consecutive stale readings up to the last one, which count as missed samples. At a new reading, those before it.
    fn missed(&self) -> u32 {
        0
    }

    /// How much older the last reading is than its sample, in s: 0 for a new one.
    fn age(&self) -> f64 {
        0.0
    }

    /// The torque that the motor holds now, in N·m (linear: N), where the device measures it; else the torque written one delay ago.
    fn applied(&self) -> Option<f64> {
        None
    }

    /// Called when the supervisor sets the world's 0 to this position, as [`Device::read`] returns it.
    fn homed(&mut self, _zero: f64) {}

    /// Called when the loop starts with `plan`, or changes to it at this sample.
    fn adopt(&mut self, _plan: &mut Plan) {}
}

/// The puck's position and velocity, as a device measures them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// In rad (linear: m), before the loop's own rounding to counts.
    pub position: f64,
    /// In rad/s (m/s) where the device measures it, else 0.
    pub velocity: f64,
    /// A prescribed jump of a simulated hand falls on this sample.
    pub announced: bool,
}

/// The reason that a device could not be read or written, or not in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Failure {
    /// It no longer answers.
    #[error("the device no longer answers")]
    Gone,
    /// Its recording has ended.
    #[error("the recording has ended")]
    Ended,
    /// Its port or bus was removed.
    #[error("the device is no longer there: its port or bus is gone")]
    Unplugged,
    /// Its drive stopped with a fault.
    #[error("{0}")]
    Drive(DriveFault),
    /// The computer is too slow for the loop of a network's station, which has missed this much of its samples, in per cent.
    #[error(
        "this computer is too slow for the loop, which has missed {0} % of its samples for 5 s: take a longer loop.period, fewer stations on one \
         computer, or a computer for each (hapt run NETWORK --station NAME)"
    )]
    Slow(u8),
}

/// The fault of a motor drive, in its manufacturer's terms and, where there is one, the supervisor's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveFault {
    /// The manufacturer's code.
    pub code: u32,
    /// The meaning of the code.
    pub what: &'static str,
    /// The corresponding reason of the supervisor.
    pub reason: Option<Reason>,
}

impl std::fmt::Display for DriveFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let DriveFault { code, what, reason } = self;
        write!(f, "the drive has stopped: {what} (its code {code}")?;
        reason.map_or(Ok(()), |reason| write!(f, ", here {}", reason.name()))?;
        write!(f, ")")
    }
}

/// A command to the loop, applied between two samples.
#[derive(Debug)]
pub enum LoopCommand {
    /// A request to the supervisor.
    Request(Request),
    /// Another world, compiled. The swap is atomic.
    Swap(Box<Plan>),
    /// Copies the loop's state before its next sample into this snapshot, which returns by [`Engine::snapshots`].
    Snapshot(Box<Snapshot>),
}

/// The record of one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// k, counted from the start; missed samples count.
    pub sample: u64,
    /// The instant of the sample, in ns from the start; sample · T while the period is constant.
    pub due: u64,
    /// The number of the plan, counted from 0 with each swap.
    pub plan: u32,
    /// The puck's position as the device measured it, rad (linear: m).
    pub position: f64,
    /// The velocity as the device measured it, rad/s (linear: m/s).
    pub velocity: f64,
    /// The position at which the world's is 0; the supervisor sets it when it arms.
    pub zero: f64,
    /// A prescribed jump of a simulated hand fell on this sample.
    pub announced: bool,
    /// The lateness of the sample in s, the supervisor's input.
    pub late: f64,
    /// Samples missed since the last one.
    pub missed: u32,
    /// Time since the last heartbeat of the client in control, in s; 0 without a link.
    pub silent: f64,
    /// The request to the supervisor at this sample.
    pub request: Option<Request>,
    /// z_k, after the encoder.
    pub measured: f64,
    /// v_k, by the estimator.
    pub measured_velocity: f64,
    /// The torque of the couplings, before levels and limit.
    pub torque: f64,
    /// The torque of the links on the puck, before levels and limit; 0 without links.
    pub link: f64,
    /// The command: the sum of both after levels and limit.
    pub command: f64,
    /// The output of the supervisor, the torque sent to the motor.
    pub output: f64,
    /// The torque that the motor holds at this sample, just after any change: the output of one delay ago.
    pub applied: f64,
    /// The phase of the supervisor.
    pub phase: Phase,
    /// The reason of a fault, or of an automatic fade-out.
    pub reason: Option<Reason>,
    /// A limit that was exceeded since this world was armed and only warns.
    pub warning: Option<Reason>,
    /// From the sample's instant to its reading, in ns.
    pub latency: u32,
    /// From the reading to the completed write to the device, in ns; a stale reading's age counts.
    pub computation: u32,
    /// Samples so far under a torque that were later than the certificate covers, or followed a command that was.
    pub outside: u32,
    /// x_k: positions and velocities of the bodies; unused entries are 0.
    pub bodies: [(f64, f64); BODIES],
}
