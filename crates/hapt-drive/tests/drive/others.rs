//! Other hosts on the bus: their frames to the drive end the loop, and a busy bus does not delay it.

use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::SeqCst};
use std::time::{Duration, Instant};

use hapt_core::Reason;
use hapt_drive::moteus::{self, Moteus, Resolution, Value, Writer};
use hapt_drive::odrive::{Odrive, codec};
use hapt_drive::simulate::{Firmware, Shaft};
use hapt_drive::{Bus, Drive, DriveError, Frame, Make};
use hapt_rt::Failure;
use hapt_testing::in_time;
use hapt_testing::prelude::*;

use crate::bench::{TestBench, lockstep, soon, world};

/// Both back ends, for the drive with identifier 1, on a scripted bus.
fn drives<B: Bus + 'static>(bus: impl Fn() -> B) -> [Box<dyn Drive>; 2] {
    let name = "nowhere";
    [Box::new(Moteus::new(Box::new(bus()), 1, name.into())), Box::new(Odrive::new(Box::new(bus()), 1, name))]
}

/// A scripted bus: it delivers a list of frames and discards sent ones.
struct Listed(VecDeque<Frame>);

impl Bus for Listed {
    fn send(&mut self, _: &Frame, _: Instant) -> io::Result<()> {
        Ok(())
    }

    fn receive(&mut self, _: Instant) -> io::Result<Option<Frame>> {
        Ok(self.0.pop_front())
    }
}

proptest! {
    /// A moteus's frames contain the numbers of sender and receiver: only host 0 may address the drive, and the drive may answer only
    /// host 0. Other traffic is ignored.
    #[test]
    fn a_frame_of_another_host_to_a_moteus_is_a_fault(from in 0_u32..0x7f, to in 0_u32..0x80, reply in any::<bool>(), prefix in 0_u32..2) {
        let frame = Frame::fd(prefix << 16 | u32::from(reply) << 15 | from << 8 | to, &[0x01, 0x00, 0x0a]);
        let mut drive = Moteus::new(Box::new(Listed(VecDeque::from([frame]))), 1, "nowhere".into());
        let is_foreign = prefix == 0 && (to == 1 || to == 0x7f || from == 1 && to != 0 && !reply);
        match drive.read(soon()) {
            Err(DriveError::Fault(fault)) => {
                prop_assert!(is_foreign, "{frame:?}");
                prop_assert_eq!(fault.reason, Some(Reason::Link));
                prop_assert!(drive.command(0.0, soon()).is_err(), "it goes on all the same");
            }
            other => prop_assert!(!is_foreign, "{other:?} {frame:?}"),
        }
    }
}

proptest! {
    /// Links between stations have identifiers of 29 bits above those of both drives (`hapt_wire::link::Frames`).
    #[test]
    fn a_frame_of_a_link_does_not_concern_a_drive(id in 1_u32 << 20..1 << 29, data in any::<[u8; 8]>()) {
        let frame = Frame::classic(id, &data).with_extended(true);
        for mut drive in drives(|| Listed(VecDeque::from([frame]))) {
            let read = drive.read(soon());
            prop_assert!(matches!(read, Err(DriveError::Silent)), "{read:?}");
        }
    }
}

/// A drive with another host on a line that hapt does not see: hapt on the UART, the other host on CAN.
struct Elsewhere(moteus::Simulated, Arc<AtomicBool>);

impl Firmware for Elsewhere {
    fn requests_position(&self, frame: &Frame) -> bool {
        self.0.requests_position(frame)
    }

    fn receive(&mut self, frame: &Frame, shaft: Shaft, send: &mut dyn FnMut(Frame)) {
        // Before a request: a frame before the command would be overridden by it.
        if self.0.requests_position(frame) && self.1.swap(false, SeqCst) {
            // Mode 10, from the present position, with all gains and a torque.
            let command = Writer::new(1)
                .write(0x000, &[Value::Int8(10)])
                .write(0x020, &[Value::Int8(i8::MIN)])
                .write(0x022, &[Value::Float(0.05)])
                .frame();
            self.0.receive(&command, shaft, &mut |_| {});
        }
        self.0.receive(frame, shaft, send);
    }

    fn pass(&mut self, seconds: f64, shaft: Shaft, send: &mut dyn FnMut(Frame)) -> f64 {
        self.0.pass(seconds, shaft, send)
    }
}

#[test]
fn a_command_of_another_host_on_another_line_is_detected_by_the_drives_answer() {
    in_time(|| {
        let world = world(&[]);
        let speaks = Arc::new(AtomicBool::new(false));
        let firmware = Box::new(Elsewhere(moteus::Simulated::new(1), Arc::clone(&speaks)));
        let bench = TestBench::new(Make::Moteus, None, firmware, &world, lockstep(&world));
        let mut looped = bench.running(&world, 200);
        speaks.store(true, SeqCst);
        // At the next answer: the command arrived before the request.
        match looped.ends(2) {
            Some(Err(Failure::Drive(fault))) => assert_eq!(fault.reason, Some(Reason::Link), "{fault}"),
            other => panic!("{other:?}"),
        }
        bench.torque_goes_off();
    });
}

/// An endless stream of other frames; each takes some time.
struct Flood {
    frame: Frame,
    pause: Duration,
}

impl Bus for Flood {
    fn send(&mut self, _: &Frame, _: Instant) -> io::Result<()> {
        Ok(())
    }

    fn receive(&mut self, _: Instant) -> io::Result<Option<Frame>> {
        std::thread::sleep(self.pause);
        Ok(Some(self.frame))
    }
}

/// Frames to a drive, from a drive, and others, of a moteus and of an ODrive.
const OTHERS: [u32; 4] = [0x8002, 0x0200, 0x049, 0x5ff];

#[test]
fn a_bus_full_of_other_frames_ends_the_sample_and_not_the_loop() {
    in_time(|| {
        for id in OTHERS {
            for mut drive in drives(|| Flood { frame: Frame::fd(id, &[0; 8]), pause: Duration::ZERO }) {
                // With a deadline that is never reached, the limit is the number of frames.
                let _ = drive.read(Instant::now() + Duration::from_secs(1_000_000)).unwrap_err();
            }
        }
        for mut drive in drives(|| Flood { frame: Frame::fd(0x200, &[0; 8]), pause: Duration::from_millis(1) }) {
            assert!(matches!(drive.read(Instant::now()), Err(DriveError::Silent | DriveError::Late)));
        }
    });
}

/// Answers a moteus's request after this many other frames.
struct Busy {
    others: usize,
    frames: VecDeque<Frame>,
}

impl Bus for Busy {
    fn send(&mut self, frame: &Frame, _: Instant) -> io::Result<()> {
        self.frames.extend((0..self.others).map(|_| Frame::fd(0x200, &[0x50; 8])));
        let number = moteus::Parser::new(frame.data()).find_map(|part| match part {
            moteus::Subframe::Write(0x014, value) => Some(value),
            _ => None,
        });
        if let Some(number) = number {
            let answer = Writer::new(0x100)
                .reply(0x014, &[number])
                .reply(0x014, &[number])
                .reply(0x000, &[Value::Int8(0)])
                .reply(0x001, &[Value::Float(0.25), Value::Float(0.0)])
                .reply(0x00f, &[Value::Int8(0)]);
            self.frames.push_back(answer.frame());
        }
        Ok(())
    }

    fn receive(&mut self, _: Instant) -> io::Result<Option<Frame>> {
        Ok(self.frames.pop_front())
    }
}

#[test]
fn an_answer_after_many_other_frames_is_found() {
    in_time(|| {
        let mut drive = Moteus::new(Box::new(Busy { others: 200, frames: VecDeque::new() }), 1, "nowhere".into());
        for _ in 0..10 {
            assert_eq!(drive.read(soon()).unwrap().position, 0.25);
        }
    });
}

/// After the last command of hapt: for each of the drive's settings the torque removes energy from the wheel or is 0, and with the factory
/// setting it is 0.
#[test]
fn after_its_watchdog_a_moteus_only_removes_energy() {
    in_time(|| {
        for mode in [0, 12, 15] {
            let mut firmware = moteus::Simulated::new(1).with_timeout_mode(mode);
            let shaft = |velocity| Shaft { position: 0.3, velocity };
            let sent = Writer::new(1)
                .write(0x000, &[Value::Int8(10)])
                .write(0x020, &[Value::Int8(i8::MIN), Value::Int8(0)])
                .write(0x022, &[Value::Float(0.2)])
                .write(0x023, &[Value::Int8(0), Value::Int8(0)])
                .write(0x02b, &[Value::Int8(0)])
                .write(0x027, &[Value::Float(0.01)])
                .frame();
            firmware.receive(&sent, shaft(0.0), &mut |_| {});
            let mut pass = |velocity| firmware.pass(1e-3, shaft(velocity), &mut |_| {});
            let during: Vec<f64> = (0..9).map(|_| pass(0.0)).collect();
            assert!((during[8] - f64::from(0.2_f32)).abs() < 1e-9, "{during:?}");
            pass(0.0);
            pass(0.0);
            for velocity in [-20.0, -1.0, 0.0, 0.5, 30.0] {
                let torque = pass(velocity);
                assert!(torque * velocity <= 0.0, "mode {mode}: {torque} at {velocity}");
                assert!(mode == 15 || torque == 0.0, "mode {mode}: {torque} at {velocity}");
                assert!(mode != 15 || velocity == 0.0 || torque != 0.0, "it brakes");
            }
            let mut says = None;
            let question = Writer::new(0x8001).read(0x000, 1, Resolution::Int8).frame();
            firmware.receive(&question, shaft(0.0), &mut |frame| says = moteus::Parser::new(frame.data()).next());
            assert_eq!(says, Some(moteus::Subframe::Reply(0x000, Value::Int8(11))));
        }
    });
}

/// Every request to the drive feeds its watchdog, and every command moves it.
#[test]
fn a_frame_of_another_host_to_an_odrive_is_a_fault() {
    in_time(|| {
        use codec::{Command, floats};
        for frame in [
            Frame::classic(Command::Torque.id(1).into(), &floats(0.1, 0.0)),
            Frame::classic(Command::State.id(1).into(), &[8, 0, 0, 0]),
            Frame::classic(Command::Clear.id(1).into(), &[]),
            Frame::remote(Command::Estimates.id(1).into(), 8),
        ] {
            let mut drive = Odrive::new(Box::new(Listed([frame].into())), 1, "nowhere");
            match drive.read(soon()) {
                Err(DriveError::Fault(fault)) => assert_eq!(fault.reason, Some(Reason::Link)),
                other => panic!("{frame:?}: {other:?}"),
            }
            assert!(drive.command(0.0, soon()).is_err(), "it goes on all the same");
            // It may send anything to another drive.
            let mut other = Odrive::new(Box::new(Listed([frame].into())), 2, "nowhere");
            assert_eq!(other.read(soon()), Err(DriveError::Silent));
        }
    });
}

#[test]
fn an_answer_without_a_request_is_of_another_drive() {
    in_time(|| {
        let answer = Frame::classic(codec::Command::Estimates.id(1).into(), &codec::floats(0.1, 0.0));
        // One before the request, and one as its answer.
        let mut drive = Odrive::new(Box::new(Listed([answer; 2].into())), 1, "nowhere");
        assert!(matches!(drive.read(soon()), Err(DriveError::Fault(fault)) if fault.what.contains("another drive")));
    });
}
