//! The functions for JavaScript, on the one page that there is.
//!
//! JavaScript asks for [`room`], writes text into it, and calls [`load`] or [`send`]. It calls [`poll`] for each frame that the browser
//! draws, and after each of these [`next`] until there is no message left.
#![allow(unsafe_code)] // Exported names.

use std::cell::RefCell;
use std::time::Duration;

use crate::{Message, Page};

#[derive(Default)]
struct Exchange {
    room: Vec<u8>,
    page: Option<Page>,
    message: Vec<u8>,
}

thread_local! {
    static EXCHANGE: RefCell<Exchange> = RefCell::default();
}

fn with<T>(act: impl FnOnce(&mut Exchange) -> T) -> T {
    EXCHANGE.with_borrow_mut(act)
}

/// Room for so many bytes of UTF-8.
#[unsafe(no_mangle)]
pub extern "C" fn room(length: usize) -> *mut u8 {
    with(|exchange| {
        exchange.room.clear();
        exchange.room.resize(length, 0);
        exchange.room.as_mut_ptr()
    })
}

/// Runs the world in the room, in place of what ran: 1, or 0 with the reason as [`message`].
#[unsafe(no_mangle)]
pub extern "C" fn load() -> u32 {
    with(|exchange| match Page::new(&String::from_utf8_lossy(&exchange.room)) {
        Ok(page) => {
            exchange.page = Some(page);
            1
        }
        Err(reason) => {
            exchange.message = reason.into_bytes();
            0
        }
    })
}

/// Takes the page's message in the room.
#[unsafe(no_mangle)]
pub extern "C" fn send() {
    with(|Exchange { room, page, .. }| {
        if let Some(page) = page {
            page.send(&String::from_utf8_lossy(room));
        }
    });
}

/// Takes the samples that are due, at a time in ms that never goes back.
#[unsafe(no_mangle)]
pub extern "C" fn poll(now: f64) {
    with(|exchange| {
        if let (Some(page), Ok(now)) = (&mut exchange.page, Duration::try_from_secs_f64(now / 1e3)) {
            page.poll(now);
        }
    });
}

/// The next message to the page: 1 for text, 2 for a frame, 0 where there is none.
#[unsafe(no_mangle)]
pub extern "C" fn next() -> u32 {
    with(|exchange| {
        let (bytes, kind) = match exchange.page.as_mut().and_then(Page::next_message) {
            Some(Message::Text(text)) => (text.into_bytes(), 1),
            Some(Message::Frame(bytes)) => (bytes, 2),
            None => (Vec::new(), 0),
        };
        exchange.message = bytes;
        kind
    })
}

/// Where that message is.
#[unsafe(no_mangle)]
pub extern "C" fn message() -> *const u8 {
    with(|exchange| exchange.message.as_ptr())
}

/// Its length in bytes.
#[unsafe(no_mangle)]
pub extern "C" fn length() -> usize {
    with(|exchange| exchange.message.len())
}

/// The columns of the last frame as doubles, for comparison with other machines: last, smallest, largest of each.
#[unsafe(no_mangle)]
pub extern "C" fn columns() -> *const f64 {
    with(|exchange| exchange.page.as_ref().map_or(std::ptr::null(), |page| page.columns().as_ptr().cast()))
}
