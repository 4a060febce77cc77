//! A moteus as a [`Drive`].

use std::io;
use std::time::{Duration, Instant};

use super::fault::{self, fault};
use super::numbers::Numbers;
use super::registers::{Parser, Resolution, Subframe, Value, Writer};
use super::{BROADCAST, REPLY, mode, register};
use crate::can::Bus;
use crate::drive::{Drive, DriveError, DriveFault, DriveLimits, Error, OTHERS, ShaftState};
use crate::frame::Frame;

/// Timeout of an answer before the loop runs, and the number of attempts.
const REPLY_TIMEOUT: Duration = Duration::from_millis(50);
const TRIES: usize = 5;
/// Timeout of switching the motor on.
const READY: Duration = Duration::from_secs(2);
/// The watchdog's time between start and the first command, in s.
const BEFORE: f32 = 1.0;
/// The supported register map.
const MAP: i32 = 5;
/// Beyond this position, in revolutions, the resolution of a float is coarser than 1/65 536 of a revolution.
const FARTHEST: f32 = 256.0;
/// Consecutive commands that the drive has not executed, and consecutive commands without an answer, that fail.
const LOST: u32 = 8;
const UNANSWERED: u32 = 10;
/// The mode of a stopped drive.
const STOP: Value = Value::Int8(mode::STOPPED as i8);

/// A moteus on a bus.
///
/// A sample of the loop is two frames, both answered: a request and a command. A command carries the torque, its largest value and the
/// watchdog's time. Both gains and the limit of the integrator are 0, and trajectories have no limits, so that the torque is the commanded
/// one for every tuning of the drive.
///
/// Each frame writes its number into a register that the mode in use ignores, and reads the register's value before and after that. The
/// latter assigns the answer to its frame, so that a late answer is recognised. The former is the number of the drive's previous frame: a
/// command of another host sets it to 0, and a lost or repeated command of this host leaves another number. A drive that was stopped when
/// a command arrived is stopped again at once.
///
/// No other host may command the drive: a frame of another host on the bus is a fault too.
pub struct Moteus {
    bus: Box<dyn Bus>,
    /// The bus's name in messages.
    name: String,
    id: u8,
    limits: DriveLimits,
    numbers: Numbers,
    /// The last command.
    command: Option<SentCommand>,
    /// Consecutive commands not executed, and not answered.
    lost: u32,
    unanswered: u32,
    /// Whether it has been in position mode since the start.
    ran: bool,
    /// Its fault, which only a start clears.
    fault: Option<DriveFault>,
}

/// A command and its state.
#[derive(Clone, Copy, Debug)]
struct SentCommand {
    number: u32,
    /// The drive executes it.
    is_taken: bool,
    /// Its answer with the previous mode has arrived.
    is_answered: bool,
}

/// A decoded frame of the bus.
enum Received {
    /// The drive's answer.
    ShaftState(Status),
    /// A frame of another host to this drive, or its answer to another host.
    Foreign,
    Nothing,
}

/// The drive's answer to a request or a command.
#[derive(Clone, Copy, Debug, Default)]
struct Status {
    /// The numbers of the previous frame and of this one.
    before: Option<f32>,
    number: Option<f32>,
    mode: Option<i32>,
    position: Option<f32>,
    velocity: Option<f32>,
    fault: Option<i32>,
    map: Option<i32>,
}

impl Moteus {
    /// The drive with this identifier, from 1 to 126, on `bus`, with the bus's `name` for messages.
    pub fn new(bus: Box<dyn Bus>, id: u8, name: String) -> Self {
        Moteus {
            bus,
            name,
            id,
            limits: DriveLimits { watchdog: 0.0, torque: 0.0 },
            numbers: Numbers::default(),
            command: None,
            lost: 0,
            unanswered: 0,
            ran: false,
            fault: None,
        }
    }

    fn called(&self) -> String {
        format!("the moteus with id {} at {}", self.id, self.name)
    }

    /// The request; the drive's answer returns its number, and the previous number.
    fn question(&mut self) -> Writer {
        Writer::new(REPLY | u32::from(self.id))
            .read(register::VOLTAGE_PHASE_A, 1, Resolution::Float)
            .write(register::VOLTAGE_PHASE_A, &[Value::Float(self.numbers.next() as f32)])
            .read(register::VOLTAGE_PHASE_A, 1, Resolution::Float)
            .read(register::MODE, 1, Resolution::Int8)
            .read(register::POSITION, 2, Resolution::Float)
            .read(register::FAULT, 1, Resolution::Int8)
    }

    /// A stop without an answer. It leaves no number in the register.
    fn stopping(&mut self) -> Frame {
        self.numbers.forget();
        Writer::new(self.id.into()).write(register::MODE, &[STOP]).frame()
    }

    /// A request that stops the drive. The mode change clears its number.
    fn asking_and_stopping(&mut self) -> Writer {
        self.numbers.forget();
        self.question().write(register::MODE, &[STOP])
    }

    /// A command of this torque in N·m within `limits`, valid for `watchdog` s. Its answer contains the mode of the drive before the
    /// command.
    fn torque(&mut self, torque: f32, watchdog: f32) -> Frame {
        let most = if self.limits.torque.is_finite() { self.limits.torque as f32 } else { f32::NAN };
        let number = self.numbers.next();
        self.command = Some(SentCommand { number, is_taken: false, is_answered: false });
        Writer::new(REPLY | u32::from(self.id))
            .read(register::VOLTAGE_PHASE_A, 1, Resolution::Float)
            .read(register::MODE, 1, Resolution::Int8)
            .write(register::MODE, &[Value::Int8(mode::POSITION as i8)])
            // From the present position, at velocity 0, without gains, integrator and limits of a trajectory.
            .write(register::COMMAND_POSITION, &[Value::Int8(i8::MIN), Value::Int8(0)])
            .write(register::COMMAND_TORQUE, &[Value::Float(torque)])
            .write(register::COMMAND_KP_SCALE, &[Value::Int8(0), Value::Int8(0)])
            .write(register::COMMAND_MAX_TORQUE, &[Value::Float(most)])
            .write(register::COMMAND_TIMEOUT, &[Value::Float(watchdog)])
            .write(register::COMMAND_VELOCITY_LIMIT, &[Value::Int8(-1), Value::Int8(-1)])
            .write(register::COMMAND_ILIMIT_SCALE, &[Value::Int8(0)])
            .write(register::VOLTAGE_PHASE_A, &[Value::Float(number as f32)])
            .read(register::VOLTAGE_PHASE_A, 1, Resolution::Float)
            .frame()
    }

    /// Decodes a frame for this host, which is number 0 on the bus.
    fn decode(&self, frame: &Frame) -> Received {
        let (to, from) = (frame.id & 0x7f, frame.id >> 8 & 0x7f);
        if frame.id >> 16 != 0 {
            return Received::Nothing;
        }
        if to == u32::from(self.id) || to == BROADCAST {
            return Received::Foreign;
        }
        if frame.id & REPLY != 0 || from != u32::from(self.id) {
            return Received::Nothing;
        }
        if to != 0 {
            return Received::Foreign;
        }
        let mut status = Status::default();
        for part in Parser::new(frame.data()) {
            let Subframe::Reply(register, value) = part else { continue };
            let scaled = value.scaled([f32::NAN; 3]);
            match register {
                register::VOLTAGE_PHASE_A if status.before.is_none() => status.before = Some(scaled),
                register::VOLTAGE_PHASE_A => status.number = Some(scaled),
                register::MODE => status.mode = Some(value.whole()),
                register::POSITION => status.position = Some(scaled),
                register::VELOCITY => status.velocity = Some(scaled),
                register::FAULT => status.fault = Some(value.whole()),
                register::MAP => status.map = Some(value.whole()),
                _ => {}
            }
        }
        Received::ShaftState(status)
    }

    /// Evaluates an answer.
    fn receive(&mut self, frame: &Frame) -> Option<Status> {
        match self.decode(frame) {
            Received::ShaftState(status) => {
                self.follow(&status);
                Some(status)
            }
            Received::Foreign => {
                self.fault.get_or_insert(fault::FOREIGN);
                None
            }
            Received::Nothing => None,
        }
    }

    /// Registers the executed frames, and detects those of other hosts.
    fn follow(&mut self, status: &Status) {
        let (Some(before), Some(number)) = (status.before, status.number) else { return };
        let taken = self.numbers.take(before, number);
        if !taken.is_new {
            return;
        }
        // It was stopped, and a command may have switched it on again. No command clears a fault or an expired watchdog.
        let ended = [mode::POSITION, mode::FAULT, mode::TIMEOUT];
        if let Some(mode) = status.mode.filter(|mode| self.ran && !ended.contains(mode)) {
            self.fault.get_or_insert(fault::taken(mode));
        }
        if taken.is_foreign {
            self.fault.get_or_insert(fault::FOREIGN);
        }
        if let Some(sent) = &mut self.command {
            let number_of = |number: f32| number == sent.number as f32;
            (sent.is_answered, sent.is_taken) =
                (sent.is_answered || number_of(number), sent.is_taken || number_of(number) || number_of(before));
        }
    }

    /// Evaluates the previous command: its arrival and its answer.
    fn count_lost(&mut self) {
        let Some(sent) = self.command else { return };
        self.lost = if sent.is_taken { 0 } else { self.lost + 1 };
        self.unanswered = if sent.is_answered { 0 } else { self.unanswered + 1 };
        if self.lost >= LOST || self.unanswered >= UNANSWERED {
            self.fault.get_or_insert(fault::NOT_EXECUTED);
        }
    }

    /// Waits for the last command's answer. A late one is read in the next sample.
    fn is_taken(&mut self, until: Instant) -> Result<(), DriveError> {
        for _ in 0..OTHERS {
            let Some(frame) = self.bus.receive(until)? else { break };
            self.receive(&frame);
            if self.fault.is_some() || self.command.is_some_and(|sent| sent.is_answered) {
                break;
            }
        }
        self.is_well()
    }

    fn is_well(&self) -> Result<(), DriveError> {
        self.fault.map_or(Ok(()), |fault| Err(DriveError::Fault(fault)))
    }

    /// Sends a request and waits for its answer; `Late` where only other answers of this drive arrive. On a busy bus it waits until that
    /// instant, and then reads a limited number of the frames that have arrived.
    fn ask(&mut self, question: &Frame, until: Instant) -> Result<Status, DriveError> {
        let mut answered = false;
        let over = Instant::now();
        for _ in 0..OTHERS {
            let Some(frame) = self.bus.receive(over)? else { break };
            answered |= self.receive(&frame).is_some();
        }
        self.bus.send(question, until)?;
        for _ in 0..OTHERS {
            let Some(frame) = self.bus.receive(until)? else { break };
            if let Some(status) = self.receive(&frame) {
                answered = true;
                if status.number == Some(self.numbers.last() as f32) {
                    return Ok(status);
                }
            }
        }
        Err(if answered { DriveError::Late } else { DriveError::Silent })
    }

    /// The same with a longer timeout, before the loop runs.
    fn ask_again(&mut self, question: fn(&mut Moteus) -> Writer) -> Result<Status, Error> {
        for _ in 0..TRIES {
            let frame = question(self).frame();
            match self.ask(&frame, Instant::now() + REPLY_TIMEOUT) {
                Ok(status) => return Ok(status),
                Err(DriveError::Gone) => return Err(self.gone()),
                Err(_) => {}
            }
        }
        Err(Error::Silent { drive: self.called(), hint: self.others() })
    }

    fn gone(&self) -> Error {
        Error::Gone { name: self.name.clone(), error: io::ErrorKind::NotConnected.into() }
    }

    /// The other drives on the bus, as the end of a sentence.
    fn others(&mut self) -> String {
        let everybody = Writer::new(REPLY | BROADCAST).read(register::MODE, 1, Resolution::Int8).frame();
        let until = Instant::now() + REPLY_TIMEOUT;
        let mut seen = Vec::new();
        if self.bus.send(&everybody, until).is_ok() {
            while let Ok(Some(frame)) = self.bus.receive(until) {
                let id = frame.id >> 8 & 0x7f;
                if frame.id >> 16 == 0 && frame.id & (REPLY | 0x7f) == 0 && !seen.contains(&id) {
                    seen.push(id);
                }
                if Instant::now() >= until {
                    break;
                }
            }
        }
        match seen.as_slice() {
            [] => "; check its supply, the cable and its termination".into(),
            [one] => format!("; a drive with id {one} answers: moteus:{}#{one}", self.name),
            several => {
                let ids: Vec<String> = several.iter().map(u32::to_string).collect();
                format!("; drives with the ids {} answer", ids.join(", "))
            }
        }
    }

    /// Latches a failure, and stops the drive first.
    fn halted<T>(&mut self, what: Result<T, DriveError>, until: Instant) -> Result<T, DriveError> {
        if let Err(DriveError::Fault(fault)) = what {
            self.fault.get_or_insert(fault);
            self.halt(until);
        }
        what
    }

    fn answer(&mut self, status: &Status) -> Result<ShaftState, DriveError> {
        let (mode, code) = status.mode.zip(status.fault).ok_or(DriveError::Late)?;
        if let Some(fault) = fault(mode, code) {
            return Err(DriveError::Fault(fault));
        }
        self.ran |= mode == mode::POSITION;
        if self.ran && mode != mode::POSITION {
            return Err(DriveError::Fault(fault::taken(mode)));
        }
        match (status.position, status.velocity) {
            (Some(position), Some(velocity)) => Ok(ShaftState { position: position.into(), velocity: velocity.into() }),
            _ => Err(DriveError::Late),
        }
    }
}

impl Drive for Moteus {
    fn start(&mut self, limits: &DriveLimits) -> Result<ShaftState, Error> {
        (self.limits, self.ran, self.fault) = (*limits, false, None);
        (self.command, self.lost, self.unanswered) = (None, 0, 0);
        // Sent separately: a bus that is down fails here.
        let stop = self.stopping();
        let sent = self.bus.send(&stop, Instant::now() + REPLY_TIMEOUT);
        sent.map_err(|error| Error::Gone { name: self.name.clone(), error })?;
        let status = self.ask_again(|drive| drive.asking_and_stopping().read(register::MAP, 1, Resolution::Int32))?;
        self.numbers.forget();
        let map = status.map.unwrap_or(0);
        if map != MAP {
            let why = format!("has register map {map}, expected {MAP}: update its firmware");
            return Err(Error::Refused { drive: self.called(), why });
        }
        // A persistent fault returns at once.
        let until = Instant::now() + READY;
        loop {
            let ready = self.torque(0.0, BEFORE);
            self.bus.send(&ready, Instant::now() + REPLY_TIMEOUT).map_err(|_| self.gone())?;
            let status = self.ask_again(Moteus::question)?;
            let (mode, code) = status.mode.zip(status.fault).unwrap_or((mode::STOPPED, 0));
            if let Some(fault) = fault(mode, code) {
                self.stop();
                return Err(Error::Fault { drive: self.called(), fault });
            }
            if self.fault.is_some() {
                self.stop();
                let why = "receives frames of another host, which has to stop first".into();
                return Err(Error::Refused { drive: self.called(), why });
            }
            if mode == mode::POSITION {
                let position = status.position.unwrap_or(f32::NAN);
                if position.abs() < FARTHEST {
                    // From now on a stopped mode has another cause than this start.
                    self.ran = true;
                    return Ok(ShaftState {
                        position: position.into(),
                        velocity: status.velocity.unwrap_or(0.0).into(),
                    });
                }
                self.stop();
                let why = format!(
                    "is {position:.0} revolutions from its zero, where the resolution of its positions is too coarse: set its zero, or switch it off \
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

    fn read(&mut self, until: Instant) -> Result<ShaftState, DriveError> {
        let question = self.question().frame();
        let status = self.ask(&question, until);
        let answer = self.is_well().and(status).and_then(|status| self.answer(&status));
        self.halted(answer, until)
    }

    fn command(&mut self, torque: f64, until: Instant) -> Result<(), DriveError> {
        self.count_lost();
        let sent = self.is_well().and_then(|()| {
            let frame = self.torque(torque as f32, self.limits.watchdog as f32);
            self.bus.send(&frame, until)?;
            self.is_taken(until)
        });
        self.halted(sent, until)
    }

    fn halt(&mut self, until: Instant) {
        let stop = self.stopping();
        // If sending fails, the drive's watchdog acts.
        let _ = self.bus.send(&stop, until);
    }

    fn stop(&mut self) {
        for _ in 0..TRIES {
            let frame = self.asking_and_stopping().frame();
            match self.ask(&frame, Instant::now() + REPLY_TIMEOUT) {
                Err(DriveError::Silent | DriveError::Late) => {}
                // It has stopped, or it is absent.
                _ => return,
            }
        }
    }
}
