//! The hand on the puck, and its control.

use serde_json::json;

use crate::common::{Frame, Page, WORLD, live};

/// The hand's target in these tests, in rad, and the position beyond which the puck counts as held.
const TARGET_RAD: f64 = 0.5;
const HELD_RAD: f32 = 0.3;

fn puck(frame: &Frame) -> f32 {
    frame.columns[0][0]
}

/// Sends the grip until the puck is held.
fn grab(page: &mut Page) {
    loop {
        page.say(json!({ "type": "hand", "grip": true, "position": TARGET_RAD }));
        if puck(&page.frame()) > HELD_RAD {
            return;
        }
    }
}

#[test]
fn a_hand_turns_the_puck_and_a_released_puck_swings_back() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    grab(&mut page);
    page.say(json!({ "type": "hand", "grip": false }));
    page.frame_until(|frame| puck(frame) < 0.0);
}

#[test]
fn the_hand_of_a_silent_page_releases() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    grab(&mut page);
    // No messages, while the frames continue: a gripping hand would keep the puck above 0.
    page.frame_until(|frame| puck(frame) < 0.0);
}

#[test]
fn the_hand_of_a_disconnected_page_releases() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    let (mut watcher, _) = Page::new(&live);
    grab(&mut page);
    drop(page);
    watcher.receive_until("control", |control| control["control"].is_null());
    watcher.frame_until(|frame| puck(frame) < 0.0);
    // The next page has control, as after a reload.
    let (_, hello) = Page::new(&live);
    assert_eq!(hello["client"], hello["control"]);
}

#[test]
fn control_is_taken_by_a_request_and_the_other_hand_releases() {
    let live = live(WORLD);
    let (mut first, one) = Page::new(&live);
    let (mut second, two) = Page::new(&live);
    assert_eq!((&one["control"], &two["control"]), (&one["client"], &one["client"]));
    second.say(json!({ "type": "hand", "grip": true, "position": 1.0 }));
    second.receive("error");
    second.say(json!({ "type": "set", "key": "loop.period", "value": "2 ms" }));
    second.receive("error");
    grab(&mut first);
    second.say(json!({ "type": "take" }));
    assert_eq!(first.receive_until("control", |c| c["control"] == two["client"])["control"], two["client"]);
    first.frame_until(|frame| puck(frame) < 0.0);
    first.say(json!({ "type": "hand", "grip": true, "position": 1.0 }));
    first.receive("error");
    second.say(json!({ "type": "give" }));
    first.receive_until("control", |control| control["control"].is_null());
    first.say(json!({ "type": "take" }));
    first.receive_until("control", |control| control["control"] == one["client"]);
}

#[test]
fn a_scenario_moves_the_hand_and_ends_on_request() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    page.say(json!({ "type": "scenario", "name": "stop" }));
    assert!(page.receive("refused")["message"].as_str().unwrap().contains("no scenario"));
    page.say(json!({ "type": "scenario", "name": "step" }));
    page.receive_until("status", |status| status["scenario"] == "step");
    // It goes to 20 degrees and is held there, while the page sends heartbeats.
    for _ in 0.. {
        page.say(json!({ "type": "alive" }));
        if puck(&page.frame()) > 0.2 {
            break;
        }
    }
    page.say(json!({ "type": "scenario", "name": null }));
    page.receive_until("status", |status| status["scenario"].is_null());
    page.frame_until(|frame| puck(frame) < 0.0);
}

/// Sends the grip at this position until the puck is there.
fn hold(page: &mut Page, there: f64) {
    loop {
        page.say(json!({ "type": "hand", "grip": true, "position": there }));
        if (f64::from(puck(&page.frame())) - there).abs() < 0.01 {
            return;
        }
    }
}

#[test]
fn a_simulated_wheel_that_is_armed_again_has_its_zero_at_its_position_without_a_torque() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    for there in [4.35, -2.0] {
        page.stay_until("status", |status| status["phase"] == "running");
        page.say(json!({ "type": "order", "order": "disarm" }));
        page.stay_until("status", |status| status["phase"] == "disarmed");
        hold(&mut page, there);
        page.say(json!({ "type": "order", "order": "arm" }));
        let mut most = 0.0_f32;
        loop {
            page.say(json!({ "type": "alive" }));
            if page.receive("status")["phase"] == "running" {
                break;
            }
        }
        for _ in 0..30 {
            let frame = page.frame();
            most = frame.columns[6].iter().fold(most, |most, output| most.max(output.abs()));
            assert!(puck(&frame).abs() < 0.1, "{}", puck(&frame));
        }
        // The motor's limit is 0.82 N m, and the spring to ground at 4.35 rad beyond it.
        assert!(most < 0.05, "thrown with {most} N m");
    }
}

#[test]
fn a_restart_resets_puck_and_world_from_any_state() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    for phase in ["running", "disarmed", "faulted"] {
        page.stay_until("status", |status| status["phase"] == "running");
        hold(&mut page, 0.4);
        match phase {
            "disarmed" => page.say(json!({ "type": "order", "order": "disarm" })),
            "faulted" => page.say(json!({ "type": "order", "order": "stop" })),
            _ => {}
        }
        page.stay_until("status", |status| status["phase"] == phase);
        page.say(json!({ "type": "restart" }));
        if phase == "running" {
            page.stay_until("status", |status| status["phase"] == "disarmed");
        }
        page.stay_until("status", |status| status["phase"] == "running");
        let frame = page.frame();
        assert_eq!((puck(&frame), frame.columns[8][0]), (0.0, 0.0), "{phase}");
    }
    // A stop meanwhile cancels the restart.
    hold(&mut page, 0.4);
    page.say(json!({ "type": "restart" }));
    page.say(json!({ "type": "order", "order": "stop" }));
    page.stay_until("status", |status| status["phase"] == "faulted");
    for _ in 0..5 {
        assert_eq!(page.receive("status")["phase"], "faulted");
    }
}
