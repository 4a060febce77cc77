//! The loop that a game closes over the wheel.

mod cost;
mod estimate;
mod free_wheel;
mod steady;
