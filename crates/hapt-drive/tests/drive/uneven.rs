//! A drive that answers late, against the times that the world states.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::SeqCst};
use std::time::Instant;

use hapt_core::{Phase, Reason, Request};
use hapt_drive::{Drive, DriveDevice, DriveError, DriveLimits, Error, ShaftState};
use hapt_model::{Source, World};
use hapt_testing::in_time;

use crate::bench::Looped;

/// A drive on a shaft at rest, with answers that can be made late.
#[derive(Clone, Default)]
struct Standing {
    is_late: Arc<AtomicBool>,
    watchdog: Arc<AtomicU64>,
    torque: Arc<AtomicU64>,
}

impl Drive for Standing {
    fn start(&mut self, limits: &DriveLimits) -> Result<ShaftState, Error> {
        self.watchdog.store(limits.watchdog.to_bits(), SeqCst);
        Ok(ShaftState { position: 0.25, velocity: 0.0 })
    }

    fn read(&mut self, _until: Instant) -> Result<ShaftState, DriveError> {
        if self.is_late.load(SeqCst) { Err(DriveError::Late) } else { Ok(ShaftState { position: 0.25, velocity: 0.0 }) }
    }

    fn command(&mut self, torque: f64, _until: Instant) -> Result<(), DriveError> {
        self.torque.store(torque.to_bits(), SeqCst);
        Ok(())
    }

    fn halt(&mut self, _until: Instant) {
        self.torque.store(0, SeqCst);
    }

    fn stop(&mut self) {
        self.torque.store(0, SeqCst);
    }
}

impl Standing {
    fn torque(&self) -> f64 {
        f64::from_bits(self.torque.load(SeqCst))
    }
}

fn world(times: &str, late: &str) -> World {
    let text = format!(
        "[loop]\nperiod = \"1 ms\"\nestimator = \"difference\"\n{times}\n[device]\ninertia = 6.4e-4\nlimit = 0.3\n[safety]\n\
         pulse = 0\nstuck = 0\nfade = \"20 ms\"\n{late}\n[[couplings]]\nkind = \"constant\"\nbetween = [\"puck\", \"ground\"]\n\
         torque = 0.2\n"
    );
    World::read(&Source::from_text("late.toml", text), &[]).unwrap()
}

/// A loop at full torque on such a drive.
fn running(world: &World) -> (Looped, Standing) {
    let drive = Standing::default();
    let device = DriveDevice::start(Box::new(drive.clone()), world).unwrap();
    let mut looped = Looped::on(Box::new(device), world);
    looped.run();
    assert!((drive.torque() - 0.2).abs() < 1e-12);
    (looped, drive)
}

#[test]
fn an_answer_older_than_certified_removes_the_torque_where_the_world_asks_for_that() {
    in_time(|| {
        let interval = "interval_max = \"1.8 ms\"";
        let delay = "delay_max = \"0.8 ms\"";
        for (times, late, ends) in [
            (interval, "", Some(Phase::FadingOut)),
            (interval, "late = \"fade\"", Some(Phase::FadingOut)),
            (interval, "late = \"fault\"", Some(Phase::Faulted)),
            (interval, "late = \"count\"", None),
            (delay, "late = \"fault\"", Some(Phase::Faulted)),
            // Two periods are certified, and one old answer is within them.
            ("interval_max = \"2 ms\"", "late = \"fault\"", None),
            ("interval_max = \"2 ms\"\ndelay_max = \"1.5 ms\"", "late = \"fault\"", None),
            // No times are stated, and only the stall is enforced.
            ("", "late = \"fault\"", None),
        ] {
            let (mut looped, drive) = running(&world(times, late));
            for _ in 0..50 {
                assert_eq!(looped.late_sample().outside, 0);
            }
            drive.is_late.store(true, SeqCst);
            let stale = looped.late_sample();
            drive.is_late.store(false, SeqCst);
            let next = looped.late_sample();
            let phase = ends.unwrap_or(Phase::Running);
            assert_eq!(next.phase, phase, "{times} {late}");
            if phase == Phase::Faulted {
                assert_eq!((next.reason, drive.torque()), (Some(Reason::Uneven), 0.0));
            }
            // Its age is known with the old answer, and the interval too.
            let is_counted = ends.is_some() || late.contains("count");
            assert_eq!(stale.outside.max(next.outside) > 0, is_counted, "{times} {late}");
            for _ in 0..50 {
                looped.late_sample();
            }
            assert_eq!(drive.torque() == 0.0, ends.is_some(), "{times} {late}");
            if ends == Some(Phase::FadingOut) {
                // It stays off until it is armed.
                let record = looped.sample(Some(Request::Arm)).unwrap();
                assert_eq!((record.phase, record.reason), (Phase::FadingIn, None));
            }
        }
    });
}

#[test]
fn the_drive_itself_removes_the_torque_within_the_certified_interval_where_a_late_sample_is_a_fault() {
    in_time(|| {
        for (times, late, watchdog) in [
            ("", "late = \"fault\"", 10e-3),
            ("interval_max = \"1.8 ms\"", "", 10e-3),
            ("interval_max = \"1.8 ms\"", "late = \"count\"", 10e-3),
            ("interval_max = \"1.8 ms\"", "late = \"fault\"", 1.8e-3),
            ("interval_max = \"1.8 ms\"\ndelay = \"0.1 ms\"\ndelay_max = \"0.4 ms\"", "late = \"fault\"", 2.1e-3),
            // Never longer than without.
            ("interval_max = \"50 ms\"", "late = \"fault\"", 10e-3),
        ] {
            let (_looped, drive) = running(&world(times, late));
            let given = f64::from_bits(drive.watchdog.load(SeqCst));
            assert!((given - watchdog).abs() < 1e-12, "{times} {late}: {given}");
        }
    });
}
