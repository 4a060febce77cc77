//! ODrive's drives by CANSimple, on a CAN interface or behind an slcan adapter.
//!
//! The drive's watchdog is off as shipped, and CANSimple has no word to set it. So [`Odrive`] does not believe that it is on: each start
//! gives the drive a torque of zero, falls silent, and wants to see it disarm. Any frame to the node feeds the watchdog, whoever sends
//! it; another host's frame to our drive is a fault therefore.
//!
//! A position is asked for by a remote frame. Answers carry no number. They are counted: one that nobody has asked for is a second
//! drive's. After a question without an answer the next one comes behind a question of another kind: what arrives before that one's
//! answer belongs to the past. A drive that says its position unasked too, as ODrives are shipped, is asked so in every sample.

mod barrier;
pub mod codec;
mod simulated;
mod start;

use std::time::{Duration, Instant};

use hapt_core::Reason;
use hapt_rt::DriveFault;

use barrier::Barrier;
use codec::{Command, Heartbeat, PASSTHROUGH, Version, control, state};

use crate::can::Bus;
use crate::drive::{Answer, Drive, Error, OTHERS, Terms, Trouble};
use crate::frame::Frame;

pub use simulated::Simulated;
pub use start::LONGEST_WATCHDOG;

/// How long it may take to answer when nothing is urgent.
const AN_ANSWER: Duration = Duration::from_millis(50);
/// How long a drive may take for a state, with the heartbeat that shows it.
const A_STATE: Duration = Duration::from_secs(1);
/// How long a frame may take to find room when nothing is urgent.
const A_FRAME: Duration = Duration::from_millis(20);
/// Frames that only a host sends have come from somewhere else.
const FOREIGN: DriveFault =
    DriveFault { code: 0, what: "another host speaks to it, and feeds its watchdog", reason: Some(Reason::Link) };
/// An answer that nobody has asked for.
const DOUBLED: DriveFault = DriveFault {
    code: 0,
    what: "another drive answers in its place, or it says its position unasked less than five times a second",
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
    /// Since when it is to be armed, and whether it has been seen so.
    begun: Option<Instant>,
    is_armed: bool,
    /// What it has been found in: nothing but a start gets it out of that.
    fault: Option<DriveFault>,
}

impl Drive for Odrive {
    fn start(&mut self, _terms: &Terms) -> Result<Answer, Error> {
        self.get_ready()
    }

    fn read(&mut self, until: Instant) -> Result<Answer, Trouble> {
        // What has come since the last sample.
        let over = Instant::now();
        for _ in 0..OTHERS {
            let Some(frame) = self.bus.receive(over)? else { break };
            self.hear(&frame);
        }
        self.is_well()?;
        self.barrier.pass();
        let mut past = self.owed > 0 || self.chats;
        if past {
            let kind = self.barrier.ask().ok_or(Trouble::Late)?;
            self.bus.send(&Frame::remote(kind.id(self.node).into(), 8), until)?;
        }
        self.bus.send(&Frame::remote(Command::Estimates.id(self.node).into(), 8), until)?;
        self.owed = self.owed.saturating_add(1);
        let mut trouble = Trouble::Silent;
        for _ in 0..OTHERS {
            let Some(frame) = self.bus.receive(until)? else { break };
            match self.hear(&frame) {
                Said::Estimates(answer) if !past => {
                    self.is_well()?;
                    return Ok(answer);
                }
                // What is owed from before is lost.
                Said::Passed if past => (past, self.owed) = (false, 1),
                Said::Nothing => {}
                _ => trouble = Trouble::Late,
            }
        }
        self.is_well()?;
        Err(trouble)
    }

    fn command(&mut self, torque: f64, until: Instant) -> Result<(), Trouble> {
        self.is_well()?;
        let node = self.node;
        let mut tell =
            |command: Command, data: [u8; 8]| self.bus.send(&Frame::classic(command.id(node).into(), &data), until);
        if self.begun.is_none() {
            // Before 0.6 a watchdog runs out on a disarmed drive too.
            tell(Command::Clear, [0; 8])?;
            tell(Command::Mode, codec::pair(control::TORQUE, PASSTHROUGH))?;
            tell(Command::Torque, [0; 8])?;
            tell(Command::State, codec::pair(state::CLOSED_LOOP, 0))?;
            self.begun = Some(Instant::now());
        }
        tell(Command::Torque, codec::floats(torque as f32, 0.0))?;
        Ok(())
    }

    fn stop(&mut self) {
        // Each by itself: the one may find room where the other has not.
        let _ = self.tell(Command::Torque, [0; 8]);
        let _ = self.tell(Command::State, codec::pair(state::IDLE, 0));
    }
}

/// What a drive has said.
enum Said {
    Heartbeat(Heartbeat),
    Estimates(Answer),
    Version(Version),
    /// What is wrong with it now.
    Error(u32),
    /// Something that it says when it is asked.
    Other(Command),
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
            begun: None,
            is_armed: false,
            fault: None,
        }
    }

    /// Takes note of what a frame says.
    fn hear(&mut self, frame: &Frame) -> Said {
        let said = self.said(frame);
        match said {
            Said::Other(command) if self.barrier.is_passed_by(command) => return Said::Passed,
            Said::Heartbeat(heartbeat) => {
                let is_armed = u32::from(heartbeat.state) == state::CLOSED_LOOP;
                // Until it has been seen armed, a heartbeat may tell of the time before.
                let had_time = self.is_armed || self.begun.is_some_and(|begun| begun.elapsed() > A_STATE);
                if had_time && !is_armed {
                    self.fault.get_or_insert(self.version.fault(heartbeat.error));
                }
                self.is_armed |= is_armed && self.begun.is_some();
            }
            Said::Foreign => {
                self.fault.get_or_insert(FOREIGN);
            }
            Said::Estimates(_) if self.owed == 0 && !self.chats => {
                self.fault.get_or_insert(DOUBLED);
            }
            Said::Estimates(_) => self.owed = self.owed.saturating_sub(1),
            _ => {}
        }
        said
    }

    fn is_well(&self) -> Result<(), Trouble> {
        self.fault.map_or(Ok(()), |fault| Err(Trouble::Fault(fault)))
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
                Said::Estimates(Answer { position: position.into(), velocity: velocity.into() })
            }),
            _ if barrier::KINDS.contains(&command) => Some(Said::Other(command)),
            _ => None,
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
