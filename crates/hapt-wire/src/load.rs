//! ```text
//! version 1  limits    world
//! version 2  limits    interval, delay, when late  world
//! version 3  limits    interval, delay, when late  recentre  world
//! u8         postcard  f64, f64, code u8           f64       as write() makes it
//! ```
//!
//! A world that states no times keeps version 1. A board that reads only version 1 refuses the others, since it would not enforce the
//! stated times, or keep its origin where it is to slip.

use hapt_core::wheel::Device;
use hapt_core::{Limits, Spec};

use crate::world::{put, take};
use crate::{Crc, Error, Stored, VERSION, write};

/// The largest size of a packed world of 4 bodies and 8 couplings.
pub const LARGEST: usize = 1024;

/// The checksum of zlib, PNG and Ethernet: polynomial 0x04c11db7 reflected, from 0xffffffff, inverted.
const HASH: Crc<u32> = Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// The version of a packed world that states its times.
const STATES_TIMES: u8 = 2;

/// The version of a packed world whose origin slips while the puck rests.
const RECENTRES: u8 = 3;

/// The identity of a packed world: the CRC-32 of its bytes.
pub fn hash(bytes: &[u8]) -> u32 {
    HASH.checksum(bytes)
}

/// Writes a world and its supervisor's limits into `room`, for a board to compile, and returns the used part.
///
/// Errors as [`write()`] does.
pub fn pack<'a>(spec: &Spec, limits: &Limits, room: &'a mut [u8]) -> Result<&'a [u8], Error> {
    let mut at = 0;
    let version = match (limits.recentre > 0.0, limits.time.is_stated()) {
        (true, _) => RECENTRES,
        (false, true) => STATES_TIMES,
        (false, false) => VERSION,
    };
    put(room, &mut at, &version)?;
    put(room, &mut at, limits)?;
    if version >= STATES_TIMES {
        put(room, &mut at, &limits.time)?;
    }
    if version >= RECENTRES {
        put(room, &mut at, &limits.recentre)?;
    }
    at += write(spec, room.get_mut(at..).ok_or(Error::NoRoom)?)?.len();
    room.get(..at).ok_or(Error::NoRoom)
}

/// Writes a board's wheel: the device with the damping and friction for effects, half of its steering range in rad, then its world as [`pack`] does.
///
/// Errors as [`write()`] does.
pub fn pack_wheel<'a>(
    device: &Device,
    half: f64,
    spec: &Spec,
    limits: &Limits,
    room: &'a mut [u8],
) -> Result<&'a [u8], Error> {
    let mut at = 0;
    put(room, &mut at, &VERSION)?;
    put(room, &mut at, device)?;
    put(room, &mut at, &half)?;
    at += pack(spec, limits, room.get_mut(at..).ok_or(Error::NoRoom)?)?.len();
    room.get(..at).ok_or(Error::NoRoom)
}

/// Reads the part that [`pack_wheel`] writes before the world; returns it with the bytes after it.
pub(crate) fn unpack_wheel(bytes: &[u8]) -> Result<(Device, f64, &[u8]), Error> {
    let (version, mut rest) = bytes.split_first().ok_or(Error::Cut)?;
    if *version != VERSION {
        return Err(Error::Version { given: *version });
    }
    let device = take(&mut rest)?;
    Ok((device, take(&mut rest)?, rest))
}

/// Reads the bytes of [`pack`]. The core checks the ranges of the numbers when it compiles them.
pub fn unpack<const B: usize, const C: usize>(bytes: &[u8]) -> Result<(Limits, Stored<B, C>), Error> {
    let (version, mut rest) = bytes.split_first().ok_or(Error::Cut)?;
    if !(VERSION..=RECENTRES).contains(version) {
        return Err(Error::Version { given: *version });
    }
    let mut limits: Limits = take(&mut rest)?;
    if *version >= STATES_TIMES {
        limits.time = take(&mut rest)?;
    }
    if *version >= RECENTRES {
        limits.recentre = take(&mut rest)?;
    }
    Ok((limits, Stored::read(rest)?))
}
