//! ODrive's drives by CANSimple, on a CAN interface or behind an slcan adapter.
//!
//! The drive's watchdog is off as shipped, and CANSimple has no word to set it. So [`Odrive`] does not believe that it is on: each start
//! gives the drive a torque of zero, falls silent, and wants to see it disarm. Any frame to the node feeds the watchdog, whoever sends
//! it; another host's frame to our drive is a fault therefore. Our own questions feed it too: so the drive is asked which torque it uses,
//! and its heartbeat has to come.
//!
//! A position is asked for by a remote frame. Answers carry no number. They are counted: one that nobody has asked for is a second
//! drive's. After a question without an answer the next one comes behind a question of another kind: what arrives before that one's
//! answer belongs to the past. A drive that says its position unasked too, as ODrives are shipped, is asked so in every sample.

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
pub use start::LONGEST_WATCHDOG;

/// How long it may take to answer when nothing is urgent.
const AN_ANSWER: Duration = Duration::from_millis(50);
/// How long a drive may take for a state, with the heartbeat that shows it.
const A_STATE: Duration = Duration::from_secs(1);
/// How long its heartbeat may stay away, in s of the loop's time and by the clock: three of those that it is shipped with.
const HEARTBEATS: f64 = 0.3;
/// How long a frame may take to find room when nothing is urgent.
const A_FRAME: Duration = Duration::from_millis(20);
/// Frames that only a host sends have come from somewhere else.
const FOREIGN: DriveFault =
    DriveFault { code: 0, what: "another host addresses it, and feeds its watchdog", reason: Some(Reason::Link) };
/// An answer that nobody has asked for.
const DOUBLED: DriveFault = DriveFault {
    code: 0,
    what: "another drive answers in its place, or it sends its position unasked less than five times a second",
    reason: Some(Reason::Link),
};
/// No state and no error can be seen.
const HEARTLESS: DriveFault = DriveFault {
    code: Command::Heartbeat as u32,
    what: "its heartbeat has stayed away for 0.3 s",
    reason: Some(Reason::Link),
};

/// A drive at a node of a bus.
pub struct Odrive {
    bus: Box<dyn Bus>,
    node: u8,
    /// How people know it.
    name: String,
    version: Version,
    /// Questions for the position that have no answer yet.
    owed: u32,
    /// When it was asked for its position last, and whether it says it unasked too.
    asked: Option<Instant>,
    chats: bool,
    barrier: Barrier,
    proof: Proof,
    /// Of the loop, s.
    period: f64,
    /// In s of the loop's time, and at the first sample since then.
    since_heartbeat: f64,
    heartbeat: Instant,
    /// The time within which its watchdog was seen to take the torque away.
    bitten: Duration,
    /// The largest torque that the loop asks for, N·m.
    most: f64,
    /// Since when it is to be armed, and whether it has been seen so.
    begun: Option<Instant>,
    is_armed: bool,
    /// What it has been found in: nothing but a start gets it out of that.
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
        let (name, bitten, most) = (&self.name, self.bitten.as_millis(), self.most);
        let mut notes = vec![format!(
            "{name}: its watchdog took the torque away within {bitten} ms of silence when it was tried; CANSimple cannot set that time"
        )];
        notes.push(if most.is_finite() {
            format!(
                "{name}: CANSimple cannot set its largest torque; hapt asks for {most:.3} N m at most, and the drive allows what is stored in \
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
        let mut tell =
            |command: Command, data: [u8; 8]| self.bus.send(&Frame::classic(command.id(node).into(), &data), until);
        if self.begun.is_none() {
            // A watchdog that runs out on a disarmed drive too leaves an error. No other error is cleared unseen.
            if self.version.is_old() {
                tell(Command::Clear, [0; 8])?;
            }
            tell(Command::Mode, codec::pair(control::TORQUE, PASSTHROUGH))?;
            tell(Command::Torque, [0; 8])?;
            tell(Command::State, codec::pair(state::CLOSED_LOOP, 0))?;
            self.begun = Some(Instant::now());
        }
        let torque = torque as f32;
        tell(Command::Torque, codec::floats(torque, 0.0))?;
        self.proof.tell(torque.into());
        Ok(())
    }

    fn halt(&mut self, until: Instant) {
        // Each by itself: the one may find room where the other has not.
        for (command, data) in [(Command::Torque, [0; 8]), (Command::State, codec::pair(state::IDLE, 0))] {
            let _ = self.bus.send(&Frame::classic(command.id(self.node).into(), &data), until);
        }
    }

    fn stop(&mut self) {
        self.halt(Instant::now() + A_FRAME);
    }
}

/// What a drive has said.
enum Said {
    Heartbeat(Heartbeat),
    Estimates(ShaftState),
    Version(Version),
    /// What is wrong with it now.
    Error(u32),
    /// Something that it says when it is asked, and its two numbers.
    Other(Command, [f32; 2]),
    /// The answer that parts the past from this sample.
    Passed,
    /// Somebody else speaks to it.
    Foreign,
    Nothing,
}

impl Odrive {
    /// The drive at `node`, from 0 to 63, of `bus`, which people know by `name`.
    pub fn new(bus: Box<dyn Bus>, node: u8, name: &str) -> Self {
        let name = format!("the ODrive with node_id {node} at {name}");
        Odrive {
            bus,
            node,
            name,
            version: Version::SILENT,
            owed: 0,
            asked: None,
            chats: false,
            barrier: Barrier::default(),
            proof: Proof::new(Command::Torques, 0.0),
            period: 1e-3,
            since_heartbeat: 0.0,
            heartbeat: Instant::now(),
            bitten: Duration::ZERO,
            most: 0.0,
            begun: None,
            is_armed: false,
            fault: None,
        }
    }

    /// One sample's question and its answer.
    fn reading(&mut self, until: Instant) -> Result<ShaftState, DriveError> {
        if self.since_heartbeat == 0.0 {
            self.heartbeat = Instant::now();
        }
        self.since_heartbeat += self.period;
        // What has come since the last sample.
        let over = Instant::now();
        for _ in 0..OTHERS {
            let Some(frame) = self.bus.receive(over)? else { break };
            self.hear(&frame, false);
        }
        self.barrier.pass();
        let is_proven = self.proof.pass(self.period);
        if !self.is_armed {
            self.proof.rest();
        }
        let is_missing = self.since_heartbeat > HEARTBEATS && self.heartbeat.elapsed().as_secs_f64() > HEARTBEATS;
        let missing = is_missing.then_some(HEARTLESS).or(self.proof.fault());
        self.fault = self.fault.or(missing);
        self.is_well()?;
        let mut past = self.owed > 0 || self.chats;
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
            match self.hear(&frame, true) {
                Said::Estimates(answer) if !past => {
                    self.is_well()?;
                    return Ok(answer);
                }
                // What is owed from before is lost.
                Said::Passed if past => (past, self.owed) = (false, 1),
                Said::Nothing => {}
                Said::Heartbeat(_)
                | Said::Estimates(_)
                | Said::Version(_)
                | Said::Error(_)
                | Said::Other(..)
                | Said::Passed
                | Said::Foreign => trouble = DriveError::Late,
            }
        }
        self.is_well()?;
        Err(trouble)
    }

    /// Takes note of what a frame says, heard after this sample's questions or before.
    fn hear(&mut self, frame: &Frame, is_asked: bool) -> Said {
        let said = self.said(frame);
        match said {
            Said::Other(command, [uses, makes]) => {
                let is_passed = self.barrier.is_passed_by(command);
                if command == self.proof.kind && self.is_armed {
                    self.proof.hear(uses.into(), makes.into(), is_passed && is_asked);
                }
                if is_passed {
                    return Said::Passed;
                }
            }
            Said::Heartbeat(heartbeat) => self.look_at(heartbeat),
            Said::Foreign => {
                self.fault.get_or_insert(FOREIGN);
            }
            Said::Estimates(_) if self.owed == 0 && !self.chats => {
                self.fault.get_or_insert(DOUBLED);
            }
            Said::Estimates(_) => self.owed = self.owed.saturating_sub(1),
            Said::Version(_) | Said::Error(_) | Said::Passed | Said::Nothing => {}
        }
        said
    }

    fn look_at(&mut self, heartbeat: Heartbeat) {
        self.since_heartbeat = 0.0;
        let is_armed = u32::from(heartbeat.state) == state::CLOSED_LOOP;
        self.is_armed |= is_armed && self.begun.is_some();
        // An error of before is cleared by nobody but a start; the old watchdog's runs out on a drive that waits.
        let waits = if self.version.is_old() { self.version.watchdog() } else { 0 };
        let is_wrong = match self.begun {
            None => heartbeat.error & !waits != 0,
            // Until it has been seen armed, a heartbeat may tell of the time before.
            Some(begun) if !self.is_armed => begun.elapsed() > A_STATE,
            Some(_) => !is_armed || heartbeat.error != 0,
        };
        if is_wrong {
            self.fault.get_or_insert(self.version.fault(heartbeat.error));
        }
    }

    fn is_well(&self) -> Result<(), DriveError> {
        self.fault.map_or(Ok(()), |fault| Err(DriveError::Fault(fault)))
    }

    /// What a frame on the bus says about this drive.
    fn said(&self, frame: &Frame) -> Said {
        let Some(id) = u16::try_from(frame.id).ok().filter(|id| !frame.extended && codec::node(*id) == self.node)
        else {
            return Said::Nothing;
        };
        let Some(command) = Command::of(id) else { return Said::Nothing };
        if frame.data().is_empty() || !command.is_a_drives() {
            return Said::Foreign;
        }
        let data = frame.data();
        let said = match command {
            Command::Heartbeat => Heartbeat::read(data).map(Said::Heartbeat),
            Command::Version => Version::read(data).map(Said::Version),
            Command::Error => data.get(..4).map(|bits| Said::Error(codec::numbers(codec::padded(bits)).0)),
            Command::Estimates => codec::two_floats(data).map(|(position, velocity)| {
                Said::Estimates(ShaftState { position: position.into(), velocity: velocity.into() })
            }),
            Command::Current | Command::Warmth | Command::Bus | Command::Torques | Command::Powers => {
                let (first, second) = codec::two_floats(data).unwrap_or((f32::NAN, f32::NAN));
                Some(Said::Other(command, [first, second]))
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
        said.unwrap_or(Said::Nothing)
    }

    fn gone(&self, error: std::io::Error) -> Error {
        Error::Gone { name: self.name.clone(), error }
    }

    fn tell(&mut self, command: Command, data: [u8; 8]) -> Result<(), Error> {
        let frame = Frame::classic(command.id(self.node).into(), &data);
        self.bus.send(&frame, Instant::now() + A_FRAME).map_err(|error| self.gone(error))
    }

    fn ask(&mut self, command: Command) -> Result<(), Error> {
        if command == Command::Estimates {
            self.asked = Some(Instant::now());
        }
        let frame = Frame::remote(command.id(self.node).into(), 8);
        self.bus.send(&frame, Instant::now() + A_FRAME).map_err(|error| self.gone(error))
    }
}
