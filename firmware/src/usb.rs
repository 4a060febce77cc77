//! The USB of STM32F4: the crate synopsys-usb-otg on the full-speed controller at PA11 and PA12. Manual: ST RM0090, 34.

use synopsys_usb_otg::UsbPeripheral;

use super::register::Register;

/// Words for a host's packets: one of the control pipe, and one of the reports.
pub const MEMORY: usize = 2 * hapt_wire::usb::PACKET as usize / 4;

/// OTG_FS.
pub struct FullSpeed;

// SAFETY: the registers are those of the controller, and nothing else in the program touches them.
unsafe impl UsbPeripheral for FullSpeed {
    const REGISTERS: *const () = 0x5000_0000 as *const ();
    const HIGH_SPEED: bool = false;
    const FIFO_DEPTH_WORDS: usize = 320;
    const ENDPOINT_COUNT: usize = 4;

    fn enable() {
        const ON: Register = Register::at(0x4002_3834);
        const RESET: Register = Register::at(0x4002_3814);
        const OTG: u32 = 1 << 7;
        ON.change(|x| x | OTG);
        RESET.change(|x| x | OTG);
        RESET.change(|x| x & !OTG);
    }

    fn ahb_frequency_hz(&self) -> u32 {
        <super::Here as super::board::Board>::CLOCK
    }
}

/// The lock of the USB crates while they use the controller. They run only in the main loop, and no interrupt uses the controller: there is
/// nothing to lock, and a sample waits for no packet.
struct MainLoop;
critical_section::set_impl!(MainLoop);

// SAFETY: `acquire` is called only by the main loop, through the USB crates; no interrupt of this program uses a critical section, and
// there is one processor.
unsafe impl critical_section::Impl for MainLoop {
    unsafe fn acquire() -> critical_section::RawRestoreState {}

    unsafe fn release(_: critical_section::RawRestoreState) {}
}
