//! A board that is a force-feedback wheel by itself: its world is part of its program, and a game's computer is its host, over USB.

use core::fmt;

use hapt_core::wheel::Wheel;
use hapt_core::{ControllerState, ExternalTorqueInput, Phase, Reading, Reason, Request};

use super::sampler::{Measurement, Motor};
use super::storage::BoardController;
use crate::load::unpack_wheel;
use crate::pid::{Player, Pool, Scale};
use crate::{Error, ROOM, unpack};

/// The effects end when the main loop, which follows the host, has not come by for so long, in s.
pub const UNSERVED: f32 = 0.02;

/// What the sampler shows the main loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelStatus {
    /// Time since the first sample, in µs: the clock of the host's reports.
    pub now: u64,
    /// The wheel's position, rad.
    pub position: f32,
    /// The supervisor's.
    pub phase: Phase,
    /// Of a fault.
    pub reason: Option<Reason>,
    /// How many effects play.
    pub playing: usize,
}

/// What the main loop and the interrupt share, each of which holds it for microseconds: a pool goes one way, a position the other.
#[derive(Clone, Copy, Debug)]
pub struct WheelMailbox {
    pool: Option<Pool>,
    /// The main loop has come by.
    served: bool,
    /// A host has taken the device.
    claimed: bool,
    shown: WheelStatus,
}

impl Default for WheelMailbox {
    fn default() -> Self {
        Self::new()
    }
}

impl WheelMailbox {
    /// Empty.
    #[must_use]
    pub const fn new() -> Self {
        let shown = WheelStatus { now: 0, position: 0.0, phase: Phase::Disarmed, reason: None, playing: 0 };
        WheelMailbox { pool: None, served: false, claimed: false, shown }
    }

    /// What the sampler has shown last.
    #[must_use]
    pub fn shown(&self) -> WheelStatus {
        self.shown
    }

    /// The main loop comes by: with the pool where it has changed, and whether a host has taken the device. What the sampler shows.
    pub fn serve(&mut self, changed: Option<&Pool>, claimed: bool) -> WheelStatus {
        if let Some(pool) = changed {
            self.pool = Some(*pool);
        }
        self.served = true;
        self.claimed |= claimed;
        self.shown
    }
}

/// Why bytes are no wheel for a board.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum NoWheel {
    /// They cannot be read.
    Bytes(Error),
    /// The core does not take the world or its limits.
    World(hapt_core::Error),
    /// The device cannot be a wheel.
    Device(hapt_core::wheel::Refused),
}

impl fmt::Display for NoWheel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NoWheel::Bytes(error) => error.fmt(f),
            NoWheel::World(error) => error.fmt(f),
            NoWheel::Device(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for NoWheel {}

/// One guarded sample a period, with the effects beside the world. It waits for nobody.
#[derive(Clone, Debug)]
pub struct WheelSampler {
    controller: BoardController,
    state: ControllerState<f32, { ROOM[0] }, { ROOM[1] }, { ROOM[2] }>,
    player: Player,
    half: f64,
    period_ns: u64,
    now_ns: u64,
    /// Samples since the main loop came by.
    unserved: u32,
    /// So many of them end the effects.
    longest_unserved: u32,
    /// The first host arms it. A fault stays until the board starts anew.
    armed: bool,
}

impl WheelSampler {
    /// The wheel that [`crate::pack_wheel`] made: disarmed until a host takes it.
    ///
    /// # Errors
    /// See [`NoWheel`].
    #[inline(always)] // As the controller's own: a board's stack has no room for a second copy.
    pub fn new(bytes: &[u8]) -> Result<Self, NoWheel> {
        let (device, half, world) = unpack_wheel(bytes).map_err(NoWheel::Bytes)?;
        let (limits, stored) = unpack::<{ ROOM[0] }, { ROOM[1] }>(world).map_err(NoWheel::Bytes)?;
        let controller = BoardController::new(&stored.spec(), &limits).map_err(NoWheel::World)?;
        let wheel = Wheel::new(&device).map_err(NoWheel::Device)?;
        let period = controller.period();
        Ok(WheelSampler {
            state: controller.start(),
            controller,
            player: Player::new(wheel, Scale::of_wheel(device.limit, half)),
            half,
            period_ns: (period * 1e9 + 0.5) as u64,
            now_ns: 0,
            unserved: 0,
            longest_unserved: (UNSERVED / period) as u32,
            armed: false,
        })
    }

    /// T in s.
    pub fn period(&self) -> f32 {
        self.controller.period()
    }

    /// Half of the steering range, rad.
    pub fn half(&self) -> f64 {
        self.half
    }

    /// As [`super::Sampler::longest_hold`].
    pub fn longest_hold(&self) -> Option<u32> {
        longest_hold(&self.controller)
    }

    /// Takes one sample. The torque is 0 before a host has taken the device, and after a fault.
    pub fn sample(&mut self, measurement: &Measurement, mailbox: &mut WheelMailbox) -> Motor {
        let passed = 1 + u64::from(measurement.missed);
        self.now_ns = self.now_ns.saturating_add(passed.saturating_mul(self.period_ns));
        let now = self.now_ns / 1000;
        self.follow(mailbox);
        let request = (mailbox.claimed && !self.armed).then_some(Request::Arm);
        self.armed |= request.is_some();
        if measurement.fault {
            self.state.trip(Reason::Driver);
        }
        let reading = Reading {
            position: measurement.position,
            velocity: measurement.velocity,
            announced: false,
            late: measurement.late,
            missed: measurement.missed,
            silent: 0.0,
        };
        let (player, mut playing, mut seen) = (&mut self.player, 0, 0.0);
        let guarded =
            self.controller.step_with(&mut self.state, &reading, request, |beside: ExternalTorqueInput<f32>| {
                let (given, count) = player.sample(beside, now);
                (playing, seen) = (count, beside.position);
                Some(given.torque)
            });
        mailbox.shown = WheelStatus { now, position: seen, phase: guarded.phase, reason: guarded.reason, playing };
        Motor { torque: guarded.output, on: guarded.phase.is_active() }
    }

    /// What the main loop has left.
    fn follow(&mut self, mailbox: &mut WheelMailbox) {
        if core::mem::take(&mut mailbox.served) {
            self.unserved = 0;
        } else {
            self.unserved = self.unserved.saturating_add(1);
        }
        if let Some(pool) = mailbox.pool.take() {
            self.player.replace(&pool);
        } else if self.unserved == self.longest_unserved.saturating_add(1) {
            self.player.stop_all();
        }
    }

    /// The motor had the torque of the last sample this long after it, in s.
    pub fn commanded(&mut self, delay: f32) {
        self.state.commanded(delay);
    }
}

/// The whole periods for which the motor may hold a torque, where the world bounds it.
pub(super) fn longest_hold(controller: &BoardController) -> Option<u32> {
    let periods = controller.longest_hold() / controller.period();
    // An interval rounded to whole periods is one.
    periods.is_finite().then_some((periods + 1e-4) as u32)
}
