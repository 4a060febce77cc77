//! Logs: `hapt sim --format`, `hapt log replay`, `hapt log convert`, and `hapt plot` of one.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use hapt_log::{Header, Log, LogWriter, Origin};
use hapt_model::{Source, World};
use hapt_rt::Change;
use hapt_sim::{Row, Simulation};

use crate::common::{Ended, Running, Table, WHEEL, folder, hapt, hapt_reads, names, program, shipped};

/// The wheel's run in all formats.
fn run(at: &Path) {
    hapt(at, ["sim", "w.toml", "--out", "r", "--format", "mcap", "--format", "parquet", "--format", "csv"]).done();
}

fn read(path: impl AsRef<Path>) -> Vec<u8> {
    fs::read(path).unwrap()
}

#[test]
fn a_run_has_a_file_of_each_format_and_each_converts_to_the_others_bytes() {
    let at = folder(&[("w.toml", WHEEL)]);
    run(at.path());
    let of_a_run = at.path().join("r");
    assert_eq!(names(&of_a_run), ["step.csv", "step.mcap", "step.parquet"]);
    for name in ["step.csv", "step.mcap", "step.parquet"] {
        hapt(at.path(), ["log", "convert", "r/step.mcap", "-o", name]).done();
        assert!(read(at.path().join(name)) == read(of_a_run.join(name)), "{name}");
    }
    // Without a format, and in addition to others: the same CSV.
    hapt(at.path(), ["sim", "w.toml", "--out", "alone"]).done();
    assert_eq!(names(&at.path().join("alone")), ["step.csv"]);
    assert!(read(at.path().join("alone/step.csv")) == read(of_a_run.join("step.csv")));
}

#[test]
fn a_log_carries_its_world_its_overrides_and_its_certificate() {
    let at = folder(&[("w.toml", WHEEL)]);
    hapt(at.path(), ["sim", "w.toml", "--set", "loop.period=2ms", "--out", "r", "--format", "mcap"]).done();
    let log = Log::open(at.path().join("r/step.mcap")).unwrap();
    assert_eq!(
        (log.header.world_text.as_str(), log.header.overrides.as_slice()),
        (WHEEL, &["loop.period=2ms".into()][..])
    );
    assert_eq!((log.header.scenario.as_deref(), log.header.device.as_str()), (Some("step"), "sim"));
    assert_eq!(log.plan().world.sampling.period, 0.002);
    let certificate: serde_json::Value = serde_json::from_str(log.header.certificate_json.as_deref().unwrap()).unwrap();
    let checked = hapt(at.path(), ["check", "w.toml", "--set", "loop.period=2ms", "--no-remedies", "--json"]).out;
    assert_eq!(certificate, serde_json::from_str::<serde_json::Value>(&checked).unwrap());
}

#[test]
fn the_same_run_is_the_same_bits_again_wherever_its_log_went() {
    let at = folder(&[("w.toml", WHEEL)]);
    run(at.path());
    let replayed = hapt(at.path(), ["log", "replay", "r/step.mcap"]).done();
    assert_eq!(
        replayed.out,
        format!(
            "r/step.mcap: by hapt {} on device sim, scenario step\nsame       all torques of 501 samples, to the bit\n",
            env!("CARGO_PKG_VERSION")
        )
    );
    assert_eq!(replayed.err, "");
    for world in ["notes/euler.toml", "devices/eth-wall.toml", "devices/smartknob-detents.toml"] {
        let folder = world.trim_end_matches(".toml");
        hapt(at.path(), ["sim", &shipped(world), "--out", folder, "--format", "mcap"]).done();
        for log in names(&at.path().join(folder)) {
            hapt(at.path(), ["log", "replay", &format!("{folder}/{log}")]).done();
        }
    }
}

/// A log of two worlds, the second with a body more.
#[test]
fn a_log_of_several_worlds_converts_each_by_its_number() {
    let at = folder(&[("w.toml", WHEEL)]);
    let other = WHEEL.replace("[bodies.wheel]", "[bodies.more]\ninertia = 1\n\n[bodies.wheel]");
    let worlds = [WHEEL, &other].map(|text| World::read(&Source::from_text("w.toml", text), &[]).unwrap());
    let header = Header { device: "sim".into(), ..Header::default() };
    let mut writer = LogWriter::new(Vec::new(), &worlds[0], &header, Origin::Run).unwrap();
    for (number, world) in (0..).zip(&worlds) {
        writer.begin(number, world, Change::Follows).unwrap();
        let mut run = Simulation::new(world, &world.scenarios[0]).unwrap();
        while let Some(row) = run.next() {
            writer.write_row(row.unwrap()).unwrap();
        }
    }
    fs::write(at.path().join("two.mcap"), writer.finish().unwrap()).unwrap();

    assert!(hapt(at.path(), ["log", "replay", "two.mcap"]).done().out.contains("all torques of 1 002 samples"));
    hapt(at.path(), ["log", "convert", "two.mcap", "-o", "x.csv"])
        .refused(2, &["plan 1", "--plan 1 converts it alone"]);
    hapt(at.path(), ["plot", "two.mcap"]).refused(2, &["plan 1 has other columns"]);
    assert_eq!(names(at.path()), ["two.mcap", "w.toml"]);
    for (plan, text) in [("0", WHEEL), ("1", &other)] {
        fs::write(at.path().join("w.toml"), text).unwrap();
        hapt(at.path(), ["log", "convert", "two.mcap", "-o", "x.csv", "--plan", plan]).done();
        hapt(at.path(), ["sim", "w.toml", "--out", "r"]).done();
        assert!(read(at.path().join("x.csv")) == read(at.path().join("r/step.csv")), "plan {plan}");
    }
    hapt(at.path(), ["log", "convert", "two.mcap", "-o", "both.mcap"]).done();
    assert!(read(at.path().join("both.mcap")) == read(at.path().join("two.mcap")));
}

/// A log of the wheel whose command of sample 7 is another.
fn tampered(at: &Path) {
    let mut log = Log::open(at.join("r/step.mcap")).unwrap();
    let world = World::read(&Source::from_text("w.toml", WHEEL), &[]).unwrap();
    let header = Header { device: "sim".into(), version: "0.0.9".into(), ..Header::default() };
    let mut writer = LogWriter::new(Vec::new(), &world, &header, Origin::Run).unwrap();
    let (mut row, mut sample) = (Row::default(), 0);
    while let Some(read) = log.next().unwrap() {
        read.fill(&mut row);
        row.command = if sample == 7 { -0.5 } else { row.command };
        writer.write_row(&row).unwrap();
        sample += 1;
    }
    fs::write(at.join("other.mcap"), writer.finish().unwrap()).unwrap();
}

#[test]
fn a_torque_that_is_another_is_named_with_its_bits_and_ends_with_1() {
    let at = folder(&[("w.toml", WHEEL)]);
    run(at.path());
    tampered(at.path());
    let right = Table::read(&at.path().join("r/step.csv")).column("command_Nm")[7];
    let Ended { code, out, err } = hapt(at.path(), ["log", "replay", "other.mcap"]);
    assert_eq!((code, err.as_str()), (Some(1), ""));
    let wanted = format!(
        "other.mcap: by hapt 0.0.9 on device sim\n\
         different  1 of 501 samples, first sample 7 (7 ms): command_Nm\n           -0.5 (bfe0000000000000) in the log\n\
         \x20          {right} ({:016x}) from today's core\n",
        right.to_bits()
    );
    assert_eq!(out, wanted);
    let Ended { code, out, .. } = hapt(at.path(), ["log", "replay", "other.mcap", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert_eq!((code, &json["same"], &json["first"]["sample"]), (Some(1), &false.into(), &7.into()));
    assert_eq!(json["first"]["replayed"].as_f64().unwrap().to_bits(), right.to_bits());
}

#[test]
fn a_log_that_was_cut_is_read_as_far_as_it_goes_and_says_so() {
    let at = folder(&[("w.toml", WHEEL)]);
    run(at.path());
    let bytes = read(at.path().join("r/step.mcap"));
    fs::write(at.path().join("cut.mcap"), &bytes[..bytes.len() / 2]).unwrap();
    let cut = format!("cut.mcap: cut off behind {} bytes, before its writer ended it", bytes.len() / 2);
    let replayed = hapt(at.path(), ["log", "replay", "cut.mcap"]).done();
    assert!(replayed.out.contains("\nsame       all torques of "), "{}", replayed.out);
    assert_eq!(replayed.err, format!("{cut}; what is there was replayed\n"));
    let replayed = hapt(at.path(), ["log", "convert", "cut.mcap", "-o", "cut.csv"]).done();
    assert!(replayed.err.starts_with(&format!("{cut}; ")), "{}", replayed.err);
    let (half, whole) = (read(at.path().join("cut.csv")), read(at.path().join("r/step.csv")));
    assert!(half.len() > 1000 && half.len() < whole.len() && whole.starts_with(&half));

    hapt(at.path(), ["log", "convert", "cut.mcap", "-o", "mended.mcap"]).done();
    assert_eq!(hapt(at.path(), ["log", "replay", "mended.mcap"]).done().err, "");
    fs::write(at.path().join("stub.mcap"), &bytes[..200]).unwrap();
    hapt(at.path(), ["log", "replay", "stub.mcap"])
        .refused(2, &["stub.mcap: it holds no sample: cut off behind 200 bytes"]);
}

#[test]
fn a_logs_figure_is_its_csvs_with_the_limit_that_the_log_knows() {
    let at = folder(&[("w.toml", WHEEL)]);
    run(at.path());
    let csv = hapt(at.path(), ["plot", "r/step.csv", "--limit", "822.25 N mm"]).done().out;
    assert_eq!(hapt(at.path(), ["plot", "r/step.mcap"]).done().out, csv);
    assert_ne!(hapt(at.path(), ["plot", "r/step.csv"]).done().out, csv);
    hapt(at.path(), ["plot", "r/step.mcap", "--limit", "5 N"]).refused(2, &["--limit", "a torque"]);
}

#[test]
fn a_conversion_that_fails_leaves_nothing() {
    let at = folder(&[("w.toml", WHEEL)]);
    run(at.path());
    hapt(at.path(), ["log", "convert", "r/step.mcap", "-o", "no/step.csv"]).refused(3, &["cannot write no/step.csv"]);
    hapt(at.path(), ["log", "convert", "r/step.mcap", "-o", "x.csv", "--plan", "4"])
        .refused(2, &["no samples of plan 4"]);
    hapt(at.path(), ["log", "convert", "r/step.mcap", "-o", "x.xlsx"])
        .refused(2, &["--out x.xlsx", "expected FILE.csv, FILE.parquet or FILE.mcap"]);
    hapt_reads(at.path(), "time_s,puck_rad\n", ["log", "replay", "-"]).refused(2, &["<stdin>: it is not a log"]);
    assert_eq!(names(at.path()), ["r", "w.toml"]);
}

#[test]
fn a_run_that_runs_away_keeps_its_rows_up_to_there_in_every_format() {
    let at = folder(&[("w.toml", WHEEL)]);
    let away = ["loop.method=forward-euler", "loop.period=1 s", "scenarios.step.duration=1000 s"];
    let sets = away.iter().flat_map(|set| ["--set", set]);
    let formats = ["--format", "csv", "--format", "mcap"];
    hapt(at.path(), ["sim", "w.toml", "--out", "r"].into_iter().chain(formats).chain(sets))
        .refused(3, &["scenario step", "ends before"]);
    let replayed = hapt(at.path(), ["log", "replay", "r/step.mcap"]).done();
    let rows = Table::read(&at.path().join("r/step.csv")).rows.len();
    assert!(replayed.out.contains(&format!("all torques of {rows} samples")), "{}", replayed.out);
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_no_file_of_any_format() {
    let at = folder(&[("w.toml", WHEEL)]);
    let formats = ["--format", "parquet", "--format", "mcap", "--format", "csv"];
    let endless = ["--set", "loop.period=1 us", "--set", "scenarios.step.duration=9999 s"];
    let mut running =
        Running::start(program(at.path(), ["sim", "w.toml", "--out", "r"].into_iter().chain(formats).chain(endless)));
    let out = at.path().join("r");
    running.until("three files are begun", |_, _| out.is_dir() && names(&out).len() == 3);
    running.signal("INT");
    assert_eq!(running.end().code, Some(130));
    assert!(!out.exists(), "the command created the folder, and nothing is in it");
}

/// A Python that has MCAP's own library: of the environment that `cargo xtask test` makes with `CI` set
/// (`xtask/src/tools.rs`), or the system's.
fn python() -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mcap/bin/python");
    let has = |python: &Path| {
        let output = Command::new(python).args(["-c", "import mcap.reader, mcap_protobuf.decoder"]).output();
        output.is_ok_and(|output| output.status.success())
    };
    let found = [own, "python3".into()].into_iter().find(|python| has(python));
    assert!(found.is_some() || std::env::var_os("CI").is_none(), "no Python reads MCAP: cargo xtask test installs it");
    if found.is_none() {
        println!("SKIPPED: no Python reads MCAP; CI=1 cargo xtask test installs it");
    }
    found
}

/// The lines of docs/logs.md, unchanged, on a recording whose process was killed, and on one that was finished.
#[cfg(unix)]
#[test]
fn pythons_own_reader_reads_every_sample_of_a_killed_recording() {
    let Some(python) = python() else { return };
    let book = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/logs.md")).unwrap();
    let lines = book.split_once("```python\n").unwrap().1.split_once("```").unwrap().0;
    let at = folder(&[("w.toml", WHEEL), ("read.py", &format!("{lines}print(len(torques))\n"))]);
    fs::create_dir(at.path().join("runs")).unwrap();
    let log = at.path().join("runs/step.mcap");
    let count = |log: &Path| {
        let mut log = Log::open(log).ok()?;
        let mut count = 0;
        while log.next().ok()?.is_some() {
            count += 1;
        }
        Some(count)
    };
    let by_python = || {
        let output = Command::new(&python).arg("read.py").current_dir(at.path()).output().unwrap();
        let out = String::from_utf8(output.stdout).unwrap();
        out.trim().parse::<u64>().unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr)))
    };
    let mut running = Running::start(program(at.path(), ["run", "w.toml", "--log", "runs/step.mcap"]));
    running.until("two seconds of samples", |_, _| count(&log).is_some_and(|count| count > 1000));
    running.signal("KILL");
    running.end();
    let killed = count(&log).unwrap();
    assert!(killed > 1000 && by_python() == killed, "{killed} {}", by_python());
    let ended = hapt(at.path(), ["log", "convert", "runs/step.mcap", "-o", "step.csv"]).done();
    assert!(ended.err.contains("before its writer ended it"), "{ended:?}");

    hapt(at.path(), ["run", "w.toml", "--scenario", "step", "--log", "runs/step.mcap"]).done();
    assert_eq!(by_python(), count(&log).unwrap());
}
