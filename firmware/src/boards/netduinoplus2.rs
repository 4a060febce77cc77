//! Netduino Plus 2 (STM32F405), as QEMU has it: USART 1, and a puck that swings by itself. QEMU's has no clocks to start; its independent
//! watchdog (IWDG) is a stretch of registers that take everything and do nothing. Manual: ST RM0090.

use super::board::{Board, Device};
use super::register::Register;
use super::swing::Swing;
use super::uart::Uart;

const STATUS: Register = Register::at(0x4001_1000);
const DATA: Register = Register::at(0x4001_1004);
const CONTROL: Register = Register::at(0x4001_100c);
const ENABLE: u32 = 1 << 13 | 1 << 3 | 1 << 2;

/// The board.
pub struct Here;

impl Board for Here {
    const NAME: &'static str = "netduinoplus2";
    const CLOCK: u32 = 168_000_000;

    type Line = Uart;
    type Device = Puck;

    /// There is no motor.
    fn cut() {}

    fn start() -> (Uart, Puck) {
        CONTROL.set(ENABLE);
        (
            Uart { state: STATUS, received: DATA, sent: DATA, full: (1 << 5, true), free: (1 << 7, true) },
            Puck(Swing::START),
        )
    }
}

/// Its puck.
pub struct Puck(Swing);

impl Device for Puck {
    fn position(&mut self) -> f32 {
        self.0.next()
    }

    fn fault(&mut self) -> bool {
        false
    }

    fn hold(&mut self, _torque: f32, _on: bool) {}

    fn feed(&mut self) {}
}
