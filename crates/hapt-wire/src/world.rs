//! ```text
//! version 1  settings                        bodies, each  couplings, each  checksum
//! version 2  settings, bodies_every          bodies, each  couplings, each  checksum
//! version 3  settings, bodies_every, filter  bodies, each  couplings, each  checksum
//! u8         postcard, u32, f64              postcard      postcard         CRC-16/IBM-3740 of all before it, little-endian u16
//! ```
//!
//! A world whose bodies step at every sample by the measured position keeps version 1. A board that reads only version 1 refuses the others,
//! since it would step the bodies too often, or use another position.

use core::fmt;

use hapt_core::{Body, Coupling, End, Estimator, Law, Method, Output, Spec};
use serde::{Deserialize, Serialize};

use crate::{SUM, coupling};

/// The first byte of a world, the version of the format.
pub const VERSION: u8 = 1;

/// The version of a world whose bodies do not step at every sample.
const BODIES_EVERY: u8 = 2;

/// The version of a world with a filtered position.
const FILTER: u8 = 3;

const SUM_BYTES: usize = 2;

/// The reason that bytes are not a world, or that a world does not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// The room for the bytes is too small.
    NoRoom,
    /// The bytes are incomplete.
    Cut,
    /// The bytes are of another version.
    Version {
        /// The first byte.
        given: u8,
    },
    /// The checksum is wrong: a byte is corrupted.
    Checksum,
    /// The checksum is right, but the bytes are not a world.
    NotAWorld,
    /// More bodies than there is room for.
    TooManyBodies {
        /// The number in the bytes.
        given: usize,
        /// The capacity.
        room: usize,
    },
    /// More couplings than there is room for.
    TooManyCouplings {
        /// The number in the bytes.
        given: usize,
        /// The capacity.
        room: usize,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Error::NoRoom => f.write_str("the world's bytes do not fit into the room given for them"),
            Error::Cut => f.write_str("the bytes end before the world is complete"),
            Error::Version { given } => {
                write!(f, "a world of version {given}, where this reads versions {VERSION} to {FILTER}")
            }
            Error::Checksum => f.write_str("the checksum is wrong: a byte is corrupted"),
            Error::NotAWorld => f.write_str("the bytes are not a world"),
            Error::TooManyBodies { given, room } => write!(f, "{given} bodies, where there is room for {room}"),
            Error::TooManyCouplings { given, room } => write!(f, "{given} couplings, where there is room for {room}"),
        }
    }
}

impl core::error::Error for Error {}

/// A spec without its lists, which follow it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Settings {
    period: f64,
    method: Method,
    output: Output,
    advance: u32,
    estimator: Estimator,
    count: Option<f64>,
    limit: Option<f64>,
    levels: Option<u32>,
    bodies: u8,
    couplings: u8,
}

/// A world read from bytes, with a capacity of B bodies and C couplings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stored<const B: usize, const C: usize> {
    settings: Settings,
    bodies_every: u32,
    filter: Option<f64>,
    bodies: [Body; B],
    couplings: [Coupling; C],
}

/// Writes a world into `room` and returns the used part: about 20 bytes, 25 for each body and 20 for each coupling.
///
/// Errors: [`Error::NoRoom`]; more than 255 bodies or couplings; [`Error::NotAWorld`] for a limit on a law that takes none.
pub fn write<'a>(spec: &Spec, room: &'a mut [u8]) -> Result<&'a [u8], Error> {
    let few = |given: usize| u8::try_from(given).ok();
    let (given, room_of_a_byte) = (spec.bodies.len(), 255);
    let bodies = few(given).ok_or(Error::TooManyBodies { given, room: room_of_a_byte })?;
    let given = spec.couplings.len();
    let couplings = few(given).ok_or(Error::TooManyCouplings { given, room: room_of_a_byte })?;
    let &Spec { period, method, output, advance, bodies_every, estimator, count, limit, levels, .. } = spec;
    let settings = Settings { period, method, output, advance, estimator, count, limit, levels, bodies, couplings };
    let mut at = 0;
    let version = match (bodies_every, spec.filter) {
        (1, None) => VERSION,
        (_, None) => BODIES_EVERY,
        (_, Some(_)) => FILTER,
    };
    put(room, &mut at, &version)?;
    put(room, &mut at, &settings)?;
    if version >= BODIES_EVERY {
        put(room, &mut at, &bodies_every)?;
    }
    if let Some(filter) = &spec.filter {
        put(room, &mut at, filter)?;
    }
    for body in spec.bodies {
        put(room, &mut at, body)?;
    }
    for coupling in spec.couplings {
        put(room, &mut at, &coupling::Coupling::new(coupling)?)?;
    }
    let sum = SUM.checksum(room.get(..at).ok_or(Error::NoRoom)?);
    room.get_mut(at..at + SUM_BYTES).ok_or(Error::NoRoom)?.copy_from_slice(&sum.to_le_bytes());
    room.get(..at + SUM_BYTES).ok_or(Error::NoRoom)
}

pub(crate) fn put<T: Serialize>(room: &mut [u8], at: &mut usize, value: &T) -> Result<(), Error> {
    let written = postcard::to_slice(value, room.get_mut(*at..).ok_or(Error::NoRoom)?).map_err(|_| Error::NoRoom)?;
    *at += written.len();
    Ok(())
}

impl<const B: usize, const C: usize> Stored<B, C> {
    /// Reads the bytes of [`write()`]. [`hapt_core::Loop::new`] checks the ranges of the numbers.
    pub fn read(bytes: &[u8]) -> Result<Self, Error> {
        let version = *bytes.first().ok_or(Error::Cut)?;
        if !(VERSION..=FILTER).contains(&version) {
            return Err(Error::Version { given: version });
        }
        let (content, sum) = bytes.split_last_chunk::<SUM_BYTES>().ok_or(Error::Cut)?;
        if SUM.checksum(content) != u16::from_le_bytes(*sum) {
            return Err(Error::Checksum);
        }
        let mut rest = content.get(1..).ok_or(Error::Cut)?;
        let settings: Settings = take(&mut rest)?;
        let bodies_every = if version >= BODIES_EVERY { take(&mut rest)? } else { 1 };
        let filter = if version >= FILTER { Some(take(&mut rest)?) } else { None };
        let (given, room) = (usize::from(settings.bodies), B);
        if given > room {
            return Err(Error::TooManyBodies { given, room });
        }
        let (given, room) = (usize::from(settings.couplings), C);
        if given > room {
            return Err(Error::TooManyCouplings { given, room });
        }
        let mut stored = Stored {
            settings,
            bodies_every,
            filter,
            bodies: [Body { inertia: 1.0, position: 0.0, velocity: 0.0 }; B],
            couplings: [Law::Constant { torque: 0.0 }.between(End::Puck, End::Ground); C],
        };
        for body in stored.bodies.iter_mut().take(usize::from(settings.bodies)) {
            *body = take(&mut rest)?;
        }
        for coupling in stored.couplings.iter_mut().take(usize::from(settings.couplings)) {
            *coupling = take::<coupling::Coupling>(&mut rest)?.read();
        }
        if rest.is_empty() { Ok(stored) } else { Err(Error::NotAWorld) }
    }

    /// The world.
    pub fn spec(&self) -> Spec<'_> {
        let Settings { period, method, output, advance, estimator, count, limit, levels, bodies, couplings } =
            self.settings;
        Spec {
            period,
            method,
            output,
            advance,
            bodies_every: self.bodies_every,
            estimator,
            filter: self.filter,
            count,
            limit,
            levels,
            bodies: self.bodies.get(..usize::from(bodies)).unwrap_or(&[]),
            couplings: self.couplings.get(..usize::from(couplings)).unwrap_or(&[]),
        }
    }
}

pub(crate) fn take<T: for<'a> Deserialize<'a>>(rest: &mut &[u8]) -> Result<T, Error> {
    let (value, after) = crate::bytes::read(rest).map_err(|_| Error::NotAWorld)?;
    *rest = after;
    Ok(value)
}
