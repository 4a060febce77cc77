//! The loop, its supervisor, the exact device and a visitor's hand as one program: what a page runs by itself, where there is no server.
//!
//! A [`Page`] is made of a world's bytes ([`hapt_wire::write()`]) and a [`Setup`]'s, and takes as many samples as are due. Nothing in it
//! knows of clocks, threads or browsers, so that its bits are those of every other machine; `web/core` is what JavaScript calls.
//!
//! [`Slot`] names what can be changed while it runs.
#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

mod page;
mod slot;

pub use page::{COLUMNS, OWN, Page, Setup};
pub use slot::{PERIODS, Slot};
