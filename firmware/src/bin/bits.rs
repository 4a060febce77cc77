//! The bits of every world in a file, as sums for the host to compare with its own: see `trace.rs`.
//!
//! The file is what `cargo xtask firmware` writes: samples (u32, little-endian), then length (u32) and bytes of each world.
#![no_std]
#![no_main]

use core::fmt::Write;
use core::panic::PanicInfo;

use cortex_m_rt::entry;
use hapt_firmware::console::{File, exit};
use hapt_firmware::{stack, trace};

#[entry]
fn main() -> ! {
    let mut console = File::console();
    let mut file = File::read_from(c"cases");
    let Some(samples) = number(&mut file) else { exit(2) };
    let mut room = [0; 1024];
    while let Some(length) = number(&mut file) {
        let Some(bytes) = room.get_mut(..length as usize) else { exit(2) };
        if !file.fill(bytes) {
            exit(2);
        }
        let result = match trace::sums(bytes, samples) {
            Some((bare, guarded, _)) => writeln!(console, "{:016x} {:016x}", bare.0, guarded.0),
            None => writeln!(console, "refused"),
        };
        if result.is_err() {
            exit(3);
        }
    }
    let _ = writeln!(console, "stack {}", stack::used());
    exit(0)
}

fn number(file: &mut File) -> Option<u32> {
    let mut bytes = [0; 4];
    file.fill(&mut bytes).then(|| u32::from_le_bytes(bytes))
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    let _ = writeln!(File::console(), "{info}");
    exit(101)
}
