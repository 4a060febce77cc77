//! `hapt identify`: from logs, from tables, and by an experiment on the simulated device.

use std::fs;
use std::path::Path;

use crate::common::{Ended, folder, hapt, names};

/// A released wheel, coupled to a virtual one.
const PAIR: &str = r#"title = "pair"
[loop]
period = "1 ms"
delay = "2 ms"
[device]
inertia = "6.4e-4 kg m^2"
damping = "3e-3 N m s/rad"
friction = "5 N mm"
limit = "822.25 N mm"
encoder = 4000
[bodies.wheel]
inertia = "0.0258 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "1 N m/rad"
[scenarios.let-go]
duration = "2 s"
hand = { kind = "step", to = "40 deg", release = "0.25 s" }
[scenarios.held]
duration = "2 s"
hand = { kind = "sine", amplitude = "1 rad", frequency = "3 Hz" }
"#;
const TRUTH: [(&str, f64); 3] = [("inertia", 6.4e-4), ("damping", 3e-3), ("friction", 5e-3)];

fn identify(at: &Path, args: &[&str]) -> Ended {
    hapt(at, [&["identify"], args].concat())
}

/// Each number is within three half widths of the truth, and no interval is wider than a twentieth of it.
#[track_caller]
fn holds(json: &str, delay: f64) {
    let json: serde_json::Value = serde_json::from_str(json).unwrap();
    let keys: Vec<&String> = json.as_object().unwrap().keys().collect();
    let named =
        ["inertia", "damping", "friction", "delay_s", "lag_s", "late_s", "offset", "sign", "counts_per_rev", "misfit"];
    assert_eq!(keys, named);
    for (name, truth) in TRUTH.into_iter().chain([("delay_s", delay)]) {
        let number = |key: &str| json[name][key].as_f64().unwrap_or_else(|| panic!("no {name}: {json}"));
        let half = 0.5 * (number("high") - number("low"));
        assert!((number("value") - truth).abs() < 3.0 * half + 1e-9 * truth, "{name}: {json}");
        assert!(half < 0.05 * if truth > 0.0 { truth } else { 1e-3 }, "{name}: {json}");
    }
    assert_eq!(json["sign"]["value"], 1.0, "{json}");
    assert_eq!(json["counts_per_rev"]["value"], 4000.0, "{json}");
}

#[test]
fn a_run_as_csv_and_as_a_log_says_what_the_wheel_is() {
    let at = folder(&[("w.toml", PAIR)]);
    hapt(at.path(), ["sim", "w.toml", "--out", ".", "--format", "csv", "--format", "mcap"]).done();
    let from = |log: &str, more: &[&str]| {
        identify(at.path(), &[&[log, "--from", "0.26s", "--json"], more].concat()).done().out
    };
    let csv = from("let-go.csv", &[]);
    holds(&csv, 2e-3);
    assert_eq!(from("let-go.mcap", &[]), csv);
    assert_eq!(from("let-go.csv", &["--columns", "torque=command_Nm,position=measured_rad"]), csv);
}

#[test]
fn positions_alone_are_enough_beside_a_known_spring() {
    let spring = PAIR.replace("\"puck\", \"wheel\"", "\"puck\", \"ground\"").replace("0.25 s", "0.1 s");
    let at = folder(&[("w.toml", &spring)]);
    hapt(at.path(), ["sim", "w.toml", "--scenario", "let-go", "--out", "."]).done();
    let of = |more: &[&str]| identify(at.path(), &[&["let-go.csv", "--from", "0.11s"], more].concat()).done();
    assert_eq!(of(&["--spring", "1 N m/rad", "--json"]).out, of(&["--json"]).out);
    // With only a spring, the effect of a delay cannot be separated from that of damping, and the interval says so.
    let printed = of(&[]);
    assert!(printed.err.contains("hardly separates damping from delay"), "{}", printed.err);
}

#[test]
fn what_is_written_is_a_device_that_a_world_takes() {
    let at = folder(&[("w.toml", PAIR)]);
    hapt(at.path(), ["sim", "w.toml", "--out", "."]).done();
    let args = ["let-go.csv", "--from", "0.26s", "--world", "w.toml", "--write", "device.toml", "--plot", "fit.svg"];
    let ended = identify(at.path(), &args).done();
    assert_eq!(names(at.path()), ["device.toml", "fit.svg", "held.csv", "let-go.csv", "w.toml"]);
    for line in [
        "sign      1: a positive torque",
        "encoder   4000 counts a revolution",
        "world     as its file has the device: ",
    ] {
        assert!(ended.out.contains(line), "{line}: {}", ended.out);
    }
    let table = fs::read_to_string(at.path().join("device.toml")).unwrap();
    assert!(table.starts_with("[device] # identified 20") && table.contains(" from let-go.csv\n"), "{table}");
    assert!(table.contains("# for [loop]: delay = \"2 ms\""), "{table}");
    let world = PAIR.replace(&PAIR[PAIR.find("[device]").unwrap()..PAIR.find("[bodies").unwrap()], &table);
    fs::write(at.path().join("found.toml"), world).unwrap();
    hapt(at.path(), ["sim", "found.toml"]).done();
    let svg = fs::read_to_string(at.path().join("fit.svg")).unwrap();
    for word in ["position (°)", "residual (counts)", "measured", "commanded torque (N·mm)"] {
        assert!(svg.contains(word), "{word}");
    }
}

#[test]
fn an_experiment_on_the_simulated_wheel_finds_it() {
    let at = folder(&[("w.toml", PAIR)]);
    // Without a delay: the simulated one is as many samples as were taken, also where some were missed.
    let args =
        ["sim", "--world", "w.toml", "--set", "loop.delay=0", "--duration", "2 s", "--log", "log.mcap", "--json"];
    let found = identify(at.path(), &args).done();
    holds(&found.out, 0.0);
    // The log of the experiment says the same.
    holds(&identify(at.path(), &["log.mcap", "--json"]).done().out, 0.0);
}

/// The delay counts from the supervisor's output in both.
#[test]
fn the_log_of_an_experiment_says_the_same_delay_as_the_experiment() {
    let at = folder(&[("w.toml", PAIR)]);
    let late = |args: &[&str]| {
        let json: serde_json::Value = serde_json::from_str(&identify(at.path(), args).done().out).unwrap();
        json["late_s"]["value"].as_f64().unwrap_or_else(|| panic!("{json}"))
    };
    let experiment = late(&["sim", "--world", "w.toml", "--duration", "2 s", "--log", "log.mcap", "--json"]);
    // Samples that were missed make it longer.
    assert!(experiment > 1.9e-3, "{experiment}");
    hapt(at.path(), ["log", "convert", "log.mcap", "-o", "log.csv"]).done();
    for log in ["log.mcap", "log.csv"] {
        let log = late(&[log, "--json"]);
        assert!((log - experiment).abs() < 1e-5, "{log} and {experiment}");
    }
}

#[test]
fn a_log_is_held_against_the_file_of_its_world() {
    let at = folder(&[("w.toml", &PAIR.replace("3e-3 N m s/rad", "3e-3 N m s/rad ± 5 %"))]);
    hapt(at.path(), ["sim", "w.toml", "--out", ".", "--format", "mcap"]).done();
    let log = ["let-go.mcap", "--from", "0.26s", "--against", "w.toml"];
    let of = |more: &[&str]| identify(at.path(), &[&log, more].concat());
    let agrees = of(&["--plot", "against.svg"]).done();
    for line in
        ["damping         0.00", "file 0.00285 to 0.00315 N m s/rad: agrees", "verdict         the record agrees"]
    {
        assert!(agrees.out.contains(line), "{line}: {}", agrees.out);
    }
    let svg = fs::read_to_string(at.path().join("against.svg")).unwrap();
    assert!(svg.contains("residual (counts)"));
    // For a file whose damping is a fifth too large, the answer says so and gives the right value.
    let wrong = of(&["--set", "device.damping=3.6e-3"]);
    assert_eq!(wrong.code, Some(1), "{}", wrong.err);
    assert!(wrong.out.contains("verdict         the record contradicts the file: damping"), "{}", wrong.out);
    let line = wrong.out.lines().find_map(|line| line.strip_prefix("remedy          [device] damping = ")).unwrap();
    // The remedy is a line that the file takes, and then the record agrees.
    of(&["--set", &format!("device.damping={}", line.trim_matches('"'))]).done();
    let json: serde_json::Value = serde_json::from_str(&of(&["--set", "device.damping=3.6e-3", "--json"]).out).unwrap();
    assert_eq!(json["agrees"], false, "{json}");
    let numbers = json["numbers"].as_array().unwrap();
    let damping = numbers.iter().find(|number| number["name"] == "damping").unwrap();
    assert_eq!(damping["verdict"], "contradicts", "{json}");
    assert!(damping["sigmas"].as_f64().unwrap() > 4.0, "{json}");
}

#[test]
fn a_coast_down_is_held_against_a_file_as_a_table_and_as_a_log() {
    let world = "[loop]\nperiod = \"1 ms\"\n[device]\ninertia = \"1e-3 kg m^2\"\ndamping = \"2e-4 N m s/rad\"\n\
                 friction = \"2e-3 N m\"\nencoder = 20000\n[scenarios.spun]\nduration = \"3 s\"\n\
                 hand = { kind = \"sine\", amplitude = \"1 rad\", frequency = \"1.5 Hz\", release = \"0.3 s\" }\n";
    let at = folder(&[("w.toml", world)]);
    hapt(at.path(), ["sim", "w.toml", "--out", ".", "--format", "csv", "--format", "mcap"]).done();
    for log in ["spun.csv", "spun.mcap"] {
        let of = |more: &[&str]| {
            identify(at.path(), &[&[log, "--coast", "--from", "0.31s", "--against", "w.toml"], more].concat())
        };
        assert!(of(&[]).done().out.contains("friction over inertia 2.00"), "{log}");
        let wrong = of(&["--set", "device.friction=1.5e-3 N m"]);
        assert_eq!(wrong.code, Some(1), "{log}: {}", wrong.err);
        let remedy = "remedy                [device] friction and inertia have to give 2.00";
        assert!(wrong.out.contains(remedy), "{log}: {}", wrong.out);
    }
}

#[test]
fn a_hand_on_the_puck_contradicts_every_file() {
    let at = folder(&[("w.toml", PAIR)]);
    hapt(at.path(), ["sim", "w.toml", "--out", "."]).done();
    let ended = identify(at.path(), &["held.csv", "--against", "w.toml", "--plot", "held.svg"]);
    assert_eq!(ended.code, Some(1), "{}", ended.err);
    for word in
        ["a torque moved the puck that no such device has", "inertia         -", "not determined, no interval is valid"]
    {
        assert!(ended.out.contains(word), "{word}: {}", ended.out);
    }
    assert_eq!(names(at.path()), ["held.csv", "held.svg", "let-go.csv", "w.toml"]);
}

#[test]
fn a_hand_on_the_puck_is_no_experiment_and_leaves_no_device_behind() {
    let at = folder(&[("w.toml", PAIR)]);
    hapt(at.path(), ["sim", "w.toml", "--out", "."]).done();
    for options in [&["--write", "device.toml"][..], &["--handle"]] {
        let ended = identify(at.path(), &[&["held.csv", "--json"], options].concat()).done();
        assert!(ended.err.contains("no inertia can be determined from this record"), "{}", ended.err);
        assert_eq!(
            ended.err.contains("no handle on a flexible shaft explains"),
            options == ["--handle"],
            "{}",
            ended.err
        );
        let json: serde_json::Value = serde_json::from_str(&ended.out).unwrap();
        assert!(json["inertia"].is_null() && json["sign"].is_null() && json["misfit"]["share"].is_number(), "{json}");
    }
    assert_eq!(names(at.path()), ["held.csv", "let-go.csv", "w.toml"]);
}

/// A lever against a rigid stop, or columns of two devices: the record is read, and determines nothing.
#[test]
fn a_motion_that_no_torque_makes_has_a_misfit_and_no_numbers() {
    let row =
        |k: usize| format!("{k},{},{}", ((0.05 * k as f64).sin() * 100.0).round(), if k % 100 < 50 { 1 } else { -1 });
    let rows: Vec<String> = (0..3000).map(row).collect();
    let text = format!("t_ms,angle_deg,tau_mNm\n{}\n", rows.join("\n"));
    let at = folder(&[("log.csv", &text)]);
    let ended = identify(at.path(), &["log.csv", "--json", "--write", "device.toml"]).done();
    for words in ["the motion does not follow from the torque", "look at the columns", "no inertia can be determined"] {
        assert!(ended.err.contains(words), "{}", ended.err);
    }
    let json: serde_json::Value = serde_json::from_str(&ended.out).unwrap();
    assert!(json["inertia"].is_null() && json["sign"].is_null(), "{json}");
    assert!(json["misfit"]["share"].as_f64().unwrap() > 0.8, "{json}");
    assert_eq!(names(at.path()), ["log.csv"]);
}

/// The confirmation on a terminal before a real device moves.
#[cfg(target_os = "linux")]
mod confirmation {
    use std::fs::File;
    use std::process::Stdio;
    use std::time::{Duration, Instant};

    use super::{folder, hapt, names};
    use crate::common::{Ended, Running, TEST_TIMEOUT, Table, drive, program};

    /// A wheel on a drive, with a loop that any machine keeps.
    const DRIVEN: &str = r#"[loop]
period = "10 ms"
estimator = "difference"
[device]
inertia = "6.4e-4 kg m^2"
damping = "3e-3 N m s/rad"
friction = "2 N mm"
limit = "100 N mm"
[safety]
stuck = 0
stall = "10 s"
"#;

    /// Answers the question with these bytes, or hangs up where there are none.
    fn answered(at: &std::path::Path, device: &str, answer: &str) -> Ended {
        let (mut terminal, path) = hapt_host::board::pty().unwrap();
        let args =
            ["identify", device, "--world", "w.toml", "--duration", "3 s", "--log", "run.mcap", "--write", "d.toml"];
        let mut command = program(at, args);
        command.stdin(Stdio::from(File::open(path).unwrap()));
        let mut running = Running::start(command);
        running.until("it asks", |_, err| err.contains("Go on? [y/N] "));
        if answer.is_empty() {
            drop(terminal);
            return running.end();
        }
        terminal.write(answer.as_bytes(), Instant::now() + Duration::from_secs(10)).unwrap();
        running.end()
    }

    #[test]
    fn who_does_not_say_yes_moves_nothing_and_writes_nothing() {
        // So fast a loop has a chirp to offer.
        let at = folder(&[("w.toml", &DRIVEN.replace("10 ms", "1 ms"))]);
        let (mut port, path) = hapt_host::board::pty().unwrap();
        let device = format!("moteus:{}", path.display());
        for answer in ["n\n", "\n", "yesterday\n", ""] {
            let ended = answered(at.path(), &device, answer);
            assert_eq!((ended.code, ended.out.as_str()), (Some(2), ""), "{answer:?}: {}", ended.err);
            for word in ["to and fro, by steps and a chirp", "up to 10 N mm for 3 s", "hapt: not moved"] {
                assert!(ended.err.contains(word), "{answer:?}: {word:?} is not in {}", ended.err);
            }
        }
        // Without a terminal there is no question.
        let nobody = hapt(at.path(), ["identify", &device, "--world", "w.toml", "--write", "d.toml"]);
        nobody.refused(2, &["will move: pass --yes when everyone is clear of it"]);
        assert_eq!(names(at.path()), ["w.toml"]);
        // Not one byte has reached the drive.
        assert_eq!(port.read(&mut [0; 64], Instant::now()).unwrap(), 0);
    }

    #[test]
    fn who_says_yes_moves_it() {
        let at = folder(&[("w.toml", DRIVEN)]);
        let (_drive, device) = drive(at.path(), "moteus", &["--lockstep"]);
        // A pause of the machine may end a run, and a slow machine leaves pushes out, within a limit: the log still exists, and no torque
        // in it exceeds the agreed one.
        let begin = Instant::now();
        let mut largest = 0.0;
        while largest <= 5e-3 {
            assert!(begin.elapsed() < TEST_TIMEOUT, "{largest} N m");
            let ended = answered(at.path(), &device, "y\n");
            assert!(ended.err.contains("Go on? [y/N]"), "{}", ended.err);
            if hapt(at.path(), ["log", "convert", "run.mcap", "-o", "run.csv"]).code != Some(0) {
                continue;
            }
            let torques = Table::read(&at.path().join("run.csv")).column("applied_Nm");
            largest = torques.iter().fold(0.0, |most: f64, torque| most.max(torque.abs()));
            assert!(largest <= 10e-3 * (1.0 + 1e-9), "{largest} N m");
        }
    }
}

/// A lever of 1.6e-3 kg m² on a loop, pushed by a hand whose sensor shows -0.25 of its torque, as a table with semicolons and decimal commas.
fn pushed() -> String {
    let (mut z, mut v) = (0.1, 0.0);
    let mut text = String::from("% a rig\nzeit [s];arm [rad];motor [N.m];sensor [N]\n");
    for k in 0..8000 {
        let t = f64::from(k) * 5e-4;
        let hand = 0.06 * ((9.0 * t).sin() + (23.0 * t + 1.0).sin() + (41.0 * t).cos());
        let motor = 1.2 * (0.3 * (13.0 * t).sin() + 0.1 * (31.0 * t).sin() - z) - 0.02 * v;
        let line = format!("{t:.4};{z:.6};{motor:.6};{:.6}\n", -0.25 * hand);
        text += &line.replace('.', ",");
        for _ in 0..10 {
            let free = v + 5e-5 * (motor + hand - 0.3 * z - 3e-3 * v) / 1.6e-3;
            let brake = 5e-5 * 0.02 / 1.6e-3;
            v = if f64::abs(free) <= brake { 0.0 } else { free - brake * free.signum() };
            z += 5e-5 * v;
        }
    }
    text
}

#[test]
fn a_second_torque_and_a_cable_are_told_beside_the_inertia() {
    let at = folder(&[("rig.csv", &pushed())]);
    let columns = ["rig.csv", "--time", "zeit", "--position", "arm", "--torque", "motor", "--force", "sensor"];
    let json = identify(at.path(), &[&columns[..], &["--json"]].concat()).done().out;
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let holds = |x: &serde_json::Value, truth: f64| {
        assert!(x["low"].as_f64().unwrap() <= truth && truth <= x["high"].as_f64().unwrap(), "{truth}: {json}");
    };
    holds(&json["inertia"], 1.6e-3);
    holds(&json["force"], -4.0);
    assert_eq!(json["terms"][0]["kind"], "stiffness", "{json}");
    let stiffness = json["terms"][0]["value"].as_f64().unwrap();
    assert!((stiffness / 0.3 - 1.0).abs() < 0.15, "{json}");
    assert_ne!(json["sign"]["value"], -1.0, "{json}");
    let text = identify(at.path(), &[&columns[..], &["--plot", "fit.svg"]].concat()).done();
    for line in ["by the torque alone", "by the motion alone", "force     ", "stiffness "] {
        assert!(text.out.contains(line), "{line}: {}", text.out);
    }
    // Without its sensor there is still an answer, or the message that there is none.
    identify(at.path(), &columns[..7]).done();
}

/// A motor on a voltage: k = 0.05 N m/A, R = 2 ohm, a gear of 3, so that the motor adds 0.01125 N m s/rad.
#[test]
fn a_record_of_volts_is_one_of_torques_with_the_motors_constants() {
    let (mut z, mut v) = (0.0, 0.0);
    let mut text = String::from("t_s,arm_deg,drive_V\n");
    let (constant, resistance, ratio) = (0.05, 2.0, 3.0);
    for k in 0..5000 {
        let t = f64::from(k) * 1e-3;
        let level = f64::from((k / 137 * 7919 + k / 61 * 104_729) % 7 - 3);
        text += &format!("{t:.4},{:.5},{level}\n", f64::to_degrees(z));
        for _ in 0..20 {
            let torque = constant * ratio / resistance * (level - constant * ratio * v);
            let free = v + 5e-5 * (torque - 2e-3 * v) / 1e-3;
            let brake = 5e-5 * 5e-3 / 1e-3;
            v = if f64::abs(free) <= brake { 0.0 } else { free - brake * free.signum() };
            z += 5e-5 * v;
        }
    }
    let at = folder(&[("volts.csv", &text)]);
    let args = [
        "volts.csv",
        "--torque",
        "drive_V",
        "--torque-constant",
        "0.05",
        "--resistance",
        "2",
        "--ratio",
        "3",
        "--json",
    ];
    let json = identify(at.path(), &args).done().out;
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    for (name, truth, within) in [("inertia", 1e-3, 0.02), ("damping", 2e-3, 0.1), ("friction", 5e-3, 0.1)] {
        let value = json[name]["value"].as_f64().unwrap();
        assert!((value / truth - 1.0).abs() < within, "{name} {value}: {json}");
    }
    assert_eq!(json["sign"]["value"], 1.0, "{json}");
}

/// With less friction in one direction: the file of `--write` has both levels, and can be read.
#[test]
fn friction_by_direction_is_written_as_such() {
    let (mut z, mut v) = (0.0, 0.0);
    let mut text = String::from("t_s,arm_rad,motor_Nm\n");
    for k in 0..6000 {
        let t = f64::from(k) * 1e-3;
        let torque = 0.02 * f64::from((k / 137 * 7919 + k / 61 * 104_729) % 7 - 3);
        text += &format!("{t:.4},{z:.4},{torque:.5}\n");
        for _ in 0..20 {
            let free = v + 5e-5 * (torque - 5e-3 * v) / 1e-3;
            let brake = 5e-5 / 1e-3 * if free > 0.0 { 5e-3 } else { 9e-3 };
            v = if f64::abs(free) <= brake { 0.0 } else { free - brake * free.signum() };
            z += 5e-5 * v;
        }
    }
    let at = folder(&[("arm.csv", &text)]);
    identify(at.path(), &["arm.csv", "--write", "d.toml"]).done();
    let written = std::fs::read_to_string(at.path().join("d.toml")).unwrap();
    let file = format!("loop.period = \"1 ms\"\n{written}");
    let world = hapt_model::World::read(&hapt_model::Source::from_text("d.toml", file), &[]).unwrap();
    let [forward, backward] = world.device.frictions_range();
    for ([low, high], truth) in [(forward, 5e-3), (backward, 9e-3)] {
        assert!(low < 1.05 * truth && high > 0.95 * truth && high - low < truth, "{low} {high} {truth}: {written}");
    }
    let against = "arm.csv --against w.toml".split(' ').collect::<Vec<_>>();
    std::fs::write(at.path().join("w.toml"), format!("loop.period = \"1 ms\"\n{written}")).unwrap();
    let agrees = identify(at.path(), &against).done();
    assert!(!agrees.out.contains("contradict"), "{}", agrees.out);
}

/// Friction that falls with the speed, as `[device.stribeck]` has it: the written file has the same.
#[test]
fn stribeck_friction_is_written_as_the_device_has_it() {
    let [coulomb, more, velocity] = [4e-3, 8e-3, 1.0];
    let (mut z, mut v) = (0.0, 0.0);
    let mut text = String::from("t_s,arm_rad,motor_Nm\n");
    for k in 0..20_000 {
        let t = f64::from(k) * 1e-3;
        let torque = 0.014 * f64::sin(2.0 * t) + 0.008 * f64::sin(9.1 * t) + 0.004 * f64::sin(23.0 * t);
        text += &format!("{t:.4},{z:.6},{torque:.6}\n");
        for _ in 0..20 {
            let free = v + 5e-5 * (torque - 4e-3 * v) / 1e-3;
            let level = coulomb + more * (1.0 - f64::abs(v) / velocity).max(0.0);
            let brake = 5e-5 * level / 1e-3;
            v = if f64::abs(free) <= brake { 0.0 } else { free - brake * free.signum() };
            z += 5e-5 * v;
        }
    }
    let at = folder(&[("arm.csv", &text)]);
    let out = identify(at.path(), &["arm.csv", "--write", "d.toml"]).done().out;
    let written = std::fs::read_to_string(at.path().join("d.toml")).unwrap();
    let file = format!("loop.period = \"1 ms\"\n{written}");
    let world = hapt_model::World::read(&hapt_model::Source::from_text("d.toml", file), &[]).unwrap();
    let found = world.device.stribeck.unwrap_or_else(|| panic!("{out}\n{written}"));
    let near = |x: f64, truth: f64, part: f64| (x / truth - 1.0).abs() < part;
    assert!(near(found.torque, more, 0.3) && near(found.velocity, velocity, 0.5), "{found:?} {out}");
    assert!(near(world.device.friction, coulomb, 0.4), "{written} {out}");
}

/// Friction that changes eight times a turn by half of itself: the written file has the same, and no cogging.
#[test]
fn friction_by_position_is_written_as_the_device_has_it() {
    let level = |z: f64| 6e-3 * (1.0 + 0.5 * f64::sin(8.0 * (z - 0.2)));
    let (mut z, mut v) = (0.0, 0.0);
    let mut text = String::from("t_s,arm_rad,motor_Nm\n");
    for k in 0..10_000 {
        let t = f64::from(k) * 1e-3;
        let torque = 0.012 * f64::sin(2.0 * t) + 0.012 * f64::sin(9.1 * t) + 0.006 * f64::sin(23.0 * t);
        text += &format!("{t:.4},{z:.6},{torque:.6}\n");
        for _ in 0..20 {
            let free = v + 5e-5 * (torque - 3e-3 * v) / 1e-3;
            let brake = 5e-5 * level(z) / 1e-3;
            v = if f64::abs(free) <= brake { 0.0 } else { free - brake * free.signum() };
            z += 5e-5 * v;
        }
    }
    let at = folder(&[("arm.csv", &text)]);
    let out = identify(at.path(), &["arm.csv", "--write", "d.toml"]).done().out;
    let written = std::fs::read_to_string(at.path().join("d.toml")).unwrap();
    let file = format!("loop.period = \"1 ms\"\n{written}");
    let world = hapt_model::World::read(&hapt_model::Source::from_text("d.toml", file), &[]).unwrap();
    let found = world.device.friction_by_position.unwrap_or_else(|| panic!("{out}\n{written}"));
    let friction = world.device.friction;
    for i in 0..60 {
        let z = 0.1 * f64::from(i);
        assert!((friction * found.at(z) - level(z)).abs() < 1.2e-3, "{z}: {written} {out}");
    }
    assert!(world.device.torque.is_none(), "{written}");
}
