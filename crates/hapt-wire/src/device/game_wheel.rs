//! A board that is a standalone force-feedback wheel: its world is part of its program, and a game's computer is its host, over USB.

use core::fmt;

use hapt_core::wheel::Wheel;
use hapt_core::{ControllerState, ExternalTorqueInput, Phase, Reading, Reason, Request};

use super::sampler::{Measurement, Motor};
use super::storage::BoardController;
use crate::load::unpack_wheel;
use crate::pid::{Player, Pool, Scale};
use crate::{Error, ROOM, unpack};

/// The effects end when the main loop, which serves the host, has not exchanged data for this time, in s.
pub const UNSERVED: f32 = 0.02;

/// The sampler's state, for the main loop.
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
    /// The number of effects that play.
    pub playing: usize,
}

/// The data that the main loop and the interrupt share, each of which locks it for microseconds: a pool in one direction, a position in the other.
#[derive(Clone, Copy, Debug)]
pub struct WheelMailbox {
    pool: Option<Pool>,
    /// Whether the main loop has served the mailbox since the last sample.
    served: bool,
    /// Whether a host has configured the device.
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

    /// The last state of the sampler.
    #[must_use]
    pub fn shown(&self) -> WheelStatus {
        self.shown
    }

    /// The exchange of the main loop: sets the pool where it has changed, and whether a host has configured the device; returns the sampler's state.
    pub fn serve(&mut self, changed: Option<&Pool>, claimed: bool) -> WheelStatus {
        if let Some(pool) = changed {
            self.pool = Some(*pool);
        }
        self.served = true;
        self.claimed |= claimed;
        self.shown
    }
}

/// The reason that bytes are no wheel for a board.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum NoWheel {
    /// They cannot be read.
    Bytes(Error),
    /// The core refuses the world or its limits.
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

/// One guarded sample per period, with effects in addition to the world. It never blocks.
#[derive(Clone, Debug)]
pub struct WheelSampler {
    controller: BoardController,
    state: ControllerState<f32, { ROOM[0] }, { ROOM[1] }, { ROOM[2] }>,
    player: Player,
    half: f64,
    period_ns: u64,
    now_ns: u64,
    /// The number of samples since the main loop served the mailbox.
    unserved: u32,
    /// The number of them that ends the effects.
    longest_unserved: u32,
    /// Whether a host has armed it: the first one does. A fault stays until the board restarts.
    armed: bool,
}

impl WheelSampler {
    /// The wheel that [`crate::pack_wheel`] wrote: disarmed until a host configures it.
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

    /// Takes one sample. The torque is 0 before a host has configured the device, and after a fault.
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
            self.controller.step_with(&mut self.state, &reading, request, |input: ExternalTorqueInput<f32>| {
                let (given, count) = player.sample(input, now);
                (playing, seen) = (count, input.position);
                Some(given.torque)
            });
        mailbox.shown = WheelStatus { now, position: seen, phase: guarded.phase, reason: guarded.reason, playing };
        Motor { torque: guarded.output, on: guarded.phase.is_active() }
    }

    /// Takes the main loop's data.
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

    /// Sets the delay in s after which the motor has received the torque of the last sample.
    pub fn commanded(&mut self, delay: f32) {
        self.state.commanded(delay);
    }
}

/// The whole periods for which the motor may hold a torque, where the world bounds it.
pub(super) fn longest_hold(controller: &BoardController) -> Option<u32> {
    let periods = controller.longest_hold() / controller.period();
    // The tolerance covers a rounded interval of whole periods.
    periods.is_finite().then_some((periods + 1e-4) as u32)
}
