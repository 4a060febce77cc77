//! The links of a station: over UDP or CAN, or between stations that one thread runs; with simulated delay and loss of their messages.

#[cfg(target_os = "linux")]
mod can;
mod channel;
#[cfg(not(target_family = "wasm"))]
mod ends;
#[cfg(not(target_family = "wasm"))]
mod station;
mod status;
mod stepped;
#[cfg(not(target_family = "wasm"))]
mod udp;

#[cfg(target_os = "linux")]
pub use can::CanAddress;
pub use channel::ChannelNumbers;
#[cfg(not(target_family = "wasm"))]
pub use station::{CanLimit, LinkError, Links, Transport, random_key};
pub(crate) use status::Counters;
pub use status::LinkStatus;
pub use stepped::SteppedLinks;
