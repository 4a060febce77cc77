//! What a station's end of a link does with messages, however they are written.

use hapt_core::Strength;

use super::{Incoming, Number, Outgoing, Refusal};

/// After so long without a message of its session a peer may begin another, in ns.
pub const SILENCE: u64 = 1_000_000_000;
/// Own messages that are remembered: what answers an older one is too old.
const ROOM: usize = 1024;
/// Sessions after another that are known to be of the same run.
const NEXT: u64 = 16;

/// What a message says, in full.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Message {
    /// The message: its sender's session and its number. Number 0 is an introduction, which says nothing but both sessions.
    pub from: Number,
    /// The receiver's session as the sender knows it, and the receiver's newest message before the sample; 0: none.
    pub to: Number,
    /// In rad (linear: m).
    pub position: f64,
    /// Of the first end: the part with which it acts. Of the second: the largest with which it can.
    pub strength: Strength,
}

/// What the receiver of a message knows before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Known {
    /// Its own session, and its newest message in it.
    pub own: Number,
    /// The newest of its messages that the other has named.
    pub answered: u64,
    /// The other's session, and the newest message that was taken; 0: none.
    pub other: Number,
}

/// How the messages of one end of a link are written and read. It has no state.
pub trait Codec {
    /// A message as it is sent.
    type Bytes: AsRef<[u8]> + Copy + Send + 'static;
    /// Sessions have the numbers from 1 to this, one less than a power of 2.
    const SESSIONS: u64;
    /// How many messages of a session may be unanswered, where a message is written so short that it is read by what is [`Known`]. Sessions are
    /// then introduced before, and replaced when more are unanswered. `None`: each message says all by itself.
    const UNANSWERED: Option<u64>;

    /// `None`: it cannot be said, such as a position out of range.
    fn write(&self, message: &Message) -> Option<Self::Bytes>;

    /// The message of these bytes.
    ///
    /// # Errors
    /// They are none of the other end of this link.
    fn read(&self, bytes: &[u8], known: &Known) -> Result<Message, Refusal>;
}

/// The other station.
#[derive(Clone, Copy, Debug)]
struct Peer {
    newest: Number,
    /// It has named this session: it is there now.
    proved: bool,
    /// When its newest message came.
    at: u64,
}

/// One station's end of a link: what makes and judges its messages.
///
/// ```
/// use hapt_wire::link::{Datagrams, Outgoing, Refusal, Session};
///
/// let key = b"not a key for a real network";
/// // The numbers of the sessions are random in earnest.
/// let mut left = Session::new(Datagrams::new(key, 7, true), 11);
/// let mut right = Session::new(Datagrams::new(key, 7, false), 22);
/// let say = |sampled, heard| Outgoing { sampled, position: 0.5, strength: hapt_core::Strength::NONE, heard };
/// let hello = left.send(&say(1_000, None)).unwrap();
/// let heard = right.receive(&hello, 5_000)?.unwrap();
/// assert_eq!(heard.since, None); // it might be years old
/// let answer = right.send(&say(6_000, Some(heard.number))).unwrap();
/// let heard = left.receive(&answer, 9_000)?.unwrap();
/// assert_eq!((heard.position, heard.since), (0.5, Some(1_000)));
/// assert_eq!(left.receive(&answer, 9_500), Err(Refusal::Old));
/// # Ok::<(), Refusal>(())
/// ```
#[derive(Clone, Debug)]
pub struct Session<C> {
    codec: C,
    own: u64,
    sequence: u64,
    /// By so many ns between two samples their messages' numbers differ by 1; 0: always.
    pace: u64,
    /// When the sample of the last message was taken.
    last: Option<u64>,
    /// The newest own message that the other has named.
    answered: u64,
    /// When the samples of the last messages were taken.
    sent: [u64; ROOM],
    peer: Option<Peer>,
}

impl<C: Codec> Session<C> {
    /// `own` is a number that was never used before, of 64 random bits.
    pub fn new(codec: C, own: u64) -> Self {
        let own = (own & C::SESSIONS).max(1);
        Session { codec, own, sequence: 0, pace: 0, last: None, answered: 0, sent: [0; ROOM], peer: None }
    }

    /// The same with numbers that tell the time between samples, which usually is `pace` ns: they differ by that time over the pace, rounded
    /// up to a whole number from an eighth on, and by 1 at least. So the time is no longer than 9/8 of what the numbers say.
    pub fn paced(self, pace: u64) -> Self {
        Session { pace, ..self }
    }

    /// By how much the number of a message with a sample of this instant is above the last.
    fn step(&self, sampled: u64) -> u64 {
        let since = self.last.map_or(0, |last| sampled.saturating_sub(last));
        let whole = since.saturating_sub(self.pace / 8);
        whole.checked_next_multiple_of(self.pace).map_or(1, |up| up / self.pace.max(1)).max(1)
    }

    /// Its session, and the newest message that it has sent in it; 0: none.
    pub fn own(&self) -> Number {
        Number { session: self.own, sequence: self.sequence }
    }

    /// The message that says it, or an introduction where the other has to know the session first. `None`: it cannot be said.
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
        let heard = say.heard.filter(|heard| heard.session == peer).map_or(0, |heard| heard.sequence);
        self.codec.write(&Message {
            from: self.own(),
            to: Number { session: peer, sequence: heard },
            position: say.position,
            strength: say.strength,
        })
    }

    /// The next session: the other has to name it.
    fn begin(&mut self) {
        self.own = if self.own >= C::SESSIONS { 1 } else { self.own + 1 };
        (self.sequence, self.answered, self.last) = (0, 0, None);
        self.peer = self.peer.map(|peer| Peer { proved: false, ..peer });
    }

    /// What a message says that came at `now`, in ns by the station's own clock; `None`: it was an introduction.
    ///
    /// # Errors
    /// It is not of this link, or nothing new: see [`Refusal`].
    pub fn receive(&mut self, bytes: &[u8], now: u64) -> Result<Option<Incoming>, Refusal> {
        let none = Number { session: 0, sequence: 0 };
        let known =
            Known { own: self.own(), answered: self.answered, other: self.peer.map_or(none, |peer| peer.newest) };
        let Message { from, to, position, strength } = self.codec.read(bytes, &known)?;
        let introduces = from.sequence == 0;
        // Messages that are read by what is known begin at 1 in sessions that both have begun for each other.
        let names = to.session == self.own && !(introduces && self.sequence > 0);
        let newest = match self.peer {
            Some(peer) if peer.newest.session == from.session => {
                if !introduces && from.sequence <= peer.newest.sequence {
                    return Err(Refusal::Old);
                }
                let newest = if introduces { peer.newest } else { from };
                Peer { newest, proved: names || peer.proved, at: now }
            }
            // Whoever has not proved to be there now, by naming this session, holds up nobody.
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

/// Whether the second session is one of the next of the run of the first.
fn follows<C: Codec>(first: u64, second: u64) -> bool {
    C::UNANSWERED.is_some() && (1..=NEXT).contains(&(second.wrapping_sub(first) & C::SESSIONS))
}
