//! World files: what they mean, what is refused, and what is written back.

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
