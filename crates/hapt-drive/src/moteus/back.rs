//! A moteus as a drive of the loop's.

use std::io;
use std::time::{Duration, Instant, SystemTime};

use super::fault::{self, fault};
use super::registers::{Parser, Resolution, Subframe, Value, Writer};
use super::{EVERYBODY, REPLY, mode, register};
use crate::can::Bus;
use crate::drive::{Answer, Drive, DriveFault, Error, OTHERS, Terms, Trouble};
use crate::frame::Frame;

/// How long an answer may take before the loop runs, and how often it is asked for.
const PATIENCE: Duration = Duration::from_millis(50);
const TRIES: usize = 5;
/// How long a drive may take to switch its motor on.
const READY: Duration = Duration::from_secs(2);
/// The watchdog's time between start and the first command, in s.
const BEFORE: f32 = 1.0;
/// The register map that this is written for.
const MAP: i32 = 5;
/// Farther from its zero, in revolutions, a float's last digit is more than 1/65 536 of a revolution.
const FARTHEST: f32 = 256.0;
/// Questions are numbered up to here, all exact in a float.
const NUMBERS: u32 = 1 << 20;
/// The last bits of a watchdog's time that a host marks as its own: less than 0.05 % of it.
const MARK: u32 = 0xfff;

/// A moteus on a bus.
///
/// The loop's sample is two frames: a question, which the drive answers, and a command, which it does not. A command carries the
/// torque, its largest value and the watchdog's time; both gains are 0, so that nothing else makes torque. The question writes its own
/// number into a register that the mode in use does not look at, and asks for it back: a late answer to an earlier question is known by
/// that, and never taken for the one that is waited for.
///
/// Nobody else may command the drive. A frame of another host on the bus is a fault; and since an adapter need not pass those on, the
/// answer also says for how long the command in force is good. The last bits of that time are this host's own: any other time was
/// another host's command.
pub struct Moteus {
    bus: Box<dyn Bus>,
    /// What people know it by.
    name: String,
    id: u8,
    terms: Terms,
    asked: u32,
    /// What this host writes into the last bits of a watchdog's time.
    mark: u32,
    /// It has been in position mode since it was started.
    ran: bool,
    /// What it has been found in: nothing but a start gets it out of that.
    fault: Option<DriveFault>,
}

/// What a frame on the bus is to this host.
enum Said {
    /// The drive's answer.
    Answer(Status),
    /// Another host's word to this drive, or this drive's to another host.
    Foreign,
    Nothing,
}

/// What a question brings back.
#[derive(Clone, Copy, Debug, Default)]
struct Status {
    number: Option<f32>,
    mode: Option<i32>,
    position: Option<f32>,
    velocity: Option<f32>,
    watchdog: Option<f32>,
    fault: i32,
    map: Option<i32>,
}

impl Moteus {
    /// The drive with this identifier, from 1 to 126, on `bus`, which people know by `name`.
    pub fn new(bus: Box<dyn Bus>, id: u8, name: String) -> Self {
        let terms = Terms { watchdog: 0.0, torque: 0.0 };
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let mark = (since.subsec_nanos() >> 8 ^ std::process::id()) & MARK;
        Moteus { bus, name, id, terms, asked: 0, mark, ran: false, fault: None }
    }

    fn called(&self) -> String {
        format!("the moteus with id {} at {}", self.id, self.name)
    }

    /// The question; the drive's answer gives its number back.
    fn question(&mut self) -> Writer {
        self.asked = (self.asked + 1) % NUMBERS;
        Writer::new(REPLY | u32::from(self.id))
            .write(register::VOLTAGE_PHASE_A, &[Value::Float(self.asked as f32)])
            .read(register::VOLTAGE_PHASE_A, 1, Resolution::Float)
            .read(register::MODE, 1, Resolution::Int8)
            .read(register::POSITION, 2, Resolution::Float)
            .read(register::COMMAND_TIMEOUT, 1, Resolution::Float)
            .read(register::FAULT, 1, Resolution::Int8)
    }

    /// A watchdog's time with this host's mark.
    fn marked(&self, watchdog: f32) -> f32 {
        f32::from_bits(watchdog.to_bits() & !MARK | self.mark)
    }

    /// A command of this torque in N·m, held to `terms`, that is good for `watchdog` s.
    fn torque(&self, torque: f32, watchdog: f32) -> Frame {
        let most = if self.terms.torque.is_finite() { self.terms.torque as f32 } else { f32::NAN };
        Writer::new(u32::from(self.id))
            .write(register::MODE, &[Value::Int8(mode::POSITION as i8)])
            // From where it is, at no velocity, with no gains.
            .write(register::COMMAND_POSITION, &[Value::Int8(i8::MIN), Value::Int8(0)])
            .write(register::COMMAND_TORQUE, &[Value::Float(torque)])
            .write(register::COMMAND_KP_SCALE, &[Value::Int8(0), Value::Int8(0)])
            .write(register::COMMAND_MAX_TORQUE, &[Value::Float(most)])
            .write(register::COMMAND_TIMEOUT, &[Value::Float(self.marked(watchdog))])
            .frame()
    }

    /// What a frame is to this host, which is number 0 on the bus.
    fn said(&self, frame: &Frame) -> Said {
        let (to, from) = (frame.id & 0x7f, frame.id >> 8 & 0x7f);
        if frame.id >> 16 != 0 {
            return Said::Nothing;
        }
        if to == u32::from(self.id) || to == EVERYBODY {
            return Said::Foreign;
        }
        if frame.id & REPLY != 0 || from != u32::from(self.id) {
            return Said::Nothing;
        }
        if to != 0 {
            return Said::Foreign;
        }
        let mut status = Status::default();
        for part in Parser::new(frame.data()) {
            let Subframe::Reply(register, value) = part else { continue };
            let scaled = value.scaled([f32::NAN; 3]);
            match register {
                register::VOLTAGE_PHASE_A => status.number = Some(scaled),
                register::MODE => status.mode = Some(value.whole()),
                register::POSITION => status.position = Some(scaled),
                register::VELOCITY => status.velocity = Some(scaled),
                register::COMMAND_TIMEOUT => status.watchdog = Some(scaled),
                register::FAULT => status.fault = value.whole(),
                register::MAP => status.map = Some(value.whole()),
                _ => {}
            }
        }
        Said::Answer(status)
    }

    /// Takes note of another host.
    fn hear(&mut self, frame: &Frame) -> Option<Status> {
        match self.said(frame) {
            Said::Answer(status) => Some(status),
            Said::Foreign => {
                self.fault.get_or_insert(fault::FOREIGN);
                None
            }
            Said::Nothing => None,
        }
    }

    fn is_well(&self) -> Result<(), Trouble> {
        self.fault.map_or(Ok(()), |fault| Err(Trouble::Fault(fault)))
    }

    /// Sends a question and waits for its answer; `Late` where other answers of this drive have come instead. However full the bus is
    /// of others' frames, it waits until that instant and looks at so many of those that are there then.
    fn ask(&mut self, question: &Frame, until: Instant) -> Result<Status, Trouble> {
        let mut heard = false;
        let over = Instant::now();
        for _ in 0..OTHERS {
            let Some(frame) = self.bus.receive(over)? else { break };
            heard |= self.hear(&frame).is_some();
        }
        self.bus.send(question, until)?;
        for _ in 0..OTHERS {
            let Some(frame) = self.bus.receive(until)? else { break };
            if let Some(status) = self.hear(&frame) {
                heard = true;
                if status.number == Some(self.asked as f32) {
                    return Ok(status);
                }
            }
        }
        Err(if heard { Trouble::Late } else { Trouble::Silent })
    }

    /// The same with patience, before the loop runs.
    fn ask_again(&mut self, question: fn(Writer) -> Writer) -> Result<Status, Error> {
        for _ in 0..TRIES {
            let frame = question(self.question()).frame();
            match self.ask(&frame, Instant::now() + PATIENCE) {
                Ok(status) => return Ok(status),
                Err(Trouble::Gone) => return Err(self.gone()),
                Err(_) => {}
            }
        }
        Err(Error::Silent { drive: self.called(), hint: self.others() })
    }

    fn gone(&self) -> Error {
        Error::Gone { name: self.name.clone(), error: io::ErrorKind::NotConnected.into() }
    }

    /// Who is there instead, as the end of a sentence.
    fn others(&mut self) -> String {
        let everybody = Writer::new(REPLY | EVERYBODY).read(register::MODE, 1, Resolution::Int8).frame();
        let until = Instant::now() + PATIENCE;
        let mut seen = Vec::new();
        if self.bus.send(&everybody, until).is_ok() {
            while let Ok(Some(frame)) = self.bus.receive(until) {
                let id = frame.id >> 8 & 0x7f;
                if frame.id & (REPLY | 0x7f) == 0 && !seen.contains(&id) {
                    seen.push(id);
                }
                if Instant::now() >= until {
                    break;
                }
            }
        }
        match seen.as_slice() {
            [] => "; is it powered, and are the cable and its termination right?".into(),
            [one] => format!("; there is one with id {one}: moteus:{}#{one}", self.name),
            several => {
                let ids: Vec<String> = several.iter().map(u32::to_string).collect();
                format!("; there are some with the ids {}", ids.join(", "))
            }
        }
    }

    fn answer(&mut self, status: &Status) -> Result<Answer, Trouble> {
        let mode = status.mode.ok_or(Trouble::Late)?;
        if let Some(fault) = fault(mode, status.fault) {
            return Err(Trouble::Fault(fault));
        }
        self.ran |= mode == mode::POSITION;
        if self.ran && mode != mode::POSITION {
            return Err(Trouble::Fault(fault::taken(mode)));
        }
        let ours = [self.terms.watchdog as f32, BEFORE].map(|watchdog| self.marked(watchdog));
        if self.ran && !status.watchdog.is_some_and(|watchdog| ours.contains(&watchdog)) {
            self.fault = Some(fault::FOREIGN);
        }
        self.is_well()?;
        match (status.position, status.velocity) {
            (Some(position), Some(velocity)) => Ok(Answer { position: position.into(), velocity: velocity.into() }),
            _ => Err(Trouble::Late),
        }
    }
}

impl Drive for Moteus {
    fn start(&mut self, terms: &Terms) -> Result<Answer, Error> {
        (self.terms, self.ran, self.fault) = (*terms, false, None);
        // Alone, because a bus that is down says so here.
        let stop = Writer::new(self.id.into()).write(register::MODE, &[Value::Int8(mode::STOPPED as i8)]).frame();
        let sent = self.bus.send(&stop, Instant::now() + PATIENCE);
        sent.map_err(|error| Error::Gone { name: self.name.clone(), error })?;
        let status = self.ask_again(|question| {
            question.write(register::MODE, &[Value::Int8(mode::STOPPED as i8)]).read(
                register::MAP,
                1,
                Resolution::Int32,
            )
        })?;
        let map = status.map.unwrap_or(0);
        if map != MAP {
            let why = format!("speaks register map {map}, and this is written for {MAP}: update its firmware");
            return Err(Error::Refused { drive: self.called(), why });
        }
        // A fault that is still there comes back at once.
        let until = Instant::now() + READY;
        loop {
            let ready = self.torque(0.0, BEFORE);
            self.bus.send(&ready, Instant::now() + PATIENCE).map_err(|_| self.gone())?;
            let status = self.ask_again(|question| question)?;
            let mode = status.mode.unwrap_or(mode::STOPPED);
            if let Some(fault) = fault(mode, status.fault) {
                self.stop();
                return Err(Error::Fault { drive: self.called(), fault });
            }
            if self.fault.is_some() {
                self.stop();
                let why = "is spoken to by another host, which has to end first".into();
                return Err(Error::Refused { drive: self.called(), why });
            }
            if mode == mode::POSITION {
                let position = status.position.unwrap_or(f32::NAN);
                if position.abs() < FARTHEST {
                    return Ok(Answer { position: position.into(), velocity: status.velocity.unwrap_or(0.0).into() });
                }
                self.stop();
                let why = format!(
                    "stands {position:.0} revolutions from its zero, where its answers are too coarse to feel: set its zero, or switch it off \
                     and on"
                );
                return Err(Error::Refused { drive: self.called(), why });
            }
            if Instant::now() > until {
                self.stop();
                let why = format!("does not switch its motor on: it stays in mode {mode}");
                return Err(Error::Refused { drive: self.called(), why });
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn read(&mut self, until: Instant) -> Result<Answer, Trouble> {
        let question = self.question().frame();
        let status = self.ask(&question, until);
        self.is_well()?;
        self.answer(&status?)
    }

    fn command(&mut self, torque: f64, until: Instant) -> Result<(), Trouble> {
        self.is_well()?;
        let frame = self.torque(torque as f32, self.terms.watchdog as f32);
        Ok(self.bus.send(&frame, until)?)
    }

    fn stop(&mut self) {
        for _ in 0..TRIES {
            let frame = self.question().write(register::MODE, &[Value::Int8(mode::STOPPED as i8)]).frame();
            match self.ask(&frame, Instant::now() + PATIENCE) {
                Err(Trouble::Silent | Trouble::Late) => {}
                // It has heard it, or there is nobody to hear it.
                _ => return,
            }
        }
    }
}
