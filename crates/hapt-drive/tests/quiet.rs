//! A sample on a drive allocates nothing and frees nothing, whether the drive answers, is silent, or is gone.
// An allocator is unsafe by its nature; this one counts, and hands on.
#![cfg(target_os = "linux")]
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use hapt_drive::moteus::{Adapter, Client, Moteus, Simulated};
use hapt_drive::simulate::{Simulator, Time};
use hapt_drive::{Line, Wheel, pty};
use hapt_model::{Source, World};
use hapt_rt::{Device, Failure};

thread_local! {
    /// What this thread has allocated and freed.
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

fn count() {
    // Gone where the thread is ending.
    let _ = COUNT.try_with(|count| count.set(count.get() + 1));
}

// SAFETY: all of it is the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const WORLD: &str = "[loop]\nperiod = \"100 ms\"\n[device]\ninertia = 6.4e-4\nlimit = 0.8\n";

#[test]
fn a_sample_allocates_nothing() {
    let world = World::read(&Source::from_text("w.toml", WORLD), &[]).unwrap();
    let (line, path) = pty().unwrap();
    let (bus, firmware) = (Box::new(Adapter::new(line)), Box::new(Simulated::new(1)));
    let mut simulator = Simulator::new(bus, firmware, &world, Time::Lockstep(0.1));
    let ends = Arc::new(AtomicBool::new(false));
    let thread = std::thread::spawn({
        let ends = Arc::clone(&ends);
        move || {
            let ran = simulator.run(|| ends.load(Ordering::SeqCst));
            // Hung up here, with the simulator.
            drop(simulator);
            ran
        }
    });
    let bus = Box::new(Client::new(Line::open(&path).unwrap(), true));
    let drive = Moteus::new(bus, 1, path.display().to_string());
    let mut wheel = Wheel::start(Box::new(drive), &world).unwrap();

    let before = COUNT.with(Cell::get);
    assert!(before > 0, "the allocator counts");
    let mut read = 0;
    for k in 0..100 {
        read += u32::from(wheel.read().is_ok());
        wheel.write(0.01 * f64::from(k)).unwrap();
    }
    assert_eq!(COUNT.with(Cell::get), before, "while it answers");
    assert_eq!(read, 100);

    ends.store(true, Ordering::SeqCst);
    thread.join().unwrap().unwrap();
    let before = COUNT.with(Cell::get);
    let failure = wheel.read();
    assert_eq!(COUNT.with(Cell::get), before, "when it is gone");
    assert_eq!(failure, Err(Failure::Unplugged));
}
