//! The firmware: the loop in an interrupt, the wire in the main loop.
#![no_std]
#![no_main]

use core::panic::PanicInfo;

use cortex_m_rt::{entry, exception};
use hapt_firmware::board::{Board, Device, Line};
use hapt_firmware::halt::halt;
use hapt_firmware::shared::Shared;
use hapt_firmware::{Here, sample, ticks};
use hapt_wire::MAX_FRAME_BYTES;
use hapt_wire::device::{CommandHandler, Mailbox, Sampler, WorldStorage};

const BOARD: hapt_wire::device::Board = hapt_wire::device::Board {
    name: Here::NAME,
    firmware: env!("CARGO_PKG_VERSION"),
    externally_clocked: false,
    periods: [100e-6, 10e-3],
};

/// The data of the interrupt.
struct Loop {
    sampler: Sampler<'static>,
    mail: Mailbox<'static>,
    device: <Here as Board>::Device,
}

static LOOP: Shared<Loop> = Shared::new();

#[entry]
fn main() -> ! {
    static mut SLOTS: [WorldStorage; 2] = [WorldStorage::EMPTY; 2];
    let [one, other] = SLOTS;
    let (mut line, device) = Here::start();
    let mut desk = CommandHandler::new(BOARD, one);
    let sampler = Sampler::new(&BOARD, other);
    every(sampler.period());
    LOOP.put(Loop { sampler, mail: Mailbox::new(), device });
    let mut room = [0; MAX_FRAME_BYTES];
    let (mut length, mut sent) = (0, 0);
    loop {
        if let Some(byte) = line.receive() {
            desk.push(byte);
        }
        LOOP.with(|running| desk.exchange(&mut running.mail));
        match room.get(sent..length).and_then(|rest| rest.first()) {
            Some(byte) => sent += usize::from(line.send(*byte)),
            None => (length, sent) = (desk.answer(&mut room).map_or(0, <[u8]>::len), 0),
        }
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
        if cfg!(feature = "stall") {
            stall(sampler.next());
        }
        let delay = sample::take(device, missed, late, |seen| sampler.sample(seen));
        sampler.commanded(delay);
        device.feed();
        let swapped = sampler.exchange(mail);
        sampler.used(ticks::since_taken_up().saturating_sub(late));
        if swapped {
            every(sampler.period());
            ticks::hold_for(sampler.longest_hold());
        }
    });
}

/// For the tests: sample 2000 takes until five more periods have begun, and from 4000 on there are no more.
fn stall(sample: u64) {
    match sample {
        2000 => while ticks::due() < 5 {},
        4000.. => halt(),
        _ => {}
    }
}

/// Begins a period every `period` seconds.
fn every(period: f32) {
    ticks::every((period * Here::CLOCK as f32 + 0.5) as u32);
}

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    halt()
}
