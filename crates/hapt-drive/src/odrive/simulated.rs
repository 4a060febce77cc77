//! The bus interface of a simulated ODrive: its messages, states, errors and watchdog.
//!
//! Firmware 0.6, or 0.5 after its published source: 0.5 does not report its version, its watchdog also expires while disarmed, its
//! heartbeat contains present errors and not the reason of the last disarming, and it has no position until it has been armed once.

use super::barrier::KINDS;
use super::codec::{self, Command, Heartbeat, PASSTHROUGH, Version, control, state};
use crate::frame::Frame;
use crate::simulate::{Firmware, Shaft};

/// Default time of its watchdog, s.
const WATCHDOG: f64 = 0.05;
/// The interval of heartbeats in the factory settings, s.
const HEARTBEAT: f64 = 0.1;
/// ODrive's gains in the factory settings: 1/s, N·m/(rev/s), N·m/rev.
const POSITION_GAIN: f64 = 20.0;
const VELOCITY_GAIN: f64 = 1.0 / 6.0;
const INTEGRATOR_GAIN: f64 = 1.0 / 3.0;
/// The part of its velocity limit above which it reports an error.
const OVERSPEED: f64 = 1.2;
const VELOCITY_LIMIT_VIOLATION: u32 = 0x8000;
const MISSING_INPUT: u32 = 0x40;
/// The value of 0.5 for both.
const CONTROLLER_FAILED: u32 = 0x200;
/// In 0.5, the byte of the heartbeat for a reached setpoint.
const DONE: u8 = 0x80;
/// N·m per A.
const MOTOR: f64 = 0.05;
/// Volts and amperes of its supply.
const BUS: (f32, f32) = (24.0, 0.0);

/// The setpoints of the controller, in revolutions.
#[derive(Clone, Copy, Debug, Default)]
struct Input {
    position: f64,
    velocity: f64,
    torque: f64,
}

/// The drive without its wheel: the caller passes frames and time, and takes the torque.
#[derive(Clone, Debug)]
pub struct Simulated {
    node: u8,
    version: Version,
    /// Time of its watchdog, s; `None`: off.
    watchdog: Option<f64>,
    /// Time since the watchdog was fed, s.
    since_fed: f64,
    is_armed: bool,
    was_armed: bool,
    error: u32,
    disarm_reason: u32,
    control: u32,
    input: Input,
    /// The integral of the velocity's error, N·m.
    integral: f64,
    /// rev/s.
    fastest: f64,
    /// The offset added to the wheel's revolutions.
    offset: f64,
    /// Period of its cyclic position messages, s; `None`: on request only.
    estimates: Option<f64>,
    since_heartbeat: f64,
    since_estimates: f64,
    /// A request of another kind has arrived since the last one for the position.
    was_requested: bool,
}

impl Simulated {
    /// Disarmed and without an error, configured for hapt: a watchdog of 50 ms, and no cyclic position.
    pub fn new(node: u8) -> Self {
        Simulated {
            node,
            version: Version::LATE,
            watchdog: Some(WATCHDOG),
            since_fed: 0.0,
            is_armed: false,
            was_armed: false,
            error: 0,
            disarm_reason: 0,
            control: control::POSITION,
            input: Input::default(),
            integral: 0.0,
            fastest: f64::INFINITY,
            offset: 0.0,
            estimates: None,
            since_heartbeat: 0.0,
            since_estimates: 0.0,
            was_requested: false,
        }
    }

    /// The same with a watchdog of this time in s; `None`: without, the factory setting.
    pub fn with_watchdog(self, watchdog: Option<f64>) -> Self {
        Simulated { watchdog, ..self }
    }

    /// The same with another firmware.
    pub fn with_version(self, version: Version) -> Self {
        Simulated { version, ..self }
    }

    /// The same with cyclic position messages of this period in s; the factory setting is 10 ms.
    pub fn with_estimates(self, every: Option<f64>) -> Self {
        Simulated { estimates: every, ..self }
    }

    /// Whether it is armed.
    pub fn is_armed(&self) -> bool {
        self.is_armed
    }

    /// Injects a fault: it disarms, with these bits for a reason.
    pub fn fail(&mut self, error: u32) {
        self.error |= error;
        self.disarm(error);
    }

    /// The data of its answer to a request.
    fn answer(&self, command: Command, shaft: Shaft) -> Option<[u8; 8]> {
        Some(match command {
            Command::Version if self.version.is_old() => return None,
            Command::Version => self.version.data(),
            // In 0.5 the errors of the motor.
            Command::Error if self.version.is_old() => [0; 8],
            Command::Error => codec::pair(self.error, self.disarm_reason),
            Command::Estimates => self.estimates(shaft),
            // 20 °C.
            Command::Current => {
                let current = (self.torque(shaft) / MOTOR) as f32;
                codec::floats(current, current)
            }
            Command::Warmth => codec::floats(20.0, 20.0),
            Command::Bus => codec::floats(BUS.0, BUS.1),
            Command::Torques if self.version.is_old() => return None,
            // The setpoint and the motor's torque.
            Command::Torques => {
                let made = self.torque(shaft);
                codec::floats(if self.is_armed { made } else { self.input.torque } as f32, made as f32)
            }
            // No power at standstill; in 0.5 no error of the controller.
            Command::Powers => [0; 8],
            Command::Heartbeat
            | Command::Estop
            | Command::State
            | Command::Mode
            | Command::Position
            | Command::Velocity
            | Command::Torque
            | Command::Limits
            | Command::Reboot
            | Command::Clear
            | Command::Absolute => return None,
        })
    }

    fn obey(&mut self, command: Command, data: [u8; 8], shaft: Shaft) {
        let (first, second) = codec::numbers(data);
        let floats = (f64::from(f32::from_bits(first)), f64::from(f32::from_bits(second)));
        match command {
            Command::Estop => self.fail(self.version.estop()),
            Command::State if first == state::CLOSED_LOOP && self.error == 0 => {
                (self.is_armed, self.was_armed) = (true, true);
                self.disarm_reason = 0;
                self.integral = 0.0;
                if self.control == control::POSITION {
                    self.input.position = self.position(shaft);
                }
            }
            // Calibration is not simulated.
            Command::State => self.is_armed = false,
            Command::Mode if second == PASSTHROUGH => self.control = first,
            Command::Mode => {}
            Command::Position => {
                let feed = |at: usize| f64::from(i16::from_le_bytes([data[at], data[at + 1]])) * 1e-3;
                self.input = Input { position: floats.0, velocity: feed(4), torque: feed(6) };
            }
            Command::Velocity => (self.input.velocity, self.input.torque) = floats,
            Command::Torque => self.input.torque = floats.0,
            Command::Limits if floats.0 > 0.0 => self.fastest = floats.0,
            Command::Clear => (self.error, self.disarm_reason) = (0, 0),
            Command::Absolute => self.offset += floats.0 - self.position(shaft),
            Command::Reboot => {
                *self = Simulated::new(self.node)
                    .with_version(self.version)
                    .with_watchdog(self.watchdog)
                    .with_estimates(self.estimates);
            }
            Command::Version
            | Command::Heartbeat
            | Command::Error
            | Command::Estimates
            | Command::Limits
            | Command::Current
            | Command::Warmth
            | Command::Bus
            | Command::Torques
            | Command::Powers => {}
        }
    }

    /// The motor's torque, N·m.
    fn torque(&self, shaft: Shaft) -> f64 {
        if !self.is_armed {
            return 0.0;
        }
        let controller = match self.control {
            control::POSITION | control::VELOCITY => {
                VELOCITY_GAIN * (self.velocity_wanted(shaft) - shaft.velocity) + self.integral
            }
            _ => 0.0,
        };
        self.input.torque + controller
    }

    fn velocity_wanted(&self, shaft: Shaft) -> f64 {
        match self.control {
            control::POSITION => POSITION_GAIN * (self.input.position - self.position(shaft)) + self.input.velocity,
            _ => self.input.velocity,
        }
    }

    fn disarm(&mut self, reason: u32) {
        if self.is_armed {
            self.disarm_reason = reason;
        }
        self.is_armed = false;
    }

    fn heartbeat(&self) -> [u8; 8] {
        let state = if self.is_armed { state::CLOSED_LOOP } else { state::IDLE } as u8;
        if self.version.is_old() {
            let mut data = Heartbeat { error: self.error, state }.data();
            data[7] = DONE;
            return data;
        }
        Heartbeat { error: self.error | self.disarm_reason, state }.data()
    }

    /// An error by its bit in 0.6.
    fn controller_fails(&mut self, error: u32) {
        self.fail(if self.version.is_old() { CONTROLLER_FAILED } else { error });
    }

    fn estimates(&self, shaft: Shaft) -> [u8; 8] {
        if self.version.is_old() && !self.was_armed {
            return [0; 8];
        }
        codec::floats(self.position(shaft) as f32, shaft.velocity as f32)
    }

    fn position(&self, shaft: Shaft) -> f64 {
        shaft.position + self.offset
    }

    /// The identifier of a frame to this drive.
    fn id(&self, frame: &Frame) -> Option<u16> {
        u16::try_from(frame.id).ok().filter(|id| !frame.extended && codec::node(*id) == self.node)
    }

    fn command(&self, frame: &Frame) -> Option<Command> {
        Command::of(self.id(frame)?)
    }

    fn frame(&self, command: Command, data: [u8; 8]) -> Frame {
        Frame::classic(command.id(self.node).into(), &data)
    }
}

impl Firmware for Simulated {
    /// Requests of other kinds before the one for the position start the sample.
    fn requests_position(&self, frame: &Frame) -> bool {
        frame.data().is_empty()
            && match self.command(frame) {
                Some(Command::Estimates) => !self.was_requested,
                Some(command) => KINDS.contains(&command) && !self.was_requested,
                None => false,
            }
    }

    fn receive(&mut self, frame: &Frame, shaft: Shaft, send: &mut dyn FnMut(Frame)) {
        if self.id(frame).is_some() {
            // Any frame feeds the watchdog.
            self.since_fed = 0.0;
        }
        let Some(command) = self.command(frame) else { return };
        if frame.data().is_empty() {
            self.was_requested = KINDS.contains(&command);
        }
        match self.answer(command, shaft).filter(|_| frame.data().is_empty()) {
            Some(data) => send(self.frame(command, data)),
            None if frame.remote => {}
            None => self.obey(command, codec::padded(frame.data()), shaft),
        }
    }

    fn pass(&mut self, seconds: f64, shaft: Shaft, send: &mut dyn FnMut(Frame)) -> f64 {
        self.since_fed += seconds;
        if self.watchdog.is_some_and(|watchdog| self.since_fed > watchdog) && (self.is_armed || self.version.is_old()) {
            self.fail(self.version.watchdog());
        }
        if self.is_armed {
            if !shaft.velocity.is_finite() || !self.torque(shaft).is_finite() {
                self.controller_fails(MISSING_INPUT);
            } else if shaft.velocity.abs() > OVERSPEED * self.fastest {
                self.controller_fails(VELOCITY_LIMIT_VIOLATION);
            } else if self.control != control::TORQUE {
                let error = self.velocity_wanted(shaft) - shaft.velocity;
                self.integral += seconds * INTEGRATOR_GAIN * error;
            }
        }
        if is_due(&mut self.since_heartbeat, seconds, HEARTBEAT) {
            send(self.frame(Command::Heartbeat, self.heartbeat()));
        }
        if self.estimates.is_some_and(|every| is_due(&mut self.since_estimates, seconds, every)) {
            send(self.frame(Command::Estimates, self.estimates(shaft)));
        }
        self.torque(shaft)
    }
}

/// Whether a cyclic message is due. Missed ones are skipped.
fn is_due(since: &mut f64, seconds: f64, every: f64) -> bool {
    *since += seconds;
    let is_due = *since >= every;
    if is_due {
        *since %= every;
    }
    is_due
}
