//! The host is killed while a game's effect plays. Only the drive's watchdog removes the torque, by the drive's own clock.

use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use hapt_core::wheel::{Device, Timing, Wheel};
use hapt_core::{Phase, Request, SafetyProfile};
use hapt_drive::moteus::{Moteus, Simulated};
use hapt_drive::simulate::{Firmware, Shaft};
use hapt_drive::{Bus, DriveDevice, Frame};
use hapt_rt::{Cycle, Moment, Outside, Plan, effects};
use hapt_testing::in_time;
use hapt_wire::pid::{FULL, Kind, Operation, Pool, Report, Scale};

use crate::bench::world;

const PERIOD: f64 = 1e-3;
const LIMIT: f64 = 0.1;
/// The transmission time of a frame, s.
const FRAME: f64 = 0.1 * PERIOD;

/// A drive with its answers.
struct Board {
    firmware: Simulated,
    answers: VecDeque<Frame>,
    /// By the drive's clock, s.
    time: f64,
    torque: f64,
}

impl Board {
    fn pass(&mut self, seconds: f64) {
        let Board { firmware, answers, time, torque } = self;
        *torque = firmware.pass(seconds, Shaft::default(), &mut |frame| answers.push_back(frame));
        *time += seconds;
    }
}

#[derive(Clone)]
struct Wired(Arc<Mutex<Board>>);

impl Bus for Wired {
    fn send(&mut self, frame: &Frame, _: Instant) -> io::Result<()> {
        let mut board = self.0.lock().unwrap();
        let Board { firmware, answers, .. } = &mut *board;
        firmware.receive(frame, Shaft::default(), &mut |frame| answers.push_back(frame));
        board.pass(FRAME);
        Ok(())
    }

    fn receive(&mut self, _: Instant) -> io::Result<Option<Frame>> {
        Ok(self.0.lock().unwrap().answers.pop_front())
    }
}

/// Its watchdog's time comes with every command: ten periods.
#[test]
fn a_moteus_whose_host_is_killed_while_a_game_plays_holds_its_torque_for_ten_periods_at_most() {
    in_time(|| {
        let world = world(&["couplings.0.stiffness=0"]);
        let board = Board { firmware: Simulated::new(1), answers: VecDeque::new(), time: 0.0, torque: 0.0 };
        let board = Wired(Arc::new(Mutex::new(board)));
        let drive = Moteus::new(Box::new(board.clone()), 1, "nowhere".into());
        let device = DriveDevice::start(Box::new(drive), &world).unwrap();
        let wheel = Wheel::new(&Device::ideal(Timing::even(PERIOD), 1e-3, LIMIT)).unwrap();
        let (port, mut wire) = effects(wheel, Scale::of_wheel(LIMIT, 1.0));
        let plan = Plan::new(&world, SafetyProfile::Simulated).unwrap();
        let mut cycle = Cycle::new(Box::new(plan), Box::new(device)).with_outside(Outside::playing(port));
        let mut samples = 0;
        let mut sample = |request| {
            let periods = u32::from(samples > 0);
            cycle.pass(periods);
            samples += 1;
            board.0.lock().unwrap().pass(PERIOD);
            cycle.sample(&Moment { periods, now: samples * 1_000_000, ..Moment::default() }, request).unwrap()
        };
        sample(None);
        sample(Some(Request::Arm));
        while sample(None).phase != Phase::Running {}
        let mut pool = Pool::new();
        for report in [
            Report::Create(Kind::Constant),
            Report::Constant { block: 0, magnitude: FULL / 2 },
            Report::Operation { block: 0, operation: Operation::Start, loops: 1 },
        ] {
            assert!(pool.take(&report, 0));
        }
        assert!(wire.pools.push(pool).is_ok());
        let mut link = 0.0;
        for _ in 0..50 {
            link = sample(None).link;
        }
        let mut killed = board.0.lock().unwrap();
        assert!(
            (killed.torque - link).abs() < 1e-3 && (link.abs() - 0.5 * LIMIT).abs() < 1e-3,
            "{} {link}",
            killed.torque
        );
        // As by a kill -9: no last frame is sent.
        std::mem::forget(cycle);
        let begin = killed.time;
        while killed.torque != 0.0 {
            killed.pass(FRAME);
            assert!(killed.time - begin < 1.0, "the torque stays");
        }
        let held = killed.time - begin;
        for _ in 0..1000 {
            killed.pass(PERIOD);
            assert_eq!(killed.torque, 0.0, "the drive stays without torque");
        }
        assert!(held > 5.0 * PERIOD && held <= 10.0 * PERIOD + 1e-9, "{held} s");
    });
}
