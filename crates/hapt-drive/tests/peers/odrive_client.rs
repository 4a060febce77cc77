//! An independent client on the simulated ODrive: odrive-can over python-can's slcan, unchanged.

use std::process::Command;

use crate::bench::{Place, TestBench, world};
use crate::python::{ODRIVE_CAN, python};
use hapt_drive::Make;
use hapt_drive::odrive::Simulated;
use hapt_drive::simulate::Time;
use hapt_testing::in_time;

/// The client waits a second for an answer, and polls ten times, which a busy machine can exceed.
const ATTEMPTS: usize = 4;

#[test]
fn odrive_can_drives_the_simulated_drive() {
    in_time(|| {
        let Some(python) = python(ODRIVE_CAN) else { return };
        let world = world(&["device.damping=0"]);
        for attempt in 1..=ATTEMPTS {
            // The setting that the client requires: it polls ten times a second, and waits for cyclic positions.
            let firmware = Simulated::new(1).with_watchdog(Some(0.5)).with_estimates(Some(0.01));
            let bench = TestBench::new(Make::Odrive, None, Box::new(firmware), &world, Time::Real);
            let Place::Port(port) = &bench.place else { unreachable!("it is behind a port") };
            let output = Command::new(&python)
                .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peers/odrive_client.py"))
                .arg(port)
                .arg(world.device.inertia.to_string())
                .output()
                .unwrap();
            let text =
                [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned()).join("\n");
            if attempt < ATTEMPTS && text.contains("TimeoutError") {
                continue;
            }
            assert!(output.status.success() && text.starts_with("done"), "{text}");
            assert_eq!(bench.faults.torque(), 0.0);
            return;
        }
    });
}
