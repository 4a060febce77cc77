//! The links of a station: over UDP, or between stations that one thread runs; and what happens to their messages on the way.

mod status;
mod stepped;
#[cfg(not(target_family = "wasm"))]
mod udp;
mod way;

pub(crate) use status::Counters;
pub use status::LinkStatus;
pub use stepped::SteppedLinks;
#[cfg(not(target_family = "wasm"))]
pub use udp::{LinkError, Links, Way, random_key};
pub use way::WayNumbers;
