//! A value that the main loop and the interrupt both use, one at a time.

use core::arch::asm;
use core::cell::{Cell, UnsafeCell};

/// Nothing, until it is put in.
pub struct Shared<T> {
    value: UnsafeCell<Option<T>>,
    lent: Cell<bool>,
}

// SAFETY: there is one processor, and nothing that uses the value interrupts it while it is lent: `with` turns interrupts off, and only one
// interrupt uses it.
unsafe impl<T: Send> Sync for Shared<T> {}

impl<T> Shared<T> {
    /// Nothing in it.
    pub const fn new() -> Self {
        Shared { value: UnsafeCell::new(None), lent: Cell::new(false) }
    }

    /// Puts the value in.
    pub fn put(&self, value: T) {
        self.change(|place| *place = Some(value));
    }

    /// Lends the value, with interrupts off; `None` where there is none, or where it is lent already.
    pub fn with<R>(&self, use_it: impl FnOnce(&mut T) -> R) -> Option<R> {
        self.change(|place| place.as_mut().map(use_it)).flatten()
    }

    /// Lends the value to an interrupt; interrupts of higher priority continue. The main loop, which may not be interrupted while it has
    /// the value, never has it then.
    pub fn with_in_interrupt<R>(&self, use_it: impl FnOnce(&mut T) -> R) -> Option<R> {
        self.lend(|place| place.as_mut().map(use_it)).flatten()
    }

    fn change<R>(&self, change: impl FnOnce(&mut Option<T>) -> R) -> Option<R> {
        let masked: u32;
        // SAFETY: PRIMASK is read, and interrupts are turned off; the compiler moves no access to memory across it.
        unsafe { asm!("mrs {}, PRIMASK", "cpsid i", out(reg) masked) };
        let given = self.lend(change);
        if masked == 0 {
            // SAFETY: they were on before.
            unsafe { asm!("cpsie i") };
        }
        given
    }

    fn lend<R>(&self, use_it: impl FnOnce(&mut Option<T>) -> R) -> Option<R> {
        (!self.lent.replace(true)).then(|| {
            // SAFETY: it was not lent, nothing that uses it can interrupt until it is given back, and the reference ends with the call.
            let given = use_it(unsafe { &mut *self.value.get() });
            self.lent.set(false);
            given
        })
    }
}

impl<T> Default for Shared<T> {
    fn default() -> Self {
        Self::new()
    }
}
