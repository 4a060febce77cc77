//! ARM's MPS2 with the FPGA images AN386 (Cortex-M4F) and AN500 (Cortex-M7), as QEMU has them: UART 0 of the CMSDK, its watchdog, and a
//! puck that swings by itself. Manuals: ARM DAI 0386, DDI 0479.

use super::board::{Board, Device};
use super::register::Register;
use super::swing::Swing;
use super::uart::Uart;

const DATA: Register = Register::at(0x4000_4000);
const STATE: Register = Register::at(0x4000_4004);
const CONTROL: Register = Register::at(0x4000_4008);
const DIVIDER: Register = Register::at(0x4000_4010);

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
    type Device = Puck;

    /// There is no motor.
    fn cut() {}

    fn start() -> (Uart, Puck) {
        DIVIDER.set(Self::CLOCK / 921_600);
        CONTROL.set(3);
        (Uart { state: STATE, received: DATA, sent: DATA, full: (1 << 1, true), free: (1, false) }, Puck(Swing::START))
    }
}

/// Its puck, and its watchdog.
pub struct Puck(Swing);

impl Device for Puck {
    fn position(&mut self) -> f32 {
        self.0.next()
    }

    fn fault(&mut self) -> bool {
        false
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
