//! SysTick, the processor's own timer: the loop's interrupt, and what instructions are counted by.

use crate::register::Register;

const CONTROL: Register = Register::at(0xe000_e010);
const RELOAD: Register = Register::at(0xe000_e014);
const CURRENT: Register = Register::at(0xe000_e018);

const ENABLE: u32 = 1;
const INTERRUPT: u32 = 2;
const PROCESSOR: u32 = 4;

/// It counts 24 bits.
pub const MASK: u32 = 0x00ff_ffff;

/// Counts the processor's clock down from the top, without interrupts.
pub fn count() {
    RELOAD.set(MASK);
    CURRENT.set(0);
    CONTROL.set(ENABLE | PROCESSOR);
}

/// Interrupts every so many clocks, from 2 to 2^24.
pub fn every(clocks: u32) {
    RELOAD.set(clocks.saturating_sub(1) & MASK);
    CURRENT.set(0);
    CONTROL.set(ENABLE | INTERRUPT | PROCESSOR);
}

/// Where it stands.
pub fn now() -> u32 {
    CURRENT.get()
}

/// Clocks from one reading to a later one, less than 2^24 apart.
pub fn between(earlier: u32, later: u32) -> u32 {
    earlier.wrapping_sub(later) & MASK
}

/// Clocks since it last began anew.
pub fn since_reload() -> u32 {
    RELOAD.get().wrapping_sub(CURRENT.get()) & MASK
}
