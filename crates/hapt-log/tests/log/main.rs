//! Logs: written, cut, recorded beside the loop, and replayed.

mod common;
mod cut;
mod recorder;
mod round_trip;
mod snapshot;
