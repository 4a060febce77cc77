//! A sample on a drive allocates nothing and frees nothing, whether the drive answers, says more than it is asked, is silent, or is gone.
//!
//! A test program of its own, for its allocator counts.

#![cfg(target_os = "linux")]

#[path = "../../../hapt-rt/tests/quiet/counting.rs"]
mod counting;
#[path = "../drive/rig.rs"]
mod rig;

use std::sync::atomic::Ordering::SeqCst;

use counting::counted;
use hapt_drive::odrive::codec::Version;
use hapt_drive::simulate::Firmware;
use hapt_drive::{Make, moteus, odrive};
use hapt_rt::{Device, Failure};
use rig::{Rig, lockstep, world};

/// Of each make, and of each way to ask it.
fn firmwares() -> [(Make, Box<dyn Firmware>); 4] {
    let odrive = odrive::Simulated::new(1);
    [
        (Make::Moteus, Box::new(moteus::Simulated::new(1))),
        (Make::Odrive, Box::new(odrive.clone())),
        (Make::Odrive, Box::new(odrive.clone().with_estimates(Some(0.01)))),
        (Make::Odrive, Box::new(odrive.with_version(Version::SILENT))),
    ]
}

#[test]
fn a_sample_allocates_nothing() {
    // So long a period that a busy machine answers within it, and no longer than a drive's watchdog bears.
    let world = world(&["loop.period=20 ms"]);
    for (make, firmware) in firmwares() {
        let mut rig = Rig::new(make, None, firmware, &world, lockstep(&world));
        // Where the machine stands still the drive ends it by a fault, and that allocates nothing either.
        let answered = (0..20).any(|_| {
            let mut wheel = rig.wheel(&world);
            let before = counted();
            assert!(before > 0, "the allocator counts");
            let mut fresh = 0;
            for k in 0..100 {
                fresh += u32::from(wheel.read().is_ok() && wheel.missed() == 0);
                let _ = wheel.write(0.001 * f64::from(k));
            }
            assert_eq!(counted(), before, "while it answers: {make:?}");
            fresh > 50
        });
        assert!(answered, "{make:?} does not answer");

        let mut wheel = rig.wheel(&world);
        rig.faults.dead.store(true, SeqCst);
        let before = counted();
        for _ in 0..3 {
            let _ = wheel.read();
            let _ = wheel.write(0.0);
        }
        assert_eq!(counted(), before, "while it is silent: {make:?}");

        rig.unplug();
        let before = counted();
        let failure = wheel.read();
        assert_eq!(counted(), before, "when it is gone: {make:?}");
        assert!(matches!(failure, Err(Failure::Unplugged | Failure::Drive(_))), "{failure:?}");
    }
}
