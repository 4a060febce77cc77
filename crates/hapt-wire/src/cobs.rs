//! Consistent overhead byte stuffing: no 0 in what is stuffed (Cheshire and Baker, IEEE/ACM Transactions on Networking 7(2), 1999).
//!
//! Each block is a code from 1 to 255 and one byte less than that of the message, none of them 0. Behind a block stands a 0 of the message,
//! but not behind one of code 255, nor behind the last. A board links this: nothing here can panic.

use postcard::ser_flavors::Flavor;
use postcard::{Error, Result};

/// The code of a block that no 0 ends.
const FULL: u8 = 255;

/// Stuffs a message as its bytes come, and ends it with a 0.
pub(crate) struct Stuffed<'a> {
    room: &'a mut [u8],
    /// Where the block's code stands, and what it would be.
    place: usize,
    code: u8,
    /// Where the next byte goes.
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

    // Every number of every message comes by here: one copy keeps the firmware small.
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

/// Turns what was stuffed, without its last 0, into the message in the same place; `None` where it is cut.
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
