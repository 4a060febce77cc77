//! The phase of a supervisor, and its inputs and outputs at a sample.

use crate::Sample;
use crate::supervisor::Reason;

crate::named! {
    /// The phase of the supervisor.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
    pub enum Phase {
        /// No torque; the world waits at its start.
        Disarmed => "disarmed",
        /// The torque rises from 0 to the loop's; the sign test comes first, where there is one.
        FadingIn => "fading-in",
        /// The loop's torque.
        Running => "running",
        /// The torque falls to 0.
        FadingOut => "fading-out",
        /// No torque, until the cause is gone and the fault is cleared.
        Faulted => "faulted",
    }
}

impl Phase {
    /// Whether there may be a torque.
    pub const fn is_active(self) -> bool {
        match self {
            Phase::FadingIn | Phase::Running | Phase::FadingOut => true,
            Phase::Disarmed | Phase::Faulted => false,
        }
    }
}

/// A request, at most one per sample. `Stop` is accepted in every phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// From disarmed: fade in, or fault where that sample exceeds a limit.
    Arm,
    /// Fade out.
    Disarm,
    /// Fault: the torque is 0 from this sample on.
    Stop,
    /// From faulted, once the cause is gone: disarm.
    Clear,
}

/// The reading of the device at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading<F> {
    /// The puck's position in rad (linear: m).
    pub position: F,
    /// Its velocity in rad/s (m/s) where the device provides it, else 0; only the exact estimator uses it.
    pub velocity: F,
    /// A prescribed jump of a simulated hand falls on this sample and is no fault. Ignored on a real device.
    pub announced: bool,
    /// Lateness of the sample, in s.
    pub late: F,
    /// Samples missed since the last one; a sample with an old reading counts as missed.
    pub missed: u32,
    /// Time since the last heartbeat of the client in control, in s; 0 without a link.
    pub silent: F,
}

/// The inputs of an external torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExternalTorqueInput<F> {
    /// Whether the world's own torque counts: not while disarmed or tested, when the position has no zero yet.
    pub ready: bool,
    /// Of the puck, measured, rad (linear: m).
    pub position: F,
    /// Of the puck, by the loop's estimator, rad/s (linear: m/s).
    pub velocity: F,
    /// The world's own torque in this sample, N·m (linear: N), before levels and limit.
    pub torque: F,
}

/// The result of one guarded sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafeOutput<F> {
    /// The loop's own sample.
    pub sample: Sample<F>,
    /// The torque for the motor: the faded command, or 0.
    pub output: F,
    /// After this sample.
    pub phase: Phase,
    /// The reason of a fault, or of an automatic fade-out.
    pub reason: Option<Reason>,
    /// A limit that was exceeded since this world was armed and only warns.
    pub warning: Option<Reason>,
    /// Under a torque, this sample came later than the certificate covers, or the command before it did.
    pub outside: bool,
}
