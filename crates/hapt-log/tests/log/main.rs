//! Logs: written, cut, recorded along with the loop, and replayed.

mod common;
mod cut;
mod recorder;
mod round_trip;
mod snapshot;
