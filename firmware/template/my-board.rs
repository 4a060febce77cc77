//! Your board: what it is, its motor, its encoder, and which manuals the numbers are from.

use super::board::{Board, Device};
use super::register::Register;
use super::uart::Uart;

// Registers by their addresses, under names that say what they do:
const UART_STATE: Register = Register::at(0x4000_441c);
const UART_RECEIVED: Register = Register::at(0x4000_4424);
const UART_SENT: Register = Register::at(0x4000_4428);
const ENCODER_COUNT: Register = Register::at(0x4000_0824);

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

    fn cut() {
        // No torque, by one or two writes to registers: a sample is too late. `hold` comes next, and decides again.
    }

    fn start() -> (Uart, Motor) {
        // Clocks, pins, UART, encoder, PWM with its outputs off, current limit, watchdog: in this order.
        // The main loop asks the UART for bytes every few microseconds. One that needs more than that gets a `Line` of its own.
        let (state, received, sent) = (UART_STATE, UART_RECEIVED, UART_SENT);
        (Uart { state, received, sent, full: (1 << 5, true), free: (1 << 7, true) }, Motor { last: 0, counts: 0 })
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
        let now = ENCODER_COUNT.get() as u16;
        self.counts = self.counts.wrapping_add(i32::from(now.wrapping_sub(self.last) as i16));
        self.last = now;
        self.counts as f32 * (core::f32::consts::TAU / COUNTS)
    }

    fn fault(&mut self) -> bool {
        // The driver's report of too much current, heat and the like, which it must have acted on by itself: read it, and acknowledge it.
        false
    }

    fn hold(&mut self, _torque: f32, _on: bool) {
        // Torque to current or duty; positive pushes the puck to larger positions. Off: the driver disconnects the motor. Turn it on only
        // where it was off at the sample before: after a fault of its own it must not come back by itself.
    }

    fn feed(&mut self) {
        // The watchdog, which must turn the driver off by itself.
    }
}
