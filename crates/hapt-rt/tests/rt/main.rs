//! The loop without a clock and on its thread.

mod common;
mod cycle;
mod engine;
mod links;
mod recentre;
mod swap;
