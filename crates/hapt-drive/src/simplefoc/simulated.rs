//! A simulated board with the sketch: its lines, its states, its watchdog. Its motor is controlled by voltage or by current.

use std::f64::consts::TAU;

use super::codec::{About, Answer, kind, state};
use super::{MotorConstant, VERSION};
use crate::frame::Frame;
use crate::simulate::{Firmware, Shaft};

/// The simulated motor's constant, in V/(N·m): that of the library's other sketch.
pub const VOLTS_PER_TORQUE: f64 = 20.0;
/// The largest target of its sketch, V or A.
const LIMIT: f32 = 24.0;

/// A simulated SimpleFOC board.
#[derive(Clone, Debug)]
pub struct Simulated {
    version: u8,
    motor: MotorConstant,
    limit: f32,
    state: u8,
    target: f32,
    /// The largest target of this session.
    ceiling: f32,
    last: u8,
    /// Time of its watchdog, and since the last target, s.
    watchdog: f64,
    since_fed: f64,
}

impl Default for Simulated {
    fn default() -> Self {
        Simulated {
            version: VERSION,
            motor: MotorConstant::VoltsPerTorque(VOLTS_PER_TORQUE),
            limit: LIMIT,
            state: state::OFF,
            target: 0.0,
            ceiling: 0.0,
            last: 0,
            watchdog: 0.0,
            since_fed: 0.0,
        }
    }
}

impl Simulated {
    /// A board that has started, with a motor of [`VOLTS_PER_TORQUE`].
    pub fn new() -> Self {
        Simulated::default()
    }

    /// The same with a sketch of this version.
    #[must_use]
    pub fn with_version(self, version: u8) -> Self {
        Simulated { version, ..self }
    }

    /// The same with this motor, controlled in the constant's unit.
    #[must_use]
    pub fn with_motor(self, motor: MotorConstant) -> Self {
        Simulated { motor, ..self }
    }

    /// The same with this largest target in its sketch.
    #[must_use]
    pub fn with_limit(self, limit: f32) -> Self {
        Simulated { limit, ..self }
    }

    /// Restarts, as after a reset or a power failure.
    pub fn restart(&mut self) {
        let Simulated { version, motor, limit, .. } = *self;
        *self = Simulated { version, motor, limit, ..Simulated::default() };
    }

    /// SimpleFOC's start fails, or the driver switches itself off.
    pub fn fail(&mut self) {
        self.off(state::FAILED);
    }

    fn off(&mut self, why: u8) {
        (self.state, self.target) = (why, 0.0);
    }

    /// Executes a line; `false`: the sketch does not define it.
    fn obey(&mut self, frame: &Frame) -> bool {
        match (u8::try_from(frame.id).unwrap_or(0), frame.data()) {
            (kind::QUERY, [_]) => {}
            (kind::STOP, [_]) if self.state == state::FAILED => {}
            (kind::STOP, [_]) => self.off(state::OFF),
            (kind::LIMIT, [_, a, b, c, d]) => {
                let limit = f32::from_be_bytes([*a, *b, *c, *d]);
                match self.state {
                    state::OFF | state::ON if self.state == state::ON || !(0.0..=self.limit).contains(&limit) => {
                        self.off(state::REFUSED);
                    }
                    state::OFF => self.ceiling = limit,
                    _ => {}
                }
            }
            (kind::ENABLE, [number, a, b]) => {
                let watchdog = u16::from_be_bytes([*a, *b]);
                if self.state == state::OFF && watchdog > 0 {
                    (self.state, self.target, self.last) = (state::ON, 0.0, *number);
                    (self.watchdog, self.since_fed) = (f64::from(watchdog) * 1e-4, 0.0);
                }
            }
            (kind::TARGET, [number, a, b, c, d]) => {
                let target = f32::from_be_bytes([*a, *b, *c, *d]);
                if self.state == state::ON {
                    if (-self.ceiling..=self.ceiling).contains(&target) {
                        (self.target, self.last, self.since_fed) = (target, *number, 0.0);
                    } else {
                        self.off(state::REFUSED);
                    }
                }
            }
            _ => return false,
        }
        true
    }

    fn answer(&self, kind: u8, number: u8, shaft: Shaft) -> Answer {
        let turns = shaft.position.floor();
        Answer {
            kind,
            number,
            state: self.state,
            last: self.last,
            turns: turns as i16,
            angle: ((shaft.position - turns) * TAU) as f32,
            measured: self.target,
        }
    }
}

impl Firmware for Simulated {
    fn requests_position(&self, frame: &Frame) -> bool {
        frame.id == u32::from(kind::QUERY)
    }

    fn receive(&mut self, frame: &Frame, shaft: Shaft, send: &mut dyn FnMut(Frame)) {
        match frame.data() {
            [number] if frame.id == u32::from(kind::VERSION) => {
                let (unit, state) = (self.motor.unit(), self.state);
                send(About { number: *number, version: self.version, unit, state, limit: self.limit }.frame());
            }
            [number, ..] if self.obey(frame) => {
                send(self.answer(u8::try_from(frame.id).unwrap_or(0), *number, shaft).frame());
            }
            _ => {}
        }
    }

    fn pass(&mut self, seconds: f64, _shaft: Shaft, _send: &mut dyn FnMut(Frame)) -> f64 {
        self.since_fed += seconds;
        if self.state == state::ON && self.since_fed > self.watchdog {
            self.off(state::EXPIRED);
        }
        // The torque of 1 V or 1 A is the reciprocal of the target for 1 N·m.
        f64::from(self.target) / self.motor.target(1.0)
    }
}
