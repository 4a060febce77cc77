//! Loop, supervisor, exact device and a visitor's hand as one program: what the page runs where there is no server.
//!
//! A [`Page`] is made of a world's bytes ([`hapt_wire::write()`]) and a [`Setup`]'s, and takes as many samples as are due. It uses no clock,
//! thread or browser, so that its bits are those of every other machine. [`Slot`] names what can be changed while it runs. For WebAssembly,
//! `exports` is what JavaScript calls.
#![cfg_attr(target_arch = "wasm32", no_std)]

extern crate alloc;

#[cfg(target_arch = "wasm32")]
mod exports;
mod page;
mod slot;

pub use page::{COLUMNS, OWN, Page, Setup};
pub use slot::{PERIODS, Slot};
