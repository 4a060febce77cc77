//! Both drives on a CAN bus of the system, with its faults: the torque is removed for the right reason, and returns only after a new
//! start. This is a separate test program: `cargo xtask guest` runs it in an emulated machine, which has exclusive use of the interface.
//!
//! Time is that of the loop (1 ms a sample), at any speed of the machine.

#![cfg(target_os = "linux")]

#[path = "../drive/bench.rs"]
mod bench;

use std::process::Command;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering::SeqCst};

use bench::{Looped, TestBench, lockstep, soon, world};
use hapt_core::{Phase, Reason, Request};
use hapt_drive::odrive::codec;
use hapt_drive::simulate::{Firmware, Time};
use hapt_drive::{Bus, DriveLimits, Error, Frame, Make, Socket, moteus, odrive};
use hapt_model::World;
use hapt_rt::Failure;

/// One test at a time uses the bus.
static BUS: Mutex<()> = Mutex::new(());
/// Longer than an answer takes and shorter than the timeout of lockstep, ms.
const ANSWER_MS: u64 = 40;
/// The longest accepted time in s: an emulated machine may pause.
const WATCHDOG: f64 = 0.095;
const TERMS: DriveLimits = DriveLimits { watchdog: 0.1, torque: 1.0 };

/// Runs a test for each drive, on the interface that the environment names.
fn on_the_bus(test: impl Fn(Make, &str)) {
    let Ok(interface) = std::env::var("HAPT_CAN") else {
        println!("SKIPPED: needs a CAN interface in HAPT_CAN, such as vcan0; cargo xtask guest has one");
        return;
    };
    let _bus = BUS.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    for make in Make::ALL.into_iter().filter(|make| make.has_can()) {
        println!("{}", make.name());
        test(make, &interface);
    }
}

fn firmware(make: Make, id: u8) -> Box<dyn Firmware> {
    match make {
        Make::Moteus => Box::new(moteus::Simulated::new(id)),
        Make::Odrive => Box::new(odrive::Simulated::new(id).with_watchdog(Some(WATCHDOG))),
        Make::Simplefoc => panic!("it has no CAN"),
    }
}

fn bench(make: Make, interface: &str, world: &World, time: Time) -> TestBench {
    TestBench::new(make, Some(interface), firmware(make, 1), world, time)
}

/// A running loop on such a drive.
fn running(make: Make, interface: &str, world: &World, firmware: Box<dyn Firmware>) -> (TestBench, Looped) {
    let bench = TestBench::new(make, Some(interface), firmware, world, lockstep(world));
    let looped = bench.running(world, ANSWER_MS);
    (bench, looped)
}

/// Checks the end: no torque, also when the bus has recovered.
fn stays_over(looped: &mut Looped, bench: &TestBench) {
    bench.torque_goes_off();
    for _ in 0..20 {
        match looped.sample(Some(Request::Arm)) {
            Ok(record) => assert_eq!((record.phase, record.output), (Phase::Faulted, 0.0)),
            Err(Failure::Ended) => panic!("that is no reason"),
            Err(_) => {}
        }
        assert_eq!(bench.faults.torque(), 0.0);
    }
}

/// The firmwares of a make, with each kind of requests.
fn kinds(make: Make) -> Vec<Box<dyn Firmware>> {
    let shipped = odrive::Simulated::new(1).with_watchdog(Some(WATCHDOG)).with_estimates(Some(0.01));
    let old = shipped.clone().with_version(codec::Version::SILENT);
    match make {
        Make::Moteus | Make::Simplefoc => vec![firmware(make, 1)],
        Make::Odrive => vec![firmware(make, 1), Box::new(shipped), Box::new(old)],
    }
}

#[test]
fn a_certified_world_comes_to_rest() {
    on_the_bus(|make, interface| {
        let world = world(&[]);
        assert!(hapt_analysis::check(&world).unwrap().certified.holds());
        for firmware in kinds(make) {
            let (bench, mut looped) = running(make, interface, &world, firmware);
            let (mut last, mut missed) = (Vec::new(), 0);
            for _ in 0..3000 {
                let record = looped.sample(None).unwrap();
                assert_eq!(record.phase, Phase::Running, "{record:?}");
                missed += record.missed;
                last.push(record.position);
            }
            println!("{missed} samples of 3000 missed");
            assert!(last[2900..].iter().all(|position| (position - 0.3).abs() < 0.01), "{:?}", &last[2900..]);
            drop(looped);
            bench.torque_goes_off();
        }
    });
}

#[test]
fn a_drive_that_is_killed_is_gone() {
    on_the_bus(|make, interface| {
        let world = world(&[]);
        let (bench, mut looped) = running(make, interface, &world, firmware(make, 1));
        bench.faults.dead.store(true, SeqCst);
        assert_eq!(looped.ends(8), Some(Err(Failure::Gone)));
        bench.faults.dead.store(false, SeqCst);
        stays_over(&mut looped, &bench);
    });
}

fn link(interface: &str, how: &str) {
    let status = Command::new("ip").args(["link", "set", interface, how]).status();
    assert!(status.is_ok_and(|status| status.success()), "ip link set {interface} {how}");
}

#[test]
fn a_bus_that_goes_down_and_up_again_restores_no_torque() {
    on_the_bus(|make, interface| {
        let world = world(&[]);
        let (bench, mut looped) = running(make, interface, &world, firmware(make, 1));
        link(interface, "down");
        let ends = looped.ends(8);
        link(interface, "up");
        assert!(matches!(ends, Some(Err(Failure::Unplugged | Failure::Gone))), "{ends:?}");
        stays_over(&mut looped, &bench);
        // A new start is a deliberate request.
        drop(looped);
        bench.looped(&world, ANSWER_MS).sample(None).unwrap();
    });
}

#[test]
fn lost_frames_are_missed_samples_and_too_many_end_the_loop() {
    on_the_bus(|make, interface| {
        for (loss, must_end) in [(10, false), (100, false), (500, true)] {
            let world = world(&[]);
            let (bench, mut looped) = running(make, interface, &world, firmware(make, 1));
            // Two of them in a row do not end lockstep.
            bench.wait_for(ANSWER_MS / 2);
            bench.faults.loss.store(loss, SeqCst);
            let before = looped.samples;
            let (ends, stood_still) = looped.ends_or_stands_still(1000);
            println!("{} % lost: {ends:?} after {} samples", f64::from(loss) / 10.0, looped.samples - before);
            match ends {
                None => assert!(!must_end, "{loss} of 1000"),
                // Its own watchdog, or the loop's timeout.
                Some(Ok(reason)) => assert!(reason == Reason::Late || stood_still, "{reason:?}"),
                Some(Err(Failure::Gone)) => {}
                Some(Err(Failure::Drive(fault))) => assert_eq!(fault.reason, Some(Reason::Late)),
                Some(Err(failure)) => panic!("{failure}"),
            }
            bench.faults.loss.store(0, SeqCst);
            if ends.is_some() {
                stays_over(&mut looped, &bench);
            }
        }
    });
}

#[test]
fn a_drive_that_answers_late_is_late() {
    on_the_bus(|make, interface| {
        let world = world(&[]);
        let (bench, mut looped) = running(make, interface, &world, firmware(make, 1));
        bench.faults.late.store(ANSWER_MS * 3 / 2, SeqCst);
        let ends = looped.ends(100);
        let by_drive = |fault: hapt_rt::DriveFault| fault.reason == Some(Reason::Late);
        let is_right = match ends {
            Some(Ok(reason)) => reason == Reason::Late,
            Some(Err(Failure::Drive(fault))) => by_drive(fault),
            other => other == Some(Err(Failure::Gone)),
        };
        assert!(is_right, "{ends:?}");
        bench.faults.late.store(0, SeqCst);
        stays_over(&mut looped, &bench);
    });
}

#[test]
fn a_drive_with_another_identifier_is_refused_and_named() {
    on_the_bus(|make, interface| {
        let world = world(&[]);
        let bench = TestBench::new(make, Some(interface), firmware(make, 7), &world, Time::Real);
        match bench.drive(1).start(&TERMS) {
            Err(error @ Error::Silent { .. }) => assert!(error.to_string().contains('7'), "{error}"),
            other => panic!("{other:?}"),
        }
        assert_eq!(bench.faults.torque(), 0.0);
    });
}

#[test]
fn two_odrives_with_one_identifier_are_not_driven() {
    on_the_bus(|make, interface| {
        let world = world(&[]);
        let (first, second) = (bench(make, interface, &world, Time::Real), bench(make, interface, &world, Time::Real));
        if make == Make::Odrive {
            match first.drive(1).start(&TERMS) {
                Err(error @ Error::Refused { .. }) => assert!(error.to_string().contains("2 drives"), "{error}"),
                other => panic!("{other:?}"),
            }
        }
        assert_eq!((first.faults.torque(), second.faults.torque()), (0.0, 0.0));
    });
}

/// Every command of another host moves the drive, and every request may precede a command.
#[test]
fn another_host_on_the_bus_ends_the_loop() {
    on_the_bus(|make, interface| {
        let world = world(&[]);
        let frames = match make {
            // A torque, and a request.
            Make::Odrive => [Frame::classic(0x2e, &codec::floats(0.5, 0.0)), Frame::remote(0x29, 8)],
            // A stop, which removes the torque, and a request.
            Make::Moteus => [Frame::fd(0x0001, &[0x01, 0x00, 0x00]), Frame::fd(0x8501, &[0x11, 0x00])],
            Make::Simplefoc => panic!("it has no CAN"),
        };
        for frame in frames {
            let (bench, mut looped) = running(make, interface, &world, firmware(make, 1));
            Socket::open(interface).unwrap().send(&frame, soon()).unwrap();
            match looped.ends(20) {
                Some(Err(Failure::Drive(fault))) => assert_eq!(fault.reason, Some(Reason::Link), "{fault}"),
                other => panic!("{other:?}"),
            }
            stays_over(&mut looped, &bench);
        }
    });
}

/// Other traffic on the bus may make the loop late, but does not block it.
#[test]
fn a_busy_bus_does_not_block_the_loop() {
    on_the_bus(|make, interface| {
        let world = world(&[]);
        let (bench, mut looped) = running(make, interface, &world, firmware(make, 1));
        let is_over = AtomicBool::new(false);
        let ends = std::thread::scope(|scope| {
            scope.spawn(|| {
                let mut others = Socket::open(interface).unwrap();
                while !is_over.load(SeqCst) {
                    for node in 40_u32..60 {
                        let _ = others.send(&Frame::classic(node << 5 | 9, &[0; 8]), soon());
                    }
                    std::thread::yield_now();
                }
            });
            let ends = looped.ends(300);
            is_over.store(true, SeqCst);
            ends
        });
        println!("{ends:?}");
        match ends {
            None => {}
            Some(Ok(reason)) => assert_eq!(reason, Reason::Late),
            Some(Err(Failure::Gone)) => {}
            Some(Err(Failure::Drive(fault))) => assert_eq!(fault.reason, Some(Reason::Late)),
            Some(Err(failure)) => panic!("{failure}"),
        }
        drop(looped);
        bench.torque_goes_off();
    });
}
