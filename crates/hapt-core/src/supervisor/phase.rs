//! Where a supervisor stands, and what goes in and out of it at a sample.

use crate::Sample;
use crate::supervisor::Reason;

crate::named! {
    /// Where the supervisor stands.
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
        /// No torque, until the cause is gone and somebody clears it.
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

/// What somebody asks for, at most one thing a sample. `Stop` counts in every phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// From disarmed: fade in. Where something is wrong at that sample it faults instead.
    Arm,
    /// Fade out.
    Disarm,
    /// The torque is 0 now, and the supervisor faulted.
    Stop,
    /// From faulted, the cause gone: disarmed.
    Clear,
}

/// What the device says at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading<F> {
    /// The puck's position in rad (linear: m).
    pub position: F,
    /// Its velocity in rad/s (m/s), where the device knows it, else 0; only the exact estimator looks at it.
    pub velocity: F,
    /// A prescribed jump of a simulated hand falls on this sample: no fault. Not believed on a real device.
    pub announced: bool,
    /// How long after its instant the sample was taken, in s.
    pub late: F,
    /// How many samples were missed since the last; one whose reading was not new counts as missed.
    pub missed: u32,
    /// How long ago whoever holds the link was last heard, in s; 0 where there is no link.
    pub silent: F,
}

/// What one guarded sample gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafeOutput<F> {
    /// The loop's own sample.
    pub sample: Sample<F>,
    /// What the motor is to hold: the command, faded, or 0.
    pub output: F,
    /// After this sample.
    pub phase: Phase,
    /// Why it is faulted, or has faded out by itself.
    pub reason: Option<Reason>,
    /// What would have tripped where it only warns, since it was armed.
    pub warning: Option<Reason>,
}
