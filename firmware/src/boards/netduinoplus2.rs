//! Netduino Plus 2 (STM32F405), as QEMU has it: USART 1, and in place of an encoder a puck that swings to and fro. QEMU's has neither
//! clocks to start nor a watchdog. Manual: ST RM0090.

use crate::board::{Board, Device, Line};
use crate::register::Register;

const STATUS: Register = Register::at(0x4001_1000);
const DATA: Register = Register::at(0x4001_1004);
const CONTROL: Register = Register::at(0x4001_100c);
const RX_FULL: u32 = 1 << 5;
const TX_FREE: u32 = 1 << 7;
const ENABLE: u32 = 1 << 13 | 1 << 3 | 1 << 2;

/// The board.
pub struct Here;

impl Board for Here {
    const NAME: &'static str = "netduinoplus2";
    const CLOCK: u32 = 168_000_000;

    type Line = Usart;
    type Device = Swing;

    fn start() -> (Usart, Swing) {
        CONTROL.set(ENABLE);
        (Usart, Swing { position: 0.0, step: 1e-4 })
    }
}

/// Its line.
pub struct Usart;

impl Line for Usart {
    fn receive(&mut self) -> Option<u8> {
        (STATUS.get() & RX_FULL != 0).then(|| DATA.get() as u8)
    }

    fn send(&mut self, byte: u8) -> bool {
        let free = STATUS.get() & TX_FREE != 0;
        if free {
            DATA.set(byte.into());
        }
        free
    }
}

/// Its puck.
pub struct Swing {
    position: f32,
    step: f32,
}

impl Device for Swing {
    fn position(&mut self) -> f32 {
        if self.position.abs() > 0.5 {
            self.step = if self.position > 0.0 { -1e-4 } else { 1e-4 };
        }
        self.position += self.step;
        self.position
    }

    fn hold(&mut self, _torque: f32, _on: bool) {}

    fn feed(&mut self) {}
}
