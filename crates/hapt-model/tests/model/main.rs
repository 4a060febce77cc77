//! World files: their meaning, their refusals, and writing them back.

mod contract;
mod counts;
mod doubts;
mod laws;
mod mistakes;
mod motor;
mod networks;
mod overrides;
mod parts;
mod round_trip;
mod schema;
