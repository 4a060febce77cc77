//! A polled UART, byte by byte: every maker's has a state, a register to read and one to write.

use super::board::Line;
use super::register::Register;

/// Its registers, and the bits of its state.
pub struct Uart {
    /// Its state.
    pub state: Register,
    /// The received byte.
    pub received: Register,
    /// The byte to send.
    pub sent: Register,
    /// The state's bit for a received byte, and its value then.
    pub full: (u32, bool),
    /// The state's bit for room to send a byte, and its value then.
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
