//! hapt's core in a browser: the functions that the page calls, and the one page that they work on.
//!
//! JavaScript writes a world's bytes (hapt-wire) into [`room`], calls [`load`], then [`step`] once a sample, and reads the
//! sample from [`row`]. All numbers are `f64`, so that the bits are those of every other machine.
#![no_std]

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

use hapt_core::{Loop, State};
use hapt_wire::Stored;

const BODIES: usize = 32;
const COUPLINGS: usize = 64;
const COUNTS: usize = 257;
const ROOM: usize = 8192;
/// Measured position and velocity, torque, command; then position and velocity of each body.
const ROW: usize = 4 + 2 * BODIES;

type World = Loop<f64, BODIES, COUPLINGS, COUNTS>;

struct Page {
    room: [u8; ROOM],
    row: [f64; ROW],
    /// What runs, once a world has been loaded: a page of zeros until then, which takes no place in the file.
    running: MaybeUninit<Running>,
    is_loaded: bool,
}

struct Running {
    world: World,
    state: State<f64, BODIES, COUPLINGS, COUNTS>,
}

impl Page {
    const EMPTY: Page = Page { room: [0; ROOM], row: [0.0; ROW], running: MaybeUninit::uninit(), is_loaded: false };

    fn running(&mut self) -> Option<(&mut Running, &mut [f64; ROW])> {
        // SAFETY: `is_loaded` is set after `running` is, and never taken back.
        self.is_loaded.then(|| (unsafe { self.running.assume_init_mut() }, &mut self.row))
    }
}

/// A page runs on one thread: its WebAssembly has no other.
struct Alone(UnsafeCell<Page>);

// SAFETY: see above; and no function below calls another that asks for the page.
unsafe impl Sync for Alone {}

static PAGE: Alone = Alone(UnsafeCell::new(Page::EMPTY));

fn page() -> &'static mut Page {
    // SAFETY: one thread, and no reference outlives the exported function that took it.
    unsafe { &mut *PAGE.0.get() }
}

/// Where a world's bytes go: 8 KiB, more than the largest world takes.
#[unsafe(no_mangle)]
pub extern "C" fn room() -> *mut u8 {
    page().room.as_mut_ptr()
}

/// Where the sample stands after [`step`].
#[unsafe(no_mangle)]
pub extern "C" fn row() -> *const f64 {
    page().row.as_ptr()
}

/// Compiles the world whose bytes are the first `length` of the room, and starts it; the number of its bodies, or -1 where the
/// bytes are no world, -2 where its numbers are not in range. A world that is refused leaves the one before running.
#[unsafe(no_mangle)]
pub extern "C" fn load(length: usize) -> i32 {
    let page = page();
    let Some(Ok(stored)) = page.room.get(..length).map(Stored::<BODIES, COUPLINGS>::read) else { return -1 };
    let Ok(world) = World::new(&stored.spec()) else { return -2 };
    page.running.write(Running { world, state: world.start() });
    page.is_loaded = true;
    world.bodies() as i32
}

/// Back to the state before sample 0.
#[unsafe(no_mangle)]
pub extern "C" fn reset() {
    if let Some((running, _)) = page().running() {
        running.state = running.world.start();
    }
}

/// One sample at the puck's position in rad (linear: m) and velocity; the command, 0 where no world runs.
#[unsafe(no_mangle)]
pub extern "C" fn step(position: f64, velocity: f64) -> f64 {
    let Some((Running { world, state }, row)) = page().running() else { return 0.0 };
    let sample = world.step(state, position, velocity);
    let (own, bodies) = row.split_at_mut(4);
    own.copy_from_slice(&[sample.puck.position, sample.puck.velocity, sample.torque, sample.command]);
    let state = state.now.position.iter().zip(&state.now.velocity).take(world.bodies());
    for (place, (w, v)) in bodies.chunks_exact_mut(2).zip(state) {
        place.copy_from_slice(&[*w, *v]);
    }
    sample.command
}

#[cfg(target_arch = "wasm32")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    core::arch::wasm32::unreachable()
}
