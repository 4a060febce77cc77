//! A session on a simulated device as one program: the page runs it where there is no server.
//!
//! A [`Page`] is made of a world's text ([`hapt_host::messages::WorldFile`]). It takes the messages that a page sends to `hapt live`, and
//! gives those that it gets from there, by the same session ([`hapt_host::PageSession`]). It uses no clock, thread or file, so that its bits
//! are those of every other machine. A [`NetworkPage`] is several of them, joined by links. For WebAssembly, `exports` is what JavaScript calls.

#[cfg(target_family = "wasm")]
mod exports;
mod network;
mod page;

pub use network::NetworkPage;
pub use page::{Message, Page};
