//! The page of a board: the firmware's own endpoint in real time, behind a pseudoterminal.

use std::time::{Duration, Instant};

use hapt_core::SafetyProfile;
use hapt_host::board::Link;
use hapt_host::board::simulate::SimulatedBoard;
use hapt_host::{Backend, Machine};
use hapt_live::{Error, Live, Options};
use hapt_model::{Source, World};
use hapt_wire::device::Board;
use serde_json::{Value, json};

use crate::common::{Page, arm};

const BOARD: Board = Board { name: "table", firmware: "1.2.3", externally_clocked: false, periods: [5e-5, 1e-2] };

/// A constant torque on a damped puck, and a wheel on a spring: there is a torque whenever it is armed.
const PUSH: &str = r#"title = "push"
[loop]
period = "1 ms"
estimator = "difference"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-2 N m s/rad"
limit = "822.25 N mm"
[safety]
pulse = 0
link = "2 s"
stuck = 0
energy = 1e9
[bodies.wheel]
inertia = "0.0258 kg m^2"
[[couplings]]
kind = "constant"
between = ["puck", "ground"]
torque = "50 N mm"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "0.1 N m/rad"
"#;

/// A simulated board, and a loop behind a page on it.
fn plugged(folder: &str) -> (SimulatedBoard, Live) {
    let source = Source::from_text("push.toml", PUSH);
    let board = SimulatedBoard::start(BOARD, World::read(&source, &[]).unwrap().device_spec()).unwrap();
    let options = Options {
        worlds: vec![source],
        sets: Vec::new(),
        address: "127.0.0.1:0".parse().unwrap(),
        token: false,
        folder: folder.into(),
    };
    let live = Live::start_on(options, |_| {
        let link = Box::new(Link::open(board.path())?);
        let (name, profile) = ("hapt:table".into(), SafetyProfile::Certified);
        Ok::<_, Error>(Machine {
            name,
            backend: Backend::Board { link, every: 1e-3 },
            hands: None,
            network: None,
            wheel: None,
            profile,
        })
    });
    (board, live.unwrap())
}

/// Repeats until it is true, for at most the test's timeout.
fn eventually(mut what: impl FnMut() -> bool) {
    let start = Instant::now();
    while !what() {
        assert!(start.elapsed() < Duration::from_secs(60), "waited too long");
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn set(page: &mut Page, key: &str, value: &str) {
    page.say(json!({ "type": "set", "key": key, "value": value }));
}

#[test]
fn a_board_stays_disarmed_shows_its_state_and_removes_the_torque_when_the_page_is_silent() {
    let (board, live) = plugged(".");
    let (mut page, _) = Page::new(&live);
    assert_eq!(page.receive("world")["device"], "hapt:table");
    for _ in 0..3 {
        let status = page.receive("status");
        assert_eq!(status["phase"], "disarmed", "nobody has armed it");
        // The board has its own clock: there is no timing.
        assert_eq!((&status["timing"], &status["realtime"]), (&Value::Null, &Value::Null));
    }
    assert_eq!(board.peak_torque(), 0.0);
    arm(&mut page);
    // The peak torque: later the wheel follows, which unloads the spring.
    eventually(|| board.peak_torque() > 0.03);
    assert!(board.peak_torque() < 0.07, "{}", board.peak_torque());
    // By the telemetry the puck turns by the motor's torque, and the wheel follows.
    let frame = page.frame_until(|frame| frame.columns[0][0] > 0.01 && frame.columns[8][0] > 0.0);
    let [position, velocity, output] = [0, 1, 6].map(|column| frame.columns[column][0]);
    assert!(velocity > 0.0 && output > 0.0 && frame.columns[0][1] <= position, "{position} {velocity} {output}");
    // The page sends nothing more, and the board removes the torque.
    let status = page.receive_until("status", |status| status["phase"] == "disarmed");
    assert_eq!(status["reason"], "link", "{status}");
    assert_eq!(board.torque(), 0.0);
    arm(&mut page);
    page.say(json!({ "type": "order", "order": "disarm" }));
    let status = page.stay_until("status", |status| status["phase"] == "disarmed");
    assert_eq!(status["reason"], Value::Null);
}

#[test]
fn the_end_removes_a_boards_torque_by_the_loops_handle_though_its_page_is_connected() {
    let (board, live) = plugged(".");
    let (mut page, _) = Page::new(&live);
    arm(&mut page);
    assert!(board.torque() > 0.0);
    live.handle().end();
    eventually(|| board.torque() == 0.0 || !page.send(json!({ "type": "alive" }).to_string().into()));
    assert_eq!(board.torque(), 0.0);
    assert!(live.wait(Duration::from_secs(60)).is_ok());
}

#[test]
fn a_key_that_is_set_is_certified_and_loaded_and_the_board_is_armed_again() {
    let (board, live) = plugged(".");
    let (mut page, _) = Page::new(&live);
    set(&mut page, "loop.estimator", "exact");
    assert!(page.receive("refused")["message"].as_str().unwrap().contains("no true velocity"));
    set(&mut page, "couplings.1.stiffness", "1000 N m/rad");
    assert!(page.receive("refused")["message"].as_str().unwrap().contains("would not be certified"));
    set(&mut page, "loop.period", "20 us");
    assert!(page.receive("refused")["message"].as_str().unwrap().contains("50 us to 100 ms"));

    // Disarmed, it stays so.
    set(&mut page, "couplings.0.torque", "60 N mm");
    page.frame_until(|frame| frame.generation == 1);
    assert_eq!(page.receive("status")["phase"], "disarmed");
    // Armed, it fades out, changes, and fades in; without a heartbeat meanwhile it stays disarmed. One success is enough.
    for generation in 2.. {
        assert!(generation < 50, "never armed again");
        arm(&mut page);
        let torque = 0.06 + 0.01 * f32::from(generation as u8 % 2);
        set(&mut page, "couplings.0.torque", &format!("{torque} N m"));
        loop {
            page.say(json!({ "type": "alive" }));
            if page.frame().generation == generation {
                break;
            }
        }
        let status =
            page.stay_until("status", |status| ["running", "disarmed"].contains(&status["phase"].as_str().unwrap()));
        if status["phase"] == "running" {
            // The constant torque less that of the spring as the puck turns, which grows with the time that a busy computer takes to fade it in.
            assert!(board.peak_torque() > 0.6 * torque, "{} of {torque}", board.peak_torque());
            break;
        }
    }
}

#[test]
fn a_world_that_the_board_refuses_leaves_the_running_one() {
    let (_board, live) = plugged(".");
    let (mut page, _) = Page::new(&live);
    // The board's timer goes up to 10 ms, which only the board can check.
    page.say(json!({ "type": "sets", "sets": [["loop.period", "20 ms"]] }));
    let refused = page.receive("refused");
    assert!(refused["message"].as_str().unwrap().contains("the board refuses to take the world"), "{refused}");
    // The page shows the running world again.
    let world = page.receive_until("world", |world| world["generation"] == 2);
    assert_eq!(world["period_s"], 1e-3);
    assert!(world["keys"].as_array().unwrap().iter().all(|key| key["changed"] == false));
    page.frame_until(|frame| frame.generation == 2);
    arm(&mut page);
}

#[test]
fn anybody_may_stop_a_board_and_a_fault_is_cleared_on_the_page() {
    let (board, live) = plugged(".");
    let (mut page, _) = Page::new(&live);
    arm(&mut page);
    let (mut watcher, _) = Page::new(&live);
    watcher.say(json!({ "type": "order", "order": "stop" }));
    let status = page.stay_until("status", |status| status["phase"] == "faulted");
    assert_eq!(status["reason"], "stop");
    assert_eq!(board.torque(), 0.0);
    // The refusal is the board's.
    page.say(json!({ "type": "order", "order": "arm" }));
    assert!(page.receive("error")["message"].as_str().unwrap().contains("the board refuses to arm"));
    loop {
        page.say(json!({ "type": "order", "order": "clear" }));
        if page.receive("status")["phase"] == "disarmed" {
            break;
        }
    }
    arm(&mut page);
}

#[test]
fn a_boards_telemetry_is_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let (_board, live) = plugged(folder.path().to_str().unwrap());
    let (mut page, _) = Page::new(&live);
    arm(&mut page);
    page.say(json!({ "type": "record", "on": true }));
    page.stay_until("status", |status| status["recording"]["seconds"].as_f64().is_some_and(|seconds| seconds > 0.1));
    page.say(json!({ "type": "record", "on": false }));
    page.stay_until("status", |status| status["recording"].is_null());
    drop((page, live));
    let mut log = hapt_log::Log::open(folder.path().join("live-0001.mcap")).unwrap();
    assert_eq!(log.header.device, "hapt:table");
    let (mut samples, mut most) = (0, 0.0_f64);
    while let Some(sample) = log.next().unwrap() {
        samples += 1;
        most = sample.values.iter().fold(most, |most, value| most.max(value.abs()));
    }
    assert!(samples > 50 && most > 0.02, "{samples} samples, {most} at most");
}

#[test]
fn a_disconnected_line_ends_the_loop_and_a_dropped_loop_removes_the_torque() {
    let (board, live) = plugged(".");
    let (mut page, _) = Page::new(&live);
    arm(&mut page);
    board.unplug();
    let start = Instant::now();
    let error = loop {
        assert!(start.elapsed() < Duration::from_secs(60));
        if let Err(error) = live.wait(Duration::from_millis(20)) {
            break error;
        }
    };
    assert!(error.to_string().contains("is gone"), "{error}");
    eventually(|| board.torque() == 0.0);

    let (board, live) = plugged(".");
    let (mut page, _) = Page::new(&live);
    arm(&mut page);
    drop((live, page));
    eventually(|| board.torque() == 0.0);
    let link = Link::open(board.path()).unwrap();
    assert_eq!(link.board().reason, Some(hapt_core::Reason::Stop));
}

#[test]
fn the_position_of_a_board_at_arming_is_the_worlds_zero_on_the_page_too() {
    let (_board, live) = plugged(".");
    let (mut page, _) = Page::new(&live);
    arm(&mut page);
    // It turns in one direction only.
    loop {
        page.say(json!({ "type": "alive" }));
        if page.frame().columns[0][0] > 2.0 {
            break;
        }
    }
    page.say(json!({ "type": "order", "order": "disarm" }));
    page.stay_until("status", |status| status["phase"] == "disarmed");
    arm(&mut page);
    let again = page.frame_until(|frame| frame.columns[0][1] < 1.0);
    // The earlier rotation does not load the spring: the energy is that of spring and wheel since arming.
    assert!(again.columns[7][0] < 0.5, "{} J", again.columns[7][0]);
}
