//! Grids, boundaries and the worst hand.

mod boundary;
mod lanes;
mod networks;
mod shards;
mod sweep;
mod wheels;
mod worst;
