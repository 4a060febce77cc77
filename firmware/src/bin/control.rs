//! A program with a possible panic, a control of the search for panics in the others: the search has to find this one.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::panic::PanicInfo;

use cortex_m_rt::entry;
use hapt_firmware::halt::halt;

#[entry]
fn main() -> ! {
    let digits = black_box([1, 2, 3]);
    black_box(digits[black_box(4)]);
    halt()
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    halt()
}
