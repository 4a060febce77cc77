//! One board.

use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use hapt_core::Phase;
use hapt_wire::{
    Command, DeviceMessage, LONGEST, Order, PIECE, PROTOCOL, Parameter, Reader, Refusal, Telemetry, frame, hash,
};

use super::{Board, Error, Line, SPEED};

/// The bits of telemetry of four bodies on the line, as a frame.
const TELEMETRY: f64 = 920.0;
/// The longest frame of a board.
const FRAME: usize = 512;
/// How long a command counts, in s. A line that holds it back for longer has it refused.
const PATIENCE: f64 = 0.25;
/// How long an answer may take; compiling a world is the longest.
const ANSWER: Duration = Duration::from_millis(500);
/// How often it is asked meanwhile whether there is something urgent.
const LOOK: Duration = Duration::from_millis(4);
/// How often what may have been lost on the line is said again.
const TRIES: usize = 4;
/// Telemetry that waits to be taken; older ones are lost.
const WAITING: usize = 4096;
/// Commands that the board may have missed.
const GAP: u32 = 2048;

/// A board at a serial port.
#[derive(Debug)]
pub struct Link {
    path: PathBuf,
    line: Line,
    /// In bits per second.
    speed: u32,
    reader: Reader<FRAME>,
    /// Read, and not looked at.
    bytes: VecDeque<u8>,
    board: Board,
    /// Whether the board has said hello, and nothing since that shows that it has restarted.
    greeted: bool,
    sequence: u32,
    /// A sample's number, when it was said, and the period in s.
    clock: (u64, Instant, f64),
    waiting: VecDeque<Telemetry>,
    /// Somebody has armed it, and nobody has seen it disarmed since.
    armed: bool,
    /// It has been asked to disarm.
    leaving: bool,
    urgent: Urgent,
}

/// Whether something has come for which no answer is waited.
struct Urgent(Box<dyn Fn() -> bool + Send>);

impl std::fmt::Debug for Urgent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Urgent")
    }
}

/// What comes from a board.
enum Heard {
    Telemetry,
    /// To the command of this sequence; to a hello without one.
    Answer(Option<u32>, Answer),
}

/// What it answers to a command.
enum Answer {
    Done,
    Refused(Refusal),
    Value(u32),
    Hello,
}

impl Link {
    /// Opens a port at 921 600 baud and greets the board there. Whatever torque it has goes on.
    ///
    /// # Errors
    /// There is no such port, nothing answers, or it speaks another version.
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
            greeted: false,
            sequence: 0,
            clock: (0, Instant::now(), 1e-3),
            waiting: VecDeque::new(),
            armed: false,
            leaving: false,
            urgent: Urgent(Box::new(|| false)),
        };
        link.greet().map_err(|error| match error {
            Error::Silent { path } => Error::Nobody { path },
            error => error,
        })?;
        Ok(link)
    }

    /// Telemetry every `every` s of a loop of this period in s, or as often as the line carries it; 0: of every sample that it carries.
    ///
    /// # Errors
    /// The board does not answer.
    pub fn show(&mut self, period: f64, every: f64) -> Result<(), Error> {
        let carried = TELEMETRY / f64::from(self.speed);
        let samples = (every.max(carried) / period - 1e-6).ceil().clamp(1.0, 65_535.0);
        self.set(Parameter::Divider, samples as u32).map(drop)
    }

    /// From now on no answer is waited for once `urgent` is true: what waits for one ends with [`Error::Interrupted`]. It is asked every few
    /// milliseconds.
    pub fn yield_to(&mut self, urgent: impl Fn() -> bool + Send + 'static) {
        self.urgent = Urgent(Box::new(urgent));
    }

    /// What the board has said of itself last.
    pub fn board(&self) -> &Board {
        &self.board
    }

    /// Asks the board anew what it is.
    ///
    /// # Errors
    /// It does not answer.
    pub fn greet(&mut self) -> Result<&Board, Error> {
        for _ in 0..TRIES {
            self.say(Order::Hello { protocol: PROTOCOL })?;
            if self.answer(None)?.is_some() {
                return Ok(&self.board);
            }
        }
        Err(Error::Silent { path: self.path.clone() })
    }

    /// Gives the board a world, as [`hapt_wire::pack`] makes it, and verifies that it runs it; its hash. Where it runs it already,
    /// nothing is sent.
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
            match self.send(packed, world) {
                // The line has lost something: once more from the beginning.
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
            self.greet()?;
        }
        if self.board.world == Some(world) { Ok(world) } else { Err(lost.unwrap_or(Error::NotVerified)) }
    }

    fn send(&mut self, packed: &[u8], hash: u32) -> Result<(), Error> {
        const LOAD: &str = "take the world";
        let length = u16::try_from(packed.len()).map_err(|_| Error::Refused { what: LOAD, why: Refusal::Room })?;
        self.ask(LOAD, Order::Begin { length, hash })?;
        let mut at = 0;
        for bytes in packed.chunks(PIECE) {
            self.ask(LOAD, Order::Piece { at, bytes })?;
            at += bytes.len() as u16;
        }
        self.ask(LOAD, Order::Commit).map(drop)
    }

    /// Arms the world of this hash: its torque fades in. What telemetry has said last before that.
    ///
    /// # Errors
    /// It runs another one, or its supervisor does not arm.
    pub fn arm(&mut self, world: u32) -> Result<Option<Telemetry>, Error> {
        // Before it is sent: its answer may be lost.
        (self.armed, self.leaving) = (true, false);
        self.ask("arm", Order::Arm { world })?;
        // What was said before is of another time.
        let last = self.waiting.pop_back();
        self.waiting.clear();
        self.armed = true;
        Ok(last)
    }

    /// The torque fades out.
    ///
    /// # Errors
    /// The board does not answer.
    pub fn disarm(&mut self) -> Result<(), Error> {
        self.ask("disarm", Order::Disarm)?;
        self.leaving = true;
        Ok(())
    }

    /// The torque is 0 at once.
    ///
    /// # Errors
    /// The board does not answer.
    pub fn stop(&mut self) -> Result<(), Error> {
        self.ask("stop", Order::Stop)?;
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
            // After a lost link a clear counts only from a host that is there again.
            self.keep()?;
            match self.ask("clear", Order::Clear) {
                // The cause has to be gone for some samples.
                Err(Error::Refused { why: Refusal::Phase, .. }) if start.elapsed() < ANSWER => {
                    std::thread::sleep(ANSWER / 20);
                }
                Err(error) => return Err(error),
                Ok(_) => {
                    (self.board.phase, self.board.reason) = (Some(Phase::Disarmed), None);
                    return Ok(());
                }
            }
        }
    }

    /// DeviceMessage that somebody is here, and waits for no answer: to be called several times in what `safety.link` allows.
    ///
    /// # Errors
    /// The port is gone.
    pub fn keep(&mut self) -> Result<(), Error> {
        self.tell(Order::Heartbeat)
    }

    /// Sets a parameter; its value then.
    ///
    /// # Errors
    /// The board has none such, or not that value.
    pub fn set(&mut self, parameter: Parameter, value: u32) -> Result<u32, Error> {
        self.value(Order::Set { parameter: parameter as u8, value })
    }

    /// Gets a parameter.
    ///
    /// # Errors
    /// The board has none such.
    pub fn get(&mut self, parameter: Parameter) -> Result<u32, Error> {
        self.value(Order::Get { parameter: parameter as u8 })
    }

    fn value(&mut self, order: Order) -> Result<u32, Error> {
        match self.ask("do that", order)? {
            Answer::Value(value) => Ok(value),
            _ => Err(Error::Silent { path: self.path.clone() }),
        }
    }

    /// Sends a command and waits for no answer: on an externally clocked board most come with the next sample.
    ///
    /// # Errors
    /// The port is gone.
    pub fn tell(&mut self, order: Order) -> Result<(), Error> {
        self.say(order).map(drop)
    }

    /// Shows an externally clocked board a sample ([`Order::Sample`]), and gives what it makes of it; `None` where one of the two was lost.
    ///
    /// # Errors
    /// It has an encoder, or has been shown this sample already.
    pub fn feed(&mut self, order: Order) -> Result<Option<Telemetry>, Error> {
        let sequence = self.say(order)?;
        let until = Instant::now() + ANSWER;
        loop {
            if let Some(telemetry) = self.waiting.pop_front() {
                return Ok(Some(telemetry));
            }
            match self.next(until)? {
                Some(Heard::Answer(said, Answer::Refused(why))) if said == Some(sequence) => {
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
            if self.next(until)?.is_none() {
                return Ok(None);
            }
        }
    }

    /// Sends a command until it is answered: each of them may be said twice, with its own sequence.
    fn ask(&mut self, what: &'static str, order: Order) -> Result<Answer, Error> {
        for _ in 0..TRIES {
            let sequence = self.say(order)?;
            match self.answer(Some(sequence))? {
                None => {}
                // It was on its way for too long, or the clocks have parted: how far is the board?
                Some(Answer::Refused(Refusal::Late | Refusal::Sequence)) => {
                    self.greet()?;
                }
                Some(Answer::Refused(why)) => return Err(Error::Refused { what, why }),
                Some(answer) => return Ok(answer),
            }
            // A piece that was taken before its answer was lost is refused when it comes again; the load then begins anew.
        }
        Err(Error::Silent { path: self.path.clone() })
    }

    /// Puts a command on the line; its sequence.
    fn say(&mut self, order: Order) -> Result<u32, Error> {
        self.sequence = self.sequence.wrapping_add(1);
        let (sample, said, period) = self.clock;
        let passed = if self.board.externally_clocked { 0.0 } else { said.elapsed().as_secs_f64() + PATIENCE };
        let ahead = if self.board.externally_clocked { 1000 } else { ((passed / period) as u64).max(8) };
        let not_after = match order {
            Order::Sample { sample, .. } => sample,
            _ => sample.saturating_add(ahead),
        };
        let command = Command { sequence: self.sequence, not_after, order };
        let mut room = [0; LONGEST + 1];
        // A 0 before it ends whatever noise has begun.
        let Some((first, rest)) = room.split_first_mut() else { return Ok(self.sequence) };
        *first = 0;
        let length = 1 + frame(&command, rest).map_err(|error| self.gone(io::Error::other(error)))?.len();
        self.line.write(&room[..length], Instant::now() + ANSWER).map_err(|error| self.gone(error))?;
        Ok(self.sequence)
    }

    /// The answer to a command, or with `None` to a hello; `None` when it does not come.
    fn answer(&mut self, sequence: Option<u32>) -> Result<Option<Answer>, Error> {
        let until = Instant::now() + ANSWER;
        loop {
            if (self.urgent.0)() {
                return Err(Error::Interrupted);
            }
            match self.next(until.min(Instant::now() + LOOK))? {
                None if Instant::now() >= until => return Ok(None),
                Some(Heard::Answer(said, answer)) if said == sequence => return Ok(Some(answer)),
                None | Some(_) => {}
            }
        }
    }

    /// The next frame; telemetry is put aside.
    fn next(&mut self, until: Instant) -> Result<Option<Heard>, Error> {
        loop {
            while let Some(byte) = self.bytes.pop_front() {
                if let Some(heard) = self.take(byte)? {
                    return Ok(Some(heard));
                }
            }
            let mut some = [0; FRAME];
            let count = self.line.read(&mut some, until).map_err(|error| self.gone(error))?;
            if count == 0 {
                return Ok(None);
            }
            self.bytes.extend(&some[..count]);
        }
    }

    /// One byte of the line.
    fn take(&mut self, byte: u8) -> Result<Option<Heard>, Error> {
        let Some(says) = self.reader.push::<DeviceMessage<'_>>(byte) else { return Ok(None) };
        let (sequence, answer) = match says {
            DeviceMessage::Hello(hello) => {
                let board = hello.protocol;
                if board != PROTOCOL {
                    return Err(Error::Protocol { path: self.path.clone(), board });
                }
                // Samples are counted from its start.
                let restarted = self.greeted && hello.sample < self.clock.0;
                self.board = Board::new(&hello);
                self.greeted = true;
                self.clock = (hello.sample, Instant::now(), f64::from(hello.period.max(1)) * 1e-9);
                // Commands that were lost leave a gap that it minds not; a board that has begun anew is far behind.
                if self.sequence.wrapping_sub(hello.sequence) > GAP {
                    self.sequence = hello.sequence;
                }
                if restarted {
                    self.armed = false;
                    return Err(Error::Restarted { path: self.path.clone() });
                }
                (None, Answer::Hello)
            }
            DeviceMessage::Done { sequence } => (Some(sequence), Answer::Done),
            // It was greeted before, and knows nothing of it.
            DeviceMessage::Refused { why: Refusal::Hello, .. } if self.greeted => {
                (self.greeted, self.armed, self.board.world) = (false, false, None);
                return Err(Error::Restarted { path: self.path.clone() });
            }
            DeviceMessage::Refused { sequence, why } => (Some(sequence), Answer::Refused(why)),
            DeviceMessage::Value { sequence, value, .. } => (Some(sequence), Answer::Value(value)),
            DeviceMessage::Telemetry(telemetry) => {
                self.clock = (telemetry.sample.saturating_add(1), Instant::now(), self.clock.2);
                let (left, faulted) = (Phase::Disarmed as u8, Phase::Faulted as u8);
                if telemetry.phase == faulted || self.leaving && telemetry.phase == left {
                    self.armed = false;
                }
                if self.waiting.len() == WAITING {
                    self.waiting.pop_front();
                }
                self.waiting.push_back(telemetry);
                return Ok(Some(Heard::Telemetry));
            }
        };
        Ok(Some(Heard::Answer(sequence, answer)))
    }

    /// Whether a torque may be on: the board was armed, and has not been seen disarmed since.
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
    /// However the program ends: a torque that is on is taken off. The board's own watch over the link is for when this does not come.
    fn drop(&mut self) {
        if self.armed {
            let _ = self.say(Order::Stop);
            let _ = self.say(Order::Stop);
        }
    }
}
