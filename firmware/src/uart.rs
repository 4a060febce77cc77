//! A UART that is asked, byte by byte: every maker's has a state, a register to read and one to write.

use super::board::Line;
use super::register::Register;

/// Its registers, and the bits of its state.
pub struct Uart {
    /// Its state.
    pub state: Register,
    /// What it has received.
    pub received: Register,
    /// What it is to send.
    pub sent: Register,
    /// The state's bit that tells whether a byte has come in, and what that bit then is.
    pub full: (u32, bool),
    /// The state's bit that tells whether it takes a byte, and what that bit then is.
    pub free: (u32, bool),
}

impl Line for Uart {
    fn receive(&mut self) -> Option<u8> {
        let (bit, set) = self.full;
        ((self.state.get() & bit != 0) == set).then(|| self.received.get() as u8)
    }

    fn send(&mut self, byte: u8) -> bool {
        let (bit, set) = self.free;
        let free = (self.state.get() & bit != 0) == set;
        if free {
            self.sent.set(byte.into());
        }
        free
    }
}
