//! The supervisor: what stands between a loop's command and a motor, sample by sample.
//!
//! A [`Supervisor`] is the limits, compiled once; a [`Watch`] is everything that it remembers, one `Copy` struct. It runs the loop
//! itself, so that no torque reaches the motor but through it:
//!
//! ```text
//! disarmed --arm--> fading in --> running --disarm--> fading out --> disarmed
//!     any of them --fault--> faulted --clear, the cause gone--> disarmed
//! ```

use crate::{Loop, Real, Sample, State};

/// Where the supervisor stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// No torque; the world waits at its start.
    Disarmed,
    /// The torque rises from 0 to the loop's.
    FadingIn,
    /// The loop's torque.
    Running,
    /// The torque falls to 0.
    FadingOut,
    /// No torque, until the cause is gone and somebody clears it.
    Faulted,
}

/// Why the torque was taken away. The codes are for wires and logs, and never change their meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[non_exhaustive]
pub enum Reason {
    /// Somebody pressed stop.
    Stop = 1,
    /// A number is no number.
    NotFinite = 2,
}

/// What somebody asks for, at most one thing a sample. `Stop` counts in every phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// From disarmed: fade in.
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
    /// Its velocity in rad/s (m/s), where the device knows it; only the exact estimator looks at it.
    pub velocity: F,
    /// A prescribed jump of a simulated hand falls on this sample: no fault.
    pub announced: bool,
    /// How long after its instant the sample was taken, in s.
    pub late: F,
    /// How many samples were missed since the last.
    pub missed: u32,
    /// How long ago whoever holds the link was last heard, in s; 0 where there is no link.
    pub silent: F,
}

/// What one guarded sample gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Guarded<F> {
    /// The loop's own sample.
    pub sample: Sample<F>,
    /// What the motor is to hold: the command, faded, or 0.
    pub output: F,
    /// After this sample.
    pub phase: Phase,
    /// Why it is faulted.
    pub reason: Option<Reason>,
}

/// The limits, compiled once.
#[derive(Clone, Copy, Debug)]
pub struct Supervisor<F> {
    /// Samples that a fade takes, at least 1.
    fade: F,
}

/// What the supervisor remembers from sample to sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Watch<F> {
    /// Where it stands.
    pub phase: Phase,
    /// Why it is faulted.
    pub reason: Option<Reason>,
    /// From 0 to 1: how much of the command reaches the motor.
    pub gain: F,
}

impl<F: Real> Watch<F> {
    /// Disarmed.
    pub const START: Self = Watch { phase: Phase::Disarmed, reason: None, gain: F::ZERO };
}

impl<F: Real> Supervisor<F> {
    /// A supervisor that fades over `fade` samples.
    pub fn new(fade: f64) -> Self {
        Supervisor { fade: F::from_f64(fade.max(1.0)) }
    }

    /// One sample of `world`, guarded.
    pub fn step<const B: usize, const C: usize, const W: usize>(
        &self,
        watch: &mut Watch<F>,
        world: &Loop<F, B, C, W>,
        state: &mut State<F, B, C, W>,
        reading: &Reading<F>,
        request: Option<Request>,
    ) -> Guarded<F> {
        match (request, watch.phase) {
            (Some(Request::Stop), _) => (watch.phase, watch.reason) = (Phase::Faulted, Some(Reason::Stop)),
            (Some(Request::Arm), Phase::Disarmed) => watch.phase = Phase::FadingIn,
            (Some(Request::Disarm), Phase::FadingIn | Phase::Running) => watch.phase = Phase::FadingOut,
            (Some(Request::Clear), Phase::Faulted) => (watch.phase, watch.reason) = (Phase::Disarmed, None),
            _ => {}
        }
        if watch.phase == Phase::Disarmed {
            *state = world.start();
        }
        let sample = world.step(state, reading.position, reading.velocity);
        match watch.phase {
            Phase::FadingIn => watch.gain += F::ONE / self.fade,
            Phase::FadingOut => watch.gain -= F::ONE / self.fade,
            Phase::Running => {}
            Phase::Disarmed | Phase::Faulted => watch.gain = F::ZERO,
        }
        if watch.gain >= F::ONE {
            (watch.gain, watch.phase) = (F::ONE, Phase::Running);
        } else if watch.gain <= F::ZERO && watch.phase == Phase::FadingOut {
            (watch.gain, watch.phase) = (F::ZERO, Phase::Disarmed);
        }
        Guarded { sample, output: watch.gain * sample.command, phase: watch.phase, reason: watch.reason }
    }
}
