//! The half in the main loop: it receives bytes, sends answers, and uploads and compiles worlds.

use crate::{
    Command, DeviceMessage, Error, Hello, HostMessage, LARGEST, MAX_FRAME_BYTES, PROTOCOL, Parameter, ROOM, Reader,
    Refusal, Telemetry, frame, hash, unpack,
};
use hapt_core::{Estimator, Phase, Request};

use super::mailbox::{Action, Outcome, Pending, Progress, Queue, Response};
use super::{Mailbox, Measurement, WorldStorage};

/// The largest distance of a command's sequence beyond the next one.
const AHEAD: u32 = 4096;
/// The largest number of samples for which a command is valid.
const HORIZON: u64 = 65_536;

/// The description of a board.
#[derive(Clone, Copy, Debug)]
pub struct Board {
    /// Its name.
    pub name: &'static str,
    /// Its firmware's version.
    pub firmware: &'static str,
    /// Whether it has no encoder and no motor, and takes its samples from the host.
    pub externally_clocked: bool,
    /// The shortest and the longest period of its timer, in s.
    pub periods: [f64; 2],
}

/// Receives bytes and answers commands; receives worlds and compiles them.
#[derive(Debug)]
pub struct CommandHandler<'w> {
    reader: Reader<MAX_FRAME_BYTES>,
    state: State<'w>,
}

/// The state of the handler other than its reader.
#[derive(Debug)]
struct State<'w> {
    board: Board,
    /// Whether a host of this protocol version has completed the handshake.
    greeted: bool,
    /// Whether a hello has not been answered yet.
    greet: bool,
    /// The sequence of the last command.
    sequence: u32,
    stop: Option<u32>,
    pending: Queue<Pending<'w>>,
    responses: Queue<Response>,
    telemetry: Option<Telemetry>,
    progress: Progress,
    upload: Upload,
    /// `None` while the sampler has it.
    spare: Option<&'w mut WorldStorage>,
}

/// The result of a command in the handler.
enum Handled {
    Outcome(Outcome),
    /// The sampler executes it.
    Later,
    Seen(Measurement),
}

impl<'w> CommandHandler<'w> {
    /// `spare` is the first of the board's two storages.
    pub const fn new(board: Board, spare: &'w mut WorldStorage) -> Self {
        let state = State {
            board,
            greeted: false,
            greet: false,
            sequence: 0,
            stop: None,
            pending: Queue::new(),
            responses: Queue::new(),
            telemetry: None,
            progress: Progress::START,
            upload: Upload::NOTHING,
            spare: Some(spare),
        };
        CommandHandler { reader: Reader::new(), state }
    }

    /// Takes a byte of the line. The last byte of a command executes the handler's part of it at once: [`Command::Commit`] compiles, which takes
    /// milliseconds. On an externally clocked board a [`Command::Sample`] returns its measurement: exchange, take that sample, exchange,
    /// before the next byte.
    pub fn push(&mut self, byte: u8) -> Option<Measurement> {
        let refused = self.reader.refused;
        let message = self.reader.push::<HostMessage<'_>>(byte)?;
        self.state.handle(&message, refused)
    }

    /// Passes the pending commands to the sampler, and takes its responses.
    pub fn exchange(&mut self, mailbox: &mut Mailbox<'w>) {
        let state = &mut self.state;
        if let Some(sequence) = state.stop.take() {
            mailbox.stop = Some(sequence);
        }
        while !mailbox.pending.is_full() {
            let Some(pending) = state.pending.pop() else { break };
            let _ = mailbox.pending.push(pending);
        }
        while !state.responses.is_full() {
            let Some(response) = mailbox.responses.pop() else { break };
            let _ = state.responses.push(response);
        }
        if let Some(storage) = mailbox.back.take() {
            state.spare = Some(storage);
        }
        if let Some(telemetry) = mailbox.telemetry.take() {
            state.telemetry = Some(telemetry);
        }
        state.progress = mailbox.progress;
    }

    /// The next frame for the host, if there is one.
    pub fn answer<'r>(&mut self, room: &'r mut [u8; MAX_FRAME_BYTES]) -> Option<&'r [u8]> {
        let next_message = self.state.next_message()?;
        frame(&next_message, room).ok()
    }
}

impl<'w> State<'w> {
    fn handle(&mut self, message: &HostMessage<'_>, unread: u32) -> Option<Measurement> {
        let &HostMessage { sequence, not_after, command } = message;
        match command {
            Command::Hello { protocol } => {
                (self.greeted, self.greet) = (protocol == PROTOCOL, true);
                self.upload.forget();
                return None;
            }
            Command::Stop => {
                self.stop = Some(sequence);
                // Earlier commands are void.
                while let Some(pending) = self.pending.pop() {
                    if let Action::Swap(storage) = pending.what {
                        self.spare = Some(storage);
                    }
                    self.respond(pending.sequence, Outcome::Refused(Refusal::Late));
                }
                return None;
            }
            Command::Heartbeat
            | Command::Arm { .. }
            | Command::Disarm
            | Command::Clear
            | Command::Begin { .. }
            | Command::Piece { .. }
            | Command::Commit
            | Command::Get { .. }
            | Command::Set { .. }
            | Command::Sample { .. } => {}
        }
        match self.accept(sequence, not_after).and_then(|()| self.execute(message, unread)) {
            Ok(Handled::Seen(measurement)) => return Some(measurement),
            Ok(Handled::Later) => {}
            Ok(Handled::Outcome(outcome)) => self.respond(sequence, outcome),
            Err(why) => self.respond(sequence, Outcome::Refused(why)),
        }
        None
    }

    /// Whether a command is the next one and still valid.
    fn accept(&mut self, sequence: u32, not_after: u64) -> Result<(), Refusal> {
        if !self.greeted {
            return Err(Refusal::Hello);
        }
        if !(1..=AHEAD).contains(&sequence.wrapping_sub(self.sequence)) {
            return Err(Refusal::Sequence);
        }
        self.sequence = sequence;
        let next = self.progress.next;
        if (next..=next.saturating_add(HORIZON)).contains(&not_after) { Ok(()) } else { Err(Refusal::Late) }
    }

    fn execute(&mut self, message: &HostMessage<'_>, unread: u32) -> Result<Handled, Refusal> {
        let done = |()| Handled::Outcome(Outcome::Done);
        let progress = self.progress;
        let pending = match message.command {
            // Both have been executed before.
            Command::Hello { .. } | Command::Stop => return Ok(Handled::Later),
            Command::Begin { length, hash } => return self.upload.begin(length, hash).map(done),
            Command::Piece { at, bytes } => return self.upload.add(at, bytes).map(done),
            Command::Commit => Action::Swap(self.compiled()?),
            Command::Heartbeat => Action::Heartbeat,
            Command::Arm { world } => Action::Ask(Request::Arm, Some(world)),
            Command::Disarm => Action::Ask(Request::Disarm, None),
            Command::Clear => Action::Ask(Request::Clear, None),
            Command::Get { parameter } => {
                let value = match Parameter::from_code(parameter).ok_or(Refusal::Parameter)? {
                    Parameter::Divider => u32::from(progress.divider),
                    Parameter::Refused => unread,
                    Parameter::Missed => progress.missed,
                    Parameter::MostUsed => progress.most_used,
                    Parameter::Outside => progress.outside,
                };
                return Ok(Handled::Outcome(Outcome::Value(parameter, value)));
            }
            Command::Set { parameter, value } => match Parameter::from_code(parameter) {
                Some(Parameter::Divider) => Action::Divide(u16::try_from(value).map_err(|_| Refusal::Parameter)?),
                Some(Parameter::MostUsed) => Action::CountUseFrom(value),
                Some(Parameter::Refused | Parameter::Missed | Parameter::Outside) | None => {
                    return Err(Refusal::Parameter);
                }
            },
            Command::Sample { sample, position, velocity, late, announced } => {
                if !self.board.externally_clocked {
                    return Err(Refusal::NotExternallyClocked);
                }
                let missed = sample.checked_sub(progress.next).filter(|missed| *missed <= HORIZON);
                let missed = missed.and_then(|missed| u32::try_from(missed).ok()).ok_or(Refusal::Sample)?;
                return Ok(Handled::Seen(Measurement { position, velocity, late, missed, announced, fault: false }));
            }
        };
        let pending = Pending { sequence: message.sequence, not_after: message.not_after, what: pending };
        match self.pending.push(pending) {
            Ok(()) => Ok(Handled::Later),
            Err(pending) => {
                if let Action::Swap(storage) = pending.what {
                    self.spare = Some(storage);
                }
                Err(Refusal::Busy)
            }
        }
    }

    /// The spare storage, with the uploaded world.
    fn compiled(&mut self) -> Result<&'w mut WorldStorage, Refusal> {
        let active = Phase::ALL.get(usize::from(self.progress.phase)).is_some_and(|phase| phase.is_active());
        if active {
            return Err(Refusal::Armed);
        }
        let storage = self.spare.take().ok_or(Refusal::Busy)?;
        match self.upload.whole().and_then(|bytes| compile(storage, bytes, &self.board)) {
            Ok(()) => {
                self.upload.forget();
                Ok(storage)
            }
            Err(why) => {
                self.spare = Some(storage);
                Err(why)
            }
        }
    }

    fn respond(&mut self, sequence: u32, outcome: Outcome) {
        // A response that finds the queue full is lost: the host does not read.
        let _ = self.responses.push(Response { sequence, outcome });
    }

    fn next_message(&mut self) -> Option<DeviceMessage<'static>> {
        if core::mem::take(&mut self.greet) {
            let Board { name, firmware, externally_clocked, .. } = self.board;
            let Progress { next, phase, reason, world, period, .. } = self.progress;
            return Some(DeviceMessage::Hello(Hello {
                protocol: PROTOCOL,
                firmware,
                board: name,
                core: hapt_core::SOURCE,
                world,
                bodies: ROOM[0] as u8,
                couplings: ROOM[1] as u8,
                window: (ROOM[2] - 1) as u8,
                externally_clocked,
                sequence: self.sequence,
                sample: next,
                period: (period * 1e9) as u32,
                phase,
                reason,
            }));
        }
        if let Some(Response { sequence, outcome }) = self.responses.pop() {
            return Some(match outcome {
                Outcome::Done => DeviceMessage::Done { sequence },
                Outcome::Refused(why) => DeviceMessage::Refused { sequence, why },
                Outcome::Value(parameter, value) => DeviceMessage::Value { sequence, parameter, value },
            });
        }
        self.telemetry.take().map(DeviceMessage::Telemetry)
    }
}

/// Checks a world, and compiles it for a board.
#[allow(clippy::wildcard_enum_match_arm)] // Every other error, also a future one, is a refusal.
fn compile(storage: &mut WorldStorage, bytes: &[u8], board: &Board) -> Result<(), Refusal> {
    let (limits, stored) = unpack::<{ ROOM[0] }, { ROOM[1] }>(bytes).map_err(|error| match error {
        Error::Version { .. } => Refusal::Version,
        Error::TooManyBodies { .. } | Error::TooManyCouplings { .. } => Refusal::Room,
        _ => Refusal::Bytes,
    })?;
    let spec = stored.spec();
    let [shortest, longest] = board.periods;
    if !(shortest <= spec.period && spec.period <= longest) {
        return Err(Refusal::Period);
    }
    if !board.externally_clocked && spec.limit.is_none() {
        return Err(Refusal::NoLimit);
    }
    if !board.externally_clocked && spec.estimator == Estimator::Exact {
        return Err(Refusal::Exact);
    }
    storage.compile(hash(bytes), &spec, &limits).map_err(|error| match error {
        hapt_core::Error::TooManyBodies { .. }
        | hapt_core::Error::TooManyCouplings { .. }
        | hapt_core::Error::WindowTooLong { .. } => Refusal::Room,
        _ => Refusal::World,
    })
}

/// The bytes of an upload so far.
#[derive(Debug)]
struct Upload {
    bytes: [u8; LARGEST],
    /// The numbers of received and announced bytes.
    so_far: usize,
    length: usize,
    hash: u32,
}

impl Upload {
    const NOTHING: Upload = Upload { bytes: [0; LARGEST], so_far: 0, length: 0, hash: 0 };

    fn forget(&mut self) {
        (self.so_far, self.length) = (0, 0);
    }

    fn begin(&mut self, length: u16, hash: u32) -> Result<(), Refusal> {
        self.forget();
        if usize::from(length) > LARGEST {
            return Err(Refusal::Room);
        }
        (self.length, self.hash) = (usize::from(length), hash);
        Ok(())
    }

    fn add(&mut self, at: u16, piece: &[u8]) -> Result<(), Refusal> {
        let end = self.so_far.saturating_add(piece.len());
        // The last piece is repeated: its acknowledgement was lost.
        if self.bytes.get(usize::from(at)..self.so_far) == Some(piece) {
            return Ok(());
        }
        if usize::from(at) != self.so_far || end > self.length {
            return Err(Refusal::Piece);
        }
        let places = self.bytes.get_mut(self.so_far..end).ok_or(Refusal::Piece)?;
        places.iter_mut().zip(piece).for_each(|(place, byte)| *place = *byte);
        self.so_far = end;
        Ok(())
    }

    /// The complete upload, if its length and hash are right.
    fn whole(&self) -> Result<&[u8], Refusal> {
        let bytes = self.bytes.get(..self.length).filter(|bytes| !bytes.is_empty() && self.so_far == self.length);
        bytes.filter(|bytes| hash(bytes) == self.hash).ok_or(Refusal::Hash)
    }
}
