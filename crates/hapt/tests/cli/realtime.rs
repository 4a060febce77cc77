//! The loop in real time: `hapt run` and `hapt latency`.

use std::fs;
use std::process::Command;

use hapt_log::{Log, LogWriter};
use hapt_rt::{Plan, Snapshot};
use serde_json::Value;

use crate::common::{Running, WHEEL, binary, folder, hapt, near, program};

/// The wheel with a torque beyond the motor's limit, and a puck that nothing holds.
const RUNAWAY: &str = r#"
[loop]
period = "1 ms"
[device]
inertia = "6.4e-4 kg m^2"
[[couplings]]
kind = "constant"
between = ["puck", "ground"]
torque = 1e308
"#;

/// The number between these words.
fn between(text: &str, before: &str, after: &str) -> f64 {
    let number = text.split_once(before).and_then(|(_, rest)| rest.split_once(after));
    number.unwrap_or_else(|| panic!("no {before:?} ... {after:?} in {text}")).0.trim().parse().unwrap()
}

/// How many samples were taken, and how many missed.
fn samples(text: &str) -> (f64, f64) {
    let line = text.lines().find(|line| line.contains(" samples, ")).unwrap_or_else(|| panic!("no samples in {text}"));
    let taken = line.split(' ').next().unwrap().parse().unwrap();
    (taken, if line.contains("none missed") { 0.0 } else { between(line, " samples, ", " missed") })
}

#[test]
fn a_scenario_in_real_time_asks_for_the_torque_that_it_asks_for_in_the_simulation() {
    let at = folder(&[("w.toml", WHEEL)]);
    let ended = hapt(at.path(), ["run", "w.toml", "--scenario", "step", "--duration", "0.3s"]).done();
    assert!(ended.out.starts_with("wheel on the simulated device, 1 ms a sample\n"), "{ended:?}");
    assert!(ended.out.contains("at full torque; ended in order"), "{ended:?}");
    // 1.018592 N m/rad over 45 deg, at the first sample.
    near(between(&ended.out, "commanded", "N mm"), 800.0, 1e-3);
    // Two fades of a tenth of a second each, and the requested duration.
    let (taken, missed) = samples(&ended.out);
    assert!(taken + missed >= 500.0 && taken > 100.0, "{ended:?}");
}

#[cfg(unix)]
#[test]
fn a_run_without_an_end_ends_with_the_torque_off_when_it_is_interrupted() {
    for (signal, code) in [("INT", 130), ("TERM", 143)] {
        let at = folder(&[("w.toml", WHEEL)]);
        let mut running = Running::start(program(at.path(), ["run", "w.toml"]));
        running.until("it runs", |_, err| err.contains("at full torque"));
        running.signal(signal);
        let ended = running.end();
        assert_eq!(ended.code, Some(code), "{ended:?}");
        assert!(ended.out.contains("interrupted, the torque off at once"), "{ended:?}");
    }
}

#[test]
fn a_loop_that_runs_away_ends_by_itself_with_the_torque_off_and_code_three() {
    let at = folder(&[("w.toml", RUNAWAY)]);
    let ended = hapt(at.path(), ["run", "w.toml", "--duration", "60s"]);
    assert_eq!(ended.code, Some(3), "{ended:?}");
    assert!(ended.err.contains("hapt: the "), "{ended:?}");
    assert!(ended.out.contains("samples"), "{ended:?}");
}

#[test]
fn a_replay_ends_with_its_recording() {
    let at = folder(&[("w.toml", WHEEL)]);
    hapt(at.path(), ["sim", "w.toml", "--out", "runs"]).done();
    let ended = hapt(at.path(), ["run", "w.toml", "--device", "replay:runs/step.csv"]).done();
    assert!(ended.out.starts_with("wheel on the positions of runs/step.csv"), "{ended:?}");
    assert!(ended.out.contains("ended in order"), "{ended:?}");
    // The recording has 501 rows; some of them may be missed.
    assert!(samples(&ended.out).0 <= 501.0, "{ended:?}");
    // One that is cut in the middle of a line says where.
    let text = fs::read_to_string(at.path().join("runs/step.csv")).unwrap();
    let cut: String = text.lines().take(3).map(|line| format!("{line}\n")).collect();
    fs::write(at.path().join("cut.csv"), cut + "0.003,0.7").unwrap();
    hapt(at.path(), ["run", "w.toml", "--device", "replay:cut.csv"])
        .refused(2, &["cut.csv, line 4", "not a finite number"]);
}

/// Its log, and the same log written anew, from its first sample on and from the middle of the run.
#[test]
fn a_log_of_a_run_gives_the_torques_again() {
    let at = folder(&[("w.toml", WHEEL)]);
    hapt(at.path(), ["run", "w.toml", "--scenario", "step", "--log", "a.mcap"]).done();
    let replayed = hapt(at.path(), ["log", "replay", "a.mcap"]).done();
    assert!(replayed.out.contains("\nsame       all torques of ") && !replayed.out.contains("skipped"), "{replayed:?}");
    hapt(at.path(), ["log", "convert", "a.mcap", "-o", "b.mcap"]).done();
    assert_eq!(hapt(at.path(), ["log", "replay", "b.mcap"]).done().out, replayed.out.replace("a.mcap", "b.mcap"));

    // From the middle on, with and without the loop's state there.
    let middle = |with_state: bool| {
        let mut log = Log::open(at.path().join("a.mcap")).unwrap();
        let world = log.plan().world.clone();
        let mut writer = LogWriter::new(Vec::new(), &world, &log.header.clone(), log.origin).unwrap();
        let (plan, mut sample) = (Plan::new(&world, log.header.profile).unwrap(), 0);
        let mut state = plan.start();
        while let Some(logged) = log.next().unwrap() {
            let inputs = logged.inputs().unwrap();
            if sample == 200 && with_state {
                let now = Snapshot { sample: inputs.sample, plan: 0, state };
                writer.write_snapshot(logged.log_time, &now).unwrap();
            }
            if sample >= 200 {
                writer.write(logged.log_time, logged.values).unwrap();
            }
            plan.step(&mut state, &inputs.reading, inputs.request);
            sample += 1;
        }
        fs::write(at.path().join("middle.mcap"), writer.finish().unwrap()).unwrap();
        sample - 200
    };
    let samples = middle(true);
    let replayed = hapt(at.path(), ["log", "replay", "middle.mcap"]).done();
    assert!(replayed.out.contains(&format!("all torques of {samples} samples")), "{replayed:?}");
    middle(false);
    hapt(at.path(), ["log", "replay", "middle.mcap"]).refused(2, &["middle.mcap", "nor its state at a later one"]);
}

#[test]
fn the_latency_comes_as_a_table_and_as_numbers() {
    let at = folder(&[("w.toml", WHEEL)]);
    let ended = hapt(at.path(), ["latency", "w.toml", "--duration", "0.2s"]).done();
    for word in ["latency", "period", "computation", "p99.9", "samples", "longest gap", "priority", "memory", "below"] {
        assert!(ended.out.contains(word), "{word}: {ended:?}");
    }
    // The line to paste is valid, and a run reports how well it kept it.
    let line = ended.out.lines().find_map(|line| line.trim().strip_prefix("interval_max = ")).unwrap();
    let set = format!("loop.interval_max={}", line.split('"').nth(1).unwrap());
    let checked = hapt(at.path(), ["check", "w.toml", "--no-remedies", "--set", &set]);
    assert!(checked.code != Some(2), "{set}: {checked:?}");
    let run = ["run", "w.toml", "--uncertified", "--duration", "0.2s", "--set", "loop.interval_max=10 s"];
    assert!(hapt(at.path(), run).done().out.contains("certified    inside the certificate for "));
    let ended =
        hapt(at.path(), ["latency", "--duration", "0.2s", "--priority", "0", "--spin", "100us", "--json"]).done();
    let json: Value = serde_json::from_str(&ended.out).unwrap();
    assert_eq!(json["period_s"], 1e-3);
    assert_eq!(json["realtime"]["priority"], Value::Null);
    let samples = json["samples"].as_u64().unwrap();
    assert!(samples + json["missed"].as_u64().unwrap() >= 200, "{json}");
    for time in ["latency_us", "period_us", "computation_us"] {
        let at = |name: &str| json[time][name].as_f64().unwrap();
        assert!(at("p50") <= at("p90") && at("p90") <= at("p99") && at("p99") <= at("p999") && at("p999") <= at("max"));
    }
    // Every sample is in one bar.
    let counts = json["histogram"].as_array().unwrap().iter().map(|bar| bar["count"].as_u64().unwrap());
    assert_eq!(counts.sum::<u64>(), samples);
}

#[test]
fn a_command_later_than_certified_ends_a_run_as_the_world_says() {
    let at = folder(&[("w.toml", WHEEL)]);
    let run = |sets: &[&str]| {
        let sets = sets.iter().flat_map(|set| ["--set", set]);
        hapt(at.path(), ["run", "w.toml", "--uncertified", "--duration", "0.3s"].into_iter().chain(sets))
    };
    // No command takes no time: every one is late.
    for late in [&[][..], &["safety.late=fade"], &["safety.late=fault"]] {
        let ended = run(&[&["loop.delay_max=0 s"], late].concat());
        assert_eq!(ended.code, Some(3), "{ended:?}");
        assert!(
            ended.err.contains("later than the certificate covers") && ended.err.contains("safety.late"),
            "{ended:?}"
        );
    }
    let counted = run(&["loop.delay_max=0 s", "safety.late=count", "safety.fade=50 ms"]).done();
    assert!(counted.out.contains("inside the certificate for 0 of "), "{counted:?}");
    // A time that the file does not state is not enforced, on any machine.
    let any = run(&["safety.late=fault"]).done();
    assert!(!any.out.contains("inside the certificate"), "{any:?}");
    let ended =
        hapt(at.path(), ["latency", "w.toml", "--duration", "0.2s", "--json", "--set", "loop.delay_max=0 s"]).done();
    let json: Value = serde_json::from_str(&ended.out).unwrap();
    assert_eq!(json["certified"]["inside"], 0);
    assert!(
        json["certified"]["samples"].as_u64().unwrap() > 0 && json["certified"]["longest_us"].as_f64().unwrap() > 0.0
    );
}

/// The table includes any pause of the process: of five that are stopped, at least one is stopped while its loop runs.
#[cfg(unix)]
#[test]
fn a_stall_shows_in_the_latency_and_as_the_longest_gap() {
    const STALL: std::time::Duration = std::time::Duration::from_millis(700);
    let at = folder(&[("w.toml", WHEEL)]);
    let replayed = (0..5).any(|_| {
        let running = Running::start(program(at.path(), ["latency", "w.toml", "--duration", "1.5s", "--json"]));
        std::thread::sleep(STALL / 2);
        running.signal("STOP");
        std::thread::sleep(STALL);
        running.signal("CONT");
        let json: Value = serde_json::from_str(&running.end().done().out).unwrap();
        let latency = json["latency_us"]["max"].as_f64().unwrap();
        let (gap, period) = (json["longest_gap_us"].as_f64().unwrap(), json["period_us"]["max"].as_f64().unwrap());
        near(gap, period, 2e-3);
        latency > 0.6e6 && gap > 0.6e6 && json["missed"].as_u64().unwrap() > 500
    });
    assert!(replayed, "no stall showed");
}

/// Where strace is installed and permitted: between its first sleep and its last, the loop's thread calls nothing of the system's but to
/// sleep until an instant.
#[cfg(target_os = "linux")]
#[test]
fn the_loops_thread_makes_one_system_call_a_sample_and_it_is_the_sleep() {
    let at = folder(&[("w.toml", WHEEL)]);
    let mut strace = Command::new("strace");
    strace.current_dir(at.path()).args(["-f", "-o", "calls"]).arg(binary());
    strace.args(["run", "w.toml", "--scenario", "step"]);
    let Some(out) = strace.output().ok().filter(|out| out.status.success()) else {
        println!("SKIPPED: there is no strace here, or it may not look");
        return;
    };
    let calls = fs::read_to_string(at.path().join("calls")).unwrap();
    // "1234  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, ..."
    let by_thread = |line: &str| line.split_once(' ').map(|(id, call)| (id.to_string(), call.trim_start().to_string()));
    let calls: Vec<(String, String)> = calls.lines().filter_map(by_thread).collect();
    let sleeps = |call: &str| call.starts_with("clock_nanosleep(") && call.contains("TIMER_ABSTIME");
    let thread = &calls.iter().find(|(_, call)| sleeps(call)).expect("nobody sleeps until an instant").0;
    let own: Vec<&str> = calls.iter().filter(|(id, _)| id == thread).map(|(_, call)| call.as_str()).collect();
    let first = own.iter().position(|call| sleeps(call)).unwrap();
    let last = own.iter().rposition(|call| sleeps(call)).unwrap();
    let slept = own[first..=last].iter().filter(|call| sleeps(call)).count();
    for call in &own[first..=last] {
        assert!(sleeps(call) || call.starts_with("<... clock_nanosleep resumed>"), "the loop's thread calls {call}");
    }
    let (taken, _) = samples(&String::from_utf8(out.stdout).unwrap());
    assert!(slept as f64 <= taken + 1.0 && slept > 100, "{slept} sleeps in {taken} samples");
}
