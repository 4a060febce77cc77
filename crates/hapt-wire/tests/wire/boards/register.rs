//! A register of a chip in this test's memory, in place of the firmware's own `register.rs`.

use super::chip::CHIP;

/// A register by its address.
#[derive(Clone, Copy, Debug)]
pub struct Register(usize);

impl Register {
    pub const fn at(address: usize) -> Self {
        Register(address)
    }

    pub fn get(self) -> u32 {
        CHIP.with_borrow_mut(|chip| chip.read(self.0))
    }

    pub fn set(self, value: u32) {
        CHIP.with_borrow_mut(|chip| chip.write(self.0, value));
    }

    pub fn change(self, change: impl FnOnce(u32) -> u32) {
        self.set(change(self.get()));
    }
}
