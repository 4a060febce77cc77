//! The start of a drive: its presence, uniqueness, faults and watchdog are checked.

use std::time::{Duration, Instant};

use super::barrier::{Barrier, KINDS};
use super::codec::{self, Command, Heartbeat, PASSTHROUGH, Version, control, state};
use super::proof::Proof;
use super::{ANSWER_TIMEOUT, Odrive, Received, STATE_TIMEOUT};
use crate::drive::{Drive, Error, OTHERS, ShaftState};
use crate::frame::Frame;

/// The longest accepted time of a drive's watchdog.
pub const MAX_WATCHDOG: Duration = Duration::from_millis(100);
/// The factory period of heartbeats, with a margin for a busy bus.
const HEARTBEAT: Duration = Duration::from_millis(200);
/// Beyond this position, in revolutions, the resolution of a float is coarser than 1/65 536 of a revolution.
const FARTHEST: f64 = 256.0;
/// Attempts of a request before the drive counts as absent.
const TRIES: u32 = 8;
/// Period of feeding the watchdog while waiting.
const FEEDING: Duration = Duration::from_millis(2);
/// The settings that differ from the factory's.
const SET_UP: &str = "In odrivetool: odrv0.axis0.config.watchdog_timeout = 0.05, odrv0.axis0.config.enable_watchdog = True, \
                      odrv0.save_configuration()";

impl Odrive {
    /// The checks before the loop.
    pub(super) fn get_ready(&mut self) -> Result<ShaftState, Error> {
        (self.owed, self.is_cyclic, self.begun, self.is_armed, self.fault) = (0, false, None, false, None);
        self.since_heartbeat = 0.0;
        // Answers to earlier requests may be pending.
        self.estimates_requested = Some(Instant::now());
        self.is_there()?;
        self.clear()?;
        self.tests_watchdog()?;
        self.clear()?;
        // Earlier answers arrive before this one.
        if let Some(kind) = self.barrier.ask() {
            self.ask(kind)?;
            self.until(ANSWER_TIMEOUT, false, |_, received| {
                matches!(received, Received::Other(answer, _) if answer == kind).then_some(())
            })?;
            self.barrier.is_passed_by(kind);
        }
        // Before 0.6 there is no position until the drive has been armed once.
        let answer = self.answer(Command::Estimates, |received| {
            if let Received::Estimates(answer) = received { Some(answer) } else { None }
        })?;
        let answer = answer.ok_or_else(|| self.silent("; its heartbeat arrives, but no position"))?;
        if answer.position.abs() >= FARTHEST {
            return Err(self.refused(format!(
                "is {:.0} revolutions from its zero, where the resolution of its positions is too coarse: switch it off and on",
                answer.position
            )));
        }
        Ok(answer)
    }

    /// Waits for a heartbeat, requests the version, and counts the answering drives.
    fn is_there(&mut self) -> Result<(), Error> {
        self.stop();
        let node = self.node;
        let mut others = [false; 64];
        let heartbeat = self.until(STATE_TIMEOUT, false, |frame, received| {
            if let (Received::Nothing, false) = (&received, frame.extended)
                && frame.id & 0x1f == Command::Heartbeat as u32
                && let Some(other) = others.get_mut((frame.id >> 5) as usize)
            {
                *other = true;
            }
            matches!(received, Received::Heartbeat(_)).then_some(())
        })?;
        if heartbeat.is_none() {
            let nodes: Vec<String> =
                others.iter().enumerate().filter(|(_, is_seen)| **is_seen).map(|(node, _)| node.to_string()).collect();
            let hint = match &nodes[..] {
                [] => ": no heartbeat. Check its supply, the bus's termination, its baud rate and its node_id; \
                       heartbeat_msg_rate_ms must not be 0"
                    .into(),
                nodes => format!(": no heartbeat from node {node}, but from {}. #ID names the drive", nodes.join(", ")),
            };
            return Err(self.silent(&hint));
        }
        let version = self.answer(Command::Version, |received| {
            if let Received::Version(version) = received { Some(version) } else { None }
        })?;
        self.version = version.unwrap_or(Version::SILENT);
        self.who_answers()
    }

    /// Requests every kind of answer, one after the other. Two answers to one request come from two drives, and answers without a request
    /// are cyclic messages, which are unusable as a barrier.
    fn who_answers(&mut self) -> Result<(), Error> {
        let (mut answers, mut unasked, mut is_foreign) = ([0_u32; KINDS.len()], [false; KINDS.len()], false);
        for (now, kind) in KINDS.into_iter().enumerate() {
            // In 0.5 its number belonged to a voltage, with an argument.
            if kind != Command::Torques || !self.version.is_old() {
                self.ask(kind)?;
            }
            self.until::<()>(ANSWER_TIMEOUT, false, |_, received| {
                match received {
                    Received::Other(answer, _) if answer == kind => answers[now] += 1,
                    Received::Other(answer, _) => {
                        let kind = KINDS.iter().position(|kind| *kind == answer);
                        unasked[kind.unwrap_or(now)] = true;
                    }
                    Received::Foreign => is_foreign = true,
                    Received::Heartbeat(_)
                    | Received::Estimates(_)
                    | Received::Version(_)
                    | Received::Error(_)
                    | Received::Passed
                    | Received::Nothing => {}
                }
                None
            })?;
        }
        if is_foreign {
            return Err(self.refused("receives frames of another host, which has to stop first".into()));
        }
        let once = |kind: usize| !unasked[kind] && answers[kind] == 1;
        let twice = (0..KINDS.len()).filter(|kind| !unasked[*kind]).map(|kind| answers[kind]).max().unwrap_or(0);
        self.barrier = Barrier::new(std::array::from_fn(once));
        let says = |kind: &Command| {
            KINDS.iter().position(|one| one == kind).is_some_and(|kind| answers[kind] > 0 || unasked[kind])
        };
        let proof = [Command::Torques, Command::Current].into_iter().find(says);
        self.proof = Proof::new(proof.unwrap_or(Command::Torques), self.most);
        match twice {
            2.. => Err(self.refused(format!("is {twice} drives: give each its own node_id"))),
            1 if proof.is_none() => Err(self.refused(
                "reports neither its torque (0x01c) nor its current (0x014), so that lost torque commands would go unnoticed".into(),
            )),
            1 => Ok(()),
            _ if answers != [0; KINDS.len()] => Err(self.refused(
                "sends every message cyclically, so that answers cannot be recognised: set iq_msg_rate_ms or another rate to 0"
                    .into(),
            )),
            _ => Err(self.silent("; its heartbeat arrives, but no answers: does the adapter send remote frames?")),
        }
    }

    /// Clears latched errors; an error where one remains.
    fn clear(&mut self) -> Result<(), Error> {
        self.send(Command::Clear, [0; 8])?;
        let left = if self.version.is_old() {
            let mut left = self.last_error()?;
            // If this machine pauses, the watchdog of a disarmed drive expires again.
            for _ in 1..TRIES {
                if left == Some(self.version.watchdog()) {
                    self.send(Command::Clear, [0; 8])?;
                    left = self.last_error()?;
                }
            }
            left
        } else {
            self.answer(
                Command::Error,
                |received| if let Received::Error(bits) = received { Some(bits) } else { None },
            )?
        };
        match left {
            Some(0) => Ok(()),
            Some(bits) => Err(Error::Fault { drive: self.name.clone(), fault: self.version.fault(bits) }),
            None => Err(self.silent("; its heartbeat arrives, but no answers")),
        }
    }

    /// The error of the second heartbeat from now on, or of the first one without an error: the first may be old.
    fn last_error(&mut self) -> Result<Option<u32>, Error> {
        let mut seen = 0;
        self.until(STATE_TIMEOUT, true, |_, received| {
            let Received::Heartbeat(heartbeat) = received else { return None };
            seen += 1;
            (heartbeat.error == 0 || seen == 2).then_some(heartbeat.error)
        })
    }

    /// Tests the drive's watchdog: armed with a torque of zero, the drive has to disarm when it receives no frames.
    fn tests_watchdog(&mut self) -> Result<(), Error> {
        self.send(Command::Mode, codec::pair(control::TORQUE, PASSTHROUGH))?;
        self.send(Command::Torque, [0; 8])?;
        self.send(Command::State, codec::pair(state::CLOSED_LOOP, 0))?;
        let mut last = Heartbeat::default();
        let armed = self.until(STATE_TIMEOUT, true, |_, received| {
            let Received::Heartbeat(heartbeat) = received else { return None };
            last = heartbeat;
            (u32::from(heartbeat.state) == state::CLOSED_LOOP).then_some(())
        })?;
        if armed.is_none() {
            let fault = self.version.fault(last.error);
            let why = format!("does not arm: {} (its code {}, axis state {})", fault.what, fault.code, last.state);
            return Err(self.refused(why));
        }
        let (silence, longest) = (Instant::now(), MAX_WATCHDOG + HEARTBEAT);
        let disarmed = self.until(longest, false, |_, received| {
            let Received::Heartbeat(heartbeat) = received else { return None };
            (u32::from(heartbeat.state) != state::CLOSED_LOOP).then_some(heartbeat.error)
        })?;
        match disarmed {
            // Received too late to be conclusive.
            Some(_) if silence.elapsed() > longest => Err(self
                .refused("could not be observed while its watchdog was tested: this machine paused. Try again".into())),
            Some(error) if error & self.version.watchdog() != 0 => {
                self.watchdog_time = silence.elapsed();
                Ok(())
            }
            Some(error) => Err(Error::Fault { drive: self.name.clone(), fault: self.version.fault(error) }),
            None => {
                self.stop();
                Err(self.refused(format!(
                    "keeps its torque without messages: its watchdog is off, slower than 100 ms, or fed by another host. {SET_UP}"
                )))
            }
        }
    }

    /// Repeats a request until it is answered; `None`: no answer.
    fn answer<T>(&mut self, command: Command, take: impl Fn(Received) -> Option<T>) -> Result<Option<T>, Error> {
        for tried in 0..TRIES {
            self.ask(command)?;
            let answer = self.until(ANSWER_TIMEOUT, false, |_, received| take(received))?;
            if answer.is_some() {
                // Answers to the other attempts may still arrive.
                self.owed = if command == Command::Estimates { tried } else { self.owed };
                return Ok(answer);
            }
        }
        Ok(None)
    }

    /// Waits until `take` returns a value, feeding the watchdog or not; `None`: a timeout.
    fn until<T>(
        &mut self,
        time: Duration,
        fed: bool,
        mut take: impl FnMut(&Frame, Received) -> Option<T>,
    ) -> Result<Option<T>, Error> {
        let end = Instant::now() + time;
        let mut feeding = Instant::now();
        // After the timeout, frames that have arrived are still read.
        let mut left = OTHERS;
        loop {
            let now = Instant::now();
            if fed && now >= feeding && now < end {
                self.ask(Command::Estimates)?;
                feeding = now + FEEDING;
            }
            let wake = if fed { end.min(feeding) } else { end };
            let Some(frame) = self.bus.receive(wake).map_err(|error| self.gone(error))? else {
                if now >= end {
                    return Ok(None);
                }
                continue;
            };
            let received = self.decode(&frame);
            let is_answer = self.estimates_requested.is_some_and(|at| at.elapsed() <= ANSWER_TIMEOUT);
            self.is_cyclic |= matches!(received, Received::Estimates(_)) && !is_answer;
            if let Some(taken) = take(&frame, received) {
                return Ok(Some(taken));
            }
            left -= usize::from(now >= end);
            if left == 0 {
                return Ok(None);
            }
        }
    }

    fn silent(&self, hint: &str) -> Error {
        Error::Silent { drive: self.name.clone(), hint: hint.into() }
    }

    fn refused(&self, why: String) -> Error {
        Error::Refused { drive: self.name.clone(), why }
    }
}
