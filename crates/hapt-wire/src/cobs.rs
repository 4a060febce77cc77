//! Consistent overhead byte stuffing: the encoded message contains no 0 (Cheshire and Baker, IEEE/ACM Transactions on Networking 7(2), 1999).
//!
//! Each block is a code n from 1 to 255 and n - 1 bytes of the message, none of them 0. Each block stands for its bytes and a 0 of the
//! message, except one of code 255 and the last. A board links this: nothing here can panic.

use postcard::ser_flavors::Flavor;
use postcard::{Error, Result};

/// The code of a block without a 0 at its end.
const FULL: u8 = 255;

/// Stuffs a message byte by byte, and ends it with a 0.
pub(crate) struct Stuffed<'a> {
    room: &'a mut [u8],
    /// The index of the block's code, and its value so far.
    place: usize,
    code: u8,
    /// The index of the next byte.
    at: usize,
}

impl<'a> Stuffed<'a> {
    pub fn new(room: &'a mut [u8]) -> Self {
        Stuffed { room, place: 0, code: 1, at: 1 }
    }

    fn put(&mut self, at: usize, byte: u8) -> Result<()> {
        *self.room.get_mut(at).ok_or(Error::SerializeBufferFull)? = byte;
        Ok(())
    }

    fn end_block(&mut self) -> Result<()> {
        self.put(self.place, self.code)?;
        (self.place, self.code) = (self.at, 1);
        self.at += 1;
        Ok(())
    }
}

impl<'a> Flavor for Stuffed<'a> {
    type Output = &'a [u8];

    // Every number of every message passes through this function: a single copy keeps the firmware small.
    #[inline(never)]
    fn try_push(&mut self, byte: u8) -> Result<()> {
        if byte == 0 {
            return self.end_block();
        }
        self.put(self.at, byte)?;
        self.at += 1;
        self.code += 1;
        if self.code == FULL { self.end_block() } else { Ok(()) }
    }

    fn finalize(mut self) -> Result<&'a [u8]> {
        self.put(self.place, self.code)?;
        self.put(self.at, 0)?;
        self.room.get(..=self.at).ok_or(Error::SerializeBufferFull)
    }
}

/// Decodes a frame without its last 0 in place; `None` where it is incomplete.
pub(crate) fn unstuff(bytes: &mut [u8]) -> Option<&[u8]> {
    let (mut from, mut to) = (0, 0);
    while let Some(&code) = bytes.get(from) {
        let end = from + usize::from(code.max(1));
        for at in from + 1..end {
            *bytes.get_mut(to)? = *bytes.get(at)?;
            to += 1;
        }
        from = end;
        if code != FULL && from < bytes.len() {
            *bytes.get_mut(to)? = 0;
            to += 1;
        }
    }
    bytes.get(..to)
}
