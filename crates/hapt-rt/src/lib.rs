//! The loop in real time: a thread that knows clock, device and core, and nothing else.
//!
//! [`Engine::start`] takes a [`Plan`] (a world compiled) and a [`Device`], and takes one sample a period on a thread of its own.
//! [`Order`]s reach that thread and [`Record`]s leave it through bounded rings without locks; a [`LoopHandle`] stops it from any other
//! thread, past all orders. The thread itself never allocates,
//! locks, prints, opens or waits on anything but the clock and the device. [`Engine::stepped`] is the same without clock and thread, for a
//! program that has a time of its own, and [`Cycle`] without rings; [`Timing`] is what the records say about the clock.
//!
//! ```no_run
//! use hapt_core::{SafetyProfile, Request};
//! use hapt_model::{Source, World};
//! use hapt_rt::{Engine, Order, Plan, SimulatedDevice, Timing};
//!
//! let world = World::read(&Source::open("wheel.toml")?, &[])?;
//! let (device, _hands) = SimulatedDevice::new(&world);
//! let mut engine = Engine::start(Plan::new(&world, SafetyProfile::Simulated)?, Box::new(device))?;
//! let _ = engine.send(Order::Request(Request::Arm));
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
mod engine;
mod handle;
mod plan;
mod replay;
mod schedule;
mod scheduling;
mod simulated;
mod snapshot;
mod timing;

use hapt_core::{Phase, Reason, Request};

pub use cycle::{Cycle, Moment};
pub use engine::{End, Engine, Error, SHORTEST_PERIOD, Settings, Stepper};
pub use handle::{Epoch, LoopHandle};
pub use plan::{Plan, PlanState};
pub use replay::Replay;
pub use scheduling::Realtime;
pub use simulated::{HandCommand, Hands, SimulatedDevice};
pub use snapshot::Snapshot;
pub use timing::{Bar, Quantiles, Timing};

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

    /// How many readings in a row up to the last one were not new: they count as missed samples. At a new one, those before it.
    fn missed(&self) -> u32 {
        0
    }

    /// What the motor holds now, in N·m (linear: N), where the device knows it; else it is what was written before the world's delay.
    fn applied(&self) -> Option<f64> {
        None
    }

    /// The supervisor has set the world's 0 to this position, as [`Device::read`] gives it.
    fn homed(&mut self, _zero: f64) {}

    /// The loop begins with `plan`, or goes on with it from this sample on.
    fn adopt(&mut self, _plan: &mut Plan) {}
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
    #[error("the device no longer answers")]
    Gone,
    /// Its recording has ended.
    #[error("the recording has ended")]
    Ended,
    /// Its port or bus is gone.
    #[error("the device is no longer there: its port or bus is gone")]
    Unplugged,
    /// Its drive has stopped by itself.
    #[error("{0}")]
    Drive(DriveFault),
}

/// Why a motor drive has stopped by itself, in its maker's terms and, where there is one, the supervisor's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveFault {
    /// The maker's number.
    pub code: u32,
    /// What it stands for.
    pub what: &'static str,
    /// The supervisor's word for it.
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

/// What reaches the loop between two samples.
#[derive(Debug)]
pub enum Order {
    /// To the supervisor.
    Request(Request),
    /// Another world, compiled; whole, or not at all.
    Swap(Box<Plan>),
    /// How the loop stands before its next sample, into what is given; it comes back by [`Engine::snapshots`].
    Snapshot(Box<Snapshot>),
}

/// One sample, as it leaves the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// k, counted from the start, missed ones too.
    pub sample: u64,
    /// The instant of the sample, in ns from the start; sample · T while nobody changes the period.
    pub due: u64,
    /// Which plan made it: counted from 0 with each swap.
    pub plan: u32,
    /// The puck's position as the device gave it, rad (linear: m).
    pub position: f64,
    /// And velocity.
    pub velocity: f64,
    /// The position at which the world's is 0; the supervisor sets it when it arms.
    pub zero: f64,
    /// A prescribed jump of a simulated hand fell on this sample.
    pub announced: bool,
    /// How long after its instant the sample was taken, in s, as the supervisor was told.
    pub late: f64,
    /// Samples missed since the last.
    pub missed: u32,
    /// How long ago whoever holds the link was last heard, in s; 0 where there is no link.
    pub silent: f64,
    /// What somebody asked of the supervisor at this sample.
    pub request: Option<Request>,
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
    /// What the motor holds at this sample, just after any change: what it was asked for the world's delay ago.
    pub applied: f64,
    /// The supervisor's.
    pub phase: Phase,
    /// Why it is faulted, or has faded out by itself.
    pub reason: Option<Reason>,
    /// What would have tripped where it only warns, since it was armed.
    pub warning: Option<Reason>,
    /// From the sample's instant to when it was taken, in ns.
    pub latency: u32,
    /// From there to when the device had its command, in ns.
    pub computation: u32,
    /// x_k: positions and velocities of the bodies; those beyond the world's are 0.
    pub bodies: [(f64, f64); BODIES],
}
