//! The messages of a link between two wheels, over a network that nobody trusts.
//!
//! Each station sends its position at its samples, in messages of [`SIZE`] bytes with an authentication code under a key that both know.
//! A [`Session`] makes and judges them; it has no clock, no socket and no memory but its own.
//!
//! **Age without a shared clock.** A message names the newest message of the receiver that its sender had before it took the position. So the
//! position is no older than the receiver's own message of that number, whose time the receiver knows: the bound is the time of the round trip, by
//! one clock. A message held back, repeated or reordered by anybody only looks older.
//!
//! **Sessions.** Each start of a station draws a number that has never been before. A position is used only if its message names the
//! receiver's own number: nothing that was recorded before this start counts. A second sender under the same key is refused until the first has been silent for
//! [`SILENCE`].
//!
//! | bytes | content, little-endian |
//! | --- | --- |
//! | 0 | version, [`VERSION`] |
//! | 1 | flags: 1 from the first station of the link |
//! | 2 | the part of the torque that acts, from the second station the largest that can ([`Strength`]) |
//! | 3..11 | which link of which network |
//! | 11..19 | the sender's session |
//! | 19..27 | the message's number in it, from 1 |
//! | 27..35 | the receiver's session, as the sender knows it; 0: not at all |
//! | 35..43 | the receiver's newest message before the sample; 0: none |
//! | 43..51 | the position, a double, in rad (linear: m) |
//! | 51..67 | HMAC-SHA-256 (RFC 2104) of all before it, its first 16 bytes |

use hapt_core::Strength;
use hmac::{Hmac, KeyInit, Mac};
use sha2::{Digest, Sha256};

/// Of a message, in bytes.
pub const SIZE: usize = 67;
/// Of the messages.
pub const VERSION: u8 = 2;
/// The shortest key in bytes.
pub const SHORTEST_KEY: usize = 16;
/// After so long without a message of its session a peer may begin another, in ns.
pub const SILENCE: u64 = 1_000_000_000;
/// Own messages that are remembered: what answers an older one is too old.
const ROOM: usize = 1024;
/// Where the authentication code begins.
const SUM: usize = SIZE - 16;

const FIRST: u8 = 1;

/// A message by its session and its number in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Number {
    /// The session of its sender.
    pub session: u64,
    /// From 1.
    pub sequence: u64,
}

/// What a station has to say at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outgoing {
    /// When the sample was taken, in ns by the station's own clock.
    pub sampled: u64,
    /// In rad (linear: m).
    pub position: f64,
    /// [`hapt_core::LinkEnd::said`]
    pub strength: Strength,
    /// The newest message that it had before the sample.
    pub heard: Option<Number>,
}

/// What a message of the other says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incoming {
    /// To be named in the next message.
    pub number: Number,
    /// The position was taken after this instant of the receiver's clock, in ns; `None`: nobody knows when, and it must not be used.
    pub since: Option<u64>,
    /// In rad (linear: m), finite.
    pub position: f64,
    /// The part of its torque with which the other acts, or can.
    pub strength: Strength,
}

/// Why a message is refused. Nothing of it is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Not [`SIZE`] bytes.
    Size,
    /// Of another version.
    Version(u8),
    /// Not under this key.
    Key,
    /// Of another link, or of a network file with other numbers.
    Link,
    /// From this end of the link: its own message, or another station that was started as this one.
    SameEnd,
    /// Of a second sender, while the first still sends.
    Session,
    /// Not newer than one that was taken.
    Old,
    /// The position is not finite, a flag is unknown, or a number is 0.
    Content,
}

impl Refusal {
    /// All of them.
    pub const ALL: [Refusal; 8] = [
        Refusal::Size,
        Refusal::Version(0),
        Refusal::Key,
        Refusal::Link,
        Refusal::SameEnd,
        Refusal::Session,
        Refusal::Old,
        Refusal::Content,
    ];

    /// Its place in [`Refusal::ALL`].
    pub fn code(self) -> usize {
        match self {
            Refusal::Size => 0,
            Refusal::Version(_) => 1,
            Refusal::Key => 2,
            Refusal::Link => 3,
            Refusal::SameEnd => 4,
            Refusal::Session => 5,
            Refusal::Old => 6,
            Refusal::Content => 7,
        }
    }

    /// What is wrong, and what would be right.
    pub fn sentence(self) -> &'static str {
        match self {
            Refusal::Size => "messages that are not of a link; does another program send to this address?",
            Refusal::Version(_) => "messages of another version of hapt; run the same version at both stations",
            Refusal::Key => "messages under another key; both stations need the same key file",
            Refusal::Link => {
                "messages of another network file, or of one with other numbers; run the same file with the same --set at both stations"
            }
            Refusal::SameEnd => "messages of the same station; one of the two has to run as the other one",
            Refusal::Session => "messages of a second sender; stop one of the two that run as the other station",
            Refusal::Old => "messages that came late or twice",
            Refusal::Content => "messages with a position that is not finite, or with unknown flags",
        }
    }
}

/// The number of a network's link, for [`Session::new`]: stations whose `text` of the network differs have no link in common.
pub fn number(text: &str, link: usize) -> u64 {
    let digest: [u8; 32] = Sha256::digest(text.as_bytes()).into();
    let [a, b, c, d, e, f, g, h, ..] = digest;
    u64::from_le_bytes([a, b, c, d, e, f, g, h]).wrapping_add(link as u64)
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
/// use hapt_wire::link::{Outgoing, Refusal, Session};
///
/// let key = b"not a key for a real network";
/// // The numbers of the sessions are random in earnest.
/// let (mut left, mut right) = (Session::new(key, 7, true, 11), Session::new(key, 7, false, 22));
/// let say = |sampled, heard| Outgoing { sampled, position: 0.5, strength: hapt_core::Strength::NONE, heard };
/// let hello = left.send(&say(1_000, None)).unwrap();
/// let heard = right.receive(&hello, 5_000).unwrap();
/// assert_eq!(heard.since, None); // it might be years old
/// let answer = right.send(&say(6_000, Some(heard.number))).unwrap();
/// let heard = left.receive(&answer, 9_000).unwrap();
/// assert_eq!((heard.position, heard.since), (0.5, Some(1_000)));
/// assert_eq!(left.receive(&answer, 9_500), Err(Refusal::Old));
/// ```
#[derive(Clone)]
pub struct Session {
    mac: Hmac<Sha256>,
    link: u64,
    first: bool,
    own: u64,
    sequence: u64,
    /// When the samples of the last messages were taken.
    sent: [u64; ROOM],
    peer: Option<Peer>,
}

impl core::fmt::Debug for Session {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Session").field("link", &self.link).field("own", &self.own).finish_non_exhaustive()
    }
}

impl Session {
    /// Of the link `link` at its first or second station, under `key`. `own` is a number that was never used under this key, of 64 random
    /// bits; 0 is taken for 1.
    pub fn new(key: &[u8], link: u64, first: bool, own: u64) -> Self {
        // It takes keys of every length.
        let mac = Hmac::new_from_slice(key).unwrap_or_else(|_| Hmac::new(&Default::default()));
        Session { mac, link, first, own: own.max(1), sequence: 0, sent: [0; ROOM], peer: None }
    }

    /// The message that says it.
    pub fn send(&mut self, say: &Outgoing) -> Option<[u8; SIZE]> {
        self.sequence = self.sequence.checked_add(1)?;
        *self.sent.get_mut(self.sequence as usize % ROOM)? = say.sampled;
        let flags = if self.first { FIRST } else { 0 };
        let peer = self.peer.map_or(0, |peer| peer.newest.session);
        let heard = say.heard.filter(|heard| heard.session == peer).map_or(0, |heard| heard.sequence);
        let mut bytes = [0; SIZE];
        let numbers = [self.link, self.own, self.sequence, peer, heard, say.position.to_bits()];
        let (head, rest) = bytes.split_at_mut(3);
        head.copy_from_slice(&[VERSION, flags, say.strength.0]);
        for (place, number) in rest.chunks_exact_mut(8).zip(numbers) {
            place.copy_from_slice(&number.to_le_bytes());
        }
        let (text, place) = bytes.split_at_mut(SUM);
        let sum = self.mac.clone().chain_update(text).finalize().into_bytes();
        place.iter_mut().zip(sum).for_each(|(place, byte)| *place = byte);
        Some(bytes)
    }

    /// What a message says that came at `now`, in ns by the station's own clock.
    ///
    /// # Errors
    /// It is not of this link, or nothing new: see [`Refusal`].
    pub fn receive(&mut self, bytes: &[u8], now: u64) -> Result<Incoming, Refusal> {
        let bytes: &[u8; SIZE] = bytes.try_into().map_err(|_| Refusal::Size)?;
        let (text, sum) = bytes.split_at(SUM);
        let [version, flags, strength, ref rest @ ..] = *text else { return Err(Refusal::Size) };
        if version != VERSION {
            return Err(Refusal::Version(version));
        }
        self.mac.clone().chain_update(text).verify_truncated_left(sum).map_err(|_| Refusal::Key)?;
        let mut numbers = [0; 6];
        for (number, bytes) in numbers.iter_mut().zip(rest.chunks_exact(8)) {
            *number = u64::from_le_bytes(bytes.try_into().map_err(|_| Refusal::Size)?);
        }
        let [link, session, sequence, own, answered, position] = numbers;
        let position = f64::from_bits(position);
        if link != self.link {
            return Err(Refusal::Link);
        }
        if (flags & FIRST != 0) == self.first || session == self.own {
            return Err(Refusal::SameEnd);
        }
        if !position.is_finite() || flags & !FIRST != 0 || session == 0 || sequence == 0 {
            return Err(Refusal::Content);
        }
        let number = Number { session, sequence };
        let proved = own == self.own;
        match self.peer {
            Some(peer) if peer.newest.session == session => {
                if sequence <= peer.newest.sequence {
                    return Err(Refusal::Old);
                }
                self.peer = Some(Peer { newest: number, proved: proved || peer.proved, at: now });
            }
            // Whoever has not proved to be there now, by naming this session, holds up nobody.
            Some(peer) if peer.proved && now.saturating_sub(peer.at) < SILENCE => return Err(Refusal::Session),
            _ => self.peer = Some(Peer { newest: number, proved, at: now }),
        }
        let remembered = answered > 0 && answered <= self.sequence && self.sequence - answered < ROOM as u64;
        let since = if proved && remembered { self.sent.get(answered as usize % ROOM).copied() } else { None };
        Ok(Incoming { number, since, position, strength: Strength(strength) })
    }
}
