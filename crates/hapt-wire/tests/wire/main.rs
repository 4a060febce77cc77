//! Messages between a host and a board, and the board's side of them.

mod boards;
#[cfg(feature = "usb")]
mod bus;
mod codes;
mod common;
mod device;
mod frames;
#[cfg(feature = "usb")]
mod game_wheel;
mod link;
mod link_frames;
mod messages;
mod noise;
mod pico2;
mod pid;
mod world;
