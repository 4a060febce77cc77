//! ODrive's drives by CANSimple, on a CAN interface or behind an slcan adapter.
//!
//! The drive's watchdog is off as shipped, and CANSimple has no word to set it. So [`Odrive`] does not believe that it is on: each start
//! gives the drive a torque of zero, falls silent, and wants to see it disarm. Any frame to the node feeds the watchdog, whoever sends
//! it; another host's frame to our drive is a fault therefore.
//!
//! A position is asked for by a remote frame. Answers carry no number. They are counted: an answer that nobody has asked for is a
//! second drive's, and a drive that says its position unasked is not started. After a question without an answer the next one comes
//! behind a question of another kind: what arrives before that one's answer belongs to the past.

pub mod codec;
mod simulated;

use std::time::{Duration, Instant};

use hapt_core::Reason;
use hapt_rt::DriveFault;

use codec::{Command, Heartbeat, PASSTHROUGH, Version, control, state};

use crate::can::Bus;
use crate::drive::{Answer, Drive, Error, Terms, Trouble};
use crate::frame::Frame;

pub use simulated::Simulated;

/// The longest that a drive's watchdog may take.
pub const LONGEST_WATCHDOG: Duration = Duration::from_millis(100);
/// From one heartbeat to the next, as shipped, and something for a busy bus.
const HEARTBEAT: Duration = Duration::from_millis(200);
/// How long a drive may take for a state, with the heartbeat that shows it.
const A_STATE: Duration = Duration::from_secs(1);
/// How long it may take to answer when nothing is urgent.
const AN_ANSWER: Duration = Duration::from_millis(50);
/// How long a frame may take to find room when nothing is urgent.
const A_FRAME: Duration = Duration::from_millis(20);
/// What stands before a question that follows one without an answer, by turns: the answer of one sample is not taken for the next one's.
/// They yield to a position on the bus, so that none overtakes one.
const BEHIND: [Command; 3] = [Command::Current, Command::Warmth, Command::Bus];
/// Frames that are looked at before a sample's question, and after it: a bus full of others' does not hold the loop.
const OTHERS: usize = 32;
/// Farther from its zero, in revolutions, a float's last digit is more than 1/65 536 of a revolution.
const FARTHEST: f64 = 256.0;
/// How often it is fed while something is waited for.
const FEEDING: Duration = Duration::from_millis(2);
/// What a drive is shipped without.
const SET_UP: &str = "In odrivetool: odrv0.axis0.config.watchdog_timeout = 0.05, odrv0.axis0.config.enable_watchdog = True, \
                      odrv0.axis0.config.can.encoder_msg_rate_ms = 0, odrv0.save_configuration()";
/// Frames that only a host sends have come from somewhere else.
const FOREIGN: DriveFault =
    DriveFault { code: 0, what: "another host speaks to it, and feeds its watchdog", reason: Some(Reason::Link) };
/// An answer that nobody has asked for.
const DOUBLED: DriveFault =
    DriveFault { code: 0, what: "another drive answers in its place", reason: Some(Reason::Link) };

/// A drive at a node of a bus.
pub struct Odrive {
    bus: Box<dyn Bus>,
    node: u8,
    /// How people know it.
    name: String,
    version: Version,
    /// Questions for the position that have no answer yet.
    owed: u32,
    /// Which of [`BEHIND`] was asked last.
    turn: usize,
    /// Since when it is to be armed, and whether it has been seen so.
    begun: Option<Instant>,
    is_armed: bool,
    /// What it has been found in: nothing but a start gets it out of that.
    fault: Option<DriveFault>,
}

impl Drive for Odrive {
    fn start(&mut self, _terms: &Terms) -> Result<Answer, Error> {
        (self.owed, self.begun, self.is_armed, self.fault) = (0, None, false, None);
        self.is_there()?;
        self.clear()?;
        self.bites()?;
        self.clear()?;
        // Answers of the time before come before this one.
        self.ask(Command::Bus)?;
        self.until(AN_ANSWER, false, |_, said| matches!(said, Said::Other(Command::Bus)).then_some(()))?;
        // Before 0.6 there is no position until the drive has been armed once.
        self.ask(Command::Estimates)?;
        let answer = self.until(AN_ANSWER, false, |_, said| match said {
            Said::Estimates(answer) => Some(answer),
            _ => None,
        })?;
        let answer = answer.ok_or_else(|| self.silent("; its heartbeat is there, positions are not"))?;
        if answer.position.abs() >= FARTHEST {
            return Err(self.refused(format!(
                "stands {:.0} revolutions from its zero, where its answers are too coarse to feel: switch it off and on",
                answer.position
            )));
        }
        Ok(answer)
    }

    fn read(&mut self, until: Instant) -> Result<Answer, Trouble> {
        // What has come since the last sample.
        let over = Instant::now();
        for _ in 0..OTHERS {
            let Some(frame) = self.bus.receive(over)? else { break };
            self.hear(&frame);
        }
        self.is_well()?;
        let mut past = self.owed > 0;
        if past {
            self.turn = (self.turn + 1) % BEHIND.len();
            self.bus.send(&Frame::remote(BEHIND[self.turn].id(self.node).into(), 8), until)?;
        }
        self.bus.send(&Frame::remote(Command::Estimates.id(self.node).into(), 8), until)?;
        self.owed += 1;
        let mut trouble = Trouble::Silent;
        for _ in 0..OTHERS {
            let Some(frame) = self.bus.receive(until)? else { break };
            match self.hear(&frame) {
                Said::Estimates(answer) if !past => {
                    self.is_well()?;
                    return Ok(answer);
                }
                // What is owed from before is lost.
                Said::Other(command) if past && command == BEHIND[self.turn] => (past, self.owed) = (false, 1),
                Said::Nothing => continue,
                _ => {}
            }
            trouble = Trouble::Late;
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
    /// Something that it says only when it is asked.
    Other(Command),
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
            turn: 0,
            begun: None,
            is_armed: false,
            fault: None,
        }
    }

    /// Waits for a heartbeat, asks for the version, and counts who answers.
    fn is_there(&mut self) -> Result<(), Error> {
        self.stop();
        let node = self.node;
        let mut others = [false; 64];
        let heartbeat = self.until(A_STATE, false, |frame, said| {
            if let (Said::Nothing, false) = (&said, frame.extended)
                && frame.id & 0x1f == Command::Heartbeat as u32
                && let Some(other) = others.get_mut((frame.id >> 5) as usize)
            {
                *other = true;
            }
            matches!(said, Said::Heartbeat(_)).then_some(())
        })?;
        if heartbeat.is_none() {
            let heard: Vec<String> =
                others.iter().enumerate().filter(|(_, heard)| **heard).map(|(node, _)| node.to_string()).collect();
            let hint = match &heard[..] {
                [] => {
                    ": no heartbeat. Look at its supply, at the bus's two ends, at its baud rate and at its node_id; \
                       heartbeat_msg_rate_ms must not be 0"
                        .into()
                }
                heard => format!(": no heartbeat from node {node}, but from {}. #ID names the drive", heard.join(", ")),
            };
            return Err(self.silent(&hint));
        }
        self.ask(Command::Version)?;
        let version = self.until(AN_ANSWER, false, |_, said| match said {
            Said::Version(version) => Some(version),
            _ => None,
        })?;
        self.version = version.unwrap_or(Version::SILENT);
        // Nobody says this unasked.
        self.ask(Command::Bus)?;
        let (mut answers, mut is_foreign) = (0, false);
        self.until::<()>(AN_ANSWER, false, |_, said| {
            answers += u32::from(matches!(said, Said::Other(Command::Bus)));
            is_foreign |= matches!(said, Said::Foreign);
            None
        })?;
        match (answers, is_foreign) {
            (2.., _) => Err(self.refused(format!("is {answers} drives: give each its own node_id"))),
            (_, true) => Err(self.refused("is spoken to by another host, which has to end first".into())),
            _ => Ok(()),
        }
    }

    /// Forgets what the drive has latched; an error where something stays.
    fn clear(&mut self) -> Result<(), Error> {
        self.tell(Command::Clear, [0; 8])?;
        let left = if self.version.is_old() {
            // The first heartbeat may be from before.
            let mut last = None;
            self.until(2 * HEARTBEAT, true, |_, said| {
                if let Said::Heartbeat(heartbeat) = said {
                    last = Some(heartbeat.error);
                }
                (last == Some(0)).then_some(())
            })?;
            last
        } else {
            self.ask(Command::Error)?;
            self.until(AN_ANSWER, false, |_, said| match said {
                Said::Error(bits) => Some(bits),
                _ => None,
            })?
        };
        match left {
            Some(0) => Ok(()),
            Some(bits) => Err(Error::Fault { drive: self.name.clone(), fault: self.version.fault(bits) }),
            None => Err(self.silent("; its heartbeat is there, answers are not")),
        }
    }

    /// Whether the drive's watchdog takes the torque away: armed with a torque of zero it has to disarm when nobody feeds it.
    fn bites(&mut self) -> Result<(), Error> {
        self.tell(Command::Mode, codec::pair(control::TORQUE, PASSTHROUGH))?;
        self.tell(Command::Torque, [0; 8])?;
        self.tell(Command::State, codec::pair(state::CLOSED_LOOP, 0))?;
        let mut last = Heartbeat::default();
        let armed = self.until(A_STATE, true, |_, said| match said {
            Said::Heartbeat(heartbeat) => {
                last = heartbeat;
                (u32::from(heartbeat.state) == state::CLOSED_LOOP).then_some(())
            }
            _ => None,
        })?;
        if armed.is_none() {
            let fault = self.version.fault(last.error);
            let why = format!("does not arm: {} (its code {}, axis state {})", fault.what, fault.code, last.state);
            return Err(self.refused(why));
        }
        let (silence, mut unasked) = (Instant::now(), false);
        let disarmed = self.until(LONGEST_WATCHDOG + HEARTBEAT, false, |_, said| match said {
            Said::Heartbeat(heartbeat) if u32::from(heartbeat.state) != state::CLOSED_LOOP => Some(heartbeat.error),
            Said::Estimates(_) => {
                // The last answers are still under way at first.
                unasked |= silence.elapsed() > AN_ANSWER;
                None
            }
            _ => None,
        })?;
        match disarmed {
            Some(_) if unasked => Err(self.refused(format!("says its position unasked. {SET_UP}"))),
            Some(error) if error & self.version.watchdog() != 0 => Ok(()),
            Some(error) => Err(Error::Fault { drive: self.name.clone(), fault: self.version.fault(error) }),
            None => {
                self.stop();
                Err(self.refused(format!(
                    "keeps its torque when nobody speaks to it: its watchdog is off, slower than 100 ms, or fed by another host. {SET_UP}"
                )))
            }
        }
    }

    /// Takes note of what a frame says.
    fn hear(&mut self, frame: &Frame) -> Said {
        let said = self.said(frame);
        match said {
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
            Said::Estimates(_) if self.owed == 0 => {
                self.fault.get_or_insert(DOUBLED);
            }
            Said::Estimates(_) => self.owed -= 1,
            _ => {}
        }
        said
    }

    fn is_well(&self) -> Result<(), Trouble> {
        self.fault.map_or(Ok(()), |fault| Err(Trouble::Fault(fault)))
    }

    fn silent(&self, hint: &str) -> Error {
        Error::Silent { drive: self.name.clone(), hint: hint.into() }
    }

    fn refused(&self, why: String) -> Error {
        Error::Refused { drive: self.name.clone(), why }
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
            Command::Current | Command::Warmth | Command::Bus => Some(Said::Other(command)),
            _ => None,
        };
        said.unwrap_or(Said::Nothing)
    }

    /// Waits for what `take` wants, fed or not in the meantime; `None`: it has not come in so long.
    fn until<T>(
        &mut self,
        time: Duration,
        fed: bool,
        mut take: impl FnMut(&Frame, Said) -> Option<T>,
    ) -> Result<Option<T>, Error> {
        let end = Instant::now() + time;
        let mut feeding = Instant::now();
        loop {
            let now = Instant::now();
            if now >= end {
                return Ok(None);
            }
            if fed && now >= feeding {
                self.ask(Command::Estimates)?;
                feeding = now + FEEDING;
            }
            let wake = if fed { end.min(feeding) } else { end };
            if let Some(frame) = self.bus.receive(wake).map_err(|error| self.gone(error))? {
                let said = self.said(&frame);
                if let Some(taken) = take(&frame, said) {
                    return Ok(Some(taken));
                }
            }
        }
    }

    fn gone(&self, error: std::io::Error) -> Error {
        Error::Gone { name: self.name.clone(), error }
    }

    fn tell(&mut self, command: Command, data: [u8; 8]) -> Result<(), Error> {
        let frame = Frame::classic(command.id(self.node).into(), &data);
        self.bus.send(&frame, Instant::now() + A_FRAME).map_err(|error| self.gone(error))
    }

    fn ask(&mut self, command: Command) -> Result<(), Error> {
        let frame = Frame::remote(command.id(self.node).into(), 8);
        self.bus.send(&frame, Instant::now() + A_FRAME).map_err(|error| self.gone(error))
    }
}
