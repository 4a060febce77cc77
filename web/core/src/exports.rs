//! The functions for JavaScript, on the one page that there is. Without a loaded world they do nothing.
//!
//! JavaScript asks for [`room`], writes a world's bytes and a setup's into it, and calls [`load`]. Then it calls [`run`] for the samples of
//! each frame, and reads them from [`frame`].
#![allow(unsafe_code)] // Exported names, one static, and a panic that traps.

use alloc::boxed::Box;
use alloc::vec::Vec;
use core::cell::UnsafeCell;

use hapt_core::{Reason, Request};
use hapt_plant::Grip;

use crate::{COLUMNS, Page, Slot};

#[global_allocator]
static HEAP: dlmalloc::GlobalDlmalloc = dlmalloc::GlobalDlmalloc;

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    core::arch::wasm32::unreachable()
}

struct Alone {
    room: Vec<u8>,
    page: Option<Box<Page>>,
}

/// A page runs on one thread: its WebAssembly has no other.
struct Thread(UnsafeCell<Alone>);

// SAFETY: see above.
unsafe impl Sync for Thread {}

static ALONE: Thread = Thread(UnsafeCell::new(Alone { room: Vec::new(), page: None }));

fn alone() -> &'static mut Alone {
    // SAFETY: one thread; no exported function calls another, and no reference outlives the one that took it.
    unsafe { &mut *ALONE.0.get() }
}

fn page() -> Option<&'static mut Page> {
    alone().page.as_deref_mut()
}

/// Room for so many bytes.
#[unsafe(no_mangle)]
pub extern "C" fn room(length: usize) -> *mut u8 {
    let room = &mut alone().room;
    room.clear();
    room.resize(length, 0);
    room.as_mut_ptr()
}

/// Loads the world in the first `world` bytes of the room and the setup in the rest, in place of what ran: how many bodies it has, or -1
/// where it is none.
#[unsafe(no_mangle)]
pub extern "C" fn load(world: usize) -> i32 {
    let Alone { room, page } = alone();
    let Some((world, setup)) = room.split_at_checked(world) else { return -1 };
    *page = Page::new(world, setup);
    page.as_ref().map_or(-1, |page| page.bodies() as i32)
}

/// Takes so many samples.
#[unsafe(no_mangle)]
pub extern "C" fn run(samples: u32) {
    if let Some(page) = page() {
        page.run(samples);
    }
}

/// Where the frame stands: of each of [`columns`] the last value; then the least of each; then the greatest.
#[unsafe(no_mangle)]
pub extern "C" fn frame() -> *const f64 {
    page().map_or(core::ptr::null(), |page| page.frame().as_ptr().cast())
}

/// How many columns a frame has room for; a world of fewer bodies leaves the last ones 0.
#[unsafe(no_mangle)]
pub extern "C" fn columns() -> usize {
    COLUMNS
}

/// 1: arm, 2: disarm, 3: stop, 4: clear.
#[unsafe(no_mangle)]
pub extern "C" fn order(code: usize) {
    let requests = [Request::Arm, Request::Disarm, Request::Stop, Request::Clear];
    if let (Some(page), Some(&request)) = (page(), requests.get(code.wrapping_sub(1))) {
        page.ask(request);
    }
}

/// The supervisor's phase, counted from 0; in the second byte the code of its reason, in the third that of its warning, 0 for none.
#[unsafe(no_mangle)]
pub extern "C" fn phase() -> u32 {
    let code = |reason: Option<Reason>| reason.map_or(0, |reason| u32::from(reason.code()));
    page().map_or(0, |page| {
        let (phase, reason, warning) = page.phase();
        phase as u32 | code(reason) << 8 | code(warning) << 16
    })
}

/// The output, counted from 0.
#[unsafe(no_mangle)]
pub extern "C" fn output() -> u32 {
    page().map_or(0, |page| page.output() as u32)
}

/// The visitor's hand takes hold.
#[unsafe(no_mangle)]
pub extern "C" fn hold(inertia: f64, damping: f64, stiffness: f64) {
    if let Some(page) = page() {
        page.hold(Some(Grip { inertia, damping, stiffness }));
    }
}

/// It means to be here, in rad (linear: m).
#[unsafe(no_mangle)]
pub extern "C" fn intend(position: f64) {
    if let Some(page) = page() {
        page.intend(position);
    }
}

/// Whoever holds the puck lets go.
#[unsafe(no_mangle)]
pub extern "C" fn release() {
    if let Some(page) = page() {
        page.hold(None);
    }
}

/// The puck at rest at 0, the world at its start, and no torque.
#[unsafe(no_mangle)]
pub extern "C" fn restart() {
    if let Some(page) = page() {
        page.restart();
    }
}

/// A scenario's hand takes hold: 1, or 0 where there is none.
#[unsafe(no_mangle)]
pub extern "C" fn begin(scenario: usize) -> u32 {
    page().is_some_and(|page| page.begin(scenario)).into()
}

/// Whether anybody holds the puck.
#[unsafe(no_mangle)]
pub extern "C" fn held() -> u32 {
    page().is_some_and(|page| page.is_held()).into()
}

/// Changes a number of the world ([`Slot`]): 1, or 0 where it is refused and nothing has changed.
#[unsafe(no_mangle)]
pub extern "C" fn set(slot: usize, index: usize, value: f64) -> u32 {
    match (page(), Slot::ALL.get(slot)) {
        (Some(page), Some(&slot)) => page.set(slot, index, value).into(),
        _ => 0,
    }
}
