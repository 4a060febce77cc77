//! The loop on a simulated SimpleFOC board: a certified world comes to rest, every fault removes the torque, and no torque is beyond the
//! limit.

use std::cell::{Cell, RefCell};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::SeqCst};

use hapt_core::{Phase, Reason};
use hapt_drive::simplefoc::{Client, MotorConstant, SimpleFoc, Simulated, VERSION};
use hapt_drive::simulate::{Firmware, Shaft};
use hapt_drive::{DriveDevice, DriveLimits, Error, Frame, Line, Make};
use hapt_rt::{Device as _, Failure};
use hapt_testing::{cases, in_time};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

use crate::bench::{Looped, Place, TestBench, WaitingDrive, lockstep, world};

/// Longer than an answer takes and shorter than the timeout of lockstep, ms.
const ANSWER_MS: u64 = 30;
const TERMS: DriveLimits = DriveLimits { watchdog: 0.01, torque: 0.1 };

/// A board that executes an injected action at the next line after the flag is set.
struct Struck(Simulated, Arc<AtomicBool>, fn(&mut Simulated));

impl Firmware for Struck {
    fn requests_position(&self, frame: &Frame) -> bool {
        self.0.requests_position(frame)
    }

    fn receive(&mut self, frame: &Frame, shaft: Shaft, send: &mut dyn FnMut(Frame)) {
        if self.1.swap(false, SeqCst) {
            self.2(&mut self.0);
        }
        self.0.receive(frame, shaft, send);
    }

    fn pass(&mut self, seconds: f64, shaft: Shaft, send: &mut dyn FnMut(Frame)) -> f64 {
        self.0.pass(seconds, shaft, send)
    }
}

fn bench(firmware: impl Firmware + 'static) -> TestBench {
    let world = world(&[]);
    TestBench::new(Make::Simplefoc, None, Box::new(firmware), &world, lockstep(&world))
}

/// The error of a start that fails; asserts that there is no torque.
fn refused(firmware: impl Firmware + 'static) -> Error {
    let bench = bench(firmware);
    let error = bench.drive(1).start(&TERMS).unwrap_err();
    bench.torque_goes_off();
    error
}

#[test]
fn a_certified_world_brings_the_puck_to_rest_on_a_simplefoc_board() {
    in_time(|| {
        let world = world(&[]);
        assert!(hapt_analysis::check(&world).unwrap().certified.holds());
        let bench = bench(Simulated::new());
        let mut looped = bench.running(&world, ANSWER_MS);
        let mut last = Vec::new();
        for _ in 0..3000 {
            let record = looped.sample(None).unwrap();
            assert_eq!(record.phase, Phase::Running, "{record:?}");
            last.push(record.position);
        }
        assert!(last[2900..].iter().all(|position| (position - 0.3).abs() < 0.01), "{:?}", &last[2900..]);
    });
}

#[test]
fn a_board_with_other_settings_is_not_driven() {
    in_time(|| {
        let is_refused = |error: Error, words: &str| {
            assert!(matches!(error, Error::Refused { .. }) && error.to_string().contains(words), "{error}");
        };
        is_refused(refused(Simulated::new().with_version(VERSION + 1)), "version 2, expected 1");
        is_refused(refused(Simulated::new().with_motor(MotorConstant::TorqueConstant(0.05))), "torque-constant");
        is_refused(refused(Simulated::new().with_limit(1.9)), "lower device.limit");
        is_refused(refused(Simulated::new().with_limit(f32::NAN)), "lower device.limit");
        let mut failed = Simulated::new();
        failed.fail();
        assert!(matches!(refused(failed), Error::Fault { fault, .. } if fault.reason == Some(Reason::Driver)));
    });
}

/// A board that controls something else.
struct Unit(u8);

impl Firmware for Unit {
    fn requests_position(&self, _: &Frame) -> bool {
        false
    }

    fn receive(&mut self, frame: &Frame, shaft: Shaft, send: &mut dyn FnMut(Frame)) {
        Simulated::new().receive(frame, shaft, &mut |answer| {
            let mut data = answer.data().to_vec();
            if answer.id == u32::from(b'V') {
                data[2] = self.0;
            }
            send(Frame::fd(answer.id, &data));
        });
    }

    fn pass(&mut self, _: f64, _: Shaft, _: &mut dyn FnMut(Frame)) -> f64 {
        0.0
    }
}

#[test]
fn a_board_that_controls_an_estimated_current_or_no_torque_is_not_driven() {
    in_time(|| {
        for (unit, words) in [(b'E', "estimated current"), (b'?', "neither the voltage nor the current")] {
            let error = refused(Unit(unit));
            assert!(matches!(error, Error::Refused { .. }) && error.to_string().contains(words), "{error}");
        }
    });
}

/// A sketch whose watchdog does not count.
struct Sleepless(Simulated);

impl Firmware for Sleepless {
    fn requests_position(&self, frame: &Frame) -> bool {
        self.0.requests_position(frame)
    }

    fn receive(&mut self, frame: &Frame, shaft: Shaft, send: &mut dyn FnMut(Frame)) {
        self.0.receive(frame, shaft, send);
    }

    fn pass(&mut self, _: f64, shaft: Shaft, send: &mut dyn FnMut(Frame)) -> f64 {
        self.0.pass(0.0, shaft, send)
    }
}

#[test]
fn a_board_without_a_watchdog_is_not_driven() {
    in_time(|| {
        let error = refused(Sleepless(Simulated::new()));
        assert!(error.to_string().contains("no watchdog"), "{error}");
    });
}

#[test]
fn a_port_without_the_sketch_is_reported() {
    in_time(|| {
        let bench = bench(Simulated::new());
        bench.faults.dead.store(true, SeqCst);
        let error = bench.drive(1).start(&TERMS).unwrap_err();
        assert!(matches!(error, Error::Silent { .. }) && error.to_string().contains("simplefoc_drive"), "{error}");
    });
}

#[test]
fn a_board_that_restarts_or_whose_driver_fails_ends_the_loop_by_name_and_stays_off() {
    in_time(|| {
        let strikes: [fn(&mut Simulated); 2] = [Simulated::restart, Simulated::fail];
        for (strike, reason) in strikes.into_iter().zip([Reason::Link, Reason::Driver]) {
            let world = world(&[]);
            let is_struck = Arc::new(AtomicBool::new(false));
            let bench = bench(Struck(Simulated::new(), Arc::clone(&is_struck), strike));
            let mut looped = bench.running(&world, ANSWER_MS);
            is_struck.store(true, SeqCst);
            match looped.ends(3) {
                Some(Err(Failure::Drive(fault))) => assert_eq!(fault.reason, Some(reason), "{fault}"),
                other => panic!("{other:?}"),
            }
            for _ in 0..20 {
                assert!(matches!(looped.sample(None), Err(Failure::Drive(_))), "it is switched on again");
            }
            bench.torque_goes_off();
        }
    });
}

#[test]
fn a_board_that_stops_answering_ends_the_loop_and_its_watchdog_removes_the_torque() {
    in_time(|| {
        let world = world(&[]);
        let bench = bench(Simulated::new());
        let mut looped = bench.running(&world, ANSWER_MS);
        assert!(bench.faults.torque() != 0.0);
        bench.faults.dead.store(true, SeqCst);
        let ended = looped.ends(20);
        assert!(matches!(ended, Some(Err(Failure::Gone) | Ok(Reason::Late))), "{ended:?}");
        bench.torque_goes_off();
    });
}

/// The board renders a fraction of each target, as with a lower `voltage_limit`.
struct Weak(Simulated);

impl Firmware for Weak {
    fn requests_position(&self, frame: &Frame) -> bool {
        self.0.requests_position(frame)
    }

    fn receive(&mut self, frame: &Frame, shaft: Shaft, send: &mut dyn FnMut(Frame)) {
        self.0.receive(frame, shaft, &mut |answer| {
            let mut data = answer.data().to_vec();
            if let Some(bytes) = data.get(9..13).and_then(|bytes| <[u8; 4]>::try_from(bytes).ok()) {
                let used = f32::from_be_bytes(bytes).clamp(-0.4, 0.4);
                data[9..].copy_from_slice(&used.to_be_bytes());
            }
            send(Frame::fd(answer.id, &data));
        });
    }

    fn pass(&mut self, seconds: f64, shaft: Shaft, send: &mut dyn FnMut(Frame)) -> f64 {
        self.0.pass(seconds, shaft, send)
    }
}

#[test]
fn a_board_that_uses_another_voltage_ends_the_loop_by_name() {
    in_time(|| {
        let world = world(&["safety.pulse=0"]);
        let bench = TestBench::new(Make::Simplefoc, None, Box::new(Weak(Simulated::new())), &world, lockstep(&world));
        bench.wait_for(ANSWER_MS);
        let mut looped = Looped::on(Box::new(bench.wheel(&world)), &world);
        let mut request = Some(hapt_core::Request::Arm);
        match (0..2000).find_map(|_| looped.sample(request.take()).err()) {
            Some(Failure::Drive(fault)) => assert!(fault.what.contains("another voltage"), "{fault}"),
            other => panic!("{other:?}"),
        }
        bench.torque_goes_off();
    });
}

/// A drive by current on this bench.
fn by_current(bench: &TestBench) -> DriveDevice {
    let Place::Port(path) = &bench.place else { panic!("it has a port") };
    let open = || {
        let bus = Box::new(Client::new(Line::open(path).unwrap()));
        let drive = SimpleFoc::new(bus, MotorConstant::TorqueConstant(0.04), "here");
        let drive = WaitingDrive(Box::new(drive), Arc::new(AtomicU64::new(ANSWER_MS)));
        DriveDevice::start(Box::new(drive), &world(&["loop.period=100 ms"]))
    };
    (0..20).find_map(|_| open().ok()).expect("it starts")
}

/// The board's motor is controlled by current, and the torque is the commanded one; where the current is not the commanded one, the loop
/// ends.
#[test]
fn a_board_by_current_gives_the_torque_or_ends_the_loop() {
    in_time(|| {
        let world = world(&["loop.period=100 ms"]);
        for is_weak in [false, true] {
            let board = Simulated::new().with_motor(MotorConstant::TorqueConstant(0.04));
            let firmware: Box<dyn Firmware> = if is_weak { Box::new(Weak(board)) } else { Box::new(board) };
            let bench = TestBench::new(Make::Simplefoc, None, firmware, &world, lockstep(&world));
            // 2.5 A, of which the weak one has 0.4. If the machine pauses, the watchdog ends it.
            let ends = || {
                let mut wheel = by_current(&bench);
                (0..60).find_map(|_| {
                    let ended = wheel.read().and_then(|_| wheel.write(0.1)).err();
                    assert!(bench.faults.torque() <= 0.1 * (1.0 + 1e-6));
                    ended
                })
            };
            let is_right = |ended: &Option<Failure>| match ended {
                None => !is_weak,
                Some(Failure::Drive(fault)) => is_weak && fault.what.contains("another current"),
                Some(_) => false,
            };
            assert!((0..20).any(|_| is_right(&ends())), "weak: {is_weak}");
            bench.torque_goes_off();
        }
    });
}

/// For any commanded number the board's torque is that number, or the limit, or 0 for a NaN.
#[test]
fn no_command_gives_a_torque_beyond_the_limit() {
    in_time(|| {
        // A watchdog of a second.
        let world = world(&["device.drive.gear=3", "loop.period=100 ms"]);
        let bench = TestBench::new(Make::Simplefoc, None, Box::new(Simulated::new()), &world, lockstep(&world));
        let number = prop_oneof![any::<f64>(), -0.2..0.2, Just(f64::NAN), Just(f64::INFINITY)];
        let wheel = RefCell::new(bench.wheel(&world));
        let (requested, made) = (Cell::new(0), Cell::new(0));
        TestRunner::new(cases(256))
            .run(&number, |torque| {
                let mut wheel = wheel.borrow_mut();
                requested.set(requested.get() + 1);
                // If the machine pauses, the watchdog ends it.
                let Ok(_) = wheel.read().and_then(|_| wheel.write(torque)).and_then(|()| wheel.read()) else {
                    *wheel = bench.wheel(&world);
                    return Ok(());
                };
                made.set(made.get() + u32::from(wheel.missed() == 0));
                let wanted = if torque.is_finite() { torque.clamp(-0.1, 0.1) / 3.0 } else { 0.0 };
                let torque = bench.faults.torque();
                prop_assert!(torque.abs() <= 0.1 / 3.0 * (1.0 + 1e-6));
                prop_assert!((torque - wanted).abs() < 1e-7 || wheel.missed() > 0, "{wanted}: {torque} N m");
                Ok(())
            })
            .unwrap();
        assert!(2 * made.get() > requested.get(), "{made:?} of {requested:?}");
    });
}
