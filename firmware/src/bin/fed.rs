//! The firmware of a board without encoder and motor: it takes a sample whenever the host sends a reading. Hardware in the loop, with the
//! host as the hardware.
#![no_std]
#![no_main]

use core::panic::PanicInfo;

use cortex_m_rt::entry;
use hapt_firmware::Here;
use hapt_firmware::board::{Board, Line};
use hapt_firmware::halt::halt;
use hapt_wire::MAX_FRAME_BYTES;
use hapt_wire::device::{Endpoint, WorldStorage};

const BOARD: hapt_wire::device::Board = hapt_wire::device::Board {
    name: Here::NAME,
    firmware: env!("CARGO_PKG_VERSION"),
    externally_clocked: true,
    periods: [50e-6, 0.1],
};

#[entry]
fn main() -> ! {
    static mut SLOTS: [WorldStorage; 2] = [WorldStorage::EMPTY; 2];
    let [one, other] = SLOTS;
    let (mut line, _) = Here::start();
    let mut station = Endpoint::new(BOARD, one, other);
    let mut room = [0; MAX_FRAME_BYTES];
    loop {
        if let Some(byte) = line.receive() {
            station.push(byte);
            while let Some(frame) = station.answer(&mut room) {
                for byte in frame {
                    while !line.send(*byte) {}
                }
            }
        }
    }
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    halt()
}
