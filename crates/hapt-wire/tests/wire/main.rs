//! Messages between a host and a board, and the board's side of them.

mod boards;
mod codes;
mod common;
mod device;
mod frames;
mod link;
mod messages;
mod noise;
mod pid;
mod world;
