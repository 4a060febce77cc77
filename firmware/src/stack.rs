//! How much of the stack has been used: it is painted before the program begins, and the part that is still painted was never reached.

use core::ptr::{addr_of, read_volatile};

unsafe extern "C" {
    static _stack_end: u32;
    static _stack_start: u32;
}

/// The word with which cortex-m-rt paints it (its feature `paint-stack`).
const PAINT: u32 = 0xcccc_cccc;

/// Bytes of the stack, from its top to the deepest place ever written.
pub fn used() -> usize {
    let (end, start) = (addr_of!(_stack_end) as usize, addr_of!(_stack_start) as usize);
    // SAFETY: the linker puts the stack, and nothing else, between the two; reading a word of it changes nothing.
    let untouched = |&at: &usize| unsafe { read_volatile(at as *const u32) } == PAINT;
    let reached = (end..start).step_by(4).find(|at| !untouched(at)).unwrap_or(start);
    start - reached
}
