//! Deserialisation of messages. A board links this: nothing here can panic, which every compiler can prove. postcard's own reader copies
//! slices whose length some compilers do not track, so that a bounds check with a panic remains.

use postcard::de_flavors::Flavor;
use postcard::{Deserializer, Error, Result};
use serde::Deserialize;

/// The bytes that are still to be read.
struct Rest<'de>(&'de [u8]);

impl<'de> Flavor<'de> for Rest<'de> {
    type Remainder = &'de [u8];
    type Source = &'de [u8];

    #[inline(always)]
    fn pop(&mut self) -> Result<u8> {
        let (first, rest) = self.0.split_first().ok_or(Error::DeserializeUnexpectedEnd)?;
        self.0 = rest;
        Ok(*first)
    }

    #[inline(always)]
    fn try_take_n(&mut self, count: usize) -> Result<&'de [u8]> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or(Error::DeserializeUnexpectedEnd)?;
        self.0 = rest;
        Ok(taken)
    }

    fn finalize(self) -> Result<&'de [u8]> {
        Ok(self.0)
    }
}

/// A value, and the bytes after it.
pub(crate) fn read<'de, T: Deserialize<'de>>(bytes: &'de [u8]) -> Result<(T, &'de [u8])> {
    let mut from = Deserializer::from_flavor(Rest(bytes));
    let value = T::deserialize(&mut from)?;
    Ok((value, from.finalize()?))
}
