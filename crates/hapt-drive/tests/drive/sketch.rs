//! The sketch of the Arduino library, compiled for this computer, at the end of a serial line: the loop on it, noise on the line, and the
//! simulated board compared with it. The same C++ source runs on boards.

mod board;
mod by_current;

use std::cell::RefCell;
use std::f64::consts::TAU;
use std::time::{Duration, Instant};

use board::Board;
use hapt_core::{Phase, Reason};
use hapt_drive::simplefoc::{Adapter, Client, MotorConstant, Simulated, VOLTS_PER_TORQUE};
use hapt_drive::simulate::{Firmware, Shaft};
use hapt_drive::{Bus, Drive, DriveLimits, Error, Frame, Line, pty};
use hapt_model::World;
use hapt_rt::{Failure, Record};
use hapt_testing::{cases, in_time};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

use crate::bench::{soon, world};

/// The sketch's largest voltage.
const LIMIT: f64 = 3.0;
const PERIOD_US: u64 = 1000;

/// 0.1 N·m are 2 V.
const CEILING: f64 = 2.0;

/// At a period whose watchdog a busy machine keeps; in lockstep it takes no longer.
const LONG_PERIOD_US: u64 = 50_000;

fn world_of_the_board() -> World {
    world(&["loop.period=50 ms", "couplings.0.stiffness=0.02", "safety.pulse=0"])
}

#[test]
fn a_certified_world_brings_the_puck_to_rest_on_the_sketch() {
    in_time(|| {
        let world = world_of_the_board();
        assert!(hapt_analysis::check(&world).unwrap().certified.holds());
        let Some(board) = Board::new(LONG_PERIOD_US, true) else { return };
        // If the machine pauses, the board's watchdog ends a run; a board that keeps no torque fails every run.
        let run = || {
            let mut looped = board.running(&world);
            (0..300).map(|_| looped.sample(None).ok().filter(|record| record.phase == Phase::Running)).collect()
        };
        let records: Option<Vec<Record>> = (0..20).find_map(|_| run());
        // The sensor's zero is anywhere within a turn.
        let away = |position: f64| (position - 0.3 - TAU * ((position - 0.3) / TAU).round()).abs();
        let last = &records.expect("a run without a pause")[280..];
        assert!(last.iter().all(|record| away(record.position) < 0.01), "{:?}", last[0]);
        assert!(board.largest() > 0.0 && board.largest() <= CEILING);
        board.goes_off();
    });
}

#[test]
fn a_board_whose_motor_does_not_start_or_with_other_settings_is_not_driven() {
    in_time(|| {
        let terms = DriveLimits { watchdog: 0.01, torque: 0.1 };
        let volts = MotorConstant::VoltsPerTorque(VOLTS_PER_TORQUE);
        let Some(failed) = Board::new(PERIOD_US, false) else { return };
        let error = failed.drive(volts).start(&terms).unwrap_err();
        assert!(matches!(error, Error::Fault { fault, .. } if fault.reason == Some(Reason::Driver)), "{error}");
        let Some(board) = Board::new(PERIOD_US, true) else { return };
        let error = board.drive(MotorConstant::TorqueConstant(0.05)).start(&terms).unwrap_err();
        assert!(matches!(error, Error::Refused { .. }) && error.to_string().contains("volts-per-torque"), "{error}");
        let error = board.drive(volts).start(&DriveLimits { torque: 0.2, ..terms }).unwrap_err();
        assert!(matches!(error, Error::Refused { .. }) && error.to_string().contains("at most 3 V"), "{error}");
        assert_eq!((failed.largest(), board.largest()), (0.0, 0.0));
    });
}

/// A reset while the motor holds a torque. The sketch restarts without a torque, and stays off.
#[test]
fn a_board_that_resets_ends_the_loop_by_name() {
    in_time(|| {
        let world = world_of_the_board();
        let Some(mut board) = Board::new(LONG_PERIOD_US, true) else { return };
        let mut looped = board.running(&world);
        board.switch_off();
        board.switch_on(true);
        let ended = looped.ends(50).expect("it ends");
        assert!(matches!(ended, Err(Failure::Gone | Failure::Drive(_)) | Ok(Reason::Late)), "{ended:?}");
        for _ in 0..20 {
            let _ = looped.sample(None);
            assert_eq!(board.present(), 0.0, "it is switched on again");
        }
    });
}

#[test]
fn a_disconnected_line_leaves_no_torque() {
    in_time(|| {
        let world = world_of_the_board();
        for cut in [true, false] {
            let Some(board) = Board::new(LONG_PERIOD_US, true) else { return };
            let mut looped = board.running(&world);
            board.intercept(move |to_board, bytes| if to_board == cut { Vec::new() } else { bytes.to_vec() });
            let ended = looped.ends(50).expect("it ends");
            assert!(matches!(ended, Err(Failure::Gone | Failure::Drive(_)) | Ok(Reason::Late)), "{ended:?}");
            let _ = looped.sample(None);
            board.goes_off();
            assert!(board.largest() <= CEILING);
        }
    });
}

/// The faults of the line's bytes.
#[derive(Clone, Debug)]
struct Noise {
    /// Of a thousand bytes, the numbers of those that are lost, changed, followed by others, or cut off with all following ones.
    lost: u32,
    changed: u32,
    added: u32,
    cut: u32,
    /// The added bytes: random ones, or a line that is too long.
    more: Vec<u8>,
    seed: u64,
}

fn noise() -> impl Strategy<Value = Noise> {
    let part = || prop_oneof![Just(0_u32), 1_u32..60];
    let more = prop_oneof![
        proptest::collection::vec(any::<u8>(), 1..60),
        Just(b"H".repeat(30)),
        Just(b"HT00\nHT7FC00000\nHTnan\n@3\n?\n".to_vec()),
        Just(b"\r\n\x07\n".to_vec()),
    ];
    (part(), part(), part(), part(), more, 1..u64::MAX).prop_map(|(lost, changed, added, cut, more, seed)| Noise {
        lost,
        changed,
        added,
        cut,
        more,
        seed,
    })
}

impl Noise {
    fn act(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut dice = |part: u32| {
            for (left, by) in [(true, 13), (false, 7), (true, 17)] {
                self.seed ^= if left { self.seed << by } else { self.seed >> by };
            }
            self.seed % 1000 < part.into()
        };
        let mut out = Vec::new();
        for byte in bytes {
            if dice(self.cut) {
                break;
            }
            if !dice(self.lost) {
                // Mostly another digit.
                out.push(if dice(self.changed) { byte ^ 1 } else { *byte });
            }
            if dice(self.added) {
                out.extend(&self.more);
            }
        }
        out
    }
}

/// With any noise: no voltage beyond the session's limit, and every end of the loop has a name; then no voltage is left on.
#[test]
fn noise_on_the_line_causes_no_torque_beyond_the_limit_and_every_end_has_a_name() {
    in_time(|| {
        let world = world_of_the_board();
        let Some(board) = Board::new(LONG_PERIOD_US, true) else { return };
        TestRunner::new(cases(64))
            .run(&noise(), |mut noise| {
                board.is_clean();
                let mut looped = board.running(&world);
                board.intercept(move |_, bytes| noise.act(bytes));
                let ended = looped.ends(100);
                prop_assert!(board.largest() <= CEILING, "{} V", board.largest());
                match ended {
                    Some(Err(Failure::Gone | Failure::Drive(_)) | Ok(Reason::Late)) | None => {}
                    // A lost sample lengthens the interval of the supervisor's reading.
                    Some(Ok(Reason::Uneven | Reason::Jump | Reason::Velocity | Reason::PortEnergy)) => {}
                    other => prop_assert!(false, "{other:?}"),
                }
                drop(looped);
                board.goes_off();
                Ok(())
            })
            .unwrap();
    });
}

/// A line with its checksum, as [`Client`] sends it.
fn ask(client: &mut Client, kind: u8, data: &[u8]) -> Option<Frame> {
    client.send(&Frame::fd(kind.into(), data), soon()).unwrap();
    client.receive(Instant::now() + Duration::from_millis(if data.is_empty() { 30 } else { 2000 })).unwrap()
}

fn float(number: u8, value: f32) -> Vec<u8> {
    [&[number][..], &value.to_be_bytes()].concat()
}

/// The state in an answer.
fn state(frame: Option<Frame>) -> Option<u8> {
    Some(frame?.data()[1])
}

/// A target that is no number, or beyond the limit, switches off, and only a stop clears that.
#[test]
fn a_nan_target_switches_the_motor_off_until_it_is_stopped_and_switched_on_again() {
    in_time(|| {
        let Some(board) = Board::new(PERIOD_US, true) else { return };
        let mut client = board.client();
        for wrong in [f32::NAN, f32::INFINITY, -f32::INFINITY, 1.001, -1.001, f32::MAX] {
            assert_eq!(state(ask(&mut client, b'S', &[1])), Some(0));
            assert_eq!(state(ask(&mut client, b'T', &float(2, 0.5))), Some(0), "it is off");
            assert_eq!(state(ask(&mut client, b'L', &float(3, 1.0))), Some(0));
            assert_eq!(state(ask(&mut client, b'E', &[4, 0xff, 0xff])), Some(1));
            assert_eq!(state(ask(&mut client, b'T', &float(5, 0.5))), Some(1));
            assert_eq!(state(ask(&mut client, b'T', &float(6, wrong))), Some(3), "{wrong}");
            board.goes_off();
            assert_eq!(state(ask(&mut client, b'E', &[7, 0xff, 0xff])), Some(3));
            assert_eq!(state(ask(&mut client, b'T', &float(8, 0.5))), Some(3));
        }
        for limit in [f32::NAN, -0.1, LIMIT as f32 * 1.001] {
            assert_eq!(state(ask(&mut client, b'S', &[1])), Some(0));
            assert_eq!(state(ask(&mut client, b'L', &float(3, limit))), Some(3), "{limit}");
        }
        assert!(board.largest() <= 0.5);
    });
}

/// In lockstep: ten queries of a millisecond without a target.
#[test]
fn the_watchdog_counts_from_the_last_target_and_a_query_does_not_feed_it() {
    in_time(|| {
        let Some(board) = Board::new(PERIOD_US, true) else { return };
        let mut client = board.client();
        // If the machine pauses, the board's clock runs on: the shortest time of several counts.
        let runs = |client: &mut Client| {
            assert_eq!(state(ask(client, b'S', &[1])), Some(0));
            assert_eq!(state(ask(client, b'L', &float(2, 1.0))), Some(0));
            assert_eq!(state(ask(client, b'E', &[3, 0, 95])), Some(1));
            for number in 0..5 {
                ask(client, b'Q', &[number]);
                if state(ask(client, b'T', &float(number, 0.5))) != Some(1) {
                    return 0;
                }
            }
            (1..100).take_while(|number| state(ask(client, b'Q', &[*number])) == Some(1)).count()
        };
        let counted = (0..20).map(|_| runs(&mut client)).max();
        assert_eq!(counted, Some(9), "9.5 ms");
        board.goes_off();
    });
}

/// Lines of the right form and random data, and random bytes.
fn lines() -> impl Strategy<Value = Vec<(u8, Vec<u8>)>> {
    let number = || prop_oneof![Just(0.5_f32), Just(-1.0), Just(f32::NAN), Just(4.0), any::<f32>()];
    let with = |kind: u8| number().prop_map(move |value| (kind, value.to_be_bytes().to_vec()));
    let line = prop_oneof![
        3 => Just((b'Q', Vec::new())),
        3 => with(b'T'),
        2 => with(b'L'),
        2 => (0_u16..60).prop_map(|time| (b'E', (time * 10 + 5).to_be_bytes().to_vec())),
        1 => Just((b'S', Vec::new())),
        1 => Just((b'V', Vec::new())),
        1 => (b'A'..=b'Z', proptest::collection::vec(any::<u8>(), 0..6)),
    ];
    proptest::collection::vec(line, 1..40)
}

/// The simulated board and the sketch answer the same lines alike, but for the position. If the machine pauses, only the sketch's clock
/// runs on.
#[test]
fn the_simulated_board_answers_as_the_sketch_does() {
    in_time(|| {
        let Some(board) = Board::new(PERIOD_US, true) else { return };
        let client = RefCell::new(board.client());
        TestRunner::new(cases(64))
            .run(&lines(), |lines| {
                let mut client = client.borrow_mut();
                for attempt in 0.. {
                    ask(&mut client, b'S', &[0]);
                    ask(&mut client, b'L', &float(0, 0.0));
                    ask(&mut client, b'E', &[0, 0xff, 0xff]);
                    ask(&mut client, b'S', &[0]);
                    let mut simulated = Simulated::new().with_limit(LIMIT as f32);
                    let begun = Instant::now();
                    let differs = lines.iter().enumerate().find_map(|(i, (kind, data))| {
                        let data = [&[i as u8 + 1], &data[..]].concat();
                        let frame = Frame::fd((*kind).into(), &data);
                        if simulated.requests_position(&frame) {
                            for _ in 0..20 {
                                simulated.pass(50e-6, Shaft::default(), &mut |_| {});
                            }
                        }
                        let mut wanted = None;
                        simulated.receive(&frame, Shaft::default(), &mut |answer| wanted = Some(answer));
                        client.send(&frame, soon()).unwrap();
                        // A line without an answer is followed by one with an answer.
                        let fence = Frame::fd(b'V'.into(), &[0xff]);
                        client.send(&fence, soon()).unwrap();
                        let mut answered = None;
                        loop {
                            let answer = client.receive(soon()).unwrap().expect("the fence is answered");
                            if answer.data()[0] == 0xff {
                                break;
                            }
                            answered = Some(answer);
                        }
                        // Kind, number, state and last target.
                        let of = |frame: Option<Frame>| frame.map(|frame| (frame.id, frame.data()[..3].to_vec()));
                        (of(answered) != of(wanted)).then(|| format!("line {i}: {answered:?}, {wanted:?}"))
                    });
                    match differs {
                        None => break,
                        // The board's clock runs on after 50 ms without a line.
                        Some(_) if begun.elapsed() > Duration::from_millis(40) && attempt < 20 => {}
                        Some(differs) => prop_assert!(false, "{differs}"),
                    }
                }
                Ok(())
            })
            .unwrap();
    });
}

/// A line of any content and length without a valid checksum has no answer and no effect.
#[test]
fn a_malformed_line_has_no_answer() {
    in_time(|| {
        let Some(board) = Board::new(PERIOD_US, true) else { return };
        let line = RefCell::new(Line::open(&board.ours).unwrap());
        let (sought, right) = (sound(b'Q', &[1]), sound(b'T', &float(2, 0.5)));
        let (first, second) = sought.split_at(4);
        let is_ignored = |wrong: &[u8]| {
            let mut line = line.borrow_mut();
            line.write(wrong, soon()).unwrap();
            // The next valid line is answered, also in two parts.
            line.write(first.as_bytes(), soon()).unwrap();
            std::thread::sleep(Duration::from_millis(1));
            line.write(second.as_bytes(), soon()).unwrap();
            let mut answer = Vec::new();
            while !answer.ends_with(b"\n") {
                let mut some = [0; 100];
                let count = line.read(&mut some, soon()).unwrap();
                assert!(count > 0, "no answer to the sound line");
                answer.extend(&some[..count]);
            }
            let answer = String::from_utf8(answer).unwrap();
            assert!(answer.starts_with("hQ01") && answer.matches('\n').count() == 1, "{wrong:?}: {answer:?}");
        };
        let mut lower = right.to_lowercase();
        lower.replace_range(0..2, "HT");
        let long = format!("{}{right}", "H".repeat(20));
        for wrong in [&long, &lower, &right.replace('\n', "\r\n"), &right.replace("HT", "HT "), "HT\n", "H\n", "\n"] {
            is_ignored(wrong.as_bytes());
        }
        // One digit of any line replaced: only the checksum detects it.
        let wrong = (0..right.len() - 3, 0..15_u8, any::<bool>(), -1.0_f32..1.0);
        TestRunner::new(cases(128))
            .run(&wrong, |(at, step, is_cut, value)| {
                let mut wrong = sound(b'T', &float(2, value)).into_bytes();
                let digit = |c: u8| (c as char).to_digit(16).unwrap() as u8;
                let other = (digit(wrong[2 + at]) + 1 + step) % 16;
                wrong[2 + at] = b"0123456789ABCDEF"[usize::from(other)];
                if is_cut {
                    wrong.remove(2 + at);
                }
                is_ignored(&wrong);
                Ok(())
            })
            .unwrap();
    });
}

/// The text of a line, taken from the client.
fn sound(kind: u8, data: &[u8]) -> String {
    let (mut theirs, path) = pty().unwrap();
    let mut client = Client::new(Line::open(&path).unwrap());
    client.send(&Frame::fd(kind.into(), data), soon()).unwrap();
    let mut bytes = [0; 64];
    let count = theirs.read(&mut bytes, soon()).unwrap();
    String::from_utf8(bytes[..count].to_vec()).unwrap()
}

/// The simulated board's end of the line accepts and refuses the same lines as the sketch.
#[test]
fn the_simulated_boards_line_refuses_what_the_sketch_refuses() {
    in_time(|| {
        let (line, path) = pty().unwrap();
        let mut adapter = Adapter::new(line);
        let mut ours = Line::open(&path).unwrap();
        let right = sound(b'T', &float(1, 0.5));
        let long = format!("{}{right}", "0".repeat(20));
        for wrong in [&long, &right.replace('T', "Q"), &right.to_lowercase(), &right.replace('\n', "\r\n")] {
            ours.write(wrong.as_bytes(), soon()).unwrap();
            ours.write(right.as_bytes(), soon()).unwrap();
            assert_eq!(adapter.receive(soon()).unwrap(), Some(Frame::fd(b'T'.into(), &float(1, 0.5))));
            assert_eq!(adapter.receive(Instant::now()).unwrap(), None, "{wrong:?}");
        }
    });
}
