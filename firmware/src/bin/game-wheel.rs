//! A force-feedback wheel for games by itself: the loop and the effects in an interrupt, USB in the main loop.
#![no_std]
#![no_main]

use core::panic::PanicInfo;

use cortex_m_rt::{entry, exception};
use hapt_firmware::board::{Board, Device};
use hapt_firmware::halt::halt;
use hapt_firmware::shared::Shared;
use hapt_firmware::usb::{FullSpeed, MEMORY};
use hapt_firmware::{Here, sample, ticks};
use hapt_wire::device::{WheelMailbox, WheelSampler};
use hapt_wire::usb::WheelPort;
use synopsys_usb_otg::UsbBus;

/// The wheel, as `cargo xtask firmware game-wheel FILE` has made it of a world.
static WHEEL: &[u8] = include_bytes!("../../worlds/game-wheel.bin");

/// The data of the interrupt.
struct Loop {
    sampler: WheelSampler,
    mail: WheelMailbox,
    device: <Here as Board>::Device,
}

static LOOP: Shared<Loop> = Shared::new();

#[entry]
fn main() -> ! {
    static mut ROOM: [u32; MEMORY] = [0; MEMORY];
    // Before the watchdog runs, for it takes a while. A wheel that the core does not take never starts, and the bridge stays off.
    let Ok(sampler) = WheelSampler::new(WHEEL) else { halt() };
    let (_, device) = Here::start();
    let (period, longest_hold, half) = (sampler.period(), sampler.longest_hold(), sampler.half());
    LOOP.put(Loop { sampler, mail: WheelMailbox::new(), device });
    ticks::every((period * Here::CLOCK as f32 + 0.5) as u32);
    ticks::hold_for(longest_hold);
    let bus = UsbBus::new(FullSpeed, ROOM);
    let Ok(mut port) = WheelPort::new(&bus, half) else { halt() };
    loop {
        port.poll();
        LOOP.with(|running| port.exchange(&mut running.mail));
    }
}

/// A period begins. Where no sample has been taken for longer than the world allows, the torque is removed here, for any cause of the
/// delay.
#[exception]
fn SysTick() {
    if ticks::begin() {
        Here::cut();
    }
}

/// A sample, below SysTick: the periods that begin while it is taken are counted as missed.
#[exception]
fn PendSV() {
    let (begun, late) = ticks::take_up();
    let Some(missed) = begun.checked_sub(1) else { return };
    LOOP.with_in_interrupt(|running| {
        let Loop { sampler, mail, device } = running;
        let delay = sample::take(device, missed, late, |seen| sampler.sample(seen, mail));
        sampler.commanded(delay);
        device.feed();
    });
}

/// Only the USB crates can panic; no interrupt can. The torque is removed at once, and the watchdog resets the board.
#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    Here::cut();
    halt()
}
