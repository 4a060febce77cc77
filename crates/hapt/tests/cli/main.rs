//! The command line as its users meet it: what is typed, what comes out, and how it ends.

mod commands;
mod common;
mod contract;
mod endings;
mod help;
mod refusals;
mod runs;
