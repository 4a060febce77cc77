//! The functions for JavaScript, on the only page of the module: of a world, or of a network's stations.
//!
//! JavaScript asks for [`room`], writes text into it, and calls [`load`], [`network`] or [`send`]. It calls [`poll`] for each frame that the
//! browser draws, and after each of these [`next`] for each station until there is no message left. A world is station 0.
#![allow(unsafe_code)] // Exported names.

use std::cell::RefCell;
use std::time::Duration;

use crate::{Message, NetworkPage, Page};

#[derive(Default)]
struct Exchange {
    room: Vec<u8>,
    runs: Option<Runs>,
    message: Vec<u8>,
}

enum Runs {
    World(Box<Page>),
    Network(Box<NetworkPage>),
}

impl Exchange {
    fn station(&mut self, index: usize) -> Option<&mut Page> {
        match self.runs.as_mut()? {
            Runs::World(page) => Some(page).filter(|_| index == 0).map(|page| &mut **page),
            Runs::Network(network) => network.station(index),
        }
    }

    fn run(&mut self, made: Result<Runs, String>) -> u32 {
        match made {
            Ok(runs) => {
                self.runs = Some(runs);
                1
            }
            Err(reason) => {
                self.message = reason.into_bytes();
                0
            }
        }
    }
}

thread_local! {
    static EXCHANGE: RefCell<Exchange> = RefCell::default();
}

fn with<T>(act: impl FnOnce(&mut Exchange) -> T) -> T {
    EXCHANGE.with_borrow_mut(act)
}

/// Room for `length` bytes of UTF-8.
#[unsafe(no_mangle)]
pub extern "C" fn room(length: usize) -> *mut u8 {
    with(|exchange| {
        exchange.room.clear();
        exchange.room.resize(length, 0);
        exchange.room.as_mut_ptr()
    })
}

/// Runs the world in the room, in place of the present one: 1, or 0 with the reason as [`message`].
#[unsafe(no_mangle)]
pub extern "C" fn load() -> u32 {
    with(|exchange| {
        let made = Page::new(&String::from_utf8_lossy(&exchange.room));
        exchange.run(made.map(|page| Runs::World(Box::new(page))))
    })
}

/// The same with the network in the room.
#[unsafe(no_mangle)]
pub extern "C" fn network() -> u32 {
    with(|exchange| {
        let made = NetworkPage::new(&String::from_utf8_lossy(&exchange.room));
        exchange.run(made.map(|network| Runs::Network(Box::new(network))))
    })
}

/// Takes the message in the room, of a station.
#[unsafe(no_mangle)]
pub extern "C" fn send(station: usize) {
    with(|exchange| {
        let text = String::from_utf8_lossy(&exchange.room).into_owned();
        if let Some(page) = exchange.station(station) {
            page.send(&text);
        }
    });
}

/// Takes the samples that are due, at a time in ms that never goes back.
#[unsafe(no_mangle)]
pub extern "C" fn poll(now: f64) {
    with(|exchange| {
        let Ok(now) = Duration::try_from_secs_f64(now / 1e3) else { return };
        match &mut exchange.runs {
            Some(Runs::World(page)) => page.poll(now),
            Some(Runs::Network(network)) => network.poll(now),
            None => {}
        }
    });
}

/// The next message to a station: 1 for text, 2 for a frame, 0 where there is none.
#[unsafe(no_mangle)]
pub extern "C" fn next(station: usize) -> u32 {
    with(|exchange| {
        let (bytes, kind) = match exchange.station(station).and_then(Page::next_message) {
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

/// The columns of a world's last frame as doubles, for comparison with other machines: last, smallest, largest of each.
#[unsafe(no_mangle)]
pub extern "C" fn columns() -> *const f64 {
    with(|exchange| exchange.station(0).map_or(std::ptr::null(), |page| page.columns().as_ptr().cast()))
}
