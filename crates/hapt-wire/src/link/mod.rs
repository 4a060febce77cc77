//! The messages of a link between two wheels.
//!
//! Each station sends its position at its samples. A [`Session`] makes and checks the messages: numbers, ages, and the accepted sender. It has no clock and
//! no socket, and allocates nothing. A [`Codec`] writes and reads messages:
//!
//! | codec | for | size | who can send |
//! | --- | --- | --- | --- |
//! | [`Datagrams`] | UDP, an untrusted network | 67 bytes | holders of the key |
//! | [`Frames`] | CAN, a closed bus | 8 bytes and the identifier | every node on the bus |
//!
//! **Age without a shared clock.** A message contains the number of the receiver's newest message that its sender had before it sampled the position. So the
//! position is no older than the receiver's own message of that number, whose time the receiver has stored: the bound is the round-trip time, by
//! one clock. Delay, repetition or reordering of a message only increases its age.
//!
//! **Numbers.** A message's number exceeds the last one's by the periods between their samples, at least 1 ([`Session::paced`]): so the receiver has
//! the time between two positions by the sender's clock, and the remote velocity. Numbers in between are never sent.
//!
//! **Sessions.** Each start of a station draws a random session number. A position is used only if its message contains the receiver's own session
//! number, so that messages recorded before this start are refused. A second sender is refused until the first has been silent for [`SILENCE`].

mod can;
mod datagram;
mod session;

use hapt_core::Strength;
use sha2::{Digest, Sha256};

pub use can::Frames;
pub use datagram::{Datagrams, SHORTEST_KEY, SIZE, VERSION};
pub use session::{Codec, Known, Message, SILENCE, Session};

/// The identity of a message: its session, and its number in that session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Number {
    /// The session of its sender.
    pub session: u64,
    /// From 1; 0: none.
    pub sequence: u64,
}

/// A station's content of a message at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outgoing {
    /// The time of the sample, in ns by the station's own clock.
    pub sampled: u64,
    /// In rad (linear: m).
    pub position: f64,
    /// [`hapt_core::LinkEnd::sent_strength`]
    pub strength: Strength,
    /// The newest message that the station had received before the sample.
    pub received: Option<Number>,
}

/// The content of a received message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incoming {
    /// The number to acknowledge in the next message.
    pub number: Number,
    /// The position was sampled after this instant of the receiver's clock, in ns; `None`: its age is unknown, and it must not be used.
    pub since: Option<u64>,
    /// In rad (linear: m), finite.
    pub position: f64,
    /// The part of its torque with which the other end acts, or can act.
    pub strength: Strength,
}

/// The reason that a message is refused. Nothing of it is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Not of the codec's size.
    Size,
    /// Of another version.
    Version(u8),
    /// Its authentication code is not of this key.
    Key,
    /// Of another link, or of a network file with other numbers.
    Link,
    /// From this end of the link: its own message, or another station that was started as this one.
    SameEnd,
    /// Of a second sender, while the first is still sending.
    Session,
    /// Not newer than one that was taken, or of an ended session.
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

    /// Its index in [`Refusal::ALL`].
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
