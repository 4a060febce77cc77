//! The server from a browser's side: over the loopback, by HTTP and websocket.

#[cfg(unix)]
mod board;
mod common;
mod crowd;
mod extremes;
mod hand;
mod motor;
mod network;
mod page;
mod record;
mod talk;
mod worlds;
