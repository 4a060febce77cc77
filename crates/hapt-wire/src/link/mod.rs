//! The messages of a link between two wheels.
//!
//! Each station sends its position at its samples. A [`Session`] makes and judges the messages: numbers, ages, and whom it listens to. It has no clock, no
//! socket and no memory but its own. How a message is written is its [`Codec`]:
//!
//! | codec | for | size | who can send |
//! | --- | --- | --- | --- |
//! | [`Datagrams`] | UDP, a network that nobody trusts | 67 bytes | who has the key |
//! | [`Frames`] | CAN, a bus that is closed | 8 bytes and the identifier | who is on the bus |
//!
//! **Age without a shared clock.** A message names the newest message of the receiver that its sender had before it took the position. So the
//! position is no older than the receiver's own message of that number, whose time the receiver knows: the bound is the time of the round trip, by
//! one clock. A message held back, repeated or reordered by anybody only looks older.
//!
//! **Numbers.** A message's number is above the last one's by the periods between their samples, 1 at least ([`Session::paced`]): so the receiver knows
//! the time between two positions by the sender's clock, and the other's velocity. Numbers in between are never sent.
//!
//! **Sessions.** Each start of a station draws a number that has never been before. A position is used only if its message names the
//! receiver's own number: nothing that was recorded before this start counts. A second sender is refused until the first has been silent for
//! [`SILENCE`].

mod can;
mod datagram;
mod session;

use hapt_core::Strength;
use sha2::{Digest, Sha256};

pub use can::Frames;
pub use datagram::{Datagrams, SHORTEST_KEY, SIZE, VERSION};
pub use session::{Codec, Known, Message, SILENCE, Session};

/// A message by its session and its number in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Number {
    /// The session of its sender.
    pub session: u64,
    /// From 1; 0: none.
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
    /// Not of the codec's size.
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
    /// Not newer than one that was taken, or of a session that is over.
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
