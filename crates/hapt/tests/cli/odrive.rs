//! An ODrive at the end of a serial port, behind an slcan adapter: `hapt simulate-drive odrive`, and `hapt run` on one.
#![cfg(target_os = "linux")]

use crate::common::{answer, at_full_torque, drive, folder, hapt, steady};
use crate::drives::slow;

/// At a period within the drive's watchdog time.
fn direct() -> String {
    slow("20 ms", "gear = 1")
}

#[test]
fn a_certified_world_runs_on_a_simulated_odrive_also_after_one_that_was_killed() {
    let at = folder(&[("w.toml", &direct())]);
    let (_drive, device) = drive(at.path(), "odrive", &["--lockstep"]);
    // A bus has no rate where it is simulated: any will do.
    let device = format!("{device}@250k");
    let killed = {
        let run = at_full_torque(at.path(), &["run", "w.toml", "--device", &device]);
        run.signal("KILL");
        run.end()
    };
    assert_eq!(killed.code, None, "{killed:?}");
    // The drive has an error now, by its own watchdog; a new start clears it.
    let ended = steady(|| hapt(at.path(), ["run", "w.toml", "--device", &device, "--duration", "1s"])).done();
    assert!(ended.out.contains(&format!("slow wheel on the drive {device}#1")), "{ended:?}");
    assert!(ended.out.contains("at full torque; ended in order"), "{ended:?}");
}

#[test]
fn an_odrive_that_is_not_there_is_said_to_be_so() {
    let at = folder(&[("w.toml", &direct())]);
    let run = |device: &str| hapt(at.path(), ["run", "w.toml", "--device", device]);
    run("odrive:/dev/no-such-port").refused(3, &["cannot open /dev/no-such-port", "No such file"]);
    run("odrive:no-such-can").refused(3, &["cannot open no-such-can"]);
    let (_drive, device) = drive(at.path(), "odrive", &["--lockstep", "--id", "9"]);
    answer("but from 9", || run(&device))
        .refused(3, &["the ODrive with node_id 1", "does not answer", "but from 9", "#ID"]);
}
