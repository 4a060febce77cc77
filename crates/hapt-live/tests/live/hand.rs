//! The hand on the puck, and who has it.

use serde_json::json;

use crate::common::{Frame, Page, WORLD, live};

/// Where the hand means to be in these tests, in rad, and what of it is enough to see that it holds.
const THERE: f64 = 0.5;
const HELD: f32 = 0.3;

fn puck(frame: &Frame) -> f32 {
    frame.columns[0][0]
}

/// Says that the puck is held until it is seen to be.
fn grab(page: &mut Page) {
    loop {
        page.say(json!({ "type": "hand", "grip": true, "position": THERE }));
        if puck(&page.frame()) > HELD {
            return;
        }
    }
}

#[test]
fn a_hand_turns_the_puck_and_let_go_it_swings_back() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    grab(&mut page);
    page.say(json!({ "type": "hand", "grip": false }));
    page.frame_until(|frame| puck(frame) < 0.0);
}

#[test]
fn the_hand_of_a_page_that_says_nothing_lets_go() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    grab(&mut page);
    // Silence, while the frames go on: a hand that held would keep the puck above 0.
    page.frame_until(|frame| puck(frame) < 0.0);
}

#[test]
fn the_hand_of_a_page_that_has_gone_lets_go() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    let (mut watcher, _) = Page::new(&live);
    grab(&mut page);
    drop(page);
    watcher.hear_until("control", |control| control["control"].is_null());
    watcher.frame_until(|frame| puck(frame) < 0.0);
    // Who comes next has control, as after a reload.
    let (_, hello) = Page::new(&live);
    assert_eq!(hello["client"], hello["control"]);
}

#[test]
fn control_is_taken_on_purpose_and_then_the_other_hand_lets_go() {
    let live = live(WORLD);
    let (mut first, one) = Page::new(&live);
    let (mut second, two) = Page::new(&live);
    assert_eq!((&one["control"], &two["control"]), (&one["client"], &one["client"]));
    second.say(json!({ "type": "hand", "grip": true, "position": 1.0 }));
    second.hear("error");
    second.say(json!({ "type": "set", "key": "loop.period", "value": "2 ms" }));
    second.hear("error");
    grab(&mut first);
    second.say(json!({ "type": "take" }));
    assert_eq!(first.hear_until("control", |c| c["control"] == two["client"])["control"], two["client"]);
    first.frame_until(|frame| puck(frame) < 0.0);
    first.say(json!({ "type": "hand", "grip": true, "position": 1.0 }));
    first.hear("error");
    second.say(json!({ "type": "give" }));
    first.hear_until("control", |control| control["control"].is_null());
    first.say(json!({ "type": "take" }));
    first.hear_until("control", |control| control["control"] == one["client"]);
}

#[test]
fn a_scenario_leads_the_hand_and_ends_when_it_is_told() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    page.say(json!({ "type": "scenario", "name": "stop" }));
    assert!(page.hear("refused")["message"].as_str().unwrap().contains("no scenario"));
    page.say(json!({ "type": "scenario", "name": "step" }));
    page.hear_until("status", |status| status["scenario"] == "step");
    // It goes to 20 degrees and is held there, while the page says that it is there.
    for _ in 0.. {
        page.say(json!({ "type": "alive" }));
        if puck(&page.frame()) > 0.2 {
            break;
        }
    }
    page.say(json!({ "type": "scenario", "name": null }));
    page.hear_until("status", |status| status["scenario"].is_null());
    page.frame_until(|frame| puck(frame) < 0.0);
}
