//! Getting a drive ready: whether it is there, alone, without a fault, and held by its watchdog.

use std::time::{Duration, Instant};

use super::barrier::{Barrier, KINDS};
use super::codec::{self, Command, Heartbeat, PASSTHROUGH, Version, control, state};
use super::proof::Proof;
use super::{A_STATE, AN_ANSWER, Odrive, Said};
use crate::drive::{Drive, Error, OTHERS, ShaftState};
use crate::frame::Frame;

/// The longest that a drive's watchdog may take.
pub const LONGEST_WATCHDOG: Duration = Duration::from_millis(100);
/// From one heartbeat to the next, as shipped, and something for a busy bus.
const HEARTBEAT: Duration = Duration::from_millis(200);
/// Farther from its zero, in revolutions, a float's last digit is more than 1/65 536 of a revolution.
const FARTHEST: f64 = 256.0;
/// How often something is asked before nobody is there to answer.
const TRIES: u32 = 8;
/// How often it is fed while something is waited for.
const FEEDING: Duration = Duration::from_millis(2);
/// What a drive is shipped without.
const SET_UP: &str = "In odrivetool: odrv0.axis0.config.watchdog_timeout = 0.05, odrv0.axis0.config.enable_watchdog = True, \
                      odrv0.save_configuration()";

impl Odrive {
    /// Everything that comes before the loop.
    pub(super) fn get_ready(&mut self) -> Result<ShaftState, Error> {
        (self.owed, self.chats, self.begun, self.is_armed, self.fault) = (0, false, None, false, None);
        self.since_heartbeat = 0.0;
        // Somebody may have asked before us.
        self.asked = Some(Instant::now());
        self.is_there()?;
        self.clear()?;
        self.bites()?;
        self.clear()?;
        // Answers of the time before come before this one.
        if let Some(kind) = self.barrier.ask() {
            self.ask(kind)?;
            self.until(AN_ANSWER, false, |_, said| {
                matches!(said, Said::Other(answer, _) if answer == kind).then_some(())
            })?;
            self.barrier.is_passed_by(kind);
        }
        // Before 0.6 there is no position until the drive has been armed once.
        let answer = self
            .answer(Command::Estimates, |said| if let Said::Estimates(answer) = said { Some(answer) } else { None })?;
        let answer = answer.ok_or_else(|| self.silent("; its heartbeat is there, positions are not"))?;
        if answer.position.abs() >= FARTHEST {
            return Err(self.refused(format!(
                "stands {:.0} revolutions from its zero, where its answers are too coarse to feel: switch it off and on",
                answer.position
            )));
        }
        Ok(answer)
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
        let version =
            self.answer(Command::Version, |said| if let Said::Version(version) = said { Some(version) } else { None })?;
        self.version = version.unwrap_or(Version::SILENT);
        self.who_answers()
    }

    /// Asks for everything that it says when it is asked, one kind after the other. What comes twice right then comes from two drives, and
    /// what comes at other times is said unasked, and serves for no barrier.
    fn who_answers(&mut self) -> Result<(), Error> {
        let (mut answers, mut unasked, mut is_foreign) = ([0_u32; KINDS.len()], [false; KINDS.len()], false);
        for (now, kind) in KINDS.into_iter().enumerate() {
            // In 0.5 its number was for a voltage, and wanted to be told which.
            if kind != Command::Torques || !self.version.is_old() {
                self.ask(kind)?;
            }
            self.until::<()>(AN_ANSWER, false, |_, said| {
                match said {
                    Said::Other(answer, _) if answer == kind => answers[now] += 1,
                    Said::Other(answer, _) => {
                        let kind = KINDS.iter().position(|kind| *kind == answer);
                        unasked[kind.unwrap_or(now)] = true;
                    }
                    Said::Foreign => is_foreign = true,
                    Said::Heartbeat(_)
                    | Said::Estimates(_)
                    | Said::Version(_)
                    | Said::Error(_)
                    | Said::Passed
                    | Said::Nothing => {}
                }
                None
            })?;
        }
        if is_foreign {
            return Err(self.refused("is spoken to by another host, which has to end first".into()));
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
                "says neither which torque it uses (0x01c) nor its current (0x014): nothing would tell whether torques reach it".into(),
            )),
            1 => Ok(()),
            _ if answers != [0; KINDS.len()] => Err(self.refused(
                "says everything unasked, so that no answer is known for one: leave iq_msg_rate_ms or another one at 0"
                    .into(),
            )),
            _ => Err(self.silent("; its heartbeat is there, answers are not: does the adapter send remote frames?")),
        }
    }

    /// Forgets what the drive has latched; an error where something stays.
    fn clear(&mut self) -> Result<(), Error> {
        self.tell(Command::Clear, [0; 8])?;
        let left = if self.version.is_old() {
            let mut left = self.last_error()?;
            // Where this machine stands still, the watchdog of a disarmed drive runs out anew.
            for _ in 1..TRIES {
                if left == Some(self.version.watchdog()) {
                    self.tell(Command::Clear, [0; 8])?;
                    left = self.last_error()?;
                }
            }
            left
        } else {
            self.answer(Command::Error, |said| if let Said::Error(bits) = said { Some(bits) } else { None })?
        };
        match left {
            Some(0) => Ok(()),
            Some(bits) => Err(Error::Fault { drive: self.name.clone(), fault: self.version.fault(bits) }),
            None => Err(self.silent("; its heartbeat is there, answers are not")),
        }
    }

    /// What the second heartbeat from now on says, or the first that tells of no error: the first may be from before.
    fn last_error(&mut self) -> Result<Option<u32>, Error> {
        let mut seen = 0;
        self.until(A_STATE, true, |_, said| {
            let Said::Heartbeat(heartbeat) = said else { return None };
            seen += 1;
            (heartbeat.error == 0 || seen == 2).then_some(heartbeat.error)
        })
    }

    /// Whether the drive's watchdog takes the torque away: armed with a torque of zero it has to disarm when nobody feeds it.
    fn bites(&mut self) -> Result<(), Error> {
        self.tell(Command::Mode, codec::pair(control::TORQUE, PASSTHROUGH))?;
        self.tell(Command::Torque, [0; 8])?;
        self.tell(Command::State, codec::pair(state::CLOSED_LOOP, 0))?;
        let mut last = Heartbeat::default();
        let armed = self.until(A_STATE, true, |_, said| {
            let Said::Heartbeat(heartbeat) = said else { return None };
            last = heartbeat;
            (u32::from(heartbeat.state) == state::CLOSED_LOOP).then_some(())
        })?;
        if armed.is_none() {
            let fault = self.version.fault(last.error);
            let why = format!("does not arm: {} (its code {}, axis state {})", fault.what, fault.code, last.state);
            return Err(self.refused(why));
        }
        let (silence, longest) = (Instant::now(), LONGEST_WATCHDOG + HEARTBEAT);
        let disarmed = self.until(longest, false, |_, said| {
            let Said::Heartbeat(heartbeat) = said else { return None };
            (u32::from(heartbeat.state) != state::CLOSED_LOOP).then_some(heartbeat.error)
        })?;
        match disarmed {
            // Heard too late to prove anything.
            Some(_) if silence.elapsed() > longest => Err(self
                .refused("was not watched while its watchdog was tried: this machine stood still. Try again".into())),
            Some(error) if error & self.version.watchdog() != 0 => {
                self.bitten = silence.elapsed();
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

    /// Asks until it answers; `None`: it does not.
    fn answer<T>(&mut self, command: Command, take: impl Fn(Said) -> Option<T>) -> Result<Option<T>, Error> {
        for tried in 0..TRIES {
            self.ask(command)?;
            let answer = self.until(AN_ANSWER, false, |_, said| take(said))?;
            if answer.is_some() {
                // The others may still be under way.
                self.owed = if command == Command::Estimates { tried } else { self.owed };
                return Ok(answer);
            }
        }
        Ok(None)
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
        // When the time is over, what is there already counts still.
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
            let said = self.said(&frame);
            let is_answer = self.asked.is_some_and(|asked| asked.elapsed() <= AN_ANSWER);
            self.chats |= matches!(said, Said::Estimates(_)) && !is_answer;
            if let Some(taken) = take(&frame, said) {
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
