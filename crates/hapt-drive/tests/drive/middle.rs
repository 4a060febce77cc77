//! Interception between a drive and its host: frames of one kind are lost, delayed, repeated or forged. In every case no torque remains
//! that the loop has not commanded.

use std::collections::VecDeque;

use hapt_core::Reason;
use hapt_drive::moteus::{self, Parser, Subframe, Tuning};
use hapt_drive::odrive::{self, codec};
use hapt_drive::simulate::Firmware;
use hapt_drive::{Frame, Make, simplefoc};
use hapt_rt::{Device as _, DriveFault, Failure};
use hapt_testing::in_time;

use codec::Command;

use crate::bench::{Direction, Looped, TestBench, lockstep, world};

/// Longer than an answer takes and shorter than the timeout of lockstep, ms.
const ANSWER_MS: u64 = 30;
/// The rounding of a torque of 32 bits, relative to the world's limit.
const SAME: f64 = 1e-6;

fn odrives() -> [odrive::Simulated; 3] {
    let shipped = odrive::Simulated::new(1);
    [shipped.clone(), shipped.clone().with_estimates(Some(0.01)), shipped.with_version(codec::Version::SILENT)]
}

fn moteus() -> moteus::Simulated {
    moteus::Simulated::new(1)
}

/// The end of the loop on this drive after an interceptor is installed; repeated if the machine pauses. The loop has to end within this
/// many samples, and no interceptor keeps a torque on.
fn ends<F, M>(make: Make, firmware: &F, within: u32, middle: impl Fn() -> M) -> Result<Reason, Failure>
where
    F: Firmware + Clone + 'static,
    M: FnMut(Direction, Frame) -> Vec<Frame> + Send + 'static,
{
    let world = world(&[]);
    for _ in 0..20 {
        let bench = TestBench::new(make, None, Box::new(firmware.clone()), &world, lockstep(&world));
        let mut looped = bench.running(&world, ANSWER_MS);
        bench.faults.intercept(middle());
        let (ends, stood_still) = looped.ends_or_stands_still(within);
        if stood_still && make == Make::Odrive {
            continue;
        }
        let ends = ends.unwrap_or_else(|| panic!("it goes on for {within} samples"));
        // The loop's last frame, and its silence.
        let _ = looped.sample(None);
        bench.torque_goes_off();
        drop(looped);
        assert_eq!(bench.faults.torque(), 0.0);
        return ends;
    }
    panic!("the machine stands still");
}

fn fault(ends: Result<Reason, Failure>) -> DriveFault {
    match ends {
        Err(Failure::Drive(fault)) => fault,
        other => panic!("{other:?}"),
    }
}

/// An ODrive's frame of this kind.
fn is(frame: &Frame, command: Command) -> bool {
    frame.id == u32::from(command.id(1))
}

fn torque(direction: Direction, frame: &Frame) -> bool {
    direction == Direction::ToDrive && is(frame, Command::Torque)
}

#[test]
fn losing_only_torque_frames_ends_the_loop_though_requests_feed_the_drives_watchdog() {
    in_time(|| {
        for firmware in odrives() {
            let ended = fault(ends(Make::Odrive, &firmware, 60, || {
                |direction: Direction, frame: Frame| if torque(direction, &frame) { vec![] } else { vec![frame] }
            }));
            assert!(ended.what.contains("torque frames are lost"), "{ended}");
        }
    });
}

#[test]
fn torque_frames_that_are_late_or_changed_end_the_loop() {
    in_time(|| {
        for late in [1, 4] {
            let ended = fault(ends(Make::Odrive, &odrives()[0], 200, || {
                let mut held = VecDeque::new();
                move |direction: Direction, frame: Frame| {
                    if !torque(direction, &frame) {
                        return vec![frame];
                    }
                    held.push_back(frame);
                    if held.len() > late { held.pop_front().into_iter().collect() } else { vec![] }
                }
            }));
            assert!(ended.what.contains("late"), "{ended}");
        }
        for (part, firmware) in [-1.0, 0.5, 20.0].into_iter().zip(odrives()) {
            let _ = ends(Make::Odrive, &firmware, 400, || {
                move |direction: Direction, frame: Frame| {
                    let Some((torque, _)) = codec::two_floats(frame.data()).filter(|_| torque(direction, &frame))
                    else {
                        return vec![frame];
                    };
                    vec![Frame::classic(frame.id, &codec::floats(part * torque, 0.0))]
                }
            });
        }
    });
}

#[test]
fn a_missing_heartbeat_ends_the_loop() {
    in_time(|| {
        for firmware in odrives() {
            let ended = fault(ends(Make::Odrive, &firmware, 100_000, || {
                |_: Direction, frame: Frame| if is(&frame, Command::Heartbeat) { vec![] } else { vec![frame] }
            }));
            assert_eq!((ended.code, ended.reason), (Command::Heartbeat as u32, Some(Reason::Link)), "{ended}");
        }
    });
}

/// With a missing or a repeated old heartbeat an idle drive is detected, and never switched on again.
#[test]
fn an_idle_drive_ends_the_loop_though_no_heartbeat_reports_it() {
    in_time(|| {
        for firmware in odrives() {
            for repeated in [false, true] {
                ends(Make::Odrive, &firmware, 100_000, || {
                    let mut is_idle = false;
                    move |direction: Direction, frame: Frame| match direction {
                        Direction::FromDrive if is(&frame, Command::Heartbeat) && repeated => {
                            let armed = codec::Heartbeat { error: 0, state: 8 };
                            vec![Frame::classic(frame.id, &armed.data())]
                        }
                        Direction::FromDrive if is(&frame, Command::Heartbeat) => vec![],
                        Direction::ToDrive if !is_idle => {
                            is_idle = true;
                            vec![Frame::classic(Command::State.id(1).into(), &codec::pair(1, 0)), frame]
                        }
                        Direction::ToDrive => {
                            assert!(!(is(&frame, Command::State) && frame.data()[0] == 8), "it is switched on again");
                            vec![frame]
                        }
                        Direction::FromDrive => vec![frame],
                    }
                })
                .unwrap_err();
            }
        }
    });
}

#[test]
fn an_error_in_the_heartbeat_of_an_armed_drive_ends_the_loop_by_name() {
    in_time(|| {
        let ended = fault(ends(Make::Odrive, &odrives()[0], 1000, || {
            |_: Direction, frame: Frame| {
                let hot = codec::Heartbeat { error: 0x2000, state: 8 };
                vec![if is(&frame, Command::Heartbeat) { Frame::classic(frame.id, &hot.data()) } else { frame }]
            }
        }));
        assert_eq!((ended.what, ended.reason), ("MOTOR_OVER_TEMP", Some(Reason::Heat)));
    });
}

#[test]
fn a_drive_that_does_not_report_its_torque_ends_the_loop() {
    in_time(|| {
        for (firmware, kind) in odrives().iter().zip([Command::Torques, Command::Torques, Command::Current]) {
            let ended = fault(ends(Make::Odrive, firmware, 100, || {
                move |direction: Direction, frame: Frame| {
                    if direction == Direction::FromDrive && is(&frame, kind) { vec![] } else { vec![frame] }
                }
            }));
            assert_eq!(ended.reason, Some(Reason::Late), "{ended}");
        }
    });
}

#[test]
fn answers_with_their_identifiers_swapped_end_the_loop() {
    in_time(|| {
        for (one, other) in [(0x29, 0x3c), (0x29, 0x21), (0x3c, 0x21)] {
            let _ = ends(Make::Odrive, &odrives()[0], 100_000, || {
                move |direction: Direction, frame: Frame| {
                    let id = match frame.id {
                        id if direction == Direction::FromDrive && id == one => other,
                        id if direction == Direction::FromDrive && id == other => one,
                        id => id,
                    };
                    vec![if frame.remote { frame } else { Frame::classic(id, frame.data()) }]
                }
            });
        }
    });
}

/// The kind of a moteus's frame: a command writes a mode, a request does not.
fn commands(direction: Direction, frame: &Frame) -> bool {
    direction == Direction::ToDrive && Parser::new(frame.data()).any(|part| matches!(part, Subframe::Write(0x000, _)))
}

/// An answer to a command, which contains no position.
fn answers_a_command(direction: Direction, frame: &Frame) -> bool {
    direction == Direction::FromDrive
        && !Parser::new(frame.data()).any(|part| matches!(part, Subframe::Reply(0x001, _)))
}

/// The frame of another host.
fn stop() -> Frame {
    Frame::fd(1, &[0x01, 0x00, 0x00])
}

/// In a period that is long enough to switch the motor on again undetected.
#[test]
fn a_moteus_that_is_stopped_between_request_and_command_stays_stopped() {
    in_time(|| {
        let world = world(&["loop.period=20 ms", "couplings.0.stiffness=0.02", "safety.pulse=0", "safety.stall=1"]);
        let bench = TestBench::new(Make::Moteus, None, Box::new(moteus()), &world, lockstep(&world));
        let mut looped = bench.running(&world, ANSWER_MS);
        let mut is_stopped = false;
        bench.faults.intercept(move |direction, frame| {
            let is_first = commands(direction, &frame) && !is_stopped;
            is_stopped |= is_first;
            if is_first { vec![stop(), frame] } else { vec![frame] }
        });
        // The command after the stop detects it.
        let ended = fault(looped.sample(None).map(|record| record.reason.unwrap_or(Reason::Late)));
        assert_eq!(ended.reason, Some(Reason::Stop), "{ended}");
        bench.torque_goes_off();
        for _ in 0..20 {
            assert_eq!(looped.sample(None).unwrap_err(), Failure::Drive(ended), "it is switched on again");
            std::thread::sleep(std::time::Duration::from_millis(5));
            assert_eq!(bench.faults.torque(), 0.0);
        }
    });
}

#[test]
fn a_moteus_whose_commands_or_their_answers_are_lost_ends_the_loop() {
    in_time(|| {
        let _ = ends(Make::Moteus, &moteus(), 40, || {
            |direction: Direction, frame: Frame| if commands(direction, &frame) { vec![] } else { vec![frame] }
        });
        // Enough frames arrive to feed its watchdog.
        let ended = fault(ends(Make::Moteus, &moteus(), 40, || {
            let mut k = 0;
            move |direction: Direction, frame: Frame| {
                k += u32::from(commands(direction, &frame));
                if commands(direction, &frame) && k % 9 != 0 { vec![] } else { vec![frame] }
            }
        }));
        assert_eq!(ended.reason, Some(Reason::Late), "{ended}");
        let ended = fault(ends(Make::Moteus, &moteus(), 40, || {
            |direction: Direction, frame: Frame| if answers_a_command(direction, &frame) { vec![] } else { vec![frame] }
        }));
        assert_eq!(ended.reason, Some(Reason::Late), "{ended}");
    });
}

#[test]
fn a_late_or_repeated_command_ends_the_loop() {
    in_time(|| {
        for (late, again) in [(1, false), (3, false), (0, true)] {
            let ended = fault(ends(Make::Moteus, &moteus(), 20, || {
                let mut held = VecDeque::new();
                move |direction: Direction, frame: Frame| {
                    if !commands(direction, &frame) {
                        return vec![frame];
                    }
                    held.push_back(frame);
                    match (again, held.len() > 2.max(late)) {
                        (true, true) => vec![held.pop_front().unwrap(), frame],
                        (true, false) => vec![frame],
                        (false, _) if held.len() > late => held.pop_front().into_iter().collect(),
                        (false, _) => vec![],
                    }
                }
            }));
            assert!(matches!(ended.reason, Some(Reason::Link | Reason::Late)), "{ended}");
        }
    });
}

#[test]
fn an_old_answer_of_a_moteus_never_counts_as_a_new_one() {
    in_time(|| {
        let ends = ends(Make::Moteus, &moteus(), 40, || {
            let mut first = None;
            move |direction: Direction, frame: Frame| {
                let is_answer = direction == Direction::FromDrive && !answers_a_command(direction, &frame);
                vec![if is_answer { *first.get_or_insert(frame) } else { frame }]
            }
        });
        assert!(matches!(ends, Ok(Reason::Late) | Err(Failure::Gone | Failure::Drive(_))), "{ends:?}");
    });
}

/// For every tuning: no torque but the commanded one, or an end that names the active limit.
#[test]
fn a_tuned_moteus_gives_only_the_commanded_torque() {
    in_time(|| {
        let world = world(&["safety.pulse=0", "couplings.0.stiffness=0"]);
        for integrator in [(1.0, 0.3), (10.0, 5.0), (400.0, 50.0)] {
            let firmware = moteus().with_tuning(Tuning { integrator, ..Tuning::TUNED });
            let bench = TestBench::new(Make::Moteus, None, Box::new(firmware), &world, lockstep(&world));
            bench.wait_for(ANSWER_MS);
            let mut wheel = bench.wheel(&world);
            let mut hold = |torque: f64| wheel.read().and_then(|_| wheel.write(torque)).unwrap();
            // A push, then no torque: the wheel turns on, away from the initial position of position mode.
            (0..100).for_each(|_| hold(0.05));
            let from = bench.faults.position();
            (0..5).for_each(|_| hold(0.0));
            for _ in 0..200 {
                hold(0.0);
                assert_eq!(bench.faults.torque(), 0.0, "at 0 asked");
            }
            assert!((bench.faults.position() - from).abs() > 0.1, "it does not turn");
        }
    });
}

#[test]
fn every_limit_of_a_moteus_torque_ends_the_loop_by_its_code() {
    in_time(|| {
        let tuned = Tuning::TUNED;
        let limits = [
            (96, Tuning { velocity: (0.05, 0.1), ..tuned }),
            (97, Tuning { power: 1e-3, ..tuned }),
            (98, Tuning { voltage: 0.02, ..tuned }),
            (99, Tuning { current: 0.1, ..tuned }),
            (100, Tuning { heat: (0.999, 0.0), ..tuned }),
            (101, Tuning { heat: (0.0, 0.999), ..tuned }),
            (103, Tuning { position: (-0.005, 0.005), ..tuned }),
        ];
        for (code, tuning) in limits {
            let world = world(&["safety.pulse=0"]);
            let firmware = moteus().with_tuning(tuning);
            let bench = TestBench::new(Make::Moteus, None, Box::new(firmware), &world, lockstep(&world));
            bench.wait_for(ANSWER_MS);
            let mut looped = Looped::on(Box::new(bench.wheel(&world)), &world);
            let mut request = Some(hapt_core::Request::Arm);
            let ended = (0..2000).find_map(|_| looped.sample(request.take()).err());
            match ended {
                Some(Failure::Drive(fault)) => assert_eq!(fault.code, code, "{fault}"),
                other => panic!("{code}: {other:?}"),
            }
            bench.torque_goes_off();
        }
    });
}

/// The effect on one intercepted frame, from a sample on.
#[derive(Clone, Copy, Debug)]
enum Act {
    Lost,
    Late(usize),
    Again,
    Frozen,
}

/// Every kind of frame, lost, late, doubled or frozen: in the end there is no torque, or the commanded one.
#[test]
fn for_any_faults_of_frames_of_one_kind_no_torque_stays_that_is_not_commanded() {
    in_time(|| {
        let acts = [Act::Lost, Act::Late(1), Act::Late(3), Act::Again, Act::Frozen];
        let kinds = [
            (Direction::ToDrive, 0x0e),
            (Direction::ToDrive, 0x1c),
            (Direction::ToDrive, 0x09),
            (Direction::FromDrive, 0x1c),
            (Direction::FromDrive, 0x01),
        ];
        // Waiting for heartbeats takes most of the time.
        for (direction, kind) in kinds {
            std::thread::scope(|scope| {
                for act in acts {
                    let is_kind = move |to, frame: &Frame| to == direction && frame.id & 0x1f == kind;
                    scope.spawn(move || is_safe(Make::Odrive, Box::new(odrives()[0].clone()), act, is_kind));
                }
            });
        }
        for act in acts {
            is_safe(Make::Moteus, Box::new(moteus()), act, commands);
            is_safe(Make::Moteus, Box::new(moteus()), act, |direction, frame| {
                direction == Direction::ToDrive && !commands(direction, frame)
            });
            is_safe(Make::Moteus, Box::new(moteus()), act, answers_a_command);
            is_safe(Make::Moteus, Box::new(moteus()), act, |direction, frame| {
                direction == Direction::FromDrive && !answers_a_command(direction, frame)
            });
            for direction in [Direction::ToDrive, Direction::FromDrive] {
                for kind in [b'T', b'Q', b'E'] {
                    let is_kind = move |to, frame: &Frame| to == direction && frame.id == u32::from(kind);
                    is_safe(Make::Simplefoc, Box::new(simplefoc::Simulated::new()), act, is_kind);
                }
            }
        }
    });
}

fn is_safe(
    make: Make,
    firmware: Box<dyn Firmware>,
    act: Act,
    is_kind: impl Fn(Direction, &Frame) -> bool + Send + 'static,
) {
    let world = world(&[]);
    let bench = TestBench::new(make, None, firmware, &world, lockstep(&world));
    let mut looped = bench.running(&world, ANSWER_MS);
    let mut past = VecDeque::new();
    bench.faults.intercept(move |direction, frame| {
        if !is_kind(direction, &frame) {
            return vec![frame];
        }
        match act {
            Act::Lost => vec![],
            Act::Again => vec![frame, frame],
            Act::Frozen => {
                vec![*past.front().unwrap_or(&frame)].into_iter().inspect(|frame| past.push_back(*frame)).collect()
            }
            Act::Late(by) => {
                past.push_back(frame);
                if past.len() > by { past.pop_front().into_iter().collect() } else { vec![] }
            }
        }
    });
    let mut requested = [0.0; 3];
    let mut strange = 0;
    for _ in 0..400 {
        match looped.sample(None) {
            Ok(record) if record.phase.is_active() => {
                let torque = bench.faults.torque();
                let is_requested = requested.iter().any(|requested| (requested - torque).abs() < SAME);
                strange = if is_requested { 0 } else { strange + 1 };
                assert!(strange < 60, "{make:?} {act:?}: {torque} N m, and {requested:?} were asked for");
                requested = [record.output, requested[0], requested[1]];
            }
            _ => {
                let _ = looped.sample(None);
                bench.torque_goes_off();
                return;
            }
        }
    }
    drop(looped);
    bench.torque_goes_off();
}
