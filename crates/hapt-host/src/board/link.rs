//! One board.

use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use hapt_core::Phase;
use hapt_wire::{
    Command, DeviceMessage, HostMessage, MAX_FRAME_BYTES, PIECE, PROTOCOL, Parameter, Reader, Refusal, Telemetry,
    frame, hash,
};

use super::{Board, Error, Line, SPEED};

/// The size of a telemetry frame of four bodies on the line, in bits.
const TELEMETRY_BITS: f64 = 920.0;
/// The longest frame of a board, in bytes.
const MAX_BOARD_FRAME_BYTES: usize = 512;
/// The time in s for which a command is valid: the board refuses one that is delayed for longer.
const COMMAND_LIFETIME_S: f64 = 0.25;
/// The time limit of an acknowledgement; compiling a world takes longest.
const ANSWER_TIMEOUT: Duration = Duration::from_millis(500);
/// The polling period of the interrupt of a wait.
const POLL_PERIOD: Duration = Duration::from_millis(4);
/// The number of times that an unacknowledged command is sent.
const TRIES: usize = 4;
/// Capacity of the queue of telemetry; the oldest is dropped.
const WAITING: usize = 4096;
/// The largest gap of lost commands that does not count as a restart.
const MAX_LOST_COMMANDS: u32 = 2048;

/// A board at a serial port.
#[derive(Debug)]
pub struct Link {
    path: PathBuf,
    line: Line,
    /// In bits per second.
    speed: u32,
    reader: Reader<MAX_BOARD_FRAME_BYTES>,
    /// Bytes read from the line and not yet parsed.
    bytes: VecDeque<u8>,
    board: Board,
    /// Whether a handshake was made, and the board has not restarted since.
    is_known: bool,
    sequence: u32,
    /// The number of a sample, the instant at which it was received, and the period in s.
    clock: (u64, Instant, f64),
    /// The sample of the last telemetry since the board's start.
    newest: Option<u64>,
    waiting: VecDeque<Telemetry>,
    /// It was armed, and no message has shown it disarmed since.
    armed: bool,
    /// It was commanded to disarm.
    disarming: bool,
    urgent: Urgent,
}

/// Whether something urgent interrupts the wait for an acknowledgement.
struct Urgent(Box<dyn Fn() -> bool + Send>);

impl std::fmt::Debug for Urgent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Urgent")
    }
}

/// A message of a board.
enum Received {
    Telemetry,
    /// Of the command with this sequence number; `None`: of a hello.
    Acknowledgement(Option<u32>, Acknowledgement),
}

/// The acknowledgement of a command.
enum Acknowledgement {
    Done,
    Refused(Refusal),
    Value(u32),
    Hello,
}

impl Link {
    /// Opens a port at 921 600 baud and makes the handshake with the board there. A torque that is on stays on.
    ///
    /// # Errors
    /// There is no such port, nothing answers, or it has another version of the protocol.
    pub fn open(path: &Path) -> Result<Link, Error> {
        Link::open_at(path, SPEED)
    }

    /// The same at another speed, in bits per second.
    ///
    /// # Errors
    /// As above.
    pub fn open_at(path: &Path, speed: u32) -> Result<Link, Error> {
        let line = Line::open_at(path, speed).map_err(|source| Error::Open { path: path.into(), source })?;
        let mut link = Link {
            path: path.into(),
            line,
            speed,
            reader: Reader::new(),
            bytes: VecDeque::new(),
            board: Board::default(),
            is_known: false,
            sequence: 0,
            clock: (0, Instant::now(), 1e-3),
            newest: None,
            waiting: VecDeque::new(),
            armed: false,
            disarming: false,
            urgent: Urgent(Box::new(|| false)),
        };
        match link.handshake().map(drop) {
            Err(Error::Silent { path }) => Err(Error::NoAnswer { path }),
            done => done.map(|()| link),
        }
    }

    /// Sets the interval of telemetry to `every` s for a loop of this period in s, or to the shortest that the line carries; 0: the shortest.
    ///
    /// # Errors
    /// The board does not answer.
    pub fn set_telemetry(&mut self, period: f64, every: f64) -> Result<(), Error> {
        let carried = TELEMETRY_BITS / f64::from(self.speed);
        let samples = (every.max(carried) / period - 1e-6).ceil().clamp(1.0, 65_535.0);
        self.set(Parameter::Divider, samples as u32).map(drop)
    }

    /// Interrupts every later wait for an acknowledgement once `urgent` is true, with [`Error::Interrupted`]. It is polled every few
    /// milliseconds.
    pub fn interrupt_when(&mut self, urgent: impl Fn() -> bool + Send + 'static) {
        self.urgent = Urgent(Box::new(urgent));
    }

    /// The board's last description of itself.
    pub fn board(&self) -> &Board {
        &self.board
    }

    /// Makes the handshake: requests the board's description.
    ///
    /// # Errors
    /// It does not answer.
    pub fn handshake(&mut self) -> Result<&Board, Error> {
        for _ in 0..TRIES {
            self.write(Command::Hello { protocol: PROTOCOL })?;
            if self.acknowledgement(None)?.is_some() {
                return Ok(&self.board);
            }
        }
        Err(Error::Silent { path: self.path.clone() })
    }

    /// Loads a world, as [`hapt_wire::pack`] makes it, into the board and verifies that the board runs it; returns its hash. A world that it
    /// runs already is not sent.
    ///
    /// # Errors
    /// The board refuses the world, or there may be a torque.
    pub fn load(&mut self, packed: &[u8]) -> Result<u32, Error> {
        let world = hash(packed);
        let mut lost = None;
        for _ in 0..TRIES {
            if self.board.world == Some(world) {
                return Ok(world);
            }
            match self.send_world(packed, world) {
                // A part was lost on the line: sent again from the beginning.
                Err(
                    error @ Error::Refused {
                        why: Refusal::Piece | Refusal::Hash | Refusal::Late | Refusal::Sequence,
                        ..
                    },
                ) => {
                    lost = Some(error);
                }
                Err(error) => return Err(error),
                Ok(()) => lost = Some(Error::NotVerified),
            }
            self.handshake()?;
        }
        if self.board.world == Some(world) { Ok(world) } else { Err(lost.unwrap_or(Error::NotVerified)) }
    }

    fn send_world(&mut self, packed: &[u8], hash: u32) -> Result<(), Error> {
        const LOAD: &str = "take the world";
        let length = u16::try_from(packed.len()).map_err(|_| Error::Refused { what: LOAD, why: Refusal::Room })?;
        self.request(LOAD, Command::Begin { length, hash })?;
        let mut at = 0;
        for bytes in packed.chunks(PIECE) {
            self.request(LOAD, Command::Piece { at, bytes })?;
            at += bytes.len() as u16;
        }
        self.request(LOAD, Command::Commit).map(drop)
    }

    /// Arms the world of this hash: its torque fades in. Returns the last telemetry before that.
    ///
    /// # Errors
    /// It runs another one, or its supervisor does not arm.
    pub fn arm(&mut self, world: u32) -> Result<Option<Telemetry>, Error> {
        // Set before the command is sent: its acknowledgement may be lost.
        (self.armed, self.disarming) = (true, false);
        self.request("arm", Command::Arm { world })?;
        // Older telemetry is from before the command.
        let last = self.waiting.pop_back();
        self.waiting.clear();
        self.armed = true;
        Ok(last)
    }

    /// Fades the torque out.
    ///
    /// # Errors
    /// The board does not answer.
    pub fn disarm(&mut self) -> Result<(), Error> {
        self.request("disarm", Command::Disarm)?;
        self.disarming = true;
        Ok(())
    }

    /// Sets the torque to 0 at once.
    ///
    /// # Errors
    /// The board does not answer.
    pub fn stop(&mut self) -> Result<(), Error> {
        self.request("stop", Command::Stop)?;
        self.armed = false;
        Ok(())
    }

    /// From faulted to disarmed.
    ///
    /// # Errors
    /// The cause is still there.
    pub fn clear(&mut self) -> Result<(), Error> {
        let start = Instant::now();
        loop {
            // After the fault `link` a clear needs a heartbeat before it.
            self.heartbeat()?;
            match self.request("clear", Command::Clear) {
                // The cause has to be absent for some samples.
                Err(Error::Refused { why: Refusal::Phase, .. }) if start.elapsed() < ANSWER_TIMEOUT => {
                    std::thread::sleep(ANSWER_TIMEOUT / 20);
                }
                Err(error) => return Err(error),
                Ok(_) => {
                    (self.board.phase, self.board.reason) = (Some(Phase::Disarmed), None);
                    return Ok(());
                }
            }
        }
    }

    /// Sends a heartbeat, without an acknowledgement: to be called several times within the world's `safety.link`.
    ///
    /// # Errors
    /// The port is gone.
    pub fn heartbeat(&mut self) -> Result<(), Error> {
        self.send(Command::Heartbeat)
    }

    /// Sets a parameter; returns its new value.
    ///
    /// # Errors
    /// The board has no such parameter, or refuses the value.
    pub fn set(&mut self, parameter: Parameter, value: u32) -> Result<u32, Error> {
        self.value(Command::Set { parameter: parameter as u8, value })
    }

    /// Gets a parameter.
    ///
    /// # Errors
    /// The board has no such parameter.
    pub fn get(&mut self, parameter: Parameter) -> Result<u32, Error> {
        self.value(Command::Get { parameter: parameter as u8 })
    }

    fn value(&mut self, command: Command) -> Result<u32, Error> {
        let Acknowledgement::Value(value) = self.request("do that", command)? else {
            return Err(Error::Silent { path: self.path.clone() });
        };
        Ok(value)
    }

    /// Sends a command without waiting for its acknowledgement: on an externally clocked board most come with the next sample.
    ///
    /// # Errors
    /// The port is gone.
    pub fn send(&mut self, command: Command) -> Result<(), Error> {
        self.write(command).map(drop)
    }

    /// Sends a sample ([`Command::Sample`]) to an externally clocked board and returns the telemetry of it; `None` where one of the two was lost.
    ///
    /// # Errors
    /// It has an encoder, or has received this sample already.
    pub fn sample(&mut self, command: Command) -> Result<Option<Telemetry>, Error> {
        let sequence = self.write(command)?;
        let until = Instant::now() + ANSWER_TIMEOUT;
        loop {
            if let Some(telemetry) = self.waiting.pop_front() {
                return Ok(Some(telemetry));
            }
            match self.receive(until)? {
                Some(Received::Acknowledgement(sent, Acknowledgement::Refused(why))) if sent == Some(sequence) => {
                    return Err(Error::Refused { what: "take the sample", why });
                }
                Some(_) => {}
                None => return Ok(None),
            }
        }
    }

    /// The next telemetry, or `None` when none has come until that instant.
    ///
    /// # Errors
    /// The port is gone.
    pub fn telemetry(&mut self, until: Instant) -> Result<Option<Telemetry>, Error> {
        loop {
            if let Some(telemetry) = self.waiting.pop_front() {
                return Ok(Some(telemetry));
            }
            if self.receive(until)?.is_none() {
                return Ok(None);
            }
        }
    }

    /// Sends a command until it is acknowledged, each time with its own sequence; the board may execute it twice.
    fn request(&mut self, what: &'static str, command: Command) -> Result<Acknowledgement, Error> {
        for _ in 0..TRIES {
            let sequence = self.write(command)?;
            match self.acknowledgement(Some(sequence))? {
                None => {}
                // It was delayed for too long, or the clocks differ: a handshake gives the board's sample.
                Some(Acknowledgement::Refused(Refusal::Late | Refusal::Sequence)) => {
                    self.handshake()?;
                }
                Some(Acknowledgement::Refused(why)) => return Err(Error::Refused { what, why }),
                Some(answer) => return Ok(answer),
            }
        }
        Err(Error::Silent { path: self.path.clone() })
    }

    /// Writes a command to the line; returns its sequence.
    fn write(&mut self, command: Command) -> Result<u32, Error> {
        self.sequence = self.sequence.wrapping_add(1);
        let (sample, sent, period) = self.clock;
        let passed =
            if self.board.externally_clocked { 0.0 } else { sent.elapsed().as_secs_f64() + COMMAND_LIFETIME_S };
        let ahead = if self.board.externally_clocked { 1000 } else { ((passed / period) as u64).max(8) };
        let not_after =
            if let Command::Sample { sample, .. } = command { sample } else { sample.saturating_add(ahead) };
        let message = HostMessage { sequence: self.sequence, not_after, command };
        let mut room = [0; MAX_FRAME_BYTES + 1];
        // A leading 0 ends a frame that noise has begun.
        let Some((first, rest)) = room.split_first_mut() else { return Ok(self.sequence) };
        *first = 0;
        let length = 1 + frame(&message, rest).map_err(|error| self.gone(io::Error::other(error)))?.len();
        self.line.write(&room[..length], Instant::now() + ANSWER_TIMEOUT).map_err(|error| self.gone(error))?;
        Ok(self.sequence)
    }

    /// Waits for the acknowledgement of a command, or with `None` for a hello; returns `None` after the time limit.
    fn acknowledgement(&mut self, sequence: Option<u32>) -> Result<Option<Acknowledgement>, Error> {
        let until = Instant::now() + ANSWER_TIMEOUT;
        loop {
            if (self.urgent.0)() {
                return Err(Error::Interrupted);
            }
            match self.receive(until.min(Instant::now() + POLL_PERIOD))? {
                None if Instant::now() >= until => return Ok(None),
                Some(Received::Acknowledgement(sent, answer)) if sent == sequence => return Ok(Some(answer)),
                None | Some(_) => {}
            }
        }
    }

    /// Receives the next message; telemetry is queued.
    fn receive(&mut self, until: Instant) -> Result<Option<Received>, Error> {
        loop {
            while let Some(byte) = self.bytes.pop_front() {
                if let Some(received) = self.push(byte)? {
                    return Ok(Some(received));
                }
            }
            let mut some = [0; MAX_BOARD_FRAME_BYTES];
            let count = self.line.read(&mut some, until).map_err(|error| self.gone(error))?;
            if count == 0 {
                return Ok(None);
            }
            self.bytes.extend(&some[..count]);
        }
    }

    /// Parses one byte of the line.
    fn push(&mut self, byte: u8) -> Result<Option<Received>, Error> {
        let Some(message) = self.reader.push::<DeviceMessage<'_>>(byte) else { return Ok(None) };
        let (sequence, answer) = match message {
            DeviceMessage::Hello(hello) => {
                let board = hello.protocol;
                if board != PROTOCOL {
                    return Err(Error::Protocol { path: self.path.clone(), board });
                }
                // Samples are counted from the board's start.
                let restarted = self.is_known && hello.sample < self.clock.0;
                self.board = Board::new(&hello);
                self.is_known = true;
                self.newest = self.newest.filter(|newest| *newest < hello.sample);
                self.clock = (hello.sample, Instant::now(), f64::from(hello.period.max(1)) * 1e-9);
                // Lost commands leave a small gap, which the board accepts; after a restart the gap is large.
                if self.sequence.wrapping_sub(hello.sequence) > MAX_LOST_COMMANDS {
                    self.sequence = hello.sequence;
                }
                if restarted {
                    self.armed = false;
                    return Err(Error::Restarted { path: self.path.clone() });
                }
                (None, Acknowledgement::Hello)
            }
            DeviceMessage::Done { sequence } => (Some(sequence), Acknowledgement::Done),
            // It has restarted since the handshake.
            DeviceMessage::Refused { why: Refusal::Hello, .. } if self.is_known => {
                (self.is_known, self.armed, self.board.world) = (false, false, None);
                return Err(Error::Restarted { path: self.path.clone() });
            }
            DeviceMessage::Refused { sequence, why } => (Some(sequence), Acknowledgement::Refused(why)),
            DeviceMessage::Value { sequence, value, .. } => (Some(sequence), Acknowledgement::Value(value)),
            // A repeated or overtaken message: its phase is an old one.
            DeviceMessage::Telemetry(telemetry) if self.newest >= Some(telemetry.sample) => return Ok(None),
            DeviceMessage::Telemetry(telemetry) => {
                self.newest = Some(telemetry.sample);
                self.clock = (telemetry.sample.saturating_add(1), Instant::now(), self.clock.2);
                let (left, faulted) = (Phase::Disarmed as u8, Phase::Faulted as u8);
                if telemetry.phase == faulted || self.disarming && telemetry.phase == left {
                    self.armed = false;
                }
                if self.waiting.len() == WAITING {
                    self.waiting.pop_front();
                }
                self.waiting.push_back(telemetry);
                return Ok(Some(Received::Telemetry));
            }
        };
        Ok(Some(Received::Acknowledgement(sequence, answer)))
    }

    /// Whether a torque may be on: the board was armed, and no message has shown it disarmed since.
    pub(crate) fn may_be_armed(&self) -> bool {
        self.armed
    }

    /// The error of a board that has lost its world.
    pub(crate) fn restarted(&self) -> Error {
        Error::Restarted { path: self.path.clone() }
    }

    fn gone(&self, source: io::Error) -> Error {
        Error::Gone { path: self.path.clone(), source }
    }
}

impl Drop for Link {
    /// Removes a torque that is on, however the program ends. The board's own watchdog of the link covers a lost message.
    fn drop(&mut self) {
        if self.armed {
            let _ = self.write(Command::Stop);
            let _ = self.write(Command::Stop);
        }
    }
}
