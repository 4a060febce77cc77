//! ```text
//! COBS( message in postcard   CRC-16/IBM-3740 of it, little-endian )   0
//! ```
//!
//! Only the last byte of a frame is 0, so that a reader resynchronises at the next 0.

use postcard::ser_flavors::crc::CrcModifier;
use serde::{Deserialize, Serialize};

use crate::bytes::read;
use crate::cobs::{Stuffed, unstuff};
use crate::{Error, SUM};

/// Writes a message as one frame into `room`, and returns the used part: the message, 4 bytes, and one more for each 254.
pub fn frame<'a, T: Serialize>(message: &T, room: &'a mut [u8]) -> Result<&'a [u8], Error> {
    postcard::serialize_with_flavor(message, CrcModifier::new(Stuffed::new(room), SUM.digest()))
        .map_err(|_| Error::NoRoom)
}

/// Finds frames of at most N bytes in a stream of bytes. Incomplete, corrupted, too long and unknown frames are skipped and counted.
#[derive(Clone, Copy, Debug)]
pub struct Reader<const N: usize> {
    bytes: [u8; N],
    length: usize,
    /// The number of invalid frames.
    pub refused: u32,
}

impl<const N: usize> Default for Reader<N> {
    fn default() -> Self {
        Reader::new()
    }
}

impl<const N: usize> Reader<N> {
    /// A reader at the start of a frame.
    pub const fn new() -> Self {
        Reader { bytes: [0; N], length: 0, refused: 0 }
    }

    /// Takes a byte; the last one of a frame returns its message.
    pub fn push<'a, T: Deserialize<'a>>(&'a mut self, byte: u8) -> Option<T> {
        if byte != 0 {
            // A frame that is too long is refused at its end.
            if let Some(place) = self.bytes.get_mut(self.length) {
                *place = byte;
            }
            self.length = self.length.saturating_add(1);
            return None;
        }
        let length = core::mem::take(&mut self.length);
        if length == 0 {
            // A 0 after a 0: a writer sends one before its frame.
            return None;
        }
        let message = self.bytes.get_mut(..length).and_then(|stuffed| {
            let (message, sum) = unstuff(stuffed)?.split_last_chunk()?;
            if SUM.checksum(message) != u16::from_le_bytes(*sum) {
                return None;
            }
            let (message, rest) = read(message).ok()?;
            rest.is_empty().then_some(message)
        });
        if message.is_none() {
            self.refused = self.refused.saturating_add(1);
        }
        message
    }
}
