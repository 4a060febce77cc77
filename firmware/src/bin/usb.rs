//! What a host reads of the wheel for games on this board, each request with its answer in hexadecimal, and what the wheel does when the host plays an effect. The endpoints are
//! the board's controller's own; in place of its registers, which no emulator has, stands the controller of hapt-wire's tests.
#![no_std]
#![no_main]

use core::fmt::Write;
use core::panic::PanicInfo;

use cortex_m_rt::entry;
use hapt_firmware::console::{File, exit};
use hapt_firmware::usb::{FullSpeed, MEMORY};
use hapt_wire::device::{Measurement, WheelMailbox, WheelSampler};
use hapt_wire::pid::{FULL, Kind, Operation, Report};
use hapt_wire::usb::WheelPort;
use synopsys_usb_otg::UsbBus;
use usb_device::UsbDirection;
use usb_device::bus::UsbBusAllocator;
use usb_device::endpoint::{In, Out};

#[path = "../../../crates/hapt-wire/tests/wire/bus.rs"]
#[allow(dead_code)] // The tests use all of it.
mod bus;

use bus::{Controller, Host, LONGEST};

static WHEEL: &[u8] = include_bytes!("../../worlds/game-wheel.bin");
static HOST: Host = Host::new();

#[entry]
fn main() -> ! {
    static mut ROOM: [u32; MEMORY] = [0; MEMORY];
    let Ok(mut sampler) = WheelSampler::new(WHEEL) else { exit(1) };
    let board = UsbBus::new(FullSpeed, ROOM);
    let bus = UsbBusAllocator::new(Controller::new(&HOST, move |direction, address, kind, most, interval| {
        Ok(match direction {
            UsbDirection::In => board.alloc::<In>(address, kind, most, interval)?.address(),
            UsbDirection::Out => board.alloc::<Out>(address, kind, most, interval)?.address(),
        })
    }));
    let Ok(mut port) = WheelPort::new(&bus, sampler.half()) else { exit(2) };
    let mut mailbox = WheelMailbox::new();
    let mut console = File::console();
    let mut room = [0; LONGEST];
    let mut turn = |mailbox: &mut WheelMailbox| {
        port.poll();
        port.exchange(mailbox);
    };
    for setup in REQUESTS {
        let Some(answer) = HOST.control(setup, &[], &mut room, || turn(&mut mailbox)) else { exit(3) };
        for (byte, end) in setup.iter().zip([""; 7].into_iter().chain([" "])) {
            let _ = write!(console, "{byte:02x}{end}");
        }
        for byte in answer {
            let _ = write!(console, "{byte:02x}");
        }
        let _ = writeln!(console);
    }
    // The supervisor tests its motor: here is one that moves, with the inertia and the damping of the wheel's world.
    let (mut position, mut velocity) = (0.0, 0.0);
    let mut run = |mailbox: &mut WheelMailbox, turn: &mut dyn FnMut(&mut WheelMailbox), samples| {
        let mut torque = 0.0;
        for _ in 0..samples {
            turn(mailbox);
            torque = sampler.sample(&Measurement { position, ..Measurement::default() }, mailbox).torque;
            velocity += sampler.period() * (torque - 0.05 * velocity) / 0.02;
            position += sampler.period() * velocity;
        }
        torque
    };
    if HOST.control([0, 9, 1, 0, 0, 0, 0, 0], &[], &mut room, || turn(&mut mailbox)).is_none() {
        exit(4);
    }
    let before = run(&mut mailbox, &mut turn, 2000);
    for report in [
        Report::Create(Kind::Constant),
        Report::Constant { block: 0, magnitude: -FULL / 2 },
        Report::Operation { block: 0, operation: Operation::Start, loops: 1 },
    ] {
        let (bytes, length) = report.write();
        let bytes = bytes.get(..length).unwrap_or_default();
        if matches!(report, Report::Create(_)) {
            let setup = [0x21, 9, bytes[0], 3, 0, 0, length as u8, 0];
            HOST.control(setup, bytes, &mut room, || turn(&mut mailbox));
        } else {
            HOST.send(1, bytes, || turn(&mut mailbox));
        }
    }
    let during = run(&mut mailbox, &mut turn, 50);
    HOST.signal(usb_device::bus::PollResult::Suspend);
    let after = run(&mut mailbox, &mut turn, 50);
    let _ = writeln!(console, "{before} {during} {after}");
    exit(0)
}

/// The device, its configuration, its reports, and its texts.
const REQUESTS: [[u8; 8]; 6] = [
    [0x80, 6, 0, 1, 0, 0, 18, 0],
    [0x80, 6, 0, 2, 0, 0, 0xff, 0],
    [0x81, 6, 0, 0x22, 0, 0, 0xff, 0x0f],
    [0x80, 6, 1, 3, 0x09, 0x04, 0xff, 0],
    [0x80, 6, 2, 3, 0x09, 0x04, 0xff, 0],
    [0x80, 6, 3, 3, 0x09, 0x04, 0xff, 0],
];

#[panic_handler]
fn panic(_: &PanicInfo) -> ! {
    exit(5)
}
