//! How a command ends when it is disturbed: closed pipes, signals, full disks, worlds that diverge.

use std::fs;
use std::io::{BufRead, BufReader, pipe};
use std::path::Path;
use std::process::Stdio;

use crate::common::{Running, Table, WHEEL, binary, folder, hapt, names, program, shipped};

/// A run of ten thousand million samples: until it is ended.
const ENDLESS: [&str; 4] = ["--set", "loop.period=1 us", "--set", "scenarios.step.duration=9999 s"];
/// Forward Euler on the wheel, far too slow: |λ| = 6.36 a sample.
const AWAY: [&str; 6] =
    ["--set", "loop.method=forward-euler", "--set", "loop.period=1 s", "--set", "scenarios.step.duration=1000 s"];

#[test]
fn a_reader_that_is_gone_ends_every_command_quietly() {
    let (euler, design) = (shipped("notes/euler.toml"), ["--travel", "1 rad", "--torque", "1 N m", "--frequency", "1"]);
    let design: Vec<&str> = ["design"].into_iter().chain(design).collect();
    for args in [
        &[][..],
        &["sim", &euler],
        &["check", &euler],
        &["check", &euler, "--json"],
        &design,
        &["--help"],
        &["sim", "--help"],
        &["--version"],
    ] {
        let (reader, writer) = pipe().unwrap();
        drop(reader);
        let mut command = program(Path::new("."), args);
        command.stdout(writer).stderr(Stdio::piped());
        let ended = Running::start_as_it_is(command).end();
        assert_eq!((ended.code, ended.messages().len()), (Some(0), 0), "{args:?}: {ended:?}");
    }
}

#[test]
fn a_reader_that_leaves_after_the_first_line_ends_a_run_quietly() {
    let (reader, writer) = pipe().unwrap();
    let euler = shipped("notes/euler.toml");
    let mut command = program(Path::new("."), ["sim", &euler, "--set", "scenarios.step.duration=500 s"]);
    command.stdout(writer).stderr(Stdio::piped());
    let running = Running::start_as_it_is(command);
    let (mut reader, mut line) = (BufReader::new(reader), String::new());
    reader.read_line(&mut line).unwrap();
    drop(reader);
    assert_eq!(line, "Virtual wheel, forward Euler\n");
    let ended = running.end();
    assert_eq!((ended.code, ended.messages().len()), (Some(0), 0), "{ended:?}");
}

#[test]
fn messages_that_nobody_reads_change_neither_the_work_nor_the_exit_code() {
    let at = folder(&[("w.toml", WHEEL)]);
    let away: Vec<&str> = ["sim", "w.toml", "--out", "away"].into_iter().chain(AWAY).collect();
    let design = ["design", "--travel", "1", "--torque", "1", "--frequency", "400"];
    for (args, code) in [
        (&["sim", "w.toml", "--out", "out"][..], 0),
        (&design, 0),
        (&["sim", "missing.toml"], 2),
        (&["sim", "--bogus"], 2),
        (&away, 3),
    ] {
        let (reader, writer) = pipe().unwrap();
        drop(reader);
        let mut command = program(at.path(), args);
        command.stdout(Stdio::piped()).stderr(writer);
        let ended = Running::start_as_it_is(command).end();
        assert_eq!(ended.code, Some(code), "{args:?}");
        assert_eq!(ended.out.is_empty(), args[0] != "design", "{args:?}");
    }
    assert_eq!(names(at.path()), ["away", "out", "w.toml"]);
    assert_eq!(names(&at.path().join("out")), ["step.csv"]);
}

#[test]
fn a_run_that_runs_away_keeps_its_rows_up_to_there() {
    let at = folder(&[("w.toml", WHEEL)]);
    let ended = hapt(at.path(), ["sim", "w.toml", "--out", "out"].into_iter().chain(AWAY));
    let ended = ended.refused(3, &["scenario step", "stops being finite", "step.csv"]);
    assert_eq!(names(&at.path().join("out")), ["step.csv"]);
    let table = Table::read(&at.path().join("out/step.csv"));
    assert!((100..1000).contains(&table.rows.len()), "{}", table.rows.len());
    let times = table.column("time_s");
    assert!(times.iter().enumerate().all(|(sample, time)| *time == sample as f64));
    assert!(ended.err.contains(&format!("t = {} s", table.rows.len())), "{} rows: {}", table.rows.len(), ended.err);
    // Not one row too few: the last is within a few samples' growth of the end of the numbers.
    let last = table.rows.last().unwrap().iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    assert!(last > f64::MAX / 1e4, "{last:e}");

    let ended = hapt(at.path(), ["sim", "w.toml"].into_iter().chain(AWAY));
    assert_eq!(ended.code, Some(3));
    assert!(ended.out.contains("\nscenario step: "), "{}", ended.out);
    let message = format!("the run stops being finite at t = {} s: the loop has run away", table.rows.len());
    assert_eq!(ended.messages(), [format!("hapt: scenario step: {message}")]);
}

#[test]
fn the_other_scenarios_still_run_when_one_runs_away() {
    let more = "[scenarios.short]\nduration = \"20 s\"\nhand = { kind = \"step\", to = \"1 deg\" }\n";
    let at = folder(&[("w.toml", &format!("{WHEEL}{more}"))]);
    let ended = hapt(at.path(), ["sim", "w.toml", "--out", "."].into_iter().chain(AWAY));
    assert_eq!(ended.code, Some(3));
    assert!(ended.err.contains("hapt: scenario step: ") && !ended.err.contains("scenario short: "), "{}", ended.err);
    assert_eq!(Table::read(&at.path().join("short.csv")).rows.len(), 21);
    assert_eq!(names(at.path()), ["short.csv", "step.csv", "w.toml"]);
}

#[test]
fn a_long_run_says_how_far_it_is_on_standard_error_only() {
    let at = folder(&[("w.toml", WHEEL)]);
    let mut running = Running::start(program(at.path(), ["sim", "w.toml"].into_iter().chain(ENDLESS)));
    running.until("a word on how far it is", |out, err| {
        assert!(["", "wheel\n"].contains(&out), "{out}");
        err.ends_with(" s left\n")
    });
    running.until("it still runs", |out, err| {
        let line = err.lines().next().unwrap();
        assert!(line.starts_with("step: ") && line.contains(" % of 9 999 000 001 samples"), "{line}");
        out == "wheel\n"
    });
}

#[cfg(unix)]
mod signals {
    use super::*;

    #[test]
    fn an_interrupted_run_leaves_nothing_behind() {
        for (signal, code) in [("INT", 130), ("TERM", 143)] {
            let at = folder(&[("w.toml", WHEEL)]);
            let args = ["sim", "w.toml", "--out", "new/out"].into_iter().chain(ENDLESS);
            let mut running = Running::start(program(at.path(), args));
            let out = at.path().join("new/out");
            running.until("a file is begun", |_, _| out.is_dir() && !names(&out).is_empty());
            running.signal(signal);
            let ended = running.end();
            assert_eq!((ended.code, ended.out.as_str()), (Some(code), ""), "{ended:?}");
            assert!(ended.messages().is_empty(), "{ended:?}");
            assert_eq!(names(at.path()), ["w.toml"]);
        }
    }

    /// Of the folders around its files the command removes only those that it has created itself.
    #[test]
    fn an_interrupted_run_leaves_the_folders_and_links_of_its_user() {
        for (given, stays) in [("out", "out"), ("link", "out"), ("link/new/er", "out"), ("out/../out/new", "out")] {
            let at = folder(&[("w.toml", WHEEL)]);
            fs::create_dir(at.path().join("out")).unwrap();
            std::os::unix::fs::symlink("out", at.path().join("link")).unwrap();
            let args = ["sim", "w.toml", "--out", given].into_iter().chain(ENDLESS);
            let mut running = Running::start(program(at.path(), args));
            let out = at.path().join(given);
            running.until("a file is begun", |_, _| out.is_dir() && !names(&out).is_empty());
            running.signal("INT");
            assert_eq!(running.end().code, Some(130), "{given}");
            assert_eq!(names(at.path()), ["link", "out", "w.toml"], "{given}");
            assert_eq!(names(&at.path().join(stays)), [""; 0], "{given}");
        }
    }

    /// Another program's file in a folder that the command has created keeps the folder.
    #[test]
    fn a_folder_into_which_another_program_has_written_stays() {
        let at = folder(&[("w.toml", WHEEL)]);
        let args = ["sim", "w.toml", "--out", "new/out"].into_iter().chain(ENDLESS);
        let mut running = Running::start(program(at.path(), args));
        let out = at.path().join("new/out");
        running.until("a file is begun", |_, _| out.is_dir() && !names(&out).is_empty());
        fs::write(at.path().join("new/mine"), "").unwrap();
        running.signal("INT");
        assert_eq!(running.end().code, Some(130));
        assert_eq!(names(&at.path().join("new")), ["mine"]);
    }

    #[test]
    fn a_refused_command_leaves_a_broken_link_and_no_folder() {
        let at = folder(&[("w.toml", WHEEL)]);
        let link = at.path().join("link");
        std::os::unix::fs::symlink("nowhere/at/all", &link).unwrap();
        for out in ["link", "link/new"] {
            let ended = hapt(at.path(), ["sim", "w.toml", "--out", out]);
            assert!([Some(2), Some(3)].contains(&ended.code) && ended.err.contains(out), "{ended:?}");
            assert!(link.is_symlink(), "{out}");
        }
        hapt(at.path(), ["sim", "w.toml", "--out", "new/../link/er"]).refused(3, &["cannot make"]);
        assert_eq!(names(at.path()), ["link", "w.toml"]);
    }

    #[test]
    fn an_interrupted_run_leaves_the_file_of_the_one_before() {
        let at = folder(&[("w.toml", WHEEL)]);
        hapt(at.path(), ["sim", "w.toml", "--out", "out"]).done();
        let out = at.path().join("out");
        let before = fs::read(out.join("step.csv")).unwrap();
        for signal in ["INT", "TERM"] {
            let args = ["sim", "w.toml", "--out", "out"].into_iter().chain(ENDLESS);
            let mut running = Running::start(program(at.path(), args));
            running.until("a file is begun", |_, _| names(&out).len() > 1);
            running.signal(signal);
            running.end();
            assert_eq!(names(&out), ["step.csv"]);
            assert!(fs::read(out.join("step.csv")).unwrap() == before);
        }
    }

    #[test]
    fn the_scenarios_done_before_an_interruption_stay() {
        let more = "[scenarios.long]\nduration = \"9999999 s\"\nhand = { kind = \"step\", to = \"1 deg\" }\n";
        let at = folder(&[("w.toml", &format!("{WHEEL}{more}"))]);
        let mut running = Running::start(program(at.path(), ["sim", "w.toml", "--out", "out"]));
        let out = at.path().join("out");
        running.until("the second file is begun", |_, _| out.is_dir() && names(&out).len() > 1);
        running.signal("INT");
        assert_eq!(running.end().code, Some(130));
        assert_eq!(names(&out), ["step.csv"]);
        assert_eq!(Table::read(&out.join("step.csv")).rows.len(), 501);
    }

    #[test]
    fn a_summary_under_way_can_be_interrupted() {
        for (signal, code) in [("INT", 130), ("TERM", 143)] {
            let at = folder(&[("w.toml", WHEEL)]);
            let mut running = Running::start(program(at.path(), ["sim", "w.toml"].into_iter().chain(ENDLESS)));
            running.until("its first line", |out, _| out == "wheel\n");
            running.signal(signal);
            let ended = running.end();
            assert_eq!((ended.code, ended.out.as_str()), (Some(code), "wheel\n"), "{ended:?}");
            assert!(ended.messages().is_empty(), "{ended:?}");
        }
    }

    #[test]
    fn waiting_for_standard_input_can_be_interrupted() {
        for (command, signal, code) in [("sim", "INT", 130), ("check", "INT", 130), ("sim", "TERM", 143)] {
            let mut command = program(Path::new("."), [command, "-"]);
            command.stdin(Stdio::piped());
            let mut running = Running::start(command);
            // More than a pipe holds: once it is written, it is being read.
            running.feed("# a comment\n".repeat(40_000).as_bytes());
            running.signal(signal);
            let ended = running.interrupted();
            assert_eq!((ended.code, ended.out.as_str()), (Some(code), ""), "{ended:?}");
            assert!(ended.messages().is_empty(), "{ended:?}");
        }
    }

    #[test]
    fn a_disk_without_room_is_said_and_leaves_nothing_half_written() {
        use std::process::Command;

        // The size of a file is limited to a few KiB; the signal of the limit is ignored.
        let limited = |folder: &Path, args: &[&str]| {
            let mut shell = Command::new("sh");
            shell.args(["-c", "trap '' XFSZ; ulimit -f 8; exec \"$0\" \"$@\""]).arg(binary());
            shell.args(args).current_dir(folder).stdin(Stdio::null());
            Running::start(shell).end()
        };
        let at = folder(&[("w.toml", WHEEL)]);
        let sim = ["sim", "w.toml", "--out", "out"];
        limited(at.path(), &sim).refused(3, &["cannot write", "step.csv"]);
        limited(at.path(), &["init", "new/world"]).refused(3, &["cannot write", "new/world"]);
        assert_eq!(names(at.path()), ["w.toml"]);
        let out = at.path().join("out");

        hapt(at.path(), ["sim", "w.toml", "--out", "out"]).done();
        let before = fs::read(out.join("step.csv")).unwrap();
        limited(at.path(), &sim).refused(3, &["cannot write", "step.csv"]);
        assert_eq!(names(&out), ["step.csv"]);
        assert!(fs::read(out.join("step.csv")).unwrap() == before);
    }

    #[test]
    fn a_file_is_as_open_to_others_as_any_other() {
        use std::os::unix::fs::PermissionsExt;

        let at = folder(&[("w.toml", WHEEL)]);
        hapt(at.path(), ["sim", "w.toml", "--out", "."]).done();
        let mode = |name: &str| fs::metadata(at.path().join(name)).unwrap().permissions().mode();
        assert_eq!(mode("step.csv"), mode("w.toml"));
    }
}

#[test]
fn a_folder_where_the_file_should_be_is_said_and_stays() {
    let at = folder(&[("w.toml", WHEEL)]);
    fs::create_dir_all(at.path().join("out/step.csv/mine")).unwrap();
    hapt(at.path(), ["sim", "w.toml", "--out", "out"]).refused(3, &["cannot write", "step.csv"]);
    assert_eq!(names(&at.path().join("out")), ["step.csv"]);
    assert_eq!(names(&at.path().join("out/step.csv")), ["mine"]);
}

#[cfg(target_os = "linux")]
mod linux {
    use std::fs::File;
    use std::process::Command;

    use super::*;

    #[test]
    fn standard_output_that_takes_nothing_more_is_a_failure() {
        let world = shipped("notes/default.toml");
        for args in [&[][..], &["sim", &world], &["check", &world], &["check", &world, "--json"], &["--help"]] {
            let mut command = program(Path::new("."), args);
            command.stdout(File::create("/dev/full").unwrap()).stderr(Stdio::piped());
            Running::start_as_it_is(command).end().refused(3, &["cannot write to standard output"]);
        }
    }

    #[test]
    fn a_place_that_takes_no_folder_is_a_failure() {
        let world = shipped("notes/default.toml");
        hapt(Path::new("."), ["sim", &world, "--out", "/proc/hapt"]).refused(3, &["cannot make /proc/hapt"]);
    }

    /// A script in a folder with a file system of 64 KiB, `small`, for this script only; `None` where this is not possible, with a message.
    fn on_a_small_file_system(at: &Path, script: &str) -> Option<crate::common::Ended> {
        fs::create_dir(at.join("small")).unwrap();
        let script = format!("mount -t tmpfs -o size=64k small small || exit 77\n{script}");
        let mut unshare = Command::new("unshare");
        unshare.args(["--map-root-user", "--mount", "sh", "-c", &script]).arg(binary());
        unshare.current_dir(at).stdin(Stdio::null());
        let possible = Command::new("unshare").args(["--map-root-user", "--mount", "true"]).output();
        if possible.is_ok_and(|output| output.status.success()) {
            let ended = Running::start(unshare).end();
            if ended.code != Some(77) {
                return Some(ended);
            }
        }
        eprintln!("skipped: no file system of its own can be mounted here");
        None
    }

    #[test]
    fn a_full_file_system_is_said_and_left_as_it_was() {
        let at = folder(&[("w.toml", WHEEL)]);
        let script = "\"$0\" sim w.toml --out small --set scenarios.step.duration=0.01 2>/dev/null || exit 78
            before=$(cksum small/step.csv)
            \"$0\" sim w.toml --out small --set scenarios.step.duration=5; echo \"code $?\"
            test \"$before\" = \"$(cksum small/step.csv)\" && ls -A small";
        let Some(ended) = on_a_small_file_system(at.path(), script) else { return };
        assert_eq!(ended.out, "code 3\n.hapt-runs.json\nstep.csv\n", "{ended:?}");
        assert!(ended.err.starts_with("hapt: cannot write small/step.csv: "), "{ended:?}");
    }

    /// 10^9 cells to a disk that takes some thousand: the rows that fit stay, whole, for --resume.
    #[test]
    fn a_sweep_that_fills_the_disk_keeps_its_rows() {
        let at = folder(&[("w.toml", WHEEL)]);
        let script =
            "\"$0\" sweep w.toml --vary device.damping=0..1:1000000000 --measure held_growth_per_s --out small/t.csv
            echo \"code $?\"
            ls -A small; cat small/*.partial | wc -l";
        let Some(ended) = on_a_small_file_system(at.path(), script) else { return };
        let lines: Vec<&str> = ended.out.lines().collect();
        assert!(
            matches!(lines[..], ["code 3", name, rows]
            if name.ends_with(".partial") && rows.trim().parse::<u32>().is_ok_and(|rows| rows > 100)),
            "{ended:?}"
        );
        assert!(ended.err.contains("cannot write small/t.csv.") && ended.err.contains("--resume"), "{ended:?}");
    }
}
