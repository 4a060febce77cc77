//! A sample on a drive allocates nothing and frees nothing, whether the drive answers, sends other frames, does not answer, or is gone.
//!
//! This is a separate test program, because its allocator counts.

#![cfg(target_os = "linux")]

#[path = "../drive/bench.rs"]
mod bench;
#[path = "../../../hapt-rt/tests/quiet/counting.rs"]
mod counting;

use std::sync::atomic::Ordering::SeqCst;

use bench::{TestBench, lockstep, world};
use counting::counted;
use hapt_drive::odrive::codec::Version;
use hapt_drive::simulate::Firmware;
use hapt_drive::{Make, moteus, odrive, simplefoc};
use hapt_rt::{Device, Failure};

/// The firmwares of each make, with each kind of requests.
fn firmwares() -> [(Make, Box<dyn Firmware>); 5] {
    let odrive = odrive::Simulated::new(1);
    [
        (Make::Moteus, Box::new(moteus::Simulated::new(1))),
        (Make::Odrive, Box::new(odrive.clone())),
        (Make::Odrive, Box::new(odrive.clone().with_estimates(Some(0.01)))),
        (Make::Odrive, Box::new(odrive.with_version(Version::SILENT))),
        (Make::Simplefoc, Box::new(simplefoc::Simulated::new())),
    ]
}

#[test]
fn a_sample_allocates_nothing() {
    // A period long enough for a busy machine to answer, and shorter than a drive's watchdog.
    let world = world(&["loop.period=20 ms"]);
    for (make, firmware) in firmwares() {
        let mut bench = TestBench::new(make, None, firmware, &world, lockstep(&world));
        // If the machine pauses, the drive ends the loop by a fault, which allocates nothing either.
        let answered = (0..20).any(|_| {
            let mut wheel = bench.wheel(&world);
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

        let mut wheel = bench.wheel(&world);
        bench.faults.dead.store(true, SeqCst);
        let before = counted();
        for _ in 0..3 {
            let _ = wheel.read();
            let _ = wheel.write(0.0);
        }
        assert_eq!(counted(), before, "while it is silent: {make:?}");

        bench.unplug();
        let before = counted();
        let failure = wheel.read();
        assert_eq!(counted(), before, "when it is gone: {make:?}");
        assert!(matches!(failure, Err(Failure::Unplugged | Failure::Drive(_))), "{failure:?}");
    }
}
