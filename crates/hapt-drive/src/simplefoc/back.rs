//! A SimpleFOC board as a [`Drive`].

use std::f64::consts::TAU;
use std::io;
use std::time::{Duration, Instant};

use hapt_rt::DriveFault;

use super::codec::{self, About, Answer, kind, state};
use super::fault::{self, fault};
use super::proof::Proof;
use super::{MotorConstant, VERSION};
use crate::can::Bus;
use crate::drive::{Drive, DriveError, DriveLimits, Error, OTHERS, ShaftState};
use crate::frame::Frame;

/// Timeout of an answer before the loop runs, and the number of attempts.
const REPLY_TIMEOUT: Duration = Duration::from_millis(100);
const TRIES: u32 = 8;
/// Timeout of the start: opening its port resets many boards, and SimpleFOC then turns the motor to align its field.
const START_TIMEOUT: Duration = Duration::from_secs(10);
/// The longest time until an expired watchdog is reported, in addition to its own time.
const EXPIRY_TIMEOUT: Duration = Duration::from_secs(1);
const POLL_PERIOD: Duration = Duration::from_millis(2);
/// Consecutive answers without the last target that fail.
const LOST: u32 = 8;
/// Units of its watchdog, per s.
const WATCHDOG_UNITS: f64 = 1e4;
/// The sketch counts no further turns.
const FARTHEST: i16 = i16::MAX - 1;
/// Relative: the rounding of a limit to 32 bits.
const ROUNDING: f64 = 1e-6;
/// The remedy for a board without the sketch.
const SKETCH: &str = "load the sketch simplefoc_drive of the library that hapt export c --arduino writes";

/// A SimpleFOC board at a serial port, with hapt's sketch.
///
/// A sample of the loop is two lines, both answered: a query and a target. Only a target feeds the board's watchdog. Every answer contains
/// the number of its line, by which a late answer is recognised; the number of the target in use, by which lost targets are recognised; and
/// the board's state, which is on from the first target up to a fault or a restart, and then off until a start.
pub struct SimpleFoc {
    bus: Box<dyn Bus>,
    /// Its name in messages.
    name: String,
    motor: MotorConstant,
    /// The time of its watchdog, in the line's units.
    watchdog: u16,
    /// The largest target, V or A.
    most: f32,
    /// The loop's period, s.
    period: f64,
    /// The number of the last line.
    number: u8,
    /// The lines since the one that switched it on, that one included; 0: none has.
    since_on: u32,
    /// The number of the last target, or of the line that switched it on.
    last: u8,
    /// Consecutive answers with another one.
    lost: u32,
    proof: Proof,
    /// The last position, in revolutions, and the samples since then.
    position: Option<f64>,
    samples: u32,
    /// Its fault, which only a start clears.
    fault: Option<DriveFault>,
}

impl SimpleFoc {
    /// The board on `bus` with this motor, with the port's `name` for messages.
    pub fn new(bus: Box<dyn Bus>, motor: MotorConstant, name: &str) -> Self {
        SimpleFoc {
            bus,
            name: format!("the SimpleFOC board at {name}"),
            motor,
            watchdog: 1,
            most: 0.0,
            period: 1e-3,
            number: 0,
            since_on: 0,
            last: 0,
            lost: 0,
            proof: Proof::new(false, 0.0),
            position: None,
            samples: 0,
            fault: None,
        }
    }

    fn send(&mut self, kind: u8, data: &[u8], until: Instant) -> io::Result<u8> {
        self.number = self.number.wrapping_add(1);
        self.since_on = if self.since_on > 0 { self.since_on.saturating_add(1) } else { 0 };
        self.bus.send(&codec::line(kind, self.number, data), until)?;
        Ok(self.number)
    }

    /// Evaluates a line of the board.
    fn receive(&mut self, frame: &Frame) -> Option<Answer> {
        let answer = Answer::read(frame)?;
        let age = u32::from(self.number.wrapping_sub(answer.number));
        let is_on = self.since_on > 0;
        // An answer from before it was switched on does not show the present state.
        if !is_on || age < self.since_on {
            self.fault = self.fault.or(fault(answer.state, is_on));
        }
        Some(answer)
    }

    fn is_well(&self) -> Result<(), DriveError> {
        self.fault.map_or(Ok(()), |fault| Err(DriveError::Fault(fault)))
    }

    /// The query of one sample and its answer.
    fn reading(&mut self, until: Instant) -> Result<ShaftState, DriveError> {
        self.samples = self.samples.saturating_add(1);
        let mut trouble = DriveError::Silent;
        let over = Instant::now();
        for _ in 0..OTHERS {
            let Some(frame) = self.bus.receive(over)? else { break };
            if self.receive(&frame).is_some() {
                trouble = DriveError::Late;
            }
        }
        self.is_well()?;
        let number = self.send(kind::QUERY, &[], until)?;
        for _ in 0..OTHERS {
            let Some(frame) = self.bus.receive(until)? else { break };
            let Some(answer) = self.receive(&frame) else { continue };
            self.is_well()?;
            if answer.kind == kind::QUERY && answer.number == number {
                return self.take(&answer);
            }
            trouble = DriveError::Late;
        }
        Err(trouble)
    }

    /// The answer to this sample's query.
    fn take(&mut self, answer: &Answer) -> Result<ShaftState, DriveError> {
        let seconds = f64::from(std::mem::take(&mut self.samples)) * self.period;
        if self.since_on > 0 {
            let is_last = answer.last == self.last;
            self.lost = if is_last { 0 } else { self.lost + 1 };
            let not_executed = (self.lost >= LOST).then_some(fault::NOT_EXECUTED);
            let another = self.proof.receive(answer.measured.into(), seconds).filter(|_| is_last);
            self.fault = self.fault.or(not_executed).or(another);
        }
        let turns = f64::from(answer.angle) / TAU;
        // One turn, to either side, with its rounding.
        if turns.is_nan() || turns.abs() > 1.0 + ROUNDING {
            self.fault = self.fault.or(Some(fault::NO_ANGLE));
        } else if answer.turns.saturating_abs() >= FARTHEST {
            self.fault = self.fault.or(Some(fault::FARTHEST));
        }
        self.is_well()?;
        let position = f64::from(answer.turns) + turns;
        let before = self.position.replace(position).unwrap_or(position);
        Ok(ShaftState { position, velocity: if seconds > 0.0 { (position - before) / seconds } else { 0.0 } })
    }

    /// Latches a failure, and stops the board first.
    fn halted<T>(&mut self, what: Result<T, DriveError>, until: Instant) -> Result<T, DriveError> {
        if let Err(DriveError::Fault(_)) = what {
            self.halt(until);
        }
        what
    }

    /// Repeats a line until it is answered, before the loop runs.
    fn ask(&mut self, kind: u8, data: &[u8]) -> Result<Answer, Error> {
        for _ in 0..TRIES {
            if let Some(frame) = self.answer(kind, data, |frame| Answer::read(frame).map(|answer| answer.number))?
                && let Some(answer) = Answer::read(&frame).filter(|answer| answer.kind == kind)
            {
                return Ok(answer);
            }
        }
        Err(self.silent("; it answered before: check the cable"))
    }

    /// Sends a line once; the frame with its number, or `None`.
    fn answer(&mut self, kind: u8, data: &[u8], number: fn(&Frame) -> Option<u8>) -> Result<Option<Frame>, Error> {
        let until = Instant::now() + REPLY_TIMEOUT;
        let sent = match self.send(kind, data, until) {
            Err(error) if error.kind() == io::ErrorKind::TimedOut => return Ok(None),
            sent => sent.map_err(|error| self.gone(error))?,
        };
        for _ in 0..OTHERS {
            let Some(frame) = self.bus.receive(until).map_err(|error| self.gone(error))? else { break };
            if number(&frame) == Some(sent) {
                return Ok(Some(frame));
            }
        }
        Ok(None)
    }

    /// The board's version, unit and limit, once it has started.
    fn about(&mut self) -> Result<About, Error> {
        let end = Instant::now() + START_TIMEOUT;
        loop {
            let frame = self.answer(kind::VERSION, &[], |frame| About::read(frame).map(|about| about.number))?;
            if let Some(about) = frame.as_ref().and_then(About::read) {
                return Ok(about);
            }
            if Instant::now() >= end {
                return Err(self.silent(&format!(": {SKETCH}, and check its supply and the speed of its line")));
            }
        }
    }

    /// The largest target in N·m, in the board's unit.
    fn ceiling(&self, about: &About, torque: f64) -> Result<f32, Error> {
        let limit = f64::from(about.limit);
        let wanted = if torque.is_finite() { self.motor.target(torque) } else { limit };
        // A NaN limit is refused too.
        if wanted <= limit * (1.0 + ROUNDING) {
            return Ok(wanted.min(limit) as f32);
        }
        let unit = char::from(about.unit);
        Err(self.refused(format!(
            "takes at most {limit} {unit}, and device.limit asks for {wanted:.3} {unit}: lower device.limit, or raise LIMIT in its sketch if \
             motor and driver bear it"
        )))
    }

    /// The checks before the loop.
    fn get_ready(&mut self, limits: &DriveLimits) -> Result<ShaftState, Error> {
        (self.since_on, self.lost, self.fault, self.position, self.samples) = (0, 0, None, None, 0);
        self.stop();
        let about = self.about()?;
        if about.version != VERSION {
            let (its, ours) = (about.version, VERSION);
            return Err(self.refused(format!("has a sketch of version {its}, expected {ours}: {SKETCH}")));
        }
        if about.unit != self.motor.unit() {
            return Err(self.refused(match about.unit {
                b'V' => "controls its torque by voltage: its address needs volts-per-torque, in V/(N m)".into(),
                b'A' => "controls its torque by current: its address needs torque-constant, in N m/A".into(),
                b'E' => "controls an estimated current, which nothing measures: set torque_controller in its sketch to voltage, or \
                         BY_CURRENT to 1 where it has current sensors"
                    .into(),
                _ => format!("controls neither the voltage nor the current of its torque: {SKETCH}"),
            }));
        }
        self.most = self.ceiling(&about, limits.torque)?;
        self.watchdog = (limits.watchdog * WATCHDOG_UNITS).floor().clamp(1.0, f64::from(u16::MAX)) as u16;
        self.proof = Proof::new(about.unit == b'A', self.most.into());
        self.state_after(kind::STOP, &[], &[state::OFF])?;
        self.state_after(kind::LIMIT, &self.most.to_be_bytes(), &[state::OFF])?;
        self.expires()?;
        self.state_after(kind::STOP, &[], &[state::OFF])?;
        let answer = self.state_after(kind::QUERY, &[], &[state::OFF])?;
        self.take(&answer).map_err(|_| self.stands())
    }

    /// Tests the board's watchdog: switched on with a target of zero, it has to switch off when no target arrives.
    fn expires(&mut self) -> Result<(), Error> {
        self.state_after(kind::ENABLE, &self.watchdog.to_be_bytes(), &[state::ON, state::EXPIRED])?;
        let end = Instant::now() + EXPIRY_TIMEOUT + Duration::from_secs_f64(f64::from(self.watchdog) / WATCHDOG_UNITS);
        loop {
            let answer = self.state_after(kind::QUERY, &[], &[state::ON, state::EXPIRED])?;
            if answer.state == state::EXPIRED {
                return Ok(());
            }
            if Instant::now() >= end {
                return Err(self.refused("keeps its motor on without targets: its sketch has no watchdog".into()));
            }
            std::thread::sleep(POLL_PERIOD);
        }
    }

    /// The answer to a line, in one of these states; every other is a fault that does not clear.
    fn state_after(&mut self, kind: u8, data: &[u8], states: &[u8]) -> Result<Answer, Error> {
        let answer = self.ask(kind, data)?;
        if states.contains(&answer.state) {
            return Ok(answer);
        }
        self.fault = fault(answer.state, false);
        Err(self.stands())
    }

    /// The error of a fault that does not clear.
    fn stands(&mut self) -> Error {
        self.stop();
        match self.fault {
            Some(fault) => Error::Fault { drive: self.name.clone(), fault },
            None => self.refused("does not do what its line says".into()),
        }
    }

    fn gone(&self, error: io::Error) -> Error {
        Error::Gone { name: self.name.clone(), error }
    }

    fn silent(&self, hint: &str) -> Error {
        Error::Silent { drive: self.name.clone(), hint: hint.into() }
    }

    fn refused(&self, why: String) -> Error {
        Error::Refused { drive: self.name.clone(), why }
    }
}

impl Drive for SimpleFoc {
    fn start(&mut self, limits: &DriveLimits) -> Result<ShaftState, Error> {
        let ready = self.get_ready(limits);
        if ready.is_err() {
            self.stop();
        }
        ready
    }

    fn read(&mut self, until: Instant) -> Result<ShaftState, DriveError> {
        let reading = match self.fault {
            Some(fault) => Err(DriveError::Fault(fault)),
            None => self.reading(until),
        };
        self.halted(reading, until)
    }

    fn command(&mut self, torque: f64, until: Instant) -> Result<(), DriveError> {
        let well = self.is_well();
        self.halted(well, until)?;
        if self.since_on == 0 {
            let watchdog = self.watchdog.to_be_bytes();
            self.last = self.send(kind::ENABLE, &watchdog, until)?;
            self.since_on = 1;
        }
        let target = self.motor.target(if torque.is_finite() { torque } else { 0.0 }) as f32;
        let target = target.clamp(-self.most, self.most);
        self.last = self.send(kind::TARGET, &target.to_be_bytes(), until)?;
        self.proof.record_target(target.into());
        Ok(())
    }

    fn halt(&mut self, until: Instant) {
        let _ = self.send(kind::STOP, &[], until);
    }

    fn stop(&mut self) {
        self.halt(Instant::now() + REPLY_TIMEOUT);
    }

    fn paced(&mut self, period: f64) {
        self.period = period;
    }

    fn notes(&self) -> Vec<String> {
        let (name, motor, most, unit) = (&self.name, self.motor, self.most, char::from(self.motor.unit()));
        vec![format!(
            "{name} takes at most {most} {unit}; the torque is as exact as {motor}, which hapt identify --inertia measures"
        )]
    }
}
