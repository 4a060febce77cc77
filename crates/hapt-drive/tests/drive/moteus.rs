//! The loop on a simulated moteus over a serial line: a certified world comes to rest, and every fault removes the torque.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::SeqCst};
use std::time::{Duration, Instant};

use hapt_core::{Phase, Reason, Request};
use hapt_drive::moteus::Simulated;
use hapt_drive::simulate::{Firmware, Shaft, Time};
use hapt_drive::{DriveError, DriveLimits, Error, Frame, Make};
use hapt_model::World;
use hapt_rt::Failure;
use hapt_testing::in_time;

use crate::bench::{Looped, TestBench, lockstep, read, soon};

/// A spring to ground that this device certifies, through a gear that reverses the direction. The period is long, so that a busy machine
/// answers in time; in lockstep it takes no longer.
const WORLD: &str = r#"
    [loop]
    period = "100 ms"
    estimator = "difference"
    [device]
    inertia = "6.4e-4 kg m^2"
    damping = "1.2e-3 N m s/rad"
    limit = "100 N mm"
    [device.drive]
    gear = 3
    direction = "reverse"
    [safety]
    stuck = 0
    fade = "1 s"
    [[couplings]]
    kind = "spring"
    between = ["puck", "ground"]
    stiffness = "0.02 N m/rad"
    rest = "0.3 rad"
    [scenarios.push]
    duration = "1 s"
    hand = { kind = "torque", moves = { kind = "step", to = "20 N mm" } }
"#;

fn world(sets: &[&str]) -> World {
    read(WORLD, sets)
}

/// A drive with an injected fault of this number.
struct WithFaults(Simulated, Arc<AtomicU32>);

impl Firmware for WithFaults {
    fn requests_position(&self, frame: &Frame) -> bool {
        self.0.requests_position(frame)
    }

    fn receive(&mut self, frame: &Frame, shaft: Shaft, send: &mut dyn FnMut(Frame)) {
        self.0.receive(frame, shaft, send);
    }

    fn pass(&mut self, seconds: f64, shaft: Shaft, send: &mut dyn FnMut(Frame)) -> f64 {
        let code = self.1.swap(0, SeqCst);
        if code > 0 {
            self.0.fail(code as u8);
        }
        self.0.pass(seconds, shaft, send)
    }
}

/// A drive that continues, with this number in its fault register, where it is not 0.
struct Goes(Simulated, Arc<AtomicU32>);

impl Firmware for Goes {
    fn requests_position(&self, frame: &Frame) -> bool {
        self.0.requests_position(frame)
    }

    fn receive(&mut self, frame: &Frame, shaft: Shaft, send: &mut dyn FnMut(Frame)) {
        let code = self.1.load(SeqCst) as u8;
        self.0.receive(frame, shaft, &mut |answer| {
            let mut data = answer.data().to_vec();
            // An answer with one 8-bit number of register 0x00f.
            let fault = data.windows(2).rposition(|two| two == [0x21, 0x0f]);
            if let Some(place) = fault.and_then(|at| data.get_mut(at + 2)).filter(|_| code > 0) {
                *place = code;
            }
            send(Frame::fd(answer.id, &data).with_extended(answer.extended));
        });
    }

    fn pass(&mut self, seconds: f64, shaft: Shaft, send: &mut dyn FnMut(Frame)) -> f64 {
        self.0.pass(seconds, shaft, send)
    }
}

fn bench(world: &World, id: u8, time: Time) -> TestBench {
    TestBench::new(Make::Moteus, None, Box::new(Simulated::new(id)), world, time)
}

fn looped(bench: &TestBench, world: &World) -> Looped {
    bench.looped(world, 0)
}

/// Runs until a failure or fault, which has to occur.
fn end(looped: &mut Looped) -> Result<Reason, Failure> {
    looped.ends(200).expect("it ends")
}

/// In lockstep nothing depends on the machine: the sign test passes through the gear that turns the other way, and the puck comes to
/// rest where the spring is slack.
#[test]
fn a_certified_world_brings_the_puck_to_rest_through_gear_and_drive() {
    in_time(|| {
        let world = world(&[]);
        assert!(hapt_analysis::check(&world).unwrap().certified.holds());
        let bench = bench(&world, 1, lockstep(&world));
        let mut looped = looped(&bench, &world);
        looped.run();
        let (mut last, mut missed) = (Vec::new(), 0);
        for _ in 0..1500 {
            let record = looped.sample(None).unwrap();
            assert_eq!(record.phase, Phase::Running, "{record:?}");
            missed += u32::from(record.missed > 0);
            last.push(record.measured);
        }
        // Only if the machine paused.
        assert!(missed < 30, "{missed} of 1500");
        let end = &last[1400..];
        assert!(end.iter().all(|position| (position - 0.3).abs() < 0.01), "{end:?}");
    });
}

/// The command at the puck does the same work at the drive's shaft: a third of the torque, the other way.
#[test]
fn torque_and_position_do_the_same_work_on_both_sides_of_the_gear() {
    in_time(|| {
        let world = world(&["safety.pulse=0"]);
        let bench = bench(&world, 1, lockstep(&world));
        let mut looped = looped(&bench, &world);
        looped.run();
        let before = looped.sample(None).unwrap();
        looped.sample(None).unwrap();
        // The period before the last sample passed under the torque of the one before it.
        let wanted = -before.output / 3.0;
        assert!(
            (bench.faults.torque() - wanted).abs() < 1e-6 && before.output.abs() > 1e-4,
            "{} {wanted}",
            bench.faults.torque()
        );
    });
}

#[test]
fn a_drive_that_dies_is_gone_within_five_samples() {
    in_time(|| {
        let world = world(&[]);
        let bench = bench(&world, 1, lockstep(&world));
        let mut looped = looped(&bench, &world);
        looped.run();
        let before = looped.samples;
        bench.faults.dead.store(true, SeqCst);
        assert_eq!(end(&mut looped), Err(Failure::Gone));
        assert_eq!(looped.samples - before, 5);
    });
}

#[test]
fn late_answers_never_count_as_new_ones() {
    in_time(|| {
        let world = world(&[]);
        let bench = bench(&world, 1, lockstep(&world));
        let mut looped = looped(&bench, &world);
        looped.run();
        bench.faults.held.store(1, SeqCst);
        assert_eq!(end(&mut looped), Ok(Reason::Late));
        // On time again, only clear and arm restore the torque.
        bench.faults.held.store(0, SeqCst);
        for _ in 0..20 {
            assert_eq!(looped.sample(None).unwrap().phase, Phase::Faulted);
        }
        assert_eq!(looped.sample(Some(Request::Clear)).unwrap().phase, Phase::Disarmed);
        looped.run();
    });
}

/// A single lost answer is only a missed sample.
#[test]
fn a_lost_answer_is_a_missed_sample() {
    in_time(|| {
        // A period long enough for a busy machine to lose none.
        let world = world(&["loop.period=0.3 s", "couplings.0.stiffness=5e-3", "safety.pulse=0"]);
        let bench = bench(&world, 1, lockstep(&world));
        let mut looped = looped(&bench, &world);
        looped.run();
        for _ in 0..3 {
            bench.faults.held.store(1, SeqCst);
            assert_eq!(looped.sample(None).unwrap().missed, 1);
            bench.faults.held.store(0, SeqCst);
            assert_eq!(looped.sample(None).unwrap().missed, 1);
            for _ in 0..5 {
                let record = looped.sample(None).unwrap();
                assert_eq!((record.missed, record.phase), (0, Phase::Running));
            }
        }
    });
}

#[test]
fn random_bytes_are_no_answer() {
    in_time(|| {
        let world = world(&[]);
        let bench = bench(&world, 1, lockstep(&world));
        let mut looped = looped(&bench, &world);
        looped.run();
        bench.faults.garbage.store(true, SeqCst);
        // It sends frames, but no answer to the request.
        assert_eq!(end(&mut looped), Ok(Reason::Late));
    });
}

#[test]
fn a_fault_of_the_drive_ends_the_loop_by_name() {
    in_time(|| {
        let world = world(&[]);
        for (code, reason) in [(38, Some(Reason::DriverHeat)), (35, Some(Reason::Jump)), (40, None)] {
            let strikes = Arc::new(AtomicU32::new(0));
            let firmware = Box::new(WithFaults(Simulated::new(1), Arc::clone(&strikes)));
            let bench = TestBench::new(Make::Moteus, None, firmware, &world, lockstep(&world));
            let mut first = looped(&bench, &world);
            first.run();
            strikes.store(code, SeqCst);
            match end(&mut first) {
                Err(Failure::Drive(fault)) => assert_eq!((fault.code, fault.reason), (code, reason)),
                other => panic!("{other:?}"),
            }
            // A new start is an explicit clear.
            drop(first);
            looped(&bench, &world).run();
        }
    });
}

/// Any number in the fault register is a condition that the certificate does not cover, except flux braking and field weakening, which do
/// not change the torque.
#[test]
fn any_number_in_the_fault_register_ends_the_loop_unless_it_is_harmless() {
    in_time(|| {
        let world = world(&[]);
        for code in [1, 31, 33, 39, 50, 51, 70, 95, 96, 104, 105, 106, 127, 128, 200, 255] {
            let says = Arc::new(AtomicU32::new(0));
            let firmware = Box::new(Goes(Simulated::new(1), Arc::clone(&says)));
            let bench = TestBench::new(Make::Moteus, None, firmware, &world, lockstep(&world));
            let mut looped = looped(&bench, &world);
            looped.run();
            says.store(code, SeqCst);
            if [104, 105].contains(&code) {
                for _ in 0..20 {
                    assert_eq!(looped.sample(None).unwrap().phase, Phase::Running, "{code}");
                }
                continue;
            }
            match end(&mut looped) {
                Err(Failure::Drive(fault)) => assert_eq!(fault.code, code),
                other => panic!("{code}: {other:?}"),
            }
        }
    });
}

#[test]
fn a_removed_cable_ends_the_loop() {
    in_time(|| {
        let world = world(&[]);
        let mut bench = bench(&world, 1, lockstep(&world));
        let mut looped = looped(&bench, &world);
        looped.run();
        bench.unplug();
        assert_eq!(end(&mut looped), Err(Failure::Unplugged));
    });
}

/// On every regular end, the dropped loop leaves the drive stopped, without torque.
#[test]
fn a_loop_that_ends_leaves_the_drive_stopped() {
    in_time(|| {
        let world = world(&[]);
        let bench = bench(&world, 1, Time::Real);
        let mut looped = looped(&bench, &world);
        for _ in 0..10 {
            let _ = looped.sample(None);
        }
        drop(looped);
        let mut after = bench.drive(1);
        after.read(soon()).unwrap();
        // Stopped, not timed out: a stopped drive starts again, a timed-out one does not.
        after.command(0.0, soon()).unwrap();
        let until = Instant::now() + Duration::from_secs(5);
        while Instant::now() < until {
            match after.read(soon()) {
                Ok(_) => return,
                Err(DriveError::Fault(fault)) => panic!("{fault}"),
                Err(_) => {}
            }
        }
        panic!("it never answered");
    });
}

/// After a kill -9 only the drive's own watchdog removes the torque. It stays off until a stop.
#[test]
fn the_drives_watchdog_latches_and_only_a_stop_clears_it() {
    in_time(|| {
        let world = world(&[]);
        let bench = bench(&world, 1, Time::Real);
        let mut drive = bench.drive(1);
        drive.start(&DriveLimits { watchdog: 0.05, torque: 1.0 }).unwrap();
        drive.command(0.02, soon()).unwrap();
        std::thread::sleep(Duration::from_millis(300));
        let silent = match drive.read(soon()) {
            Err(DriveError::Fault(fault)) => fault,
            other => panic!("{other:?}"),
        };
        assert_eq!((silent.code, silent.reason), (11, Some(Reason::Late)));
        // Commands do not restore it.
        for _ in 0..5 {
            assert_eq!(drive.command(0.02, soon()), Err(DriveError::Fault(silent)));
            assert_eq!(drive.read(soon()), Err(DriveError::Fault(silent)));
            assert_eq!(bench.faults.torque(), 0.0);
        }
        drive.start(&DriveLimits { watchdog: 10.0, torque: 1.0 }).unwrap();
        drive.command(0.02, soon()).unwrap();
        drive.read(soon()).unwrap();
        drive.stop();
    });
}

#[test]
fn a_wrong_identifier_names_the_one_on_the_bus() {
    in_time(|| {
        let world = world(&[]);
        let bench = bench(&world, 7, Time::Real);
        let mut drive = bench.drive(1);
        match drive.start(&DriveLimits { watchdog: 1.0, torque: 1.0 }) {
            Err(error @ Error::Silent { .. }) => assert!(error.to_string().contains("#7"), "{error}"),
            other => panic!("{other:?}"),
        }
    });
}

/// With a home the world's 0 is a fixed position, and the puck is within half a turn of it.
#[test]
fn with_a_home_positions_are_counted_from_it() {
    in_time(|| {
        for (home, at) in
            [("1 rad", -1.0), ("-200 deg", 200_f64.to_radians() - std::f64::consts::TAU), ("720 deg", 0.0)]
        {
            let homed = world(&[&format!("device.drive.home={home}"), "safety.pulse=0"]);
            // The simulated wheel is at the drive's zero.
            let bench = bench(&world(&[]), 1, lockstep(&homed));
            let mut looped = looped(&bench, &homed);
            let record = looped.sample(None).unwrap();
            assert!((record.measured - at).abs() < 1e-6, "{home}: {} {at}", record.measured);
        }
    });
}

/// What the device has of its own, and its stops, are where the world says, wherever the drive's zero is.
#[test]
fn a_simulated_wheel_with_a_home_hangs_and_stops_where_the_world_says() {
    in_time(|| {
        for (home, gear, direction) in [(1.0, 1, "reverse"), (-2.5, 3, "forward"), (0.7, 3, "reverse")] {
            for (own, at) in [
                ("device.gravity.phase=90 deg", std::f64::consts::FRAC_PI_2),
                ("device.stops.high=20 deg", 20_f64.to_radians()),
            ] {
                let mut sets = vec![
                    "device.gravity.torque=0.05".to_owned(),
                    own.to_owned(),
                    "device.damping=0.01".to_owned(),
                    "loop.period=10 ms".to_owned(),
                    "safety.pulse=0".to_owned(),
                    format!("device.drive.home={home}"),
                    format!("device.drive.gear={gear}"),
                    format!("device.drive.direction={direction}"),
                ];
                if own.contains("stops") {
                    sets.extend(["device.gravity.phase=45 deg".to_owned(), "device.stops.stiffness=50".to_owned()]);
                }
                let sets: Vec<&str> = sets.iter().map(String::as_str).collect();
                let world = world(&sets);
                let bench = bench(&world, 1, lockstep(&world));
                let mut looped = looped(&bench, &world);
                let mut last = 0.0;
                for _ in 0..150 {
                    last = looped.sample(None).unwrap().measured;
                }
                assert!((last - at).abs() < 2e-3, "{home} {gear} {direction} {own}: {last}");
            }
        }
    });
}
