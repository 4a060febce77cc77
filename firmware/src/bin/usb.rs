//! The descriptors that a host reads of the wheel for games on this board, each request with its answer in hexadecimal, the wheel's torque
//! when the host plays an effect, and the number of instructions. The endpoints are the board's controller's own; its registers, which no
//! emulator has, are replaced by the controller of hapt-wire's tests.
#![no_std]
#![no_main]

use core::fmt::Write;
use core::hint::black_box;
use core::panic::PanicInfo;

use cortex_m_rt::entry;
use hapt_core::Phase;
use hapt_firmware::console::{File, exit};
use hapt_firmware::ticks;
use hapt_firmware::usb::{FullSpeed, MEMORY};
use hapt_wire::device::{Measurement, WheelMailbox, WheelSampler};
use hapt_wire::pid::{Condition, EFFECTS, FULL, Kind, Operation, Pool, Report};
use hapt_wire::usb::WheelPort;
use synopsys_usb_otg::UsbBus;
use usb_device::UsbDirection;
use usb_device::bus::UsbBusAllocator;
use usb_device::endpoint::{In, Out};

#[path = "../../../crates/hapt-wire/tests/wire/bus.rs"]
#[allow(dead_code)] // The tests use all of it.
mod bus;

use bus::{Controller, Host, MAX_TRANSFER_BYTES};

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
    let mut room = [0; MAX_TRANSFER_BYTES];
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
    let mut wheel = Moving::START;
    let mut run = |mailbox: &mut WheelMailbox, turn: &mut dyn FnMut(&mut WheelMailbox), samples| {
        let mut torque = 0.0;
        for _ in 0..samples {
            turn(mailbox);
            torque = wheel.sample(&mut sampler, mailbox);
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
    ticks::count();
    for effects in [0, 1, 4, EFFECTS] {
        let [of_a_sample, of_a_change] = [false, true].map(|changes| instructions(effects, changes));
        let _ = writeln!(console, "effects {effects} {of_a_sample:.0} {of_a_change:.0}");
    }
    let _ = writeln!(console, "report {:.0}", of_a_report());
    exit(0)
}

/// The supervisor tests its motor: this one moves, with the inertia and the damping of the wheel's world.
struct Moving {
    position: f32,
    velocity: f32,
}

impl Moving {
    const START: Moving = Moving { position: 0.0, velocity: 0.0 };

    fn sample(&mut self, sampler: &mut WheelSampler, mailbox: &mut WheelMailbox) -> f32 {
        let seen = Measurement { position: self.position, ..Measurement::default() };
        let torque = sampler.sample(&seen, mailbox).torque;
        self.velocity += sampler.period() * (torque - 0.05 * self.velocity) / 0.02;
        self.position += sampler.period() * self.velocity;
        torque
    }
}

/// The timer counts 24 bits of a clock that is five times as fast as the instructions.
const SAMPLES: u32 = 100;

/// Instructions of a number of samples, less those of a run of half the length.
fn counted(mut run: impl FnMut(u32)) -> f32 {
    let mut ticks_of = |samples| {
        let start = ticks::now();
        run(samples);
        ticks::between(start, ticks::now())
    };
    let (short, long) = (ticks_of(SAMPLES), ticks_of(2 * SAMPLES));
    (long - short) as f32 / ticks::of_an_instruction() / SAMPLES as f32
}

/// Instructions of a supervised sample while this many conditions play; `changes` puts a changed pool into the mailbox before each of them.
fn instructions(effects: usize, changes: bool) -> f32 {
    let mut pool = Pool::new();
    for block in 0..effects {
        let kinds = [Kind::Spring, Kind::Damper, Kind::Friction, Kind::Inertia];
        let kind = kinds.get(block % 4).copied().unwrap_or(Kind::Spring);
        pool.take(&Report::Create(kind), 0);
        pool.take(&condition(block), 0);
        pool.take(&Report::Operation { block, operation: Operation::Start, loops: 255 }, 0);
    }
    let Ok(mut sampler) = WheelSampler::new(WHEEL) else { exit(1) };
    let (mut mailbox, mut wheel) = (WheelMailbox::new(), Moving::START);
    mailbox.serve(Some(&pool), true);
    let mut run = |samples| {
        for _ in 0..samples {
            mailbox.serve(changes.then_some(&pool), true);
            black_box(wheel.sample(&mut sampler, &mut mailbox));
        }
    };
    // Until it is armed and has faded in.
    run(2000);
    let count = counted(&mut run);
    // A wheel that has stopped would be cheap.
    if mailbox.shown().phase != Phase::Running || mailbox.shown().playing != effects {
        exit(6);
    }
    count
}

fn condition(block: usize) -> Report {
    let condition = Condition {
        offset: 0,
        positive: FULL,
        negative: FULL / 2,
        positive_saturation: FULL,
        negative_saturation: FULL,
        dead_band: 0,
    };
    Report::Condition { block, axis: 0, condition }
}

/// Instructions of a report that changes a condition.
fn of_a_report() -> f32 {
    let mut pool = Pool::new();
    pool.take(&Report::Create(Kind::Spring), 0);
    let (bytes, length) = condition(0).write();
    counted(|reports| {
        for _ in 0..reports {
            let report = Report::read(black_box(bytes.get(..length).unwrap_or_default()));
            black_box(report.map(|report| pool.take(&report, 0)));
        }
    })
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
