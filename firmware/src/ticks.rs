//! SysTick, the processor's own timer: the loop's periods, and the counting of instructions.
//!
//! Two interrupts make a sample: SysTick, of the highest priority, only counts that a period has begun, and requests PendSV, of the
//! lowest, which takes the sample. However long a sample takes, every period that passes meanwhile is counted.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use crate::register::Register;

const CONTROL: Register = Register::at(0xe000_e010);
const RELOAD: Register = Register::at(0xe000_e014);
const CURRENT: Register = Register::at(0xe000_e018);

/// The processor's interrupts: requests and priorities (ARM DDI 0403, B3.2).
const ASKED: Register = Register::at(0xe000_ed04);
const PRIORITIES: Register = Register::at(0xe000_ed20);
const PENDSV: u32 = 1 << 28;
const PENDSV_LAST: u32 = 0xff << 16;

/// Periods begun, and not yet taken up by a sample.
static DUE: AtomicU32 = AtomicU32::new(0);

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

/// Begins a period every `clocks` clocks, from 2 to 2^24.
pub fn every(clocks: u32) {
    PRIORITIES.set(PENDSV_LAST);
    RELOAD.set(clocks.saturating_sub(1) & MASK);
    CURRENT.set(0);
    CONTROL.set(ENABLE | INTERRUPT | PROCESSOR);
    DUE.store(0, Relaxed);
}

/// Periods for which the motor may hold a torque.
static LONGEST_HOLD: AtomicU32 = AtomicU32::new(u32::MAX);

/// The work of SysTick's interrupt: a period has begun, and PendSV is to take a sample. Returns whether the motor has held its torque for
/// too long.
#[inline(always)]
pub fn begin() -> bool {
    let before = DUE.fetch_add(1, Relaxed);
    ASKED.set(PENDSV);
    before >= LONGEST_HOLD.load(Relaxed)
}

/// The motor may hold a torque for this many periods; `None`: for any.
pub fn hold_for(periods: Option<u32>) {
    LONGEST_HOLD.store(periods.unwrap_or(u32::MAX), Relaxed);
}

/// How many periods have begun that no sample has taken up.
#[inline(always)]
pub fn due() -> u32 {
    DUE.load(Relaxed)
}

/// The beginning of PendSV's interrupt: takes up the periods that have begun. Returns their number, and the clocks since the last one's
/// beginning.
#[inline(always)]
pub fn take_up() -> (u32, u32) {
    loop {
        let (due, since) = (due(), since_reload());
        // A period that began between the two readings would make them inconsistent.
        if DUE.compare_exchange(due, 0, Relaxed, Relaxed).is_ok() {
            return (due, since);
        }
    }
}

/// Clocks since the beginning of the period that was taken up last.
#[inline(always)]
pub fn since_taken_up() -> u32 {
    loop {
        let (before, since) = (due(), since_reload());
        if due() == before {
            return RELOAD.get().saturating_add(1).saturating_mul(before).saturating_add(since);
        }
    }
}

/// Its present count.
pub fn now() -> u32 {
    CURRENT.get()
}

/// Clocks from one reading to a later one, less than 2^24 apart.
pub fn between(earlier: u32, later: u32) -> u32 {
    earlier.wrapping_sub(later) & MASK
}

/// Clocks since it last began anew.
fn since_reload() -> u32 {
    RELOAD.get().wrapping_sub(CURRENT.get()) & MASK
}

/// SysTick counts the board's clock, `-icount` its own.
#[cfg(feature = "semihosting")]
pub fn of_an_instruction() -> f32 {
    let run = |rounds: u32| {
        let start = now();
        // SAFETY: two instructions a round, on a register of their own.
        unsafe { core::arch::asm!("2: subs {0}, {0}, #1", "bne 2b", inout(reg) rounds => _) };
        between(start, now())
    };
    (run(11_000) - run(1_000)) as f32 / 20_000.0
}
