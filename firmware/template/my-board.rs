//! Your board: what it is, its motor, its encoder, and which manuals the numbers are from.

use crate::board::{Board, Device, Line};
use crate::register::Register;

// Registers by their addresses, under names that say what they do:
const UART_STATE: Register = Register::at(0x4000_441c);

/// The encoder's counts a revolution, all four edges of its lines.
const COUNTS: f32 = 4096.0;

/// The board.
pub struct Here;

impl Board for Here {
    const NAME: &'static str = "my-board";
    /// What the processor runs at after `start`.
    const CLOCK: u32 = 170_000_000;
    type Line = Uart;
    type Device = Motor;

    fn start() -> (Uart, Motor) {
        // Clocks, pins, UART, encoder, PWM with its outputs off, current limit, watchdog: in this order.
        (Uart, Motor { last: 0, counts: 0 })
    }
}

/// Its line.
pub struct Uart;

impl Line for Uart {
    fn receive(&mut self) -> Option<u8> {
        // A byte, if one has come in. The main loop asks every few microseconds: an interrupt or DMA is for slower ones.
        let _ = UART_STATE.get();
        None
    }

    fn send(&mut self, _byte: u8) -> bool {
        // True if it has been taken.
        true
    }
}

/// Its encoder and its motor.
pub struct Motor {
    last: u16,
    counts: i32,
}

impl Device for Motor {
    fn position(&mut self) -> f32 {
        // The timer's count, whose 16 bits run over.
        let now = 0_u16;
        self.counts = self.counts.wrapping_add(i32::from(now.wrapping_sub(self.last) as i16));
        self.last = now;
        self.counts as f32 * (core::f32::consts::TAU / COUNTS)
    }

    fn hold(&mut self, _torque: f32, _on: bool) {
        // Torque to current or duty; positive pushes the puck to larger positions. Off: the driver lets go.
    }

    fn feed(&mut self) {
        // The watchdog, which must turn the driver off by itself.
    }
}
