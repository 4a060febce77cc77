//! `hapt flash` and `hapt run` with a board at a pseudoterminal: the firmware's own station in real time on the exact device.

use hapt_host::board::simulate::SimulatedBoard;
use hapt_model::{Source, World};
use hapt_wire::device::Board;
use hapt_wire::{Command, DeviceMessage, Hello, HostMessage};

use crate::common::{Running, Table, WHEEL, folder, hapt, program};

const BOARD: Board = Board { name: "table", firmware: "1.2.3", externally_clocked: false, periods: [5e-5, 1e-2] };

/// A spring to ground that is certified on its device, and a wheel behind it.
const KNOB: &str = r#"
title = "knob"
[loop]
period = "1 ms"
[device]
inertia = "6.4e-4 kg m^2"
damping = "5e-3 N m s/rad"
limit = "822.25 N mm"
encoder = 4000
[safety]
stuck = 0
link = "2 s"
[bodies.wheel]
inertia = "0.0258 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "1.02 N m/rad"
[[couplings]]
kind = "constant"
between = ["puck", "ground"]
torque = "20 N mm"
"#;

fn world(text: &str) -> World {
    World::read(&Source::from_text("w.toml", text), &[]).unwrap()
}

fn plugged(board: Board) -> (SimulatedBoard, String) {
    let simulated = SimulatedBoard::start(board, world(KNOB).device_spec()).unwrap();
    let spec = format!("hapt:{}", simulated.path().display());
    (simulated, spec)
}

#[test]
fn a_world_is_sent_to_the_board_once_and_runs_there() {
    let at = folder(&[("w.toml", KNOB)]);
    let (board, spec) = plugged(BOARD);
    let ended = hapt(at.path(), ["flash", "w.toml", "--device", &spec]).done();
    assert!(ended.out.starts_with("knob\nboard        table, firmware 1.2.3\nworld        "), "{ended:?}");
    assert!(ended.out.ends_with(": sent and verified\n"), "{ended:?}");
    let ended = hapt(at.path(), ["flash", "w.toml", "--device", &spec]).done();
    assert!(ended.out.ends_with(": was there already\n"), "{ended:?}");
    assert_eq!(board.peak_torque(), 0.0);

    let args = ["run", "w.toml", "--device", &spec, "--duration", "0.3 s", "--log", "run.mcap"];
    let ended = hapt(at.path(), args).done();
    assert!(ended.out.starts_with("knob on the board table, 1 ms a sample\n"), "{ended:?}");
    assert!(ended.out.contains("at full torque; ended in order"), "{ended:?}");
    assert!(ended.err.contains("at full torque; Ctrl-C takes it off"), "{ended:?}");
    assert!(board.peak_torque() > 0.01, "{}", board.peak_torque());
    assert_eq!(board.torque(), 0.0);
    // The log shows the same: the motor's 20 N mm, pushing the puck.
    hapt(at.path(), ["log", "convert", "run.mcap", "-o", "run.csv"]).done();
    let table = Table::read(&at.path().join("run.csv"));
    let largest = table.column("applied_Nm").iter().fold(0.0_f64, |most, torque| most.max(torque.abs()));
    assert!((largest - f64::from(board.peak_torque())).abs() < 2e-3, "{largest} and {}", board.peak_torque());
    // The board's f32 on this machine: the same bits.
    let ended = hapt(at.path(), ["log", "replay", "run.mcap"]).done();
    assert!(ended.out.contains("same       all torques of "), "{ended:?}");
    assert!(table.column("request").contains(&1.0), "it was armed");
}

#[test]
fn a_boards_log_with_samples_left_out_is_not_replayed_and_says_what_would_be_right() {
    let at = folder(&[("w.toml", KNOB)]);
    let (_board, spec) = plugged(BOARD);
    // The samples that a slow line carries.
    let slow = format!("{spec}@9600");
    hapt(at.path(), ["run", "w.toml", "--device", &slow, "--duration", "0.3 s", "--log", "run.mcap"]).done();
    hapt(at.path(), ["log", "replay", "run.mcap"]).refused(2, &["only where every sample is in it", "hapt:PATH@BAUD"]);
}

/// A port with a peer: each received frame is passed to `answer`, and its result is sent back; with `None` the port is closed.
fn peer(
    mut answer: impl FnMut(&HostMessage<'_>) -> Option<DeviceMessage<'static>> + Send + 'static,
) -> (std::thread::JoinHandle<()>, String) {
    let (mut line, path) = hapt_host::board::pty().unwrap();
    let thread = std::thread::spawn(move || {
        let mut reader = hapt_wire::Reader::<512>::new();
        let mut bytes = [0; 512];
        let until = || std::time::Instant::now() + std::time::Duration::from_secs(60);
        while let Ok(count @ 1..) = line.read(&mut bytes, until()) {
            for byte in &bytes[..count] {
                let Some(message) = reader.push::<HostMessage<'_>>(*byte) else { continue };
                let Some(says) = answer(&message) else { return };
                line.write(hapt_wire::frame(&says, &mut [0; 512]).unwrap(), until()).unwrap();
            }
        }
    });
    (thread, format!("hapt:{}", path.display()))
}

fn hello(protocol: u16) -> DeviceMessage<'static> {
    DeviceMessage::Hello(Hello {
        protocol,
        firmware: "9",
        board: "other",
        core: hapt_core::SOURCE,
        world: None,
        bodies: 4,
        couplings: 8,
        window: 16,
        externally_clocked: false,
        sequence: 0,
        sample: 0,
        period: 1_000_000,
        phase: 0,
        reason: 0,
    })
}

#[test]
fn firmware_of_another_version_is_named_and_gets_no_world() {
    let at = folder(&[("w.toml", KNOB)]);
    for command in ["flash", "run"] {
        let (thread, spec) = peer(|message| {
            assert!(matches!(message.command, Command::Hello { .. }), "{message:?}");
            Some(hello(7))
        });
        hapt(at.path(), [command, "w.toml", "--device", &spec])
            .refused(3, &["has version 7 of the protocol, this hapt version 1", "of the same release"]);
        drop(thread);
    }
}

#[test]
fn a_board_that_goes_away_with_half_a_world_is_an_error_and_no_log_is_begun() {
    let at = folder(&[("w.toml", KNOB)]);
    for args in [vec!["flash"], vec!["run", "--log", "run.mcap"]] {
        let (thread, spec) = peer(|message| match message.command {
            Command::Hello { .. } => Some(hello(1)),
            Command::Begin { .. } => Some(DeviceMessage::Done { sequence: message.sequence }),
            _ => None,
        });
        let mut words = args.clone();
        words.extend(["w.toml", "--device", &spec]);
        hapt(at.path(), &words).refused(3, &["is gone: "]);
        thread.join().unwrap();
        assert!(!at.path().join("run.mcap").exists());
    }
}

#[test]
fn a_run_on_a_board_says_for_how_many_samples_it_was_inside_the_certificate() {
    let timed = KNOB.replace("period = \"1 ms\"", "period = \"1 ms\"\ninterval_max = \"1.5 ms\"");
    let at = folder(&[("w.toml", &timed), ("plain.toml", KNOB)]);
    let (_board, spec) = plugged(BOARD);
    let run = |file: &str| {
        hapt(at.path(), ["run", file, "--device", &spec, "--duration", "0.3 s", "--set", "safety.late=count"]).done()
    };
    let timed = run("w.toml");
    let line = timed.out.lines().find(|line| line.starts_with("certified ")).unwrap_or_else(|| panic!("{timed:?}"));
    let (inside, all) = line.split_once(" of ").unwrap_or_else(|| panic!("{line}"));
    let all = all.split(" samples").next().unwrap_or_default();
    // Digits are in groups of three.
    let [inside, all] = [inside, all].map(|text| text.chars().filter(char::is_ascii_digit).collect::<String>());
    let [inside, all] = [inside, all].map(|digits| digits.parse::<u64>().unwrap_or_else(|_| panic!("{line}")));
    // A busy machine is late, and the count shows it.
    assert!(inside <= all && all > 250, "{line}");
    assert!(!run("plain.toml").out.contains("certified"));
}

#[test]
fn a_run_on_a_board_that_is_interrupted_leaves_no_torque() {
    for (signal, code) in [("INT", 130), ("TERM", 143)] {
        let at = folder(&[("w.toml", KNOB)]);
        let (board, spec) = plugged(BOARD);
        let mut running = Running::start(program(at.path(), ["run", "w.toml", "--device", &spec]));
        running.until("it runs", |_, err| err.contains("at full torque"));
        assert!(board.torque() != 0.0);
        running.signal(signal);
        let ended = running.end();
        assert_eq!(ended.code, Some(code), "{ended:?}");
        assert!(ended.out.contains("interrupted, the torque off at once"), "{ended:?}");
        assert_eq!(board.torque(), 0.0);
        // The next run clears the state that the interruption left, and reports it.
        let ended = hapt(at.path(), ["run", "w.toml", "--device", &spec, "--duration", "10 ms"]).done();
        assert!(ended.err.contains("cleared: Stop was pressed."), "{ended:?}");
    }
}

#[test]
fn a_program_that_is_killed_takes_the_torque_with_it() {
    let at = folder(&[("w.toml", KNOB)]);
    let (board, spec) = plugged(BOARD);
    let mut running = Running::start(program(at.path(), ["run", "w.toml", "--device", &spec]));
    running.until("it runs", |_, err| err.contains("at full torque"));
    running.signal("KILL");
    let start = std::time::Instant::now();
    while board.torque() != 0.0 {
        assert!(start.elapsed() < std::time::Duration::from_secs(60), "it is still on");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
}

#[test]
fn a_board_that_is_pulled_out_ends_the_run_with_code_three_and_its_torque() {
    let at = folder(&[("w.toml", KNOB)]);
    let (board, spec) = plugged(BOARD);
    let mut running = Running::start(program(at.path(), ["run", "w.toml", "--device", &spec, "--log", "run.mcap"]));
    running.until("it runs", |_, err| err.contains("at full torque"));
    board.unplug();
    let ended = running.end();
    assert_eq!(ended.code, Some(3), "{ended:?}");
    assert!(ended.err.contains("is gone: "), "{ended:?}");
    let start = std::time::Instant::now();
    while board.torque() != 0.0 {
        assert!(start.elapsed() < std::time::Duration::from_secs(60), "it is still on");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    // The log up to then is complete.
    hapt(at.path(), ["log", "convert", "run.mcap", "-o", "run.csv"]).done();
}

#[test]
fn a_board_refuses_what_does_not_fit_and_the_host_says_so_first_where_it_can() {
    let at = folder(&[("w.toml", KNOB)]);
    let (_board, spec) = plugged(BOARD);
    let run = |args: &[&str]| hapt(at.path(), ["flash", "w.toml", "--device", &spec].iter().chain(args));
    run(&["--set", "loop.period=20ms", "--set", "device.damping=1"])
        .refused(2, &["the board refuses to take the world", "loop.period"]);
    run(&["--set", "loop.estimator=foaw", "--set", "loop.window=100", "--uncertified"])
        .refused(2, &["on a board: a window of 100 samples, where this loop remembers 16"]);
    run(&["--set", "device.damping=0"]).refused(2, &["not certified", "--uncertified"]);

    let (_fed, spec) = plugged(Board { externally_clocked: true, ..BOARD });
    hapt(at.path(), ["run", "w.toml", "--device", &spec]).refused(2, &["has no encoder and no motor"]);
}

#[test]
fn a_board_that_is_not_there_is_a_device_that_failed() {
    let at = folder(&[("w.toml", WHEEL)]);
    let run = |device: &str| hapt(at.path(), ["run", "w.toml", "--uncertified", "--device", device]);
    run("hapt:/dev/no-such-port").refused(3, &["cannot open /dev/no-such-port", "No such file"]);
    run("hapt:w.toml").refused(3, &["cannot open w.toml", "not a serial port"]);
}

#[test]
fn a_page_is_the_face_of_a_board_and_goes_without_a_torque() {
    let at = folder(&[("w.toml", KNOB)]);
    let (board, spec) = plugged(BOARD);
    let live = |more: &[&str]| {
        let args = ["live", "w.toml", "--port", "0", "--device", &spec];
        Running::start(program(at.path(), args.iter().chain(more)))
    };
    for (signal, code) in [("INT", 130), ("TERM", 143)] {
        let mut running = live(&[]);
        running.until("the page's address", |out, _| {
            out.starts_with("http://127.0.0.1:") && out.contains("/#") && out.ends_with('\n')
        });
        running.signal(signal);
        assert_eq!(running.end().code, Some(code));
    }
    // The world is on the board, and is not armed.
    hapt(at.path(), ["flash", "w.toml", "--device", &spec]).done();
    assert_eq!(board.peak_torque(), 0.0);

    live(&["--set", "device.damping=0"]).end().refused(2, &["not certified", "--uncertified"]);
    live(&["--set", "loop.period=20ms", "--set", "device.damping=1"])
        .end()
        .refused(2, &["the board refuses to take the world", "loop.period"]);
    let gone = ["live", "w.toml", "--port", "0", "--device", "hapt:/dev/no-such-port"];
    hapt(at.path(), gone).refused(3, &["cannot open /dev/no-such-port"]);
    let (_fed, spec) = plugged(Board { externally_clocked: true, ..BOARD });
    hapt(at.path(), ["live", "w.toml", "--port", "0", "--device", &spec]).refused(2, &["has no encoder and no motor"]);
}
