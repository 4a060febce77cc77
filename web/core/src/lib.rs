//! A session on a simulated device as one program: what the page runs where there is no server.
//!
//! A [`Page`] is made of a world's text ([`hapt_host::messages::WorldFile`]). It takes the messages that a page sends to `hapt live`, and
//! gives those that it gets from there, by the same session ([`hapt_host::PageSession`]). It uses no clock, thread or file, so that its bits
//! are those of every other machine. For WebAssembly, `exports` is what JavaScript calls.

#[cfg(target_family = "wasm")]
mod exports;
mod page;

pub use page::{Message, Page};
