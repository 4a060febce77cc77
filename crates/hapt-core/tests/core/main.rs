//! One guarded sample of the loop: the rules of its methods, its limits, and what it refuses.
// Tests run where the standard library is.
#![allow(clippy::disallowed_methods, clippy::disallowed_macros)]

mod acceleration;
mod assist;
mod display;
mod game_loop;
mod gradient;
mod integral;
mod lanes;
mod link;
mod methods;
mod periodic;
mod reference;
mod refused;
mod sample;
mod supervisor;
mod two_rates;
mod wheel;
