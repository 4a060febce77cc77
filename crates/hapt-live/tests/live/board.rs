//! A page as the face of a board: the firmware's own station in real time, behind a pseudoterminal.

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

/// A constant torque against a damped puck, and a wheel on a spring: something is on whenever it is armed.
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

/// A board on the table, and a loop behind a page on it.
fn plugged(folder: &str) -> (SimulatedBoard, Live) {
    let source = Source::from_text("push.toml", PUSH);
    let board = SimulatedBoard::start(BOARD, World::read(&source, &[]).unwrap().device_spec()).unwrap();
    let options = Options { source, sets: Vec::new(), address: "127.0.0.1:0".parse().unwrap(), folder: folder.into() };
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

/// However slow the machine is.
fn patiently(mut what: impl FnMut() -> bool) {
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
fn a_board_waits_to_be_armed_shows_what_it_does_and_lets_go_when_the_page_is_silent() {
    let (board, live) = plugged(".");
    let (mut page, _) = Page::new(&live);
    assert_eq!(page.hear("world")["device"], "hapt:table");
    for _ in 0..3 {
        let status = page.hear("status");
        assert_eq!(status["phase"], "disarmed", "nobody has armed it");
        // Its clock is its own.
        assert_eq!((&status["timing"], &status["realtime"]), (&Value::Null, &Value::Null));
    }
    assert_eq!(board.peak_torque(), 0.0);
    arm(&mut page);
    // The largest, at first: the wheel comes after, and takes its spring's torque away.
    patiently(|| board.peak_torque() > 0.03);
    assert!(board.peak_torque() < 0.07, "{}", board.peak_torque());
    // The puck turns by the motor's torque, and the wheel after it, as the telemetry has it.
    let frame = page.frame_until(|frame| frame.columns[0][0] > 0.01 && frame.columns[8][0] > 0.0);
    let [position, velocity, output] = [0, 1, 6].map(|column| frame.columns[column][0]);
    assert!(velocity > 0.0 && output > 0.0 && frame.columns[0][1] <= position, "{position} {velocity} {output}");
    // The page says nothing more, and the board takes the torque away by itself.
    let status = page.hear_until("status", |status| status["phase"] == "disarmed");
    assert_eq!(status["reason"], "link", "{status}");
    assert_eq!(board.torque(), 0.0);
    arm(&mut page);
    page.say(json!({ "type": "order", "order": "disarm" }));
    let status = page.stay_until("status", |status| status["phase"] == "disarmed");
    assert_eq!(status["reason"], Value::Null);
}

#[test]
fn the_end_takes_a_boards_torque_by_the_loops_handle_though_its_page_is_there() {
    let (board, live) = plugged(".");
    let (mut page, _) = Page::new(&live);
    arm(&mut page);
    assert!(board.torque() > 0.0);
    live.handle().end();
    patiently(|| board.torque() == 0.0 || !page.send(json!({ "type": "alive" }).to_string().into()));
    assert_eq!(board.torque(), 0.0);
    assert!(live.wait(Duration::from_secs(60)).is_ok());
}

#[test]
fn a_key_that_is_set_is_judged_and_taken_whole_and_the_board_armed_again() {
    let (board, live) = plugged(".");
    let (mut page, _) = Page::new(&live);
    set(&mut page, "loop.estimator", "exact");
    assert!(page.hear("refused")["message"].as_str().unwrap().contains("no true velocity"));
    set(&mut page, "couplings.1.stiffness", "1000 N m/rad");
    assert!(page.hear("refused")["message"].as_str().unwrap().contains("would not be certified"));
    set(&mut page, "loop.period", "20 us");
    assert!(page.hear("refused")["message"].as_str().unwrap().contains("50 us to 100 ms"));

    // Disarmed, it stays so.
    set(&mut page, "couplings.0.torque", "60 N mm");
    page.frame_until(|frame| frame.generation == 1);
    assert_eq!(page.hear("status")["phase"], "disarmed");
    // Armed, it fades out, changes, and fades in; where the page was not heard meanwhile, it stays disarmed. Once is enough.
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
            // The constant's, less what the spring takes as the puck turns: the more, the longer a busy computer takes to fade it in.
            assert!(board.peak_torque() > 0.6 * torque, "{} of {torque}", board.peak_torque());
            break;
        }
    }
}

#[test]
fn a_world_that_the_board_does_not_take_leaves_the_one_that_runs() {
    let (_board, live) = plugged(".");
    let (mut page, _) = Page::new(&live);
    // Its timer goes up to 10 ms, and only the board knows.
    page.say(json!({ "type": "sets", "sets": [["loop.period", "20 ms"]] }));
    let refused = page.hear("refused");
    assert!(refused["message"].as_str().unwrap().contains("the board refuses to take the world"), "{refused}");
    // What is shown is again what runs.
    let world = page.hear_until("world", |world| world["generation"] == 2);
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
    // Refused by the board, in its words, and nothing else.
    page.say(json!({ "type": "order", "order": "arm" }));
    assert!(page.hear("error")["message"].as_str().unwrap().contains("the board refuses to arm"));
    loop {
        page.say(json!({ "type": "order", "order": "clear" }));
        if page.hear("status")["phase"] == "disarmed" {
            break;
        }
    }
    arm(&mut page);
}

#[test]
fn what_a_board_shows_is_recorded() {
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
fn a_plug_that_is_pulled_ends_it_and_a_loop_that_is_dropped_takes_the_torque_off() {
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
    patiently(|| board.torque() == 0.0);

    let (board, live) = plugged(".");
    let (mut page, _) = Page::new(&live);
    arm(&mut page);
    drop((live, page));
    patiently(|| board.torque() == 0.0);
    let link = Link::open(board.path()).unwrap();
    assert_eq!(link.board().reason, Some(hapt_core::Reason::Stop));
}

#[test]
fn where_a_board_is_armed_is_the_worlds_zero_on_the_page_too() {
    let (_board, live) = plugged(".");
    let (mut page, _) = Page::new(&live);
    arm(&mut page);
    // It turns one way alone.
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
    // And the spring is not wound up by all that the puck had turned before: its energy and the wheel's.
    assert!(again.columns[7][0] < 0.5, "{} J", again.columns[7][0]);
}
