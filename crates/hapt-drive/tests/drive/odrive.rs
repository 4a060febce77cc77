//! The loop on a simulated ODrive behind a serial adapter: a certified world comes to rest, and every fault removes the torque.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::SeqCst};
use std::time::{Duration, Instant};

use hapt_core::{Phase, Reason, Request};
use hapt_drive::odrive::Simulated;
use hapt_drive::odrive::codec::{self, Version};
use hapt_drive::simulate::{Firmware, Shaft, Time};
use hapt_drive::{Bus, Drive, DriveError, DriveLimits, Error, Frame, Line, Make, slcan};
use hapt_model::World;
use hapt_rt::{DriveFault, Failure, Record};
use hapt_testing::in_time;

use crate::bench::{Looped, TestBench, lockstep, soon, world};

/// Longer than a busy machine needs to answer, ms.
const ANSWER_MS: u64 = 200;
/// Shorter than the timeout of lockstep.
const STILL: Duration = Duration::from_millis(30);
const TERMS: DriveLimits = DriveLimits { watchdog: 0.01, torque: 1.0 };

fn bench(world: &World, time: Time) -> TestBench {
    with(Simulated::new(1), world, time)
}

fn with(firmware: Simulated, world: &World, time: Time) -> TestBench {
    TestBench::new(Make::Odrive, None, Box::new(firmware), world, time)
}

/// The factory setting: it sends its position every 10 ms.
fn chatty() -> Simulated {
    Simulated::new(1).with_estimates(Some(0.01))
}

/// With the last firmware before 0.6.
fn old() -> Simulated {
    Simulated::new(1).with_version(Version::SILENT)
}

/// The started back end; repeated if the machine pauses and the drive's watchdog expires.
fn started(bench: &TestBench) -> Box<dyn Drive> {
    let mut drive = bench.drive(1);
    let started = (0..20).any(|_| drive.start(&TERMS).is_ok());
    assert!(started, "{:?}", drive.start(&TERMS));
    drive
}

/// A drive with an injected error, injected again as long as it is set.
struct WithFaults(Simulated, Arc<AtomicU32>);

impl Firmware for WithFaults {
    fn requests_position(&self, frame: &Frame) -> bool {
        self.0.requests_position(frame)
    }

    fn receive(&mut self, frame: &Frame, shaft: Shaft, send: &mut dyn FnMut(Frame)) {
        self.0.receive(frame, shaft, send);
        let error = self.1.load(SeqCst);
        if error != 0 {
            self.0.fail(error);
        }
    }

    fn pass(&mut self, seconds: f64, shaft: Shaft, send: &mut dyn FnMut(Frame)) -> f64 {
        self.0.pass(seconds, shaft, send)
    }
}

fn struck(world: &World, time: Time) -> (TestBench, Arc<AtomicU32>) {
    let error = Arc::new(AtomicU32::new(0));
    let firmware = Box::new(WithFaults(Simulated::new(1), Arc::clone(&error)));
    (TestBench::new(Make::Odrive, None, firmware, world, time), error)
}

/// Through floats of 32 bits and a line of text the loop agrees with the exact device, sample by sample; with any cyclic position
/// messages or none, the loop's readings are new in every sample.
#[test]
fn in_lockstep_the_loop_on_the_drive_is_the_loop_on_the_exact_device() {
    in_time(|| {
        let world = world(&[]);
        assert!(hapt_analysis::check(&world).unwrap().certified.holds());
        // If the machine pauses for longer than the timeout of lockstep, the run is inconclusive.
        for firmware in [Simulated::new(1), old(), chatty(), Simulated::new(1).with_estimates(Some(7e-4))] {
            let run = |_| both(firmware.clone(), &world);
            let last = (0..20).find_map(run).expect("a run in which the machine does not stand still");
            assert_eq!(last.phase, Phase::Running);
            assert!((last.position - 0.3).abs() < 0.01, "it swings still: {}", last.position);
        }
    });
}

/// The loop on both devices from rest, and its last sample; `None`: the machine paused.
fn both(firmware: Simulated, world: &World) -> Option<Record> {
    let bench = with(firmware, world, lockstep(world));
    let mut drive = bench.looped(world, ANSWER_MS);
    let mut exact = Looped::on(Box::new(hapt_rt::SimulatedDevice::new(world).0), world);
    // The drive's first command arms it.
    drive.sample(None).ok()?;
    exact.sample(None).unwrap();
    let mut request = Some(Request::Arm);
    let (mut begin, mut last) = (0.0, None);
    for k in 0..2000 {
        let before = Instant::now();
        let ours = drive.sample(request).ok()?;
        let theirs = exact.sample(request.take()).unwrap();
        // The machine may delay an answer; a missing one fails every run.
        if before.elapsed() > STILL || ours.missed > 0 {
            return None;
        }
        if k == 0 {
            begin = ours.position;
        }
        assert_eq!(ours.phase, theirs.phase, "sample {k}");
        let position = ours.position - begin;
        assert!((position - theirs.position).abs() < 1e-5, "sample {k}: {position} {}", theirs.position);
        last = Some(Record { position, ..ours });
    }
    last
}

#[test]
fn a_drive_that_dies_is_gone_within_five_samples() {
    in_time(|| {
        let world = world(&[]);
        let bench = bench(&world, lockstep(&world));
        let mut looped = bench.running(&world, ANSWER_MS);
        bench.faults.dead.store(true, SeqCst);
        assert_eq!(looped.ends(5), Some(Err(Failure::Gone)));
        // Only its own watchdog can remove the torque.
        bench.torque_goes_off();
    });
}

#[test]
fn late_answers_never_count_as_new_ones() {
    in_time(|| {
        let world = world(&[]);
        // By less than two samples, by more than three, by more than four, at 20 ms a sample.
        for (late, firmware) in [(35, Simulated::new(1)), (67, Simulated::new(1)), (67, chatty()), (88, old())] {
            let bench = with(firmware, &world, lockstep(&world));
            let mut looped = bench.running(&world, 20);
            bench.faults.late.store(late, SeqCst);
            let ends = looped.ends(200);
            let is_right = match ends {
                Some(Ok(reason)) => reason == Reason::Late,
                Some(Err(Failure::Drive(fault))) => fault.reason == Some(Reason::Late),
                ends => ends == Some(Err(Failure::Gone)),
            };
            assert!(is_right, "{late} ms: {ends:?}");
        }
    });
}

#[test]
fn a_few_lost_frames_are_missed_samples_and_half_of_them_end_the_loop() {
    in_time(|| {
        for (loss, survives) in [(0, true), (2, true), (500, false)] {
            let world = world(&[]);
            let ends = (0..20).find_map(|_| {
                let bench = bench(&world, lockstep(&world));
                let mut looped = bench.running(&world, 30);
                bench.faults.loss.store(loss, SeqCst);
                let (ends, stood_still) = looped.ends_or_stands_still(600);
                (!stood_still || !survives).then_some(ends)
            });
            match ends.expect("a run in which the machine does not stand still") {
                None => assert!(survives, "{loss} of 1000"),
                Some(ends) => {
                    assert!(!survives, "{loss} of 1000: {ends:?}");
                    assert!(matches!(ends, Ok(Reason::Late) | Err(Failure::Gone | Failure::Drive(_))), "{ends:?}");
                }
            }
        }
    });
}

#[test]
fn an_error_of_the_drive_ends_the_loop_by_name_and_only_a_new_start_clears_it() {
    in_time(|| {
        // When it is armed again the puck still moves: no sign test.
        let world = world(&["safety.pulse=0"]);
        let (bench, error) = struck(&world, lockstep(&world));
        for (bits, reason) in [(0x2000, Some(Reason::Heat)), (0x8000, Some(Reason::Overspeed)), (0x200, None)] {
            let mut looped = bench.running(&world, ANSWER_MS);
            error.store(bits, SeqCst);
            // A heartbeat reports it, every 100 ms.
            match looped.ends(150) {
                Some(Err(Failure::Drive(fault))) => assert_eq!((fault.code, fault.reason), (bits, reason)),
                other => panic!("{other:?}"),
            }
            error.store(0, SeqCst);
            for _ in 0..20 {
                assert!(matches!(looped.sample(None), Err(Failure::Drive(_))), "it has come back by itself");
            }
            bench.torque_goes_off();
        }
    });
}

#[test]
fn a_drive_whose_error_stays_is_not_started() {
    in_time(|| {
        let world = world(&[]);
        let (bench, error) = struck(&world, Time::Real);
        error.store(0x200, SeqCst);
        match bench.drive(1).start(&TERMS) {
            Err(Error::Fault { fault: DriveFault { code: 0x200, what: "DC_BUS_UNDER_VOLTAGE", .. }, .. }) => {}
            other => panic!("{other:?}"),
        }
    });
}

/// The drive's own stop was pressed after the start: no command of the loop clears that, or switches the drive on.
#[test]
fn an_error_between_start_and_first_command_is_not_cleared() {
    in_time(|| {
        let world = world(&[]);
        let (bench, error) = struck(&world, Time::Real);
        let mut drive = started(&bench);
        error.store(0x0200_0000, SeqCst);
        let end = soon();
        let fault = loop {
            assert!(Instant::now() < end, "it goes on");
            assert_eq!(bench.faults.torque(), 0.0);
            match drive.read(soon()).and_then(|_| drive.command(0.01, soon())) {
                Err(DriveError::Fault(fault)) => break fault,
                _ => std::thread::sleep(Duration::from_millis(1)),
            }
            // It occurs once: from now on only a clear would remove it.
            error.store(0, SeqCst);
        };
        assert_eq!((fault.what, fault.reason), ("ESTOP_REQUESTED", Some(Reason::Stop)));
        assert_eq!(bench.faults.torque(), 0.0);
    });
}

/// CANSimple cannot set them: the drive's notes report them.
#[test]
fn a_started_drive_notes_the_settings_that_cannot_be_set() {
    in_time(|| {
        let world = world(&[]);
        let bench = bench(&world, Time::Real);
        let notes = bench.wheel(&world).notes().join("\n");
        for word in ["watchdog removed the torque after", "cannot set that time", "0.100 N m", "torque_soft_max"] {
            assert!(notes.contains(word), "{word}: {notes}");
        }
    });
}

/// With the factory settings an ODrive's torque stays without frames. Such a drive is refused, and the watchdog of every drive is tested.
#[test]
fn a_drive_that_is_not_set_up_is_not_started() {
    in_time(|| {
        let world = world(&[]);
        for (firmware, watchdog) in
            [(Simulated::new(1), None), (Simulated::new(1), Some(2.0)), (old(), None), (chatty(), None)]
        {
            let bench = with(firmware.with_watchdog(watchdog), &world, Time::Real);
            match bench.drive(1).start(&TERMS) {
                Err(error @ Error::Refused { .. }) => {
                    assert!(error.to_string().contains("enable_watchdog = True"), "{error}");
                }
                other => panic!("{other:?}"),
            }
            assert_eq!(bench.faults.torque(), 0.0);
        }
    });
}

/// Before 0.6 the watchdog also expires while the drive is disarmed, a heartbeat contains only present errors, and there is no position
/// until the drive has been armed once.
#[test]
fn a_drive_of_the_old_firmware_starts_despite_its_watchdogs_error_and_at_its_position() {
    in_time(|| {
        let world = world(&["couplings.0.stiffness=0"]);
        let bench = with(old(), &world, Time::Real);
        let bus = bus(&bench);
        assert_eq!(heartbeat(bus, |heartbeat| heartbeat.error != 0).error, Version::SILENT.watchdog());
        started(&bench).stop();
        // A push, and the wheel turns.
        let end = soon();
        while bench.faults.position() < 0.25 {
            assert!(Instant::now() < end, "it does not turn");
            let mut drive = started(&bench);
            while bench.faults.position() < 0.25 && drive.read(soon()).is_ok() && drive.command(0.02, soon()).is_ok() {
                std::thread::sleep(Duration::from_millis(1));
            }
            drive.stop();
        }
        bench.torque_goes_off();
        let before = bench.faults.position();
        let answer = started(&bench).read(soon()).unwrap();
        assert!(answer.position > 0.99 * before, "{before} {answer:?}");
    });
}

#[test]
fn an_error_of_the_old_firmware_has_its_own_number() {
    in_time(|| {
        let world = world(&["safety.pulse=0"]);
        let error = Arc::new(AtomicU32::new(0));
        let bench = TestBench::new(
            Make::Odrive,
            None,
            Box::new(WithFaults(old(), Arc::clone(&error))),
            &world,
            lockstep(&world),
        );
        for (bits, reason) in [(0x4_0000, Some(Reason::DriverHeat)), (0x40, None)] {
            let mut looped = bench.running(&world, ANSWER_MS);
            error.store(bits, SeqCst);
            match looped.ends(150) {
                Some(Err(Failure::Drive(fault))) => assert_eq!((fault.code, fault.reason), (bits, reason)),
                other => panic!("{other:?}"),
            }
            error.store(0, SeqCst);
            bench.torque_goes_off();
        }
    });
}

/// The first heartbeat of node 1 that satisfies a condition.
fn heartbeat(mut bus: impl Bus, is_so: impl Fn(&codec::Heartbeat) -> bool) -> codec::Heartbeat {
    let end = soon();
    loop {
        assert!(Instant::now() < end, "no such heartbeat");
        let Some(frame) = bus.receive(soon()).unwrap() else { continue };
        let read =
            codec::Heartbeat::read(frame.data()).filter(|_| frame.id == u32::from(codec::Command::Heartbeat.id(1)));
        if let Some(heartbeat) = read.filter(|heartbeat| is_so(heartbeat)) {
            return heartbeat;
        }
    }
}

#[test]
fn the_watchdog_disarms_the_drive_of_a_killed_host_and_torque_frames_do_not_arm_it_again() {
    in_time(|| {
        let world = world(&["couplings.0.stiffness=0"]);
        let bench = bench(&world, Time::Real);
        let mut drive = started(&bench);
        drive.command(0.01, soon()).unwrap();
        let end = soon();
        while bench.faults.torque() == 0.0 {
            assert!(Instant::now() < end, "it was never armed");
            drive.command(0.01, soon()).unwrap();
            std::thread::sleep(Duration::from_millis(1));
        }
        // As after a kill -9: no frame is sent.
        bench.torque_goes_off();
        let fault = loop {
            drive.command(0.01, soon()).unwrap();
            match drive.read(soon()) {
                Ok(_) => {}
                Err(DriveError::Fault(fault)) => break fault,
                other => panic!("{other:?}"),
            }
        };
        assert_eq!((fault.what, fault.reason), ("WATCHDOG_TIMER_EXPIRED", Some(Reason::Late)));
        assert_eq!(bench.faults.torque(), 0.0);
        assert_eq!(drive.command(0.01, soon()), Err(DriveError::Fault(fault)));
        let started = |_| drive.start(&TERMS).is_ok() && drive.read(soon()).is_ok();
        assert!((0..20).any(started), "a new start does not clear it");
    });
}

#[test]
fn a_loop_that_is_dropped_leaves_the_drive_disarmed_at_once() {
    in_time(|| {
        let world = world(&[]);
        let bench = bench(&world, lockstep(&world));
        drop(bench.running(&world, ANSWER_MS));
        bench.torque_goes_off();
        // Disarmed before the watchdog expired: no error is left.
        let bus = bus(&bench);
        assert_eq!(error(bus), 0);
    });
}

/// Its position, without a back end.
fn bus(bench: &TestBench) -> slcan::Client {
    let crate::bench::Place::Port(path) = &bench.place else { unreachable!("it is behind a port") };
    slcan::Client::open(Line::open(path).unwrap(), slcan::Rate::default()).unwrap()
}

/// The drive's error.
fn error(mut bus: impl Bus) -> u32 {
    use hapt_drive::odrive::codec::{Command, numbers, padded};
    bus.send(&Frame::remote(Command::Error.id(1).into(), 8), soon()).unwrap();
    loop {
        let frame = bus.receive(soon()).unwrap().expect("it answers");
        if frame.id == u32::from(Command::Error.id(1)) {
            return numbers(padded(frame.data())).0;
        }
    }
}

#[test]
fn a_removed_cable_ends_the_loop() {
    in_time(|| {
        let world = world(&[]);
        let mut bench = bench(&world, lockstep(&world));
        let mut looped = bench.running(&world, ANSWER_MS);
        bench.unplug();
        assert_eq!(looped.ends(2), Some(Err(Failure::Unplugged)));
    });
}

#[test]
fn a_wrong_node_names_the_one_on_the_bus() {
    in_time(|| {
        let world = world(&[]);
        let bench = bench(&world, Time::Real);
        match bench.drive(5).start(&TERMS) {
            Err(error @ Error::Silent { .. }) => {
                let text = error.to_string();
                assert!(text.contains("node_id 5") && text.contains("but from 1"), "{text}");
            }
            other => panic!("{other:?}"),
        }
    });
}
