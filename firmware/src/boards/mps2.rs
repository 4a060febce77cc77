//! ARM's MPS2 with the FPGA images AN386 (Cortex-M4F) and AN500 (Cortex-M7), as QEMU has them: UART 0 of the CMSDK, its watchdog, and in
//! place of an encoder a puck that swings to and fro. Manuals: ARM DAI 0386, DDI 0479.

use crate::board::{Board, Device, Line};
use crate::register::Register;

const DATA: Register = Register::at(0x4000_4000);
const STATE: Register = Register::at(0x4000_4004);
const CONTROL: Register = Register::at(0x4000_4008);
const DIVIDER: Register = Register::at(0x4000_4010);
const TX_FULL: u32 = 1;
const RX_FULL: u32 = 2;

const WATCH_LOAD: Register = Register::at(0x4000_8000);
const WATCH_CONTROL: Register = Register::at(0x4000_8008);
const WATCH_CLEAR: Register = Register::at(0x4000_800c);
const WATCH_LOCK: Register = Register::at(0x4000_8c00);

/// The board.
pub struct Here;

impl Board for Here {
    const NAME: &'static str = "mps2";
    const CLOCK: u32 = 25_000_000;

    type Line = Uart;
    type Device = Swing;

    fn start() -> (Uart, Swing) {
        DIVIDER.set(Self::CLOCK / 921_600);
        CONTROL.set(3);
        (Uart, Swing { position: 0.0, step: 1e-4 })
    }
}

/// Its line.
pub struct Uart;

impl Line for Uart {
    fn receive(&mut self) -> Option<u8> {
        (STATE.get() & RX_FULL != 0).then(|| DATA.get() as u8)
    }

    fn send(&mut self, byte: u8) -> bool {
        let free = STATE.get() & TX_FULL == 0;
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

    fn feed(&mut self) {
        if WATCH_CONTROL.get() == 0 {
            // 20 ms to its interrupt, and as long again to the reset.
            WATCH_LOCK.set(0x1acc_e551);
            WATCH_LOAD.set(Here::CLOCK / 50);
            WATCH_CONTROL.set(3);
        }
        WATCH_CLEAR.set(1);
    }
}
