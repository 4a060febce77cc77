//! A station's end of a link: making and checking messages, for any codec.

use hapt_core::Strength;

use super::{Incoming, Number, Outgoing, Refusal};

/// A second sender is accepted after this time without a message of the first, in ns.
pub const SILENCE: u64 = 1_000_000_000;
/// The number of own messages whose times are stored: an answer to an older one is too old.
const ROOM: usize = 1024;
/// A session that is at most this number above another one is of the same run.
const NEXT: u64 = 16;

/// The full content of a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Message {
    /// The sender's session and the message's number. Number 0 is an introduction, which contains only both sessions.
    pub from: Number,
    /// The receiver's session, if the sender has received it, and the receiver's newest message before the sample; 0: none.
    pub to: Number,
    /// In rad (linear: m).
    pub position: f64,
    /// Of the first end: the part with which it acts. Of the second: the largest part with which it can act.
    pub strength: Strength,
}

/// The receiver's state before a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Known {
    /// Its own session, and its newest message in it.
    pub own: Number,
    /// The newest of its messages that the other end has acknowledged.
    pub answered: u64,
    /// The other end's session, and the newest message that was taken; 0: none.
    pub other: Number,
}

/// Writes and reads the messages of one end of a link, without state.
pub trait Codec {
    /// The bytes of a message.
    type Bytes: AsRef<[u8]> + Copy + Send + 'static;
    /// Sessions have the numbers from 1 to this, one less than a power of 2.
    const SESSIONS: u64;
    /// The largest number of unanswered messages of a session, for a codec whose shortened messages are completed by the [`Known`] state. Sessions are
    /// then introduced first, and replaced when more are unanswered. `None`: each message is complete in itself.
    const UNANSWERED: Option<u64>;

    /// `None`: it cannot be encoded, such as a position out of range.
    fn write(&self, message: &Message) -> Option<Self::Bytes>;

    /// The message of these bytes.
    ///
    /// # Errors
    /// They are no message of the other end of this link.
    fn read(&self, bytes: &[u8], known: &Known) -> Result<Message, Refusal>;
}

/// The other station.
#[derive(Clone, Copy, Debug)]
struct Peer {
    newest: Number,
    /// It has acknowledged this session, so that it is present now.
    proved: bool,
    /// The time of arrival of its newest message.
    at: u64,
}

/// One station's end of a link: makes and checks its messages.
///
/// ```
/// use hapt_wire::link::{Datagrams, Outgoing, Refusal, Session};
///
/// let key = b"not a key for a real network";
/// // In a real network the numbers of the sessions are random.
/// let mut left = Session::new(Datagrams::new(key, 7, true), 11);
/// let mut right = Session::new(Datagrams::new(key, 7, false), 22);
/// let say = |sampled, received| Outgoing { sampled, position: 0.5, strength: hapt_core::Strength::NONE, received };
/// let hello = left.send(&say(1_000, None)).unwrap();
/// let received = right.receive(&hello, 5_000)?.unwrap();
/// assert_eq!(received.since, None); // its age is unknown
/// let answer = right.send(&say(6_000, Some(received.number))).unwrap();
/// let received = left.receive(&answer, 9_000)?.unwrap();
/// assert_eq!((received.position, received.since), (0.5, Some(1_000)));
/// assert_eq!(left.receive(&answer, 9_500), Err(Refusal::Old));
/// # Ok::<(), Refusal>(())
/// ```
#[derive(Clone, Debug)]
pub struct Session<C> {
    codec: C,
    own: u64,
    sequence: u64,
    /// The time in ns per 1 by which the numbers of two messages differ; 0: they always differ by 1.
    pace: u64,
    /// The time of the last message's sample.
    last: Option<u64>,
    /// The newest own message that the other end has acknowledged.
    answered: u64,
    /// The times of the last messages' samples.
    sent: [u64; ROOM],
    peer: Option<Peer>,
}

impl<C: Codec> Session<C> {
    /// `own` is the session number: 64 random bits, never used before.
    pub fn new(codec: C, own: u64) -> Self {
        let own = (own & C::SESSIONS).max(1);
        Session { codec, own, sequence: 0, pace: 0, last: None, answered: 0, sent: [0; ROOM], peer: None }
    }

    /// The same with numbers that encode the time between samples, nominally `pace` ns: they differ by that time divided by the pace, rounded up to a whole
    /// number from an eighth on, and at least by 1. So the time is at most 9/8 of the encoded one.
    pub fn paced(self, pace: u64) -> Self {
        Session { pace, ..self }
    }

    /// The difference of the number of a message with a sample of this instant from the last number.
    fn step(&self, sampled: u64) -> u64 {
        let since = self.last.map_or(0, |last| sampled.saturating_sub(last));
        let whole = since.saturating_sub(self.pace / 8);
        whole.checked_next_multiple_of(self.pace).map_or(1, |up| up / self.pace.max(1)).max(1)
    }

    /// Its session, and the newest message sent in it; 0: none.
    pub fn own(&self) -> Number {
        Number { session: self.own, sequence: self.sequence }
    }

    /// The message with this content, or an introduction where the other end has to receive the session first. `None`: it cannot be encoded.
    pub fn send(&mut self, say: &Outgoing) -> Option<C::Bytes> {
        let peer = self.peer.map_or(0, |peer| peer.newest.session);
        let step = self.step(say.sampled);
        if let Some(most) = C::UNANSWERED {
            let is_met = self.peer.is_some_and(|peer| peer.proved);
            if !is_met || self.sequence.saturating_sub(self.answered).saturating_add(step) > most {
                if self.sequence > 0 {
                    self.begin();
                }
                let [from, to] = [self.own, peer].map(|session| Number { session, sequence: 0 });
                return self.codec.write(&Message { from, to, position: 0.0, strength: Strength::NONE });
            }
        }
        self.sequence = self.sequence.checked_add(step)?;
        self.last = Some(say.sampled);
        *self.sent.get_mut(self.sequence as usize % ROOM)? = say.sampled;
        let received = say.received.filter(|received| received.session == peer).map_or(0, |received| received.sequence);
        self.codec.write(&Message {
            from: self.own(),
            to: Number { session: peer, sequence: received },
            position: say.position,
            strength: say.strength,
        })
    }

    /// Begins the next session, which the other end has to acknowledge.
    fn begin(&mut self) {
        self.own = if self.own >= C::SESSIONS { 1 } else { self.own + 1 };
        (self.sequence, self.answered, self.last) = (0, 0, None);
        self.peer = self.peer.map(|peer| Peer { proved: false, ..peer });
    }

    /// The content of a message that arrived at `now`, in ns by the station's own clock; `None`: it was an introduction.
    ///
    /// # Errors
    /// It is not of this link, or not new: see [`Refusal`].
    pub fn receive(&mut self, bytes: &[u8], now: u64) -> Result<Option<Incoming>, Refusal> {
        let none = Number { session: 0, sequence: 0 };
        let known =
            Known { own: self.own(), answered: self.answered, other: self.peer.map_or(none, |peer| peer.newest) };
        let Message { from, to, position, strength } = self.codec.read(bytes, &known)?;
        let introduces = from.sequence == 0;
        // Shortened messages begin at number 1 in sessions that both ends have begun for each other.
        let names = to.session == self.own && !(introduces && self.sequence > 0);
        let newest = match self.peer {
            Some(peer) if peer.newest.session == from.session => {
                if !introduces && from.sequence <= peer.newest.sequence {
                    return Err(Refusal::Old);
                }
                let newest = if introduces { peer.newest } else { from };
                Peer { newest, proved: names || peer.proved, at: now }
            }
            // A peer that has not proved its presence by acknowledging this session does not block another sender.
            Some(peer) if peer.proved && now.saturating_sub(peer.at) < SILENCE => {
                if follows::<C>(from.session, peer.newest.session) {
                    return Err(Refusal::Old);
                }
                if !follows::<C>(peer.newest.session, from.session) {
                    return Err(Refusal::Session);
                }
                Peer { newest: from, proved: names, at: now }
            }
            _ => Peer { newest: from, proved: names, at: now },
        };
        self.peer = Some(newest);
        if introduces {
            return Ok(None);
        }
        let answered = to.sequence;
        let is_remembered = answered > 0 && answered <= self.sequence && self.sequence - answered < ROOM as u64;
        let is_dated = names && is_remembered;
        if is_dated {
            self.answered = self.answered.max(answered);
        }
        let since = if is_dated { self.sent.get(answered as usize % ROOM).copied() } else { None };
        Ok(Some(Incoming { number: from, since, position, strength }))
    }
}

/// Whether the second session is one of those that follow the first in its run.
fn follows<C: Codec>(first: u64, second: u64) -> bool {
    C::UNANSWERED.is_some() && (1..=NEXT).contains(&(second.wrapping_sub(first) & C::SESSIONS))
}
