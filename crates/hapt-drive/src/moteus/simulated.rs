//! The firmware of a simulated moteus: its registers, modes and watchdog.
//!
//! Simulated: stopped, position mode with its gains, its integrator, limits of torque and watchdog, the mode after the watchdog
//! (`servo.timeout_mode` 0, 12 and 15), zero velocity, brake, faults, torque limits with their codes, the setting of its zero.
//! Not simulated: trajectories (stop position, limits of velocity and acceleration), the diagnostic stream, which is always empty. Its
//! motor makes 0.1 N·m per A.

use super::registers::{Parser, Resolution, Subframe, Value, Writer};
use super::tuning::{MOTOR, Tuning};
use super::{BROADCAST, REPLY, mode, register};
use crate::frame::Frame;
use crate::simulate::{Firmware, Shaft};

/// The factory settings: the watchdog in s, torque per revolution and per revolution per second, the largest torque after an expired
/// watchdog, in N·m.
const DEFAULT_TIMEOUT: f32 = 0.1;
const KP: f32 = 4.0;
const KD: f32 = 0.05;
const TIMEOUT_TORQUE: f32 = 5.0;
/// Time to switch its motor on, in s.
const ENABLING: f64 = 3e-3;
const ENABLING_MODE: i32 = 2;
/// Its serial number, and the bytes of its UUID.
const SERIAL: i32 = 0x6861_7074;
const COMMANDS: usize = (register::LAST_COMMAND - register::COMMAND_POSITION + 1) as usize;

/// Steps of the integer types for 8, 16 and 32 bits.
type Scales = [f32; 3];
const ANGLE: Scales = [0.01, 1e-4, 1e-5];
const VELOCITY: Scales = [0.1, 2.5e-4, 1e-5];
const ACCELERATION: Scales = [0.05, 1e-3, 1e-5];
const TORQUE: Scales = [0.5, 0.01, 1e-3];
const VOLTAGE: Scales = [0.5, 0.1, 1e-3];
const AMPERE: Scales = [1.0, 0.1, 1e-3];
const POWER: Scales = [10.0, 0.05, 1e-4];
const PART: Scales = [1.0 / 127.0, 1.0 / 32767.0, 1.0 / 2147483647.0];
const TIME: Scales = [0.01, 1e-3, 1e-6];

/// A simulated moteus.
#[derive(Clone, Debug)]
pub struct Simulated {
    id: u8,
    mode: i32,
    fault: i32,
    /// Values written from 0x010 to 0x01f and from 0x020 on, pending until a mode is written.
    other: [f32; 16],
    written: [f32; COMMANDS],
    /// The active values.
    active: [f32; COMMANDS],
    /// The setpoint of position mode, in revolutions.
    wanted: Option<f64>,
    /// Time until its watchdog expires, and until its motor is on, in s.
    left: f64,
    enabling: f64,
    after_enabling: i32,
    /// The offset of its position from the shaft's.
    zero: f64,
    torque: f32,
    /// The torque of its integrator, in N·m.
    integral: f32,
    tuning: Tuning,
    /// The mode after an expired watchdog, as in `servo.timeout_mode`.
    after_timeout: i32,
}

impl Simulated {
    /// A drive with this identifier, stopped, with [`Tuning::TUNED`].
    pub fn new(id: u8) -> Self {
        Simulated {
            id,
            mode: mode::STOPPED,
            fault: 0,
            other: [0.0; 16],
            written: fresh(),
            active: fresh(),
            wanted: None,
            left: f64::INFINITY,
            enabling: 0.0,
            after_enabling: mode::STOPPED,
            zero: 0.0,
            torque: 0.0,
            integral: 0.0,
            tuning: Tuning::TUNED,
            after_timeout: mode::ZERO_VELOCITY,
        }
    }

    /// The same with this mode after an expired watchdog: 0, no torque; 12, zero velocity, the factory setting; 15, brake.
    pub fn with_timeout_mode(self, mode: i32) -> Self {
        Simulated { after_timeout: mode, ..self }
    }

    /// The same with another configuration.
    pub fn with_tuning(self, tuning: Tuning) -> Self {
        Simulated { tuning, ..self }
    }

    /// Injects the fault of this number.
    pub fn fail(&mut self, code: u8) {
        (self.mode, self.fault, self.torque) = (mode::FAULT, code.into(), 0.0);
    }

    fn command(&self, register: u32) -> f32 {
        self.active[(register - register::COMMAND_POSITION) as usize]
    }

    /// Executes a written mode with the values written after it.
    fn commit(&mut self, wanted: i32, shaft: Shaft) {
        match (wanted, self.mode) {
            (mode::STOPPED, _) => {
                (self.mode, self.fault, self.wanted, self.integral) = (mode::STOPPED, 0, None, 0.0);
            }
            // Latched until a stop.
            (_, mode::FAULT | mode::TIMEOUT) => {}
            (mode::POSITION | mode::CURRENT | mode::ZERO_VELOCITY | mode::BRAKE, before) => {
                self.active = self.written;
                if before == mode::STOPPED {
                    (self.mode, self.enabling) = (ENABLING_MODE, ENABLING);
                } else if before != ENABLING_MODE && before != wanted {
                    self.enter(wanted, shaft);
                }
                self.after_enabling = wanted;
                let timeout = self.command(register::COMMAND_TIMEOUT);
                self.left = match (wanted, timeout) {
                    (mode::POSITION, 0.0) => DEFAULT_TIMEOUT.into(),
                    (mode::POSITION, timeout) if !timeout.is_nan() => timeout.into(),
                    _ => f64::INFINITY,
                };
                let position = self.command(register::COMMAND_POSITION);
                if !position.is_nan() {
                    self.wanted = Some(position.into());
                } else if self.wanted.is_none() {
                    self.wanted = Some(shaft.position + self.zero);
                }
            }
            _ => {}
        }
    }

    /// Whether position mode may start: not beyond the limits of the position.
    fn enter(&mut self, wanted: i32, shaft: Shaft) {
        let position = (shaft.position + self.zero) as f32;
        let (least, most) = self.tuning.position;
        self.mode = wanted;
        if wanted == mode::POSITION && (position < least || position > most) {
            self.fail(39);
        }
    }

    /// The torque in this mode at this shaft.
    fn torque(&mut self, seconds: f64, shaft: Shaft) -> f32 {
        let velocity = shaft.velocity as f32;
        // The damping is scaled by the active command.
        let kept = -KD * self.command(register::COMMAND_KD_SCALE) * velocity;
        match self.mode {
            mode::POSITION => {
                let goes = self.command(register::COMMAND_VELOCITY);
                let goes = if goes.is_nan() { 0.0 } else { goes };
                let wanted = self.wanted.get_or_insert(shaft.position + self.zero);
                *wanted += f64::from(goes) * seconds;
                let away = (*wanted - shaft.position - self.zero) as f32;
                let (rate, most) = self.tuning.integrator;
                // Only its limit is scaled by the command.
                let most = most * self.command(register::COMMAND_ILIMIT_SCALE);
                self.integral = (self.integral + rate * away * seconds as f32).max(-most).min(most);
                let requested = KP * self.command(register::COMMAND_KP_SCALE) * away
                    + KD * self.command(register::COMMAND_KD_SCALE) * (goes - velocity)
                    + self.command(register::COMMAND_TORQUE)
                    + self.integral;
                let most = self.command(register::COMMAND_MAX_TORQUE).abs();
                let allowed = if most.is_nan() { requested } else { requested.clamp(-most, most) };
                let ignored = self.command(register::COMMAND_IGNORE_BOUNDS);
                let position = (ignored.is_nan() || ignored == 0.0).then_some((shaft.position + self.zero) as f32);
                let (torque, code) = self.tuning.limited(allowed, position, velocity);
                self.fault = if code == 0 && allowed != requested { 102 } else { code };
                torque
            }
            mode::TIMEOUT => match self.after_timeout {
                mode::ZERO_VELOCITY => kept.clamp(-TIMEOUT_TORQUE, TIMEOUT_TORQUE),
                mode::BRAKE => -KD * velocity,
                _ => 0.0,
            },
            mode::ZERO_VELOCITY => kept.clamp(-TIMEOUT_TORQUE, TIMEOUT_TORQUE),
            // Its windings are shorted.
            mode::BRAKE => -KD * velocity,
            mode::CURRENT => MOTOR * self.other[0xc],
            _ => 0.0,
        }
    }

    /// 1: there is no such register; 2: it cannot be written; 3: not with this value.
    fn write(&mut self, register: u32, value: Value, shaft: Shaft) -> Result<Option<i32>, u32> {
        match register {
            register::MODE => {
                let wanted = value.whole();
                if !(0..mode::END).contains(&wanted) {
                    return Err(3);
                }
                (self.written, self.other) = (fresh(), [0.0; 16]);
                return Ok(Some(wanted));
            }
            0x010..0x020 => self.other[(register - 0x010) as usize] = value.scaled(scales(register)),
            register::COMMAND_POSITION..=register::LAST_COMMAND => {
                self.written[(register - register::COMMAND_POSITION) as usize] = value.scaled(scales(register));
            }
            register::SET_OUTPUT_NEAREST | register::SET_OUTPUT_EXACT => {
                let position = value.scaled(ANGLE);
                if !position.is_finite() {
                    return Err(3);
                }
                let offset = f64::from(position) - shaft.position;
                let nearest = register == register::SET_OUTPUT_NEAREST;
                // The nearest position that differs by whole turns from the encoder's position.
                self.zero = if nearest { offset.round() } else { offset };
                self.wanted = None;
            }
            register::MODE..=register::FAULT | register::MODEL..=0x122 | register::UUID..=0x153 => return Err(2),
            _ => return Err(1),
        }
        Ok(None)
    }

    fn read(&self, register: u32, resolution: Resolution, shaft: Shaft) -> Result<Value, u32> {
        let whole = |x: i32| Ok(Value::from_whole(x, resolution));
        let scaled = |x: f32| Ok(Value::from_scaled(x, scales(register), resolution));
        match register {
            register::MODE => whole(self.mode),
            register::POSITION | register::ABS_POSITION => scaled((shaft.position + self.zero) as f32),
            register::VELOCITY => scaled(shaft.velocity as f32),
            register::TORQUE => scaled(self.torque),
            register::Q_CURRENT => scaled(self.torque / MOTOR),
            register::D_CURRENT => scaled(0.0),
            register::POWER => scaled(self.torque * shaft.velocity as f32 * std::f32::consts::TAU),
            register::MOTOR_TEMPERATURE | register::TEMPERATURE => scaled(25.0),
            register::TRAJECTORY_COMPLETE => whole(1),
            register::HOME_STATE => whole(1),
            register::VOLTAGE => scaled(self.tuning.voltage),
            register::FAULT => whole(self.fault),
            0x010..0x020 => scaled(self.other[(register - 0x010) as usize]),
            register::COMMAND_POSITION..=register::LAST_COMMAND => {
                scaled(self.written[(register - register::COMMAND_POSITION) as usize])
            }
            register::ID => whole(self.id.into()),
            _ if resolution != Resolution::Int32 => Err(1),
            register::MODEL => whole(0x100),
            register::FIRMWARE => whole(0x108),
            register::MAP => whole(5),
            register::SERIAL..=0x122 | register::UUID..=0x153 => whole(self.uuid(register)),
            register::UUID_MASK_CAPABLE => whole(1),
            _ => Err(1),
        }
    }

    /// Its identity: a part of its serial number or UUID.
    fn uuid(&self, register: u32) -> i32 {
        SERIAL ^ i32::from(self.id) << 8 ^ (register & 3) as i32
    }
}

impl Firmware for Simulated {
    fn requests_position(&self, frame: &Frame) -> bool {
        let is_mine = frame.id >> 16 == 0 && frame.id & 0x7f == u32::from(self.id) && frame.id & REPLY != 0;
        is_mine && Parser::new(frame.data()).any(|part| matches!(part, Subframe::Read(register::POSITION, _)))
    }

    fn receive(&mut self, frame: &Frame, shaft: Shaft, send: &mut dyn FnMut(Frame)) {
        let (to, source) = (frame.id & 0x7f, frame.id >> 8 & 0x7f);
        if frame.id >> 16 != 0 || ![u32::from(self.id), BROADCAST].contains(&to) {
            return;
        }
        let mut answer = Writer::new(u32::from(self.id) << 8 | source);
        let mut wanted = None;
        // Consecutive registers are answered in one subframe.
        let (mut first, mut values) = (0, Run::default());
        for part in Parser::new(frame.data()) {
            let read = match part {
                Subframe::Read(register, resolution) => Some((register, self.read(register, resolution, shaft))),
                Subframe::Write(..) | Subframe::Reply(..) | Subframe::Error(..) | Subframe::Stream(_) => None,
            };
            match read {
                Some((register, Ok(value))) if values.takes(register, first, value) => values.push(value),
                read => {
                    answer = values.flush(answer, first);
                    match read {
                        Some((register, Ok(value))) => {
                            first = register;
                            values.push(value);
                        }
                        Some((register, Err(code))) => answer = answer.error(1, register, code),
                        None => {}
                    }
                }
            }
            match part {
                // Selects one of several drives with the same identifier.
                Subframe::Write(register @ register::UUID_MASK..register::UUID_MASK_CAPABLE, mask) => {
                    if mask.whole() != self.uuid(register) {
                        return;
                    }
                }
                Subframe::Write(register, value) => match self.write(register, value, shaft) {
                    Ok(mode) => wanted = mode.or(wanted),
                    Err(code) => answer = answer.error(0, register, code),
                },
                Subframe::Stream(channel) => answer = answer.empty_stream(channel),
                Subframe::Read(..) | Subframe::Reply(..) | Subframe::Error(..) => {}
            }
        }
        answer = values.flush(answer, first);
        if let Some(wanted) = wanted {
            self.commit(wanted, shaft);
        }
        if frame.id & REPLY != 0 && !answer.is_empty() {
            send(answer.frame());
        }
    }

    fn pass(&mut self, seconds: f64, shaft: Shaft, _say: &mut dyn FnMut(Frame)) -> f64 {
        if self.mode != mode::FAULT {
            self.fault = 0;
        }
        if self.mode == ENABLING_MODE {
            self.enabling -= seconds;
            if self.enabling <= 0.0 {
                self.enter(self.after_enabling, shaft);
            }
        }
        self.left -= seconds;
        if self.left <= 0.0 && self.mode == mode::POSITION {
            self.mode = mode::TIMEOUT;
        }
        self.torque = self.torque(seconds, shaft);
        self.torque.into()
    }
}

/// Consecutive values of one type.
#[derive(Default)]
struct Run {
    values: Vec<Value>,
}

impl Run {
    /// Whether `register` follows the last one, in the same type.
    fn takes(&self, register: u32, first: u32, value: Value) -> bool {
        let same = |other: &Value| std::mem::discriminant(other) == std::mem::discriminant(&value);
        self.values.first().is_some_and(same) && register == first + self.values.len() as u32
    }

    fn push(&mut self, value: Value) {
        self.values.push(value);
    }

    fn flush(&mut self, answer: Writer, first: u32) -> Writer {
        let answer = answer.reply(first, &self.values);
        self.values.clear();
        answer
    }
}

/// The default command: full gains, no limits, the default watchdog.
fn fresh() -> [f32; COMMANDS] {
    let mut command = [f32::NAN; COMMANDS];
    let says = [
        (register::COMMAND_POSITION, 0.0),
        (register::COMMAND_VELOCITY, 0.0),
        (register::COMMAND_TORQUE, 0.0),
        (register::COMMAND_KP_SCALE, 1.0),
        (register::COMMAND_KD_SCALE, 1.0),
        (register::COMMAND_ILIMIT_SCALE, 1.0),
        (register::COMMAND_TIMEOUT, 0.0),
    ];
    for (register, value) in says {
        command[(register - register::COMMAND_POSITION) as usize] = value;
    }
    command
}

/// The unit of a register.
fn scales(register: u32) -> Scales {
    match register {
        register::POSITION
        | register::ABS_POSITION
        | register::COMMAND_POSITION
        | register::COMMAND_STOP_POSITION
        | register::SET_OUTPUT_NEAREST
        | register::SET_OUTPUT_EXACT => ANGLE,
        register::VELOCITY | register::COMMAND_VELOCITY | register::COMMAND_VELOCITY_LIMIT | 0x01e => VELOCITY,
        0x029 => ACCELERATION,
        register::TORQUE | register::COMMAND_TORQUE | register::COMMAND_MAX_TORQUE => TORQUE,
        register::VOLTAGE | 0x014..=0x016 | 0x019..=0x01b | 0x02a => VOLTAGE,
        register::POWER => POWER,
        register::COMMAND_TIMEOUT => TIME,
        register::COMMAND_IGNORE_BOUNDS => [1.0; 3],
        0x010..=0x013
        | 0x018
        | register::COMMAND_KP_SCALE
        | register::COMMAND_KD_SCALE
        | register::COMMAND_ILIMIT_SCALE => PART,
        _ => AMPERE,
    }
}
