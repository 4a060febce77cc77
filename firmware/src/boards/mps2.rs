//! ARM's MPS2 as QEMU has it: UART 0 of the CMSDK, its watchdog, and a puck that swings by itself. With the FPGA images AN386 (Cortex-M4F) and
//! AN500 (Cortex-M7), and AN505 (Cortex-M33, as in an RP2350) in its secure state. Manuals: ARM DAI 0386, DAI 0505, DDI 0479.

use super::board::{Board, Device};
use super::register::Register;
use super::swing::Swing;
use super::uart::Uart;

/// The image's name, its clock in Hz, and where the UART and the watchdog begin.
#[cfg(feature = "mps2")]
const IMAGE: (&str, u32, usize, usize) = ("mps2", 25_000_000, 0x4000_4000, 0x4000_8000);
#[cfg(feature = "mps2-an505")]
const IMAGE: (&str, u32, usize, usize) = ("mps2-an505", 20_000_000, 0x5020_0000, 0x5008_1000);

const DATA: Register = Register::at(IMAGE.2);
const STATE: Register = Register::at(IMAGE.2 + 0x4);
const CONTROL: Register = Register::at(IMAGE.2 + 0x8);
const DIVIDER: Register = Register::at(IMAGE.2 + 0x10);

const WATCH_LOAD: Register = Register::at(IMAGE.3);
const WATCH_CONTROL: Register = Register::at(IMAGE.3 + 0x8);
const WATCH_CLEAR: Register = Register::at(IMAGE.3 + 0xc);
const WATCH_LOCK: Register = Register::at(IMAGE.3 + 0xc00);

/// The board.
pub struct Here;

impl Board for Here {
    const NAME: &'static str = IMAGE.0;
    const CLOCK: u32 = IMAGE.1;

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
