//! The loop that a game closes over the wheel.

mod cost;
mod free_wheel;
