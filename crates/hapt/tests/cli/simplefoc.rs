//! A SimpleFOC board at the end of a serial port: `hapt simulate-drive simplefoc`, and `hapt run` and `hapt identify` on one.
#![cfg(target_os = "linux")]

use std::time::Instant;

use crate::common::{TEST_TIMEOUT, at_full_torque, drive, folder, hapt, steady};
use crate::drives::slow;

fn world() -> String {
    slow("100 ms", "gear = 3\ndirection = \"reverse\"")
}

#[test]
fn a_certified_world_runs_on_a_simulated_board_also_after_a_run_that_was_killed() {
    let at = folder(&[("w.toml", &world())]);
    let (_drive, device) = drive(at.path(), "simplefoc", &["--lockstep"]);
    let device = format!("{device}?volts-per-torque=20");
    let killed = {
        let run = at_full_torque(at.path(), &["run", "w.toml", "--device", &device]);
        run.signal("KILL");
        run.end()
    };
    assert_eq!(killed.code, None, "{killed:?}");
    let ended = steady(|| hapt(at.path(), ["run", "w.toml", "--device", &device, "--duration", "2s"])).done();
    assert!(ended.out.contains(&format!("slow wheel on the drive {device}")), "{ended:?}");
    assert!(ended.out.contains("at full torque; ended in order"), "{ended:?}");
    // A unit that is not the board's.
    let other = device.replace("volts-per-torque=20", "torque-constant=0.05");
    hapt(at.path(), ["run", "w.toml", "--device", &other]).refused(3, &["voltage", "volts-per-torque"]);
}

/// By an address whose constant is wrong the motor makes another torque than commanded, 5/4 of it by voltage and 4/5 by current. The corrected address
/// has the motor's own constant.
#[test]
fn identify_finds_the_motors_constant_by_a_known_inertia() {
    let at = folder(&[("w.toml", &slow("10 ms", "gear = 1"))]);
    for (motor, guess, constant) in
        [("", "volts-per-torque=25", 20.0), ("?torque-constant=0.04", "torque-constant=0.05", 0.04)]
    {
        let (_drive, device) = drive(at.path(), &format!("simplefoc{motor}"), &["--lockstep"]);
        let device = device.replace(motor, "");
        let unit = guess.split_once('=').unwrap().0;
        let guess = format!("{device}?{guess}");
        let begin = Instant::now();
        loop {
            assert!(begin.elapsed() < TEST_TIMEOUT, "it finds none");
            let known = ["--inertia", "6.4e-4 kg m^2", "--duration", "6 s", "--torque", "20 N mm", "--yes"];
            let ended = hapt(at.path(), ["identify", &guess, "--world", "w.toml"].iter().chain(&known));
            let after = ended.err.split(&format!("that of {device}?{unit}=")).nth(1);
            let found: Option<f64> = after.and_then(|rest| rest.split_whitespace().next()?.parse().ok());
            // In a pause of the machine, the run ends early.
            let Some(found) = found.filter(|_| ended.code == Some(0)) else { continue };
            assert!((found / constant - 1.0).abs() < 1e-3, "{ended:?}");
            assert!(!ended.err.contains("differ by more"), "{ended:?}");
            break;
        }
    }
}
