//! A loop behind a page on a motor, which no page's hand can move.

use hapt_core::SafetyProfile;
use hapt_host::Machine;
use hapt_live::{Error, Live, Options};
use hapt_model::Source;
use hapt_rt::Hands;
use serde_json::json;

use crate::common::{Frame, Page, WORLD, arm, many_bodies};

/// The world on a device with the supervisor's profile of a real one; its hand is the test's. Lateness of a busy machine is permitted here.
fn on_a_motor(profile: SafetyProfile) -> (Live, Option<Hands>) {
    on_a_motor_with(profile, WORLD, &[])
}

fn on_a_motor_with(profile: SafetyProfile, world: &str, more: &[&str]) -> (Live, Option<Hands>) {
    let source = Source::from_text("wheel.toml", world);
    let sets = ["loop.period=2 ms", "loop.estimator=difference", "safety.stall=0 s", "device.damping=5e-3 N m s/rad"];
    let sets: Vec<&str> = sets.iter().chain(more).copied().collect();
    let options = Options {
        worlds: vec![source],
        sets: sets.into_iter().map(String::from).collect(),
        address: "127.0.0.1:0".parse().unwrap(),
        token: false,
        folder: ".".into(),
    };
    let mut hands = None;
    let live = Live::start_on(options, |world| {
        let machine = Machine::simulated(world);
        hands = machine.hands;
        Ok::<_, Error>(Machine { name: "motor".into(), hands: None, profile, ..machine })
    });
    (live.unwrap(), hands)
}

#[test]
fn a_motor_stays_disarmed_until_armed_and_loses_the_torque_when_the_page_is_silent() {
    let (live, _hands) = on_a_motor(SafetyProfile::Certified);
    let (mut page, _) = Page::new(&live);
    assert_eq!(page.receive("world")["device"], "motor");
    for _ in 0..5 {
        assert_eq!(page.receive("status")["phase"], "disarmed", "not armed");
    }
    arm(&mut page);
    // The page sends nothing more: it is asleep, closed or disconnected.
    let status = page.receive_until("status", |status| status["phase"] == "disarmed");
    assert_eq!(status["reason"], "link", "{status}");
    arm(&mut page);
}

#[test]
fn a_motor_has_no_hand_for_the_page_and_no_key_goes_beyond_the_certificate() {
    let (live, _hands) = on_a_motor(SafetyProfile::Certified);
    let (mut page, _) = Page::new(&live);
    page.say(json!({ "type": "scenario", "name": "step" }));
    assert!(page.receive("refused")["message"].as_str().unwrap().contains("no hand"));
    page.say(json!({ "type": "set", "key": "loop.method", "value": "forward-euler" }));
    assert!(page.receive("refused")["message"].as_str().unwrap().contains("would not be certified"));
    page.say(json!({ "type": "set", "key": "loop.method", "value": "trapezoidal" }));
    assert_eq!(page.receive_until("world", |world| world["generation"] != 0)["generation"], 1);
    drop((live, page));

    let (live, _hands) = on_a_motor(SafetyProfile::Uncertified);
    let (mut page, _) = Page::new(&live);
    page.say(json!({ "type": "set", "key": "loop.method", "value": "forward-euler" }));
    assert_eq!(page.receive_until("world", |world| world["generation"] != 0)["generation"], 1);
}

/// Sets a key; `Err`: the refusal.
fn set(page: &mut Page, key: &str, value: &str) -> Result<(), String> {
    page.say(json!({ "type": "set", "key": key, "value": value }));
    let answer = page.receive_any(&["refused", "world"]);
    match answer["type"].as_str() {
        Some("world") => Ok(()),
        _ => Err(answer["message"].as_str().unwrap().to_string()),
    }
}

#[test]
fn the_files_device_and_safety_limit_the_settings_of_a_page() {
    for profile in [SafetyProfile::Certified, SafetyProfile::Uncertified] {
        let (live, _hands) = on_a_motor(profile);
        let (mut page, _) = Page::new(&live);
        page.receive("world");
        for (key, value) in [
            ("device.limit", "50 N m"),
            ("device.limit", "822.3 N mm"),
            ("device.limit", "1e9"),
            ("device.limit", "1 N mm"),
            ("device.damping", "100"),
            ("device.damping", "0"),
            ("device.inertia", "1 kg m^2"),
            ("device.friction", "1 N m"),
            ("device.encoder", "100000"),
            ("device.levels", "2"),
            ("device.drive.gear", "2"),
            ("device.drive.direction", "reverse"),
            ("device.drive.home", "0"),
            ("loop.delay", "1 us"),
            ("loop.estimator", "exact"),
            ("safety.torque", "50 N m"),
            ("safety.stall", "100 s"),
            ("safety.link", "0"),
            ("safety.pulse", "0"),
            ("safety.overspeed", "1e6"),
            ("safety.energy", "1e6"),
            ("safety.world_ledger", "warn"),
            ("motion", "linear"),
            ("title", "x"),
        ] {
            let refused = set(&mut page, key, value);
            assert!(refused.is_err(), "{key} = {value}");
            // Also not together with a key that may be set.
            page.say(json!({ "type": "sets", "sets": [["couplings.0.stiffness", "1 N m/rad"], [key, value]] }));
            let answer = page.receive_any(&["refused", "world"]);
            assert_eq!(answer["type"], "refused", "{key} = {value}");
        }
        // It may be lowered, and raised again up to the file's.
        for (limit, right) in [("400 N mm", true), ("822.25 N mm", true), ("200 N mm", true), ("823 N mm", false)] {
            assert_eq!(set(&mut page, "device.limit", limit).is_ok(), right, "{limit}");
        }
        page.say(json!({ "type": "reset" }));
        let world = page.receive("world");
        assert_eq!(world["limit"], 0.82225);
        for key in world["keys"].as_array().unwrap() {
            let path = key["path"].as_str().unwrap();
            let free = !path.starts_with("device.") && path != "loop.delay" || path == "device.limit";
            assert_eq!(key["fixed"], !free, "{path}");
            if path == "device.limit" {
                assert_eq!(key["max"], 0.82225);
            }
        }
    }
}

#[test]
fn the_certificate_applies_to_the_files_device() {
    let (live, _hands) = on_a_motor(SafetyProfile::Certified);
    let (mut page, _) = Page::new(&live);
    page.receive("world");
    // b = 5 mN m s/rad permits K T/2 up to 5 N m/rad in all, however they are set.
    assert!(set(&mut page, "couplings.0.stiffness", "500 N m/rad").unwrap_err().contains("would not be certified"));
    page.say(json!({ "type": "sets", "sets": [["device.damping", "100"], ["couplings.0.stiffness", "500 N m/rad"]] }));
    page.receive("refused");
    set(&mut page, "device.limit", "100 N mm").unwrap();
    set(&mut page, "loop.period", "1 ms").unwrap();
    assert!(set(&mut page, "couplings.0.stiffness", "20 N m/rad").is_err());
    // No button proposes another device. Directly after a world's message its verdict has not been sent yet.
    set(&mut page, "couplings.0.stiffness", "0.5 N m/rad").unwrap();
    let verdict = page.stay_until("verdict", |verdict| verdict["remedies"].is_array());
    for remedy in verdict["remedies"].as_array().unwrap() {
        for set in remedy["sets"].as_array().unwrap() {
            let key = set[0].as_str().unwrap();
            assert!(!key.starts_with("device.") && key != "loop.delay", "{remedy}");
        }
    }
}

#[test]
fn without_the_links_token_no_client_gets_control_of_a_motor() {
    let (live, _hands) = on_a_motor(SafetyProfile::Certified);
    let token = live.link().split_once("/#").unwrap().1.to_string();
    assert!(live.asks_for_token() && token.len() == 32);
    for hello in [json!({ "type": "hello", "v": 1 }), json!({ "type": "hello", "v": 1, "token": "0".repeat(32) })] {
        let mut stranger = Page::open(&live);
        stranger.say(hello);
        stranger.receive("error");
        assert_eq!(stranger.closed(), 1008);
    }
    let mut stranger = Page::open(&live);
    stranger.say(json!({ "type": "take" }));
    stranger.receive("error");
    stranger.say(json!({ "type": "order", "order": "arm" }));
    stranger.receive("error");
    let (mut page, hello) = Page::new(&live);
    assert_eq!(hello["control"], hello["client"]);
    assert_eq!(page.receive("status")["phase"], "disarmed");
}

/// The best of several tries, since the machine may pause.
#[test]
fn the_torque_is_off_within_the_links_time_of_the_pages_last_message() {
    let (live, _hands) = on_a_motor_with(SafetyProfile::Certified, PUSHED, &[]);
    let (mut page, _) = Page::new(&live);
    let off = |page: &mut Page| {
        arm(page);
        page.say(json!({ "type": "alive" }));
        let last = page.frame().time;
        page.say(json!({ "type": "alive" }));
        let off = page.frame_until(|frame| frame.columns[6][0] == 0.0);
        off.time - last
    };
    let best = (0..10).map(|_| off(&mut page)).fold(f64::INFINITY, f64::min);
    // And the time of two frames.
    assert!(best < 0.3 + 0.04, "off after {best} s");
    assert!(best > 0.15, "off after {best} s");
}

#[test]
fn a_page_that_follows_another_gets_no_torque() {
    let (live, _hands) = on_a_motor_with(SafetyProfile::Certified, PUSHED, &["safety.link=20 s"]);
    for change in ["reload", "give", "take"] {
        let (mut page, _) = Page::new(&live);
        page.say(json!({ "type": "take" }));
        arm(&mut page);
        let mut next = match change {
            "reload" => {
                drop(page);
                Page::new(&live).0
            }
            "give" => {
                page.say(json!({ "type": "give" }));
                Page::new(&live).0
            }
            _ => Page::new(&live).0,
        };
        next.say(json!({ "type": "take" }));
        // It sends heartbeats, and no request.
        next.stay_until("status", |status| status["phase"] == "disarmed");
        for _ in 0..5 {
            let status = next.stay_until("status", |_| true);
            assert_eq!(status["phase"], "disarmed", "{change}: {status}");
        }
        arm(&mut next);
        next.say(json!({ "type": "order", "order": "disarm" }));
        next.stay_until("status", |status| status["phase"] == "disarmed");
    }
}

#[test]
fn a_stop_waits_neither_for_a_certificate_nor_for_a_flood() {
    let world = many_bodies(24);
    // About 400 at once are taken or dropped; beyond that the socket closes, and searches the received messages for a stop.
    for (messages, is_motor) in [(60, true), (200, true), (200, false), (1000, false)] {
        let (live, _hands) = match is_motor {
            true => on_a_motor_with(SafetyProfile::Uncertified, &world, &["safety.stuck=0"]),
            false => (crate::common::live(&world), None),
        };
        let (mut watcher, _) = Page::new(&live);
        let (mut page, _) = Page::new(&live);
        page.say(json!({ "type": "take" }));
        arm(&mut page);
        for k in 0..messages {
            let message = match k % 10 {
                0 => json!({ "type": "reset" }),
                1 => json!({ "type": "order", "order": "clear" }),
                2 => json!({ "type": "order", "order": "arm" }),
                k => {
                    json!({ "type": "set", "key": format!("couplings.{k}.stiffness"), "value": format!("{k} N mm/deg") })
                }
            };
            page.send(message.to_string().into());
        }
        page.send(json!({ "type": "order", "order": "stop" }).to_string().into());
        let mut worlds = 0;
        loop {
            let message = watcher.receive_any(&["world", "status"]);
            worlds += u32::from(message["type"] == "world");
            if message["phase"] == "faulted" {
                assert_eq!(message["reason"], "stop", "{message}");
                break;
            }
        }
        assert!(worlds < 20, "{worlds} changed worlds came before the stop of {messages} messages");
        // Earlier requests do not arm it again.
        for _ in 0..5 {
            assert_eq!(watcher.receive("status")["phase"], "faulted");
        }
    }
}

/// Sets a key twice in each frame's time, until a frame satisfies the condition or the loop's time in s is over.
fn set_without_end(page: &mut Page, torque: f64, time: f64, wanted: impl Fn(&Frame) -> bool) -> bool {
    let begun = page.frame().time;
    let mut k = 0;
    loop {
        // Not more than the server accepts from one page.
        for _ in 0..2 {
            k += 1;
            let value = format!("{} N mm", torque + 1e-6 * f64::from(k % 100));
            page.say(json!({ "type": "set", "key": "couplings.0.torque", "value": value }));
        }
        let frame = page.frame();
        if wanted(&frame) || frame.time > begun + time {
            return wanted(&frame);
        }
    }
}

#[test]
fn the_motors_torque_follows_the_world_however_quickly_a_page_changes_it() {
    // Each swap fades over from the present torque: a swap at every sample would freeze the torque.
    let (live, _hands) = on_a_motor_with(
        SafetyProfile::Certified,
        PUSHED,
        &["loop.period=50 ms", "safety.link=20 s", "couplings.0.torque=5 N mm"],
    );
    let (mut page, _) = Page::new(&live);
    arm(&mut page);
    for torque in [-5.0, 5.0, -5.0] {
        let follows = |frame: &Frame| (f64::from(frame.columns[6][0]) - 1e-3 * torque).abs() < 1e-4;
        assert!(set_without_end(&mut page, torque, 3.0, follows), "{torque} N mm are not there after 3 s");
    }
    // A stop removes it at once, also with queued changes.
    let begun = page.frame().time;
    page.say(json!({ "type": "order", "order": "disarm" }));
    let off = page.frame_until(|frame| frame.columns[6][0] == 0.0).time - begun;
    assert!(off < 1.0, "off after {off} s");
}

#[test]
fn a_delay_in_samples_does_not_shrink_with_the_period() {
    let (live, _hands) = on_a_motor_with(SafetyProfile::Certified, PUSHED, &["loop.delay=1.5 samples"]);
    let (mut page, _) = Page::new(&live);
    page.receive("world");
    for period in ["0.2 ms", "1 ms", "4 ms"] {
        assert!(set(&mut page, "loop.period", period).unwrap_err().contains("in samples"), "{period}");
    }
    // Given as a time it stays.
    let (live, _hands) = on_a_motor_with(SafetyProfile::Certified, PUSHED, &["loop.delay=3 ms"]);
    let (mut page, _) = Page::new(&live);
    page.receive("world");
    set(&mut page, "loop.period", "1.9 ms").unwrap();
}

/// A motor that pushes whenever it is armed, against a damper's drag.
const PUSHED: &str = r#"title = "push"
[loop]
period = "1 ms"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-2 N m s/rad"
limit = "822.25 N mm"
[safety]
pulse = 0
stuck = 0
energy = 1e9
[[couplings]]
kind = "constant"
between = ["puck", "ground"]
torque = "50 N mm"
"#;
