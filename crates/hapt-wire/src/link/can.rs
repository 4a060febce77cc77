//! Messages for a bus that is closed: one classical CAN frame each.

use hapt_core::Strength;
use sha2::{Digest, Sha256};

use super::{Codec, Known, Message, Number, Refusal};

/// The version of the frames.
const VERSION: u8 = 1;
/// The number of bits of a session's number.
const SESSION: u32 = 28;
/// The number of bits of the check in the identifier, below the kind.
const CHECKED: u32 = 13;
/// The identifier's bit of the kind, 1 for an introduction.
const KIND: u32 = 1 << CHECKED;
/// The lowest bits of the end, of 6 bits, and of the range, of 9 bits, in the identifier.
const END: u32 = 14;
const RANGE: u32 = 20;
/// The number of steps of a position per radian (linear: metre).
const STEPS: f64 = (1_u32 << 22) as f64;

/// Classical CAN frames with 29-bit identifiers and 8 bytes, for a closed bus: every sender on it is trusted.
///
/// A frame is written as 12 bytes: 4 of its identifier, little-endian, and 8 of data.
///
/// | bits of the identifier | content |
/// | --- | --- |
/// | 20..29 | the range of identifiers that the network has on the bus, 1 to 511 |
/// | 14..20 | the end: twice the link's place in the network file, 1 more from its second station |
/// | 13 | 0: a position, 1: an introduction |
/// | 0..13 | the check's lower bits |
///
/// | bytes of a position | content, little-endian |
/// | --- | --- |
/// | 0..4 | the position in 2^-22 rad (linear: m), signed: ±512 rad |
/// | 4 | the part of the torque that acts, from the second station the largest that can ([`Strength`]) |
/// | 5 | the message's number in its session, its lower 8 bits |
/// | 6 | the receiver's newest message before the sample, its lower 8 bits |
/// | 7 | the check's upper 8 bits |
///
/// An introduction has the sender's session in bits 0 to 27, the receiver's session, if the sender has received it, in 28 to 55 (0: unknown), and
/// the check in byte 7.
///
/// The check is the first 21 bits of SHA-256 of the frame's content *in full*: the network's link, both sessions, both numbers with 64 bits, position and
/// strength. It detects frames of other networks and of other sessions. It is no authentication: there is no key, and 21 bits are guessed in minutes.
///
/// **Numbers that wrap.** A bus may lose frames and delay them for any time. The frames of an end arrive in their order, or at least no frame of a session is
/// overtaken by one whose number is more than 128 above its own. Then every number and every echo is decoded correctly:
///
/// * Let a be the newest own message that the other end has acknowledged, and n the newest that was sent. [`Session`](super::Session) sends none
///   beyond n = a + 127: it begins a new session instead. The echo in a message is in a..=n, as messages are taken in their order, and
///   a sender's echoes do not decrease. These are at most 128 numbers, so their lower 8 bits distinguish them.
/// * Let S be the newest message taken. A newer one has its number in S + 1..=S + 127, since its sender has received no answer beyond S. An older one, by
///   the bound on overtaking, is in S - 128..=S. These are 256 numbers, so 8 bits distinguish them, and the older are refused.
/// * Sessions change in pairs: an end that receives a new session begins one itself, unless it has sent nothing in its own. Frames of an ended
///   pair were sent before the introduction that ended it, so they arrive before it.
///
/// A frame that arrives later still, for example from the queue of an earlier program, has to pass the check, which one in 2 million does.
#[derive(Clone, Debug)]
pub struct Frames {
    link: u64,
    /// The identifier's bits of the range and of the own end.
    own: u32,
}

impl Frames {
    /// The ranges of identifiers. The identifiers below are those of moteus drives.
    pub const RANGES: core::ops::RangeInclusive<u16> = 1..=511;
    /// The default range. Identifiers of 11 bits below 0x400 have priority on the bus.
    pub const RANGE: u16 = 256;
    /// Positions are rounded to the nearest multiple of this, in rad (linear: m).
    pub const STEP: f64 = 1.0 / STEPS;
    /// The largest number of links in a range.
    pub const LINKS: usize = 32;
    /// The largest number of bits of a frame on the bus, with stuffed bits and the space after it.
    pub const BITS: u32 = 160;

    /// The codec of the link `link` ([`number`](super::number)), the network's `at`-th from 0, at its first or second station. `None`: the range
    /// or the link has no identifier.
    pub fn new(range: u16, at: usize, link: u64, first: bool) -> Option<Self> {
        if !Frames::RANGES.contains(&range) || at >= Frames::LINKS {
            return None;
        }
        let end = 2 * at as u32 + u32::from(!first);
        Some(Frames { link, own: u32::from(range) << RANGE | end << END })
    }

    /// The bits that the identifiers of a range share, and which bits these are.
    pub fn filter(range: u16) -> [u32; 2] {
        [u32::from(range) << RANGE, 0x1ff << RANGE]
    }

    /// Whether a frame with this identifier is of this link, from either end.
    pub fn is_of_link(&self, id: u32) -> bool {
        (id ^ self.own) >> (END + 1) == 0
    }

    /// The check of a message from `end`; its position in steps.
    fn check(&self, end: u32, message: &Message, position: i32) -> u32 {
        let Message { from, to, strength, .. } = *message;
        let mut sum = Sha256::new();
        sum.update(b"hapt link over CAN");
        sum.update([VERSION, strength.0]);
        sum.update(end.to_le_bytes());
        sum.update(position.to_le_bytes());
        for number in [self.link, from.session, from.sequence, to.session, to.sequence] {
            sum.update(number.to_le_bytes());
        }
        let [a, b, c, ..]: [u8; 32] = sum.finalize().into();
        u32::from_le_bytes([a, b, c, 0]) & ((1 << (CHECKED + 8)) - 1)
    }

    /// The message of a position frame, with its numbers completed by those known; the check is not verified here.
    fn numbered(data: &[u8; 7], known: &Known) -> Option<Message> {
        let [.., strength, number, echo] = *data;
        let step = number.wrapping_sub(known.other.sequence as u8);
        let echoed = known.answered + u64::from(echo.wrapping_sub(known.answered as u8));
        let is_new = known.other.session > 0 && (1..=127).contains(&step);
        (is_new && echoed <= known.own.sequence).then_some(Message {
            from: Number { sequence: known.other.sequence + u64::from(step), ..known.other },
            to: Number { sequence: echoed, ..known.own },
            position: 0.0,
            strength: Strength(strength),
        })
    }
}

impl Codec for Frames {
    type Bytes = [u8; 12];
    const SESSIONS: u64 = (1 << SESSION) - 1;
    const UNANSWERED: Option<u64> = Some(127);

    fn write(&self, message: &Message) -> Option<[u8; 12]> {
        let Message { from, to, position, strength } = *message;
        let introduces = from.sequence == 0;
        let steps = position * STEPS;
        // A NaN is outside of every range.
        if !(-f64::from(i32::MAX)..=f64::from(i32::MAX)).contains(&steps) {
            return None;
        }
        let steps = (steps + if steps < 0.0 { -0.5 } else { 0.5 }) as i32;
        let check = self.check(self.own, message, steps);
        let id = self.own | if introduces { KIND } else { 0 } | check & (KIND - 1);
        let [a, b, c, d] = steps.to_le_bytes();
        let payload = if introduces {
            (from.session | to.session << SESSION).to_le_bytes()
        } else {
            [a, b, c, d, strength.0, from.sequence as u8, to.sequence as u8, 0]
        };
        let mut bytes = [0; 12];
        let (place, data) = bytes.split_at_mut(4);
        place.copy_from_slice(&id.to_le_bytes());
        data.copy_from_slice(&payload);
        *data.last_mut()? = (check >> CHECKED) as u8;
        Some(bytes)
    }

    fn read(&self, bytes: &[u8], known: &Known) -> Result<Message, Refusal> {
        let bytes: &[u8; 12] = bytes.try_into().map_err(|_| Refusal::Size)?;
        let [i, d, e, n, data @ .., upper] = *bytes;
        let id = u32::from_le_bytes([i, d, e, n]);
        let end = id >> END << END;
        if !self.is_of_link(id) {
            return Err(Refusal::Link);
        }
        if end == self.own {
            return Err(Refusal::SameEnd);
        }
        let check = id & (KIND - 1) | u32::from(upper) << CHECKED;
        let [a, b, c, d, ..] = data;
        let steps = i32::from_le_bytes([a, b, c, d]);
        if id & KIND == 0 {
            let message = Frames::numbered(&data, known).ok_or(Refusal::Old)?;
            let fits = self.check(end, &message, steps) == check;
            return if fits {
                Ok(Message { position: f64::from(steps) / STEPS, ..message })
            } else {
                Err(Refusal::Old)
            };
        }
        let [a, b, c, d, e, f, g] = data;
        let both = u64::from_le_bytes([a, b, c, d, e, f, g, 0]);
        let [from, to] = [both & Frames::SESSIONS, both >> SESSION].map(|session| Number { session, sequence: 0 });
        let message = Message { from, to, position: 0.0, strength: Strength::NONE };
        if self.check(end, &message, 0) != check {
            return Err(Refusal::Link);
        }
        if from.session == 0 { Err(Refusal::Content) } else { Ok(message) }
    }
}
