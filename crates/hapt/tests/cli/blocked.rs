//! Readers that do not read, terminals that are closed, and signals: no torque stays on, and no unfinished file is left.

use std::fs;
use std::io::{PipeReader, PipeWriter, Write, pipe};
use std::os::unix::fs::FileTypeExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use hapt_log::{Ending, Log};

use crate::common::{Running, WHEEL, binary, folder, hapt, names, program};

/// The signals that end a command, and its exit codes.
const SIGNALS: [(&str, u8); 4] = [("INT", 130), ("TERM", 143), ("HUP", 129), ("QUIT", 131)];

/// A full pipe. It stays full as long as its reader is kept.
fn full() -> (PipeReader, PipeWriter) {
    let (reader, writer) = pipe().unwrap();
    let (mut filling, written) = (writer.try_clone().unwrap(), Arc::new(AtomicUsize::new(0)));
    let count = Arc::clone(&written);
    thread::spawn(move || {
        while let Ok(length) = filling.write(&[b'.'; 512]) {
            count.fetch_add(length, Ordering::Relaxed);
        }
    });
    let mut before = usize::MAX;
    while before != written.load(Ordering::Relaxed) || before == 0 {
        before = written.load(Ordering::Relaxed);
        thread::sleep(Duration::from_millis(200));
    }
    (reader, writer)
}

/// The last sample in a log, whole or not.
fn samples(log: &Path) -> Option<(usize, bool)> {
    let mut log = Log::open(log).ok()?;
    let mut count = 0;
    while log.next().ok()?.is_some() {
        count += 1;
    }
    Some((count, *log.ending() == Ending::Whole))
}

#[test]
fn a_run_whose_messages_nobody_reads_ends_when_its_time_is_over() {
    let at = folder(&[("w.toml", WHEEL)]);
    let (_reader, writer) = full();
    let mut command = program(at.path(), ["run", "w.toml", "--duration", "0.3s", "--log", "r.mcap"]);
    command.stdout(Stdio::piped()).stderr(writer);
    let ended = Running::start_as_it_is(command).end();
    assert_eq!(ended.code, Some(0), "{ended:?}");
    assert!(ended.out.contains("ended in order"), "{ended:?}");
    assert!(samples(&at.path().join("r.mcap")).is_some_and(|(_, whole)| whole));
}

#[test]
fn a_run_whose_messages_nobody_reads_obeys_every_signal() {
    for (signal, code) in SIGNALS {
        let at = folder(&[("w.toml", WHEEL)]);
        let (_reader, writer) = full();
        let mut command = program(at.path(), ["run", "w.toml", "--log", "r.mcap"]);
        command.stdout(Stdio::piped()).stderr(writer);
        let mut running = Running::start_as_it_is(command);
        let log = at.path().join("r.mcap");
        running.until("samples in its log", |_, _| samples(&log).is_some_and(|(count, _)| count > 500));
        running.signal(signal);
        let ended = running.end();
        assert_eq!(ended.code, Some(code.into()), "{signal}: {ended:?}");
        assert!(ended.out.contains("interrupted, the torque off at once"), "{ended:?}");
        assert_eq!(names(at.path()), ["r.mcap", "w.toml"]);
    }
}

/// The second run would have replaced the first one's log when it began.
#[test]
fn nothing_replaces_the_log_of_a_run_under_way() {
    let at = folder(&[("w.toml", WHEEL)]);
    let mut running = Running::start(program(at.path(), ["run", "w.toml", "--log", "step.mcap"]));
    let log = at.path().join("step.mcap");
    running.until("samples in its log", |_, _| samples(&log).is_some_and(|(count, _)| count > 100));
    for second in [
        &["run", "w.toml", "--duration", "0.1s", "--log", "step.mcap"][..],
        &["run", "w.toml", "--duration", "0.1s", "--log", "./step.mcap"],
        &["sim", "w.toml", "--format", "mcap", "--out", "."],
    ] {
        hapt(at.path(), second).refused(3, &["step.mcap", "another run is writing its log there"]);
    }
    assert_eq!(names(at.path()), ["step.mcap", "w.toml"]);
    let before = samples(&log).unwrap().0;
    running.until("more samples in it", |_, _| samples(&log).is_some_and(|(count, _)| count > before + 100));
    running.signal(SIGNALS[0].0);
    running.end();
    assert!(samples(&log).is_some_and(|(_, whole)| whole));
    // It is over, and the name is free again.
    hapt(at.path(), ["run", "w.toml", "--duration", "0.1s", "--log", "step.mcap"]).done();
}

/// If several runs start at once, one gets the name, and the others are refused before they have a torque.
#[test]
fn of_runs_that_start_at_once_with_one_log_one_has_it() {
    let at = folder(&[("w.toml", WHEEL)]);
    let run = || Running::start(program(at.path(), ["run", "w.toml", "--duration", "2s", "--log", "r.mcap"]));
    let ended: Vec<_> = (0..4).map(|_| run()).collect::<Vec<_>>().into_iter().map(Running::end).collect();
    let done = ended.iter().filter(|ended| ended.code == Some(0)).count();
    let refused = |ended: &&crate::common::Ended| {
        ended.code == Some(3) && ended.err.contains("another run is writing its log there") && ended.out.is_empty()
    };
    assert_eq!((done, ended.iter().filter(refused).count()), (1, 3), "{ended:?}");
    assert!(samples(&at.path().join("r.mcap")).is_some_and(|(count, whole)| count > 1500 && whole));
}

/// A file that is read may be a FIFO, or what a shell makes of `<(...)`.
#[test]
fn a_fifo_that_nobody_writes_is_refused_and_one_with_a_writer_is_read() {
    let network = "[stations.left]\nworld = \"w.toml\"\n[stations.right]\nworld = \"w.toml\"\n\
                   [[links]]\nkind = \"spring\"\nbetween = [\"left\", \"right\"]\nstiffness = 0.01\nage_max = \"40 ms\"\n";
    let at = folder(&[("w.toml", WHEEL), ("pair.toml", network), ("key", "0123456789abcdef0123456789abcdef")]);
    let fifo = at.path().join("f");
    assert!(Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    let station = |key| {
        let ends = ["--listen", "127.0.0.1:0", "--peer", "right=127.0.0.1:9"];
        [&["run", "pair.toml", "--station", "left", "--duration", "0.1s"][..], &ends, &["--key", key]].concat()
    };
    for args in [
        &["check", "f"][..],
        &["sim", "f", "--out", "runs"],
        &station("f"),
        &["log", "replay", "f"],
        &["plot", "f", "--out", "f.svg"],
        &["run", "w.toml", "--device", "replay:f"],
        &["identify", "f"],
    ] {
        hapt(at.path(), args).refused(2, &["f: it is a FIFO without a writer"]);
    }
    assert_eq!(names(at.path()), ["f", "key", "pair.toml", "w.toml"]);
    let shell = |line: &str| {
        let mut command = Command::new("bash");
        command.args(["-c", line]).current_dir(at.path()).env("HAPT", binary());
        let ended = command.output().unwrap();
        (ended.status.code(), String::from_utf8_lossy(&ended.stderr).into_owned())
    };
    for line in [
        "\"$HAPT\" check <(cat w.toml)",
        // Slow, in pieces, and longer than a pipe holds.
        "\"$HAPT\" check <(sleep 0.3; head -c 30 w.toml; sleep 0.3; tail -c +31 w.toml; head -c 200000 /dev/zero | tr '\\0' '\\n')",
        "{ sleep 0.5; cat w.toml; } > f & \"$HAPT\" check f",
    ] {
        assert_eq!(shell(line).0, Some(0), "{line}: {:?}", shell(line));
    }
    let station = station("\"$KEYS\"").join(" ").replace("\"$KEYS\"", "<(cat key)");
    let (code, printed) = shell(&format!("\"$HAPT\" {station}"));
    assert_eq!(code, Some(0), "{printed}");
}

/// Both pipes are full, so that the command cannot print anything.
#[test]
fn a_run_whose_results_nobody_reads_has_no_torque_on_and_obeys_a_signal() {
    let at = folder(&[("w.toml", WHEEL)]);
    let (_reader, writer) = full();
    let mut command = program(at.path(), ["run", "w.toml", "--duration", "0.2s", "--log", "r.mcap"]);
    command.stdout(writer.try_clone().unwrap()).stderr(writer);
    let mut running = Running::start_as_it_is(command);
    let log = at.path().join("r.mcap");
    running.until("the loop's end", |_, _| samples(&log).is_some_and(|(_, whole)| whole));
    running.signal("HUP");
    assert_eq!(running.end().code, Some(129));
}

#[test]
fn a_page_whose_link_nobody_reads_obeys_a_signal() {
    let at = folder(&[("w.toml", WHEEL)]);
    let (_reader, writer) = full();
    let mut command = program(at.path(), ["live", "w.toml", "--port", "0", "--log-dir", "logs/of/today"]);
    command.stdout(writer.try_clone().unwrap()).stderr(writer);
    let mut running = Running::start_as_it_is(command);
    // Made at the start, not at the first recording.
    running.until("its folder", |_, _| at.path().join("logs/of/today").is_dir());
    thread::sleep(Duration::from_millis(300));
    running.signal("INT");
    assert_eq!(running.end().code, Some(130));
}

#[test]
fn every_command_under_way_ends_at_a_closed_terminal_and_leaves_no_unfinished_file() {
    let endless = ["--set", "loop.period=1 us", "--set", "scenarios.step.duration=9999 s"];
    let sim: Vec<&str> = ["sim", "w.toml", "--out", "out"].into_iter().chain(endless).collect();
    let report: Vec<&str> = ["report", "w.toml", "--out", "out"].into_iter().chain(endless).collect();
    for (i, args) in [
        &sim[..],
        &report,
        &["run", "w.toml"],
        &["latency", "w.toml", "--duration", "99s"],
        &["identify", "sim", "--world", "w.toml", "--duration", "50s", "--log", "i.mcap"],
        &["live", "w.toml", "--port", "0"],
        &["simulate-drive", "moteus", "--pty"],
        &[
            "sweep",
            "w.toml",
            "--vary",
            "device.damping=0..1:900000000",
            "--measure",
            "held_growth_per_s",
            "--out",
            "s.csv",
        ],
    ]
    .into_iter()
    .enumerate()
    {
        let (signal, code) = SIGNALS[2 + i % 2];
        let at = folder(&[("w.toml", WHEEL)]);
        let running = Running::start(program(at.path(), args));
        thread::sleep(Duration::from_millis(500));
        running.signal(signal);
        let ended = running.end();
        assert_eq!(ended.code, Some(code.into()), "{args:?} {signal}: {ended:?}");
        let mut found = names(at.path());
        if at.path().join("out").is_dir() {
            found.extend(names(&at.path().join("out")));
        }
        // A sweep's rows are kept on purpose: --resume continues after them.
        let partial = |name: &String| name.ends_with(".partial") && !name.starts_with("s.csv.");
        assert!(!found.iter().any(partial), "{args:?}: {found:?}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_run_that_is_to_outlive_its_terminal_does() {
    let at = folder(&[("w.toml", WHEEL)]);
    let mut shell = Command::new("sh");
    shell.args(["-c", "trap '' HUP; exec \"$0\" run w.toml --duration 1s"]).arg(binary()).current_dir(at.path());
    let mut running = Running::start(shell);
    running.until("it runs", |_, err| err.contains("at full torque"));
    running.signal("HUP");
    running.end().done();
}

#[test]
fn a_fifo_and_a_device_are_written_through_and_stay_what_they_are() {
    let at = folder(&[("w.toml", WHEEL)]);
    hapt(at.path(), ["sim", "w.toml", "--out", "."]).done();
    let fifo = at.path().join("f.svg");
    assert!(Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    let is_fifo = || fs::symlink_metadata(&fifo).unwrap().file_type().is_fifo();
    let reads = fifo.clone();
    let reader = thread::spawn(move || fs::read_to_string(reads).unwrap());
    hapt(at.path(), ["plot", "step.csv", "--out", "f.svg"]).done();
    assert!(reader.join().unwrap().starts_with("<svg") && is_fifo());
    // Without a reader, a plain message and no endless wait.
    for args in [
        &["plot", "step.csv", "--out", "f.svg"][..],
        &["impedance", "w.toml", "--plot", "f.svg"],
        &["run", "w.toml", "--duration", "0.1s", "--log", "f"],
    ] {
        fs::rename(&fifo, at.path().join(args[args.len() - 1])).unwrap();
        hapt(at.path(), args).refused(3, &["it is a FIFO without a reader"]);
        fs::rename(at.path().join(args[args.len() - 1]), &fifo).unwrap();
        assert!(is_fifo());
    }
    fs::rename(&fifo, at.path().join("f.csv")).unwrap();
    let sweep = ["sweep", "w.toml", "--vary", "device.damping=0..1:3", "--measure", "certified", "--out", "f.csv"];
    hapt(at.path(), sweep).refused(2, &["f.csv: it is a device or a FIFO; expected a file"]);
    assert!(fs::metadata(at.path().join("f.csv")).unwrap().file_type().is_fifo());

    std::os::unix::fs::symlink("/dev/null", at.path().join("null.svg")).unwrap();
    std::os::unix::fs::symlink("/dev/full", at.path().join("full.svg")).unwrap();
    hapt(at.path(), ["plot", "step.csv", "--out", "null.svg"]).done();
    #[cfg(target_os = "linux")]
    hapt(at.path(), ["plot", "step.csv", "--out", "full.svg"]).refused(3, &["cannot write full.svg"]);
    for link in ["null.svg", "full.svg"] {
        assert!(fs::symlink_metadata(at.path().join(link)).unwrap().is_symlink());
    }
    // Results among results.
    let ended = hapt(at.path(), ["plot", "step.csv", "--out", "/dev/stdout"]).done();
    assert!(ended.out.starts_with("<svg") && ended.out.ends_with("</svg>\n"), "{ended:?}");
}

#[test]
fn a_link_is_followed_to_its_file_which_appears_whole() {
    let at = folder(&[("w.toml", WHEEL), ("there.csv", "old")]);
    fs::create_dir(at.path().join("far")).unwrap();
    for (link, to) in [("a.csv", "there.csv"), ("b.csv", "far/new.csv"), ("c.csv", "b.csv")] {
        std::os::unix::fs::symlink(to, at.path().join(link)).unwrap();
        hapt(at.path(), ["impedance", "w.toml", "--points", "3", "--out", link]).done();
        assert!(fs::symlink_metadata(at.path().join(link)).unwrap().is_symlink());
        assert!(fs::read_to_string(at.path().join(to)).unwrap().starts_with("frequency_hz,"));
    }
    std::os::unix::fs::symlink("d.csv", at.path().join("d.csv")).unwrap();
    hapt(at.path(), ["impedance", "w.toml", "--out", "d.csv"]).refused(3, &["cannot write d.csv"]);
}

#[test]
fn a_run_that_is_refused_leaves_an_older_log_as_it_was() {
    let at = folder(&[("w.toml", WHEEL), ("old.mcap", "old"), ("bare.toml", &WHEEL.replace("limit =", "# "))]);
    let device = "moteus:/dev/no-such-port";
    let uncertified = ["run", "w.toml", "--device", device, "--log", "old.mcap"];
    let missing = ["run", "w.toml", "--device", device, "--uncertified", "--log", "old.mcap"];
    let identify = ["identify", device, "--world", "w.toml", "--yes", "--log", "old.mcap"];
    let replay = ["run", "w.toml", "--device", "replay:no-such.csv", "--log", "old.mcap"];
    let board = ["run", "w.toml", "--uncertified", "--device", "hapt:/dev/no-such-port", "--log", "old.mcap"];
    for args in [&uncertified[..], &missing, &identify, &replay, &board] {
        let ended = hapt(at.path(), args);
        assert!([Some(2), Some(3)].contains(&ended.code), "{args:?}: {ended:?}");
        assert_eq!(fs::read_to_string(at.path().join("old.mcap")).unwrap(), "old", "{args:?}");
        assert_eq!(names(at.path()), ["bare.toml", "old.mcap", "w.toml"], "{args:?}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_recording_without_an_end_is_refused() {
    let at = folder(&[("w.toml", WHEEL)]);
    // Whatever is read takes less than this of memory, in KiB.
    let limited = |device: &str| {
        let mut shell = Command::new("sh");
        shell.args(["-c", "ulimit -v 3000000; exec \"$0\" run w.toml --duration 0.1s --device \"$1\""]);
        Running::start({
            shell.arg(binary()).arg(device).current_dir(at.path());
            shell
        })
        .end()
    };
    limited("replay:/dev/zero").refused(2, &["/dev/zero, line 1: the line does not end within 1 MiB"]);
    let mut endless = Command::new("sh");
    endless.args(["-c", "(echo puck_rad,puck_rad_per_s; yes 0,0) | exec \"$0\" run w.toml --device replay:/dev/stdin"]);
    endless.arg(binary()).current_dir(at.path());
    Running::start(endless).end().refused(2, &["it has more than", "expected a shorter recording"]);
    std::os::unix::fs::symlink("/dev/zero", at.path().join("hapt.schema.json")).unwrap();
    hapt(at.path(), ["init"]).refused(2, &["is there already"]);
}
