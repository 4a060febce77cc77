//! Messages for an untrusted network.

use hapt_core::Strength;
use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;

use super::{Codec, Known, Message, Number, Refusal};

/// The size of a datagram, in bytes.
pub const SIZE: usize = 67;
/// The version of the datagrams.
pub const VERSION: u8 = 2;
/// The shortest key in bytes.
pub const SHORTEST_KEY: usize = 16;
/// The offset of the authentication code.
const SUM: usize = SIZE - 16;

const FIRST: u8 = 1;

/// Datagrams of [`SIZE`] bytes with an authentication code under a key of both stations. Numbers have 64 bits, and never wrap.
///
/// | bytes | content, little-endian |
/// | --- | --- |
/// | 0 | version, [`VERSION`] |
/// | 1 | flags: 1 from the first station of the link |
/// | 2 | the part of the torque that acts, from the second station the largest that can ([`Strength`]) |
/// | 3..11 | the number of the link ([`number`](super::number)) |
/// | 11..19 | the sender's session |
/// | 19..27 | the message's number in it, from 1 |
/// | 27..35 | the receiver's session, if the sender has received it; 0: unknown |
/// | 35..43 | the receiver's newest message before the sample; 0: none |
/// | 43..51 | the position, a double, in rad (linear: m) |
/// | 51..67 | HMAC-SHA-256 (RFC 2104) of all before it, its first 16 bytes |
#[derive(Clone)]
pub struct Datagrams {
    mac: Hmac<Sha256>,
    link: u64,
    first: bool,
}

impl core::fmt::Debug for Datagrams {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Datagrams").field("link", &self.link).field("first", &self.first).finish_non_exhaustive()
    }
}

impl Datagrams {
    /// The codec of the link `link` ([`number`](super::number)) at its first or second station, under `key`.
    pub fn new(key: &[u8], link: u64, first: bool) -> Self {
        // HMAC takes keys of every length: this does not fail.
        let mac = Hmac::new_from_slice(key).unwrap_or_else(|_| Hmac::new(&Default::default()));
        Datagrams { mac, link, first }
    }
}

impl Codec for Datagrams {
    type Bytes = [u8; SIZE];
    const SESSIONS: u64 = u64::MAX;
    const UNANSWERED: Option<u64> = None;

    fn write(&self, message: &Message) -> Option<[u8; SIZE]> {
        let Message { from, to, position, strength } = *message;
        let flags = if self.first { FIRST } else { 0 };
        let numbers = [self.link, from.session, from.sequence, to.session, to.sequence, position.to_bits()];
        let mut bytes = [0; SIZE];
        let (head, rest) = bytes.split_at_mut(3);
        head.copy_from_slice(&[VERSION, flags, strength.0]);
        for (place, number) in rest.chunks_exact_mut(8).zip(numbers) {
            place.copy_from_slice(&number.to_le_bytes());
        }
        let (text, place) = bytes.split_at_mut(SUM);
        let sum = self.mac.clone().chain_update(text).finalize().into_bytes();
        place.iter_mut().zip(sum).for_each(|(place, byte)| *place = byte);
        Some(bytes)
    }

    fn read(&self, bytes: &[u8], known: &Known) -> Result<Message, Refusal> {
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
        if (flags & FIRST != 0) == self.first || session == known.own.session {
            return Err(Refusal::SameEnd);
        }
        if !position.is_finite() || flags & !FIRST != 0 || session == 0 || sequence == 0 {
            return Err(Refusal::Content);
        }
        let [from, to] = [(session, sequence), (own, answered)].map(|(session, sequence)| Number { session, sequence });
        Ok(Message { from, to, position, strength: Strength(strength) })
    }
}
