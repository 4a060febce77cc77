//! A device's register: a word of memory that is not memory.

/// By its address.
#[derive(Clone, Copy)]
pub struct Register(usize);

impl Register {
    /// At this address, which must be one of the processor's or the board's registers: the effects of reading and writing it are in the
    /// manual, and never change this program's memory.
    pub(crate) const fn at(address: usize) -> Self {
        Register(address)
    }

    /// Reads it.
    #[inline(always)]
    pub fn get(self) -> u32 {
        // SAFETY: a register stands there, aligned, for as long as there is power; no reference is made to it.
        unsafe { core::ptr::read_volatile(self.0 as *const u32) }
    }

    /// Writes it.
    #[inline(always)]
    pub fn set(self, value: u32) {
        // SAFETY: as above.
        unsafe { core::ptr::write_volatile(self.0 as *mut u32, value) }
    }

    /// Writes the result of `change` on its value.
    #[allow(dead_code)] // Not every board has such a one.
    #[inline(always)]
    pub fn change(self, change: impl FnOnce(u32) -> u32) {
        self.set(change(self.get()));
    }
}
