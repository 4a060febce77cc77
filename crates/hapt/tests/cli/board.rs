//! `hapt flash` and `hapt run` with a board at a pseudoterminal: the firmware's own station in real time on the exact device.

use hapt_link::simulate::Simulated;
use hapt_model::{Source, World};
use hapt_station::Board;

use crate::common::{Running, Table, WHEEL, folder, hapt, program};

const BOARD: Board = Board { name: "table", firmware: "1.2.3", fed: false, periods: [5e-5, 1e-2] };

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

fn plugged(board: Board) -> (Simulated, String) {
    let simulated = Simulated::start(board, world(KNOB).rig()).unwrap();
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
    assert_eq!(board.most(), 0.0);

    let args = ["run", "w.toml", "--device", &spec, "--duration", "0.3 s", "--log", "run.mcap"];
    let ended = hapt(at.path(), args).done();
    assert!(ended.out.starts_with("knob on the board table, 1 ms a sample\n"), "{ended:?}");
    assert!(ended.out.contains("at full torque; ended in order"), "{ended:?}");
    assert!(ended.err.contains("at full torque; Ctrl-C takes it off"), "{ended:?}");
    assert!(board.most() > 0.01, "{}", board.most());
    assert_eq!(board.torque(), 0.0);
    // The log shows the same: the motor's 20 N mm, pushing the puck.
    hapt(at.path(), ["convert", "run.mcap", "-o", "run.csv"]).done();
    let table = Table::read(&at.path().join("run.csv"));
    let largest = table.column("applied_Nm").iter().fold(0.0_f64, |most, torque| most.max(torque.abs()));
    assert!((largest - f64::from(board.most())).abs() < 2e-3, "{largest} and {}", board.most());
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
        // The next run clears what the interruption has left, and says so.
        let ended = hapt(at.path(), ["run", "w.toml", "--device", &spec, "--duration", "10 ms"]).done();
        assert!(ended.err.contains("cleared: Somebody pressed stop."), "{ended:?}");
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
    // What was logged up to then is whole.
    hapt(at.path(), ["convert", "run.mcap", "-o", "run.csv"]).done();
}

#[test]
fn a_board_refuses_what_does_not_fit_and_the_host_says_so_first_where_it_can() {
    let at = folder(&[("w.toml", KNOB)]);
    let (_board, spec) = plugged(BOARD);
    let run = |args: &[&str]| hapt(at.path(), ["flash", "w.toml", "--device", &spec].iter().chain(args));
    run(&["--set", "loop.period=20ms", "--set", "device.damping=1"])
        .refused(2, &["the board will not take the world", "loop.period"]);
    run(&["--set", "loop.estimator=foaw", "--set", "loop.window=100", "--uncertified"])
        .refused(2, &["on a board: a FOAW window of 100 samples, where this loop remembers 16"]);
    run(&["--set", "device.damping=0"]).refused(2, &["not certified", "--uncertified"]);

    let (_fed, spec) = plugged(Board { fed: true, ..BOARD });
    hapt(at.path(), ["run", "w.toml", "--device", &spec]).refused(2, &["has no encoder and no motor"]);
}

#[test]
fn a_board_that_is_not_there_is_a_device_that_failed() {
    let at = folder(&[("w.toml", WHEEL)]);
    let run = |device: &str| hapt(at.path(), ["run", "w.toml", "--uncertified", "--device", device]);
    run("hapt:/dev/no-such-port").refused(3, &["cannot open /dev/no-such-port", "No such file"]);
    run("hapt:w.toml").refused(3, &["cannot open w.toml", "no serial port"]);
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
        running.until("the page's address", |out, _| out.starts_with("http://127.0.0.1:") && out.ends_with("/\n"));
        running.signal(signal);
        assert_eq!(running.end().code, Some(code));
    }
    // The world is there, and nobody has armed it.
    hapt(at.path(), ["flash", "w.toml", "--device", &spec]).done();
    assert_eq!(board.most(), 0.0);

    live(&["--set", "device.damping=0"]).end().refused(2, &["not certified", "--uncertified"]);
    live(&["--set", "loop.period=20ms", "--set", "device.damping=1"])
        .end()
        .refused(2, &["the board will not take the world", "loop.period"]);
    let gone = ["live", "w.toml", "--port", "0", "--device", "hapt:/dev/no-such-port"];
    hapt(at.path(), gone).refused(3, &["cannot open /dev/no-such-port"]);
    let (_fed, spec) = plugged(Board { fed: true, ..BOARD });
    hapt(at.path(), ["live", "w.toml", "--port", "0", "--device", &spec]).refused(2, &["has no encoder and no motor"]);
}
