//! The half in the main loop: bytes come in, answers go out, worlds are gathered and compiled.

use hapt_core::{Estimator, Phase, Request};
use hapt_wire::{
    Command, Error, Hello, LARGEST, LONGEST, Order, PROTOCOL, Parameter, Reader, Says, Telemetry, Why, frame, hash,
    unpack,
};

use crate::mail::{Errand, Progress, Queue, Said, Verdict, What};
use crate::{Mail, ROOM, Seen, Slot};

/// A command may be so far behind the next one.
const AHEAD: u32 = 4096;
/// And count for so many samples at most.
const HORIZON: u64 = 65_536;

/// What a board is.
#[derive(Clone, Copy, Debug)]
pub struct Board {
    /// What it is called.
    pub name: &'static str,
    /// Its firmware's version.
    pub firmware: &'static str,
    /// Whether it has no encoder and no motor, and takes a sample whenever it is shown one.
    pub fed: bool,
    /// The shortest and the longest period that its timer keeps, in s.
    pub periods: [f64; 2],
}

/// Takes bytes, gives answers; gathers worlds and compiles them.
#[derive(Debug)]
pub struct Desk<'w> {
    reader: Reader<LONGEST>,
    clerk: Clerk<'w>,
}

/// Who does what the reader has read.
#[derive(Debug)]
struct Clerk<'w> {
    board: Board,
    /// Whether a host of this version has said hello.
    greeted: bool,
    /// A hello waits for its answer.
    greet: bool,
    /// The last command's.
    sequence: u32,
    stop: Option<u32>,
    orders: Queue<Errand<'w>>,
    verdicts: Queue<Verdict>,
    telemetry: Option<Telemetry>,
    progress: Progress,
    gathered: Gathered,
    /// `None` while the sampler has it.
    spare: Option<&'w mut Slot>,
}

/// What a command comes to at the desk.
enum Outcome {
    Said(Said),
    /// The sampler says.
    Later,
    Seen(Seen),
}

impl<'w> Desk<'w> {
    /// `spare` is the first of the board's two slots.
    pub const fn new(board: Board, spare: &'w mut Slot) -> Self {
        let clerk = Clerk {
            board,
            greeted: false,
            greet: false,
            sequence: 0,
            stop: None,
            orders: Queue::new(),
            verdicts: Queue::new(),
            telemetry: None,
            progress: Progress::START,
            gathered: Gathered::NOTHING,
            spare: Some(spare),
        };
        Desk { reader: Reader::new(), clerk }
    }

    /// Takes a byte of the line. A command's last one has it done here and now, as far as it is the desk's: [`Order::Commit`] compiles, and
    /// takes milliseconds. On a fed board an [`Order::Feed`] gives what it shows: exchange, take that sample, exchange, before the next byte.
    pub fn push(&mut self, byte: u8) -> Option<Seen> {
        let refused = self.reader.refused;
        let command = self.reader.push::<Command<'_>>(byte)?;
        self.clerk.hear(&command, refused)
    }

    /// Leaves the orders, and takes what there is to say.
    pub fn exchange(&mut self, mail: &mut Mail<'w>) {
        let clerk = &mut self.clerk;
        if let Some(sequence) = clerk.stop.take() {
            mail.stop = Some(sequence);
        }
        while !mail.orders.is_full() {
            let Some(errand) = clerk.orders.pop() else { break };
            let _ = mail.orders.push(errand);
        }
        while !clerk.verdicts.is_full() {
            let Some(verdict) = mail.verdicts.pop() else { break };
            let _ = clerk.verdicts.push(verdict);
        }
        if let Some(slot) = mail.back.take() {
            clerk.spare = Some(slot);
        }
        if let Some(telemetry) = mail.telemetry.take() {
            clerk.telemetry = Some(telemetry);
        }
        clerk.progress = mail.progress;
    }

    /// The next frame for the host, if there is one.
    pub fn answer<'r>(&mut self, room: &'r mut [u8; LONGEST]) -> Option<&'r [u8]> {
        let says = self.clerk.says()?;
        frame(&says, room).ok()
    }
}

impl<'w> Clerk<'w> {
    fn hear(&mut self, command: &Command<'_>, unread: u32) -> Option<Seen> {
        let &Command { sequence, not_after, order } = command;
        match order {
            Order::Hello { protocol } => {
                (self.greeted, self.greet) = (protocol == PROTOCOL, true);
                self.gathered.forget();
                return None;
            }
            Order::Stop => {
                self.stop = Some(sequence);
                // What was asked for before counts no more.
                while let Some(errand) = self.orders.pop() {
                    if let What::Swap(slot) = errand.what {
                        self.spare = Some(slot);
                    }
                    self.say(errand.sequence, Said::Refused(Why::Late));
                }
                return None;
            }
            Order::Alive
            | Order::Arm { .. }
            | Order::Disarm
            | Order::Clear
            | Order::Begin { .. }
            | Order::Piece { .. }
            | Order::Commit
            | Order::Get { .. }
            | Order::Set { .. }
            | Order::Feed { .. } => {}
        }
        match self.admit(sequence, not_after).and_then(|()| self.act(command, unread)) {
            Ok(Outcome::Seen(seen)) => return Some(seen),
            Ok(Outcome::Later) => {}
            Ok(Outcome::Said(said)) => self.say(sequence, said),
            Err(why) => self.say(sequence, Said::Refused(why)),
        }
        None
    }

    /// Whether a command is the next one, and in time.
    fn admit(&mut self, sequence: u32, not_after: u64) -> Result<(), Why> {
        if !self.greeted {
            return Err(Why::Hello);
        }
        if !(1..=AHEAD).contains(&sequence.wrapping_sub(self.sequence)) {
            return Err(Why::Sequence);
        }
        self.sequence = sequence;
        let next = self.progress.next;
        if (next..=next.saturating_add(HORIZON)).contains(&not_after) { Ok(()) } else { Err(Why::Late) }
    }

    fn act(&mut self, command: &Command<'_>, unread: u32) -> Result<Outcome, Why> {
        let done = |()| Outcome::Said(Said::Done);
        let progress = self.progress;
        let errand = match command.order {
            // Both are done by now.
            Order::Hello { .. } | Order::Stop => return Ok(Outcome::Later),
            Order::Begin { length, hash } => return self.gathered.begin(length, hash).map(done),
            Order::Piece { at, bytes } => return self.gathered.add(at, bytes).map(done),
            Order::Commit => What::Swap(self.compiled()?),
            Order::Alive => What::Alive,
            Order::Arm { world } => What::Ask(Request::Arm, Some(world)),
            Order::Disarm => What::Ask(Request::Disarm, None),
            Order::Clear => What::Ask(Request::Clear, None),
            Order::Get { parameter } => {
                let value = match Parameter::from_code(parameter).ok_or(Why::Parameter)? {
                    Parameter::Divider => u32::from(progress.divider),
                    Parameter::Refused => unread,
                    Parameter::Missed => progress.missed,
                    Parameter::MostUsed => progress.most_used,
                };
                return Ok(Outcome::Said(Said::Value(parameter, value)));
            }
            Order::Set { parameter, value } => match Parameter::from_code(parameter) {
                Some(Parameter::Divider) => What::Divide(u16::try_from(value).map_err(|_| Why::Parameter)?),
                Some(Parameter::MostUsed) => What::CountUseFrom(value),
                Some(Parameter::Refused | Parameter::Missed) | None => return Err(Why::Parameter),
            },
            Order::Feed { sample, position, velocity, late, announced } => {
                if !self.board.fed {
                    return Err(Why::NotFed);
                }
                let missed = sample.checked_sub(progress.next).filter(|missed| *missed <= HORIZON);
                let missed = missed.and_then(|missed| u32::try_from(missed).ok()).ok_or(Why::Sample)?;
                return Ok(Outcome::Seen(Seen { position, velocity, late, missed, announced, fault: false }));
            }
        };
        let errand = Errand { sequence: command.sequence, not_after: command.not_after, what: errand };
        match self.orders.push(errand) {
            Ok(()) => Ok(Outcome::Later),
            Err(errand) => {
                if let What::Swap(slot) = errand.what {
                    self.spare = Some(slot);
                }
                Err(Why::Busy)
            }
        }
    }

    /// The spare slot, with the gathered world in it.
    fn compiled(&mut self) -> Result<&'w mut Slot, Why> {
        let active = Phase::ALL.get(usize::from(self.progress.phase)).is_some_and(|phase| phase.is_active());
        if active {
            return Err(Why::Armed);
        }
        let slot = self.spare.take().ok_or(Why::Busy)?;
        match self.gathered.whole().and_then(|bytes| compile(slot, bytes, &self.board)) {
            Ok(()) => {
                self.gathered.forget();
                Ok(slot)
            }
            Err(why) => {
                self.spare = Some(slot);
                Err(why)
            }
        }
    }

    fn say(&mut self, sequence: u32, said: Said) {
        // A host that does not listen misses it.
        let _ = self.verdicts.push(Verdict { sequence, said });
    }

    fn says(&mut self) -> Option<Says<'static>> {
        if core::mem::take(&mut self.greet) {
            let Board { name, firmware, fed, .. } = self.board;
            let Progress { next, phase, reason, world, period, .. } = self.progress;
            return Some(Says::Hello(Hello {
                protocol: PROTOCOL,
                firmware,
                board: name,
                core: hapt_core::SOURCE,
                world,
                bodies: ROOM[0] as u8,
                couplings: ROOM[1] as u8,
                window: (ROOM[2] - 1) as u8,
                fed,
                sequence: self.sequence,
                sample: next,
                period: (period * 1e9) as u32,
                phase,
                reason,
            }));
        }
        if let Some(Verdict { sequence, said }) = self.verdicts.pop() {
            return Some(match said {
                Said::Done => Says::Done { sequence },
                Said::Refused(why) => Says::Refused { sequence, why },
                Said::Value(parameter, value) => Says::Value { sequence, parameter, value },
            });
        }
        self.telemetry.take().map(Says::Telemetry)
    }
}

/// Checks a world, and compiles it for a board.
fn compile(slot: &mut Slot, bytes: &[u8], board: &Board) -> Result<(), Why> {
    let (limits, stored) = unpack::<{ ROOM[0] }, { ROOM[1] }>(bytes).map_err(|error| match error {
        Error::Version { .. } => Why::Version,
        Error::TooManyBodies { .. } | Error::TooManyCouplings { .. } => Why::Room,
        _ => Why::Bytes,
    })?;
    let spec = stored.spec();
    let [shortest, longest] = board.periods;
    if !(shortest <= spec.period && spec.period <= longest) {
        return Err(Why::Period);
    }
    if !board.fed && spec.limit.is_none() {
        return Err(Why::NoLimit);
    }
    if !board.fed && spec.estimator == Estimator::Exact {
        return Err(Why::Exact);
    }
    slot.compile(hash(bytes), &spec, &limits).map_err(|error| match error {
        hapt_core::Error::TooManyBodies { .. }
        | hapt_core::Error::TooManyCouplings { .. }
        | hapt_core::Error::WindowTooLong { .. } => Why::Room,
        _ => Why::World,
    })
}

/// A world's bytes, as far as they have come.
#[derive(Debug)]
struct Gathered {
    bytes: [u8; LARGEST],
    /// How many have come, and how many were announced.
    so_far: usize,
    length: usize,
    hash: u32,
}

impl Gathered {
    const NOTHING: Gathered = Gathered { bytes: [0; LARGEST], so_far: 0, length: 0, hash: 0 };

    fn forget(&mut self) {
        (self.so_far, self.length) = (0, 0);
    }

    fn begin(&mut self, length: u16, hash: u32) -> Result<(), Why> {
        self.forget();
        if usize::from(length) > LARGEST {
            return Err(Why::Room);
        }
        (self.length, self.hash) = (usize::from(length), hash);
        Ok(())
    }

    fn add(&mut self, at: u16, piece: &[u8]) -> Result<(), Why> {
        let end = self.so_far.saturating_add(piece.len());
        if usize::from(at) != self.so_far || end > self.length {
            return Err(Why::Piece);
        }
        let places = self.bytes.get_mut(self.so_far..end).ok_or(Why::Piece)?;
        places.iter_mut().zip(piece).for_each(|(place, byte)| *place = *byte);
        self.so_far = end;
        Ok(())
    }

    /// All of it, as it was announced.
    fn whole(&self) -> Result<&[u8], Why> {
        let bytes = self.bytes.get(..self.length).filter(|bytes| !bytes.is_empty() && self.so_far == self.length);
        bytes.filter(|bytes| hash(bytes) == self.hash).ok_or(Why::Hash)
    }
}
