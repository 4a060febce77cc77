//! A drive at the end of a serial port: `hapt devices`, `hapt simulate-drive`, and `hapt run` on one.
#![cfg(target_os = "linux")]

use std::path::Path;

use crate::common::{answer, at_full_torque, drive, folder, hapt, steady};

/// A spring that this device certifies, at a period that a busy machine keeps, on a drive mounted as in `mounting`.
pub fn slow(period: &str, mounting: &str) -> String {
    format!(
        r#"title = "slow wheel"
[loop]
period = "{period}"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
limit = "100 N mm"
[device.drive]
{mounting}
[safety]
stuck = 0
stall = "10 s"
[[couplings]]
kind = "spring"
between = ["puck", "ground"]
stiffness = "0.01 N m/rad"
rest = "0.3 rad"
[scenarios.step]
duration = "0.5 s"
hand = {{ kind = "step", to = "45 deg" }}
"#
    )
}

fn geared() -> String {
    slow("100 ms", "gear = 3\ndirection = \"reverse\"")
}

#[test]
fn a_certified_world_runs_on_a_simulated_drive_and_its_log_replays_to_the_bit() {
    let at = folder(&[("w.toml", &geared())]);
    let (drive, device) = drive(at.path(), "moteus", &["--lockstep"]);
    let args = ["run", "w.toml", "--device", &device, "--duration", "2s", "--log", "run.mcap"];
    let ended = steady(|| hapt(at.path(), args)).done();
    assert!(ended.out.contains(&format!("slow wheel on the drive {device}#1")), "{ended:?}");
    assert!(ended.out.contains("at full torque; ended in order"), "{ended:?}");
    assert!(ended.err.contains("lag and jitter only as the file states them"), "{ended:?}");
    // The velocity was differenced, as in the certificate, and the log records that.
    hapt(at.path(), ["log", "replay", "run.mcap"]).done();
    drive.signal("TERM");
    assert_eq!(drive.end().code, Some(143));
}

#[test]
fn a_drive_that_is_taken_away_ends_the_run_with_code_three() {
    let at = folder(&[("w.toml", &geared())]);
    let (drive, device) = drive(at.path(), "moteus", &["--lockstep"]);
    let run = at_full_torque(at.path(), &["run", "w.toml", "--device", &device]);
    drive.signal("KILL");
    let ended = run.end();
    assert_eq!(ended.code, Some(3), "{ended:?}");
    assert!(ended.err.contains("the torque off: the device"), "{ended:?}");
}

#[test]
fn an_interrupted_run_leaves_the_drive_ready_for_the_next() {
    let at = folder(&[("w.toml", &geared())]);
    let (_drive, device) = drive(at.path(), "moteus", &["--id", "5"]);
    let device = format!("{device}#5");
    for _ in 0..2 {
        let run = at_full_torque(at.path(), &["run", "w.toml", "--device", &device]);
        run.signal("INT");
        let ended = run.end();
        assert_eq!(ended.code, Some(130), "{ended:?}");
        assert!(ended.out.contains("interrupted, the torque off at once"), "{ended:?}");
    }
}

#[test]
fn a_drive_that_is_not_there_is_said_to_be_so() {
    let at = folder(&[("w.toml", &geared())]);
    let run = |device: &str| hapt(at.path(), ["run", "w.toml", "--device", device]);
    run("moteus:/dev/no-such-port").refused(3, &["cannot open /dev/no-such-port", "No such file"]);
    run("moteus:/dev/null").refused(3, &["not a serial port"]);
    run("moteus:no-such-can").refused(3, &["cannot open no-such-can"]);
    hapt(at.path(), ["simulate-drive", "moteus", "--can", "no-such-can"]).refused(3, &["no-such-can"]);
    let (_drive, device) = drive(at.path(), "moteus", &["--id", "9"]);
    answer("#9", || run(&device)).refused(3, &["the moteus with id 1", "does not answer", "#9"]);
}

#[test]
fn a_world_without_a_limit_gets_no_motor() {
    let at = folder(&[("w.toml", &geared().replace("limit = \"100 N mm\"\n", ""))]);
    hapt(at.path(), ["run", "w.toml", "--device", "moteus:/dev/null"]).refused(2, &["device.limit"]);
}

#[test]
fn what_is_plugged_in_is_listed() {
    let ended = hapt(Path::new("."), ["devices"]).done();
    assert!(ended.out.ends_with('\n') && ended.err.is_empty(), "{ended:?}");
}
