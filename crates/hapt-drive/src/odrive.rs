//! ODrive's drives with CANSimple, on a CAN interface or behind an slcan adapter.
//!
//! The drive's watchdog is off by default, and CANSimple has no command to set it. [`Odrive`] therefore tests it: each start commands zero
//! torque, sends nothing, and requires the drive to disarm. Any frame to the node feeds the watchdog, from any host; a frame of another
//! host to this drive is therefore a fault. The requests of this host feed it too: so the drive's torque is requested and compared,
//! and its heartbeat is required.
//!
//! A remote frame requests the position. Answers have no sequence number. They are counted: a surplus answer comes from a second drive.
//! After a request without an answer the next one follows a request of another kind: positions that arrive before that one's answer are
//! stale. A drive that also sends its position cyclically, the factory setting, gets both requests in every sample.

mod barrier;
pub mod codec;
mod proof;
mod simulated;
mod start;

use std::time::{Duration, Instant};

use hapt_core::Reason;
use hapt_rt::DriveFault;

use barrier::Barrier;
use codec::{Command, Heartbeat, PASSTHROUGH, Version, control, state};
use proof::Proof;

use crate::can::Bus;
use crate::drive::{Drive, DriveError, DriveLimits, Error, OTHERS, ShaftState};
use crate::frame::Frame;

pub use simulated::Simulated;
pub use start::MAX_WATCHDOG;

/// Timeout of an answer outside the loop.
const ANSWER_TIMEOUT: Duration = Duration::from_millis(50);
/// Timeout of a change of state, including the heartbeat that reports it.
const STATE_TIMEOUT: Duration = Duration::from_secs(1);
/// Timeout of its heartbeat, in s of the loop's time and of the clock: three periods of the factory setting.
const HEARTBEAT_TIMEOUT_S: f64 = 0.3;
/// Timeout of sending a frame outside the loop.
const FRAME_TIMEOUT: Duration = Duration::from_millis(20);
/// Frames of another host to this drive.
const FOREIGN: DriveFault =
    DriveFault { code: 0, what: "another host addresses it, and feeds its watchdog", reason: Some(Reason::Link) };
/// An answer without a request.
const DOUBLED: DriveFault = DriveFault {
    code: 0,
    what: "another drive answers in its place, or it sends its position cyclically less than five times a second",
    reason: Some(Reason::Link),
};
/// Without a heartbeat the drive's state and errors are unknown.
const NO_HEARTBEAT: DriveFault =
    DriveFault { code: Command::Heartbeat as u32, what: "no heartbeat for 0.3 s", reason: Some(Reason::Link) };

/// A drive at a node of a bus.
pub struct Odrive {
    bus: Box<dyn Bus>,
    node: u8,
    /// Its name in messages.
    name: String,
    version: Version,
    /// Unanswered requests for the position.
    owed: u32,
    /// The time of the last request for its position, and whether it also sends it cyclically.
    estimates_requested: Option<Instant>,
    is_cyclic: bool,
    barrier: Barrier,
    proof: Proof,
    /// The loop's period, s.
    period: f64,
    /// Time since the last heartbeat, in s of the loop's time, and the clock at the first sample since then.
    since_heartbeat: f64,
    heartbeat: Instant,
    /// The measured time of its watchdog.
    watchdog_time: Duration,
    /// The largest command of the loop, N·m.
    most: f64,
    /// The time of arming, and whether a heartbeat has confirmed it.
    begun: Option<Instant>,
    is_armed: bool,
    /// Its fault, which only a start clears.
    fault: Option<DriveFault>,
}

impl Drive for Odrive {
    fn start(&mut self, limits: &DriveLimits) -> Result<ShaftState, Error> {
        self.most = limits.torque;
        self.get_ready()
    }

    fn paced(&mut self, period: f64) {
        self.period = period;
    }

    fn notes(&self) -> Vec<String> {
        let (name, watchdog_time, most) = (&self.name, self.watchdog_time.as_millis(), self.most);
        let mut notes = vec![format!(
            "{name}: in a test its watchdog removed the torque after {watchdog_time} ms without frames; CANSimple cannot set that time"
        )];
        notes.push(if most.is_finite() {
            format!(
                "{name}: CANSimple cannot set its largest torque; hapt commands {most:.3} N m at most, and the drive allows what is stored in \
                 it: set axis0.config.torque_soft_max, before 0.6 axis0.motor.config.torque_lim, to that in odrivetool"
            )
        } else {
            format!("{name}: CANSimple cannot set its largest torque, and this world has no device.limit")
        });
        notes
    }

    fn read(&mut self, until: Instant) -> Result<ShaftState, DriveError> {
        let answer = self.reading(until);
        if let Err(DriveError::Fault(_)) = answer {
            self.halt(until);
        }
        answer
    }

    fn command(&mut self, torque: f64, until: Instant) -> Result<(), DriveError> {
        if let Err(fault) = self.is_well() {
            self.halt(until);
            return Err(fault);
        }
        let node = self.node;
        let mut send =
            |command: Command, data: [u8; 8]| self.bus.send(&Frame::classic(command.id(node).into(), &data), until);
        if self.begun.is_none() {
            // The watchdog may also expire on a disarmed drive and leave an error. No other error is cleared without a report.
            if self.version.is_old() {
                send(Command::Clear, [0; 8])?;
            }
            send(Command::Mode, codec::pair(control::TORQUE, PASSTHROUGH))?;
            send(Command::Torque, [0; 8])?;
            send(Command::State, codec::pair(state::CLOSED_LOOP, 0))?;
            self.begun = Some(Instant::now());
        }
        let torque = torque as f32;
        send(Command::Torque, codec::floats(torque, 0.0))?;
        self.proof.record_command(torque.into());
        Ok(())
    }

    fn halt(&mut self, until: Instant) {
        // Each is sent separately: one may succeed where the other fails.
        for (command, data) in [(Command::Torque, [0; 8]), (Command::State, codec::pair(state::IDLE, 0))] {
            let _ = self.bus.send(&Frame::classic(command.id(self.node).into(), &data), until);
        }
    }

    fn stop(&mut self) {
        self.halt(Instant::now() + FRAME_TIMEOUT);
    }
}

/// A decoded frame of the drive, or of another host to it.
enum Received {
    Heartbeat(Heartbeat),
    Estimates(ShaftState),
    Version(Version),
    /// Its present errors.
    Error(u32),
    /// An answer of another kind, and its two numbers.
    Other(Command, [f32; 2]),
    /// The barrier's answer: later positions belong to this sample.
    Passed,
    /// A frame of another host.
    Foreign,
    Nothing,
}

impl Odrive {
    /// The drive at `node`, from 0 to 63, of `bus`, with the bus's `name` for messages.
    pub fn new(bus: Box<dyn Bus>, node: u8, name: &str) -> Self {
        let name = format!("the ODrive with node_id {node} at {name}");
        Odrive {
            bus,
            node,
            name,
            version: Version::SILENT,
            owed: 0,
            estimates_requested: None,
            is_cyclic: false,
            barrier: Barrier::default(),
            proof: Proof::new(Command::Torques, 0.0),
            period: 1e-3,
            since_heartbeat: 0.0,
            heartbeat: Instant::now(),
            watchdog_time: Duration::ZERO,
            most: 0.0,
            begun: None,
            is_armed: false,
            fault: None,
        }
    }

    /// The request of one sample and its answer.
    fn reading(&mut self, until: Instant) -> Result<ShaftState, DriveError> {
        if self.since_heartbeat == 0.0 {
            self.heartbeat = Instant::now();
        }
        self.since_heartbeat += self.period;
        // Frames since the last sample.
        let over = Instant::now();
        for _ in 0..OTHERS {
            let Some(frame) = self.bus.receive(over)? else { break };
            self.receive(&frame, false);
        }
        self.barrier.pass();
        let is_proven = self.proof.pass(self.period);
        if !self.is_armed {
            self.proof.rest();
        }
        let is_missing =
            self.since_heartbeat > HEARTBEAT_TIMEOUT_S && self.heartbeat.elapsed().as_secs_f64() > HEARTBEAT_TIMEOUT_S;
        let missing = is_missing.then_some(NO_HEARTBEAT).or(self.proof.fault());
        self.fault = self.fault.or(missing);
        self.is_well()?;
        let mut past = self.owed > 0 || self.is_cyclic;
        let proof = self.proof.kind;
        let kind = (is_proven && self.barrier.ask_for(proof)).then_some(proof);
        if is_proven && !self.barrier.serves(proof) {
            self.bus.send(&Frame::remote(proof.id(self.node).into(), 8), until)?;
        }
        let kind = match kind {
            None if past => Some(self.barrier.ask().ok_or(DriveError::Late)?),
            kind => kind,
        };
        if let Some(kind) = kind {
            self.bus.send(&Frame::remote(kind.id(self.node).into(), 8), until)?;
        }
        self.bus.send(&Frame::remote(Command::Estimates.id(self.node).into(), 8), until)?;
        self.owed = self.owed.saturating_add(1);
        let mut trouble = DriveError::Silent;
        for _ in 0..OTHERS {
            let Some(frame) = self.bus.receive(until)? else { break };
            match self.receive(&frame, true) {
                Received::Estimates(answer) if !past => {
                    self.is_well()?;
                    return Ok(answer);
                }
                // Earlier answers are lost.
                Received::Passed if past => (past, self.owed) = (false, 1),
                Received::Nothing => {}
                Received::Heartbeat(_)
                | Received::Estimates(_)
                | Received::Version(_)
                | Received::Error(_)
                | Received::Other(..)
                | Received::Passed
                | Received::Foreign => trouble = DriveError::Late,
            }
        }
        self.is_well()?;
        Err(trouble)
    }

    /// Evaluates a frame that arrived after this sample's requests, or before them.
    fn receive(&mut self, frame: &Frame, is_answer: bool) -> Received {
        let received = self.decode(frame);
        match received {
            Received::Other(command, [uses, makes]) => {
                let is_passed = self.barrier.is_passed_by(command);
                if command == self.proof.kind && self.is_armed {
                    self.proof.receive(uses.into(), makes.into(), is_passed && is_answer);
                }
                if is_passed {
                    return Received::Passed;
                }
            }
            Received::Heartbeat(heartbeat) => self.look_at(heartbeat),
            Received::Foreign => {
                self.fault.get_or_insert(FOREIGN);
            }
            Received::Estimates(_) if self.owed == 0 && !self.is_cyclic => {
                self.fault.get_or_insert(DOUBLED);
            }
            Received::Estimates(_) => self.owed = self.owed.saturating_sub(1),
            Received::Version(_) | Received::Error(_) | Received::Passed | Received::Nothing => {}
        }
        received
    }

    fn look_at(&mut self, heartbeat: Heartbeat) {
        self.since_heartbeat = 0.0;
        let is_armed = u32::from(heartbeat.state) == state::CLOSED_LOOP;
        self.is_armed |= is_armed && self.begun.is_some();
        // Only a start clears earlier errors; the watchdog of 0.5 expires on a disarmed drive too.
        let waits = if self.version.is_old() { self.version.watchdog() } else { 0 };
        let is_wrong = match self.begun {
            None => heartbeat.error & !waits != 0,
            // Before arming is confirmed, a heartbeat may be older than the command.
            Some(begun) if !self.is_armed => begun.elapsed() > STATE_TIMEOUT,
            Some(_) => !is_armed || heartbeat.error != 0,
        };
        if is_wrong {
            self.fault.get_or_insert(self.version.fault(heartbeat.error));
        }
    }

    fn is_well(&self) -> Result<(), DriveError> {
        self.fault.map_or(Ok(()), |fault| Err(DriveError::Fault(fault)))
    }

    /// Decodes a frame of the bus with respect to this drive.
    fn decode(&self, frame: &Frame) -> Received {
        let Some(id) = u16::try_from(frame.id).ok().filter(|id| !frame.extended && codec::node(*id) == self.node)
        else {
            return Received::Nothing;
        };
        let Some(command) = Command::of(id) else { return Received::Nothing };
        if frame.data().is_empty() || !command.is_a_drives() {
            return Received::Foreign;
        }
        let data = frame.data();
        let received = match command {
            Command::Heartbeat => Heartbeat::read(data).map(Received::Heartbeat),
            Command::Version => Version::read(data).map(Received::Version),
            Command::Error => data.get(..4).map(|bits| Received::Error(codec::numbers(codec::padded(bits)).0)),
            Command::Estimates => codec::two_floats(data).map(|(position, velocity)| {
                Received::Estimates(ShaftState { position: position.into(), velocity: velocity.into() })
            }),
            Command::Current | Command::Warmth | Command::Bus | Command::Torques | Command::Powers => {
                let (first, second) = codec::two_floats(data).unwrap_or((f32::NAN, f32::NAN));
                Some(Received::Other(command, [first, second]))
            }
            Command::Estop
            | Command::State
            | Command::Mode
            | Command::Position
            | Command::Velocity
            | Command::Torque
            | Command::Limits
            | Command::Reboot
            | Command::Clear
            | Command::Absolute => None,
        };
        received.unwrap_or(Received::Nothing)
    }

    fn gone(&self, error: std::io::Error) -> Error {
        Error::Gone { name: self.name.clone(), error }
    }

    fn send(&mut self, command: Command, data: [u8; 8]) -> Result<(), Error> {
        let frame = Frame::classic(command.id(self.node).into(), &data);
        self.bus.send(&frame, Instant::now() + FRAME_TIMEOUT).map_err(|error| self.gone(error))
    }

    fn ask(&mut self, command: Command) -> Result<(), Error> {
        if command == Command::Estimates {
            self.estimates_requested = Some(Instant::now());
        }
        let frame = Frame::remote(command.id(self.node).into(), 8);
        self.bus.send(&frame, Instant::now() + FRAME_TIMEOUT).map_err(|error| self.gone(error))
    }
}
