//! A loop behind a page whose device is not the page's to move.

use hapt_core::Guarding;
use hapt_live::{Error, Live, Machine, Options};
use hapt_model::Source;
use hapt_rt::Hands;
use serde_json::json;

use crate::common::{Page, WORLD, arm};

/// The world on a device that is guarded as a real one; its hand is the test's. A busy machine is late, and that is no matter here.
fn on_a_motor(guarding: Guarding) -> (Live, Hands) {
    let source = Source::from_text("wheel.toml", WORLD);
    let sets = ["loop.period=2 ms", "loop.estimator=difference", "safety.late=0 s", "device.damping=5e-3 N m s/rad"];
    let options = Options {
        source,
        sets: sets.map(String::from).into(),
        address: "127.0.0.1:0".parse().unwrap(),
        folder: ".".into(),
    };
    let mut hands = None;
    let live = Live::start_on(options, |world| {
        let machine = Machine::simulated(world);
        hands = machine.hands;
        Ok::<_, Error>(Machine { name: "motor".into(), hands: None, guarding, ..machine })
    });
    (live.unwrap(), hands.unwrap())
}

#[test]
fn a_motor_waits_to_be_armed_and_lets_go_when_the_page_is_silent() {
    let (live, _hands) = on_a_motor(Guarding::Certified);
    let (mut page, _) = Page::new(&live);
    assert_eq!(page.hear("world")["device"], "motor");
    for _ in 0..5 {
        assert_eq!(page.hear("status")["phase"], "disarmed", "nobody has armed it");
    }
    arm(&mut page);
    // The page says nothing more: asleep, closed, cut off.
    let status = page.hear_until("status", |status| status["phase"] == "disarmed");
    assert_eq!(status["reason"], "link", "{status}");
    arm(&mut page);
}

#[test]
fn a_motor_has_no_hand_for_the_page_and_no_key_goes_beyond_the_certificate() {
    let (live, _hands) = on_a_motor(Guarding::Certified);
    let (mut page, _) = Page::new(&live);
    page.say(json!({ "type": "scenario", "name": "step" }));
    assert!(page.hear("refused")["message"].as_str().unwrap().contains("no hand"));
    page.say(json!({ "type": "set", "key": "loop.method", "value": "forward-euler" }));
    assert!(page.hear("refused")["message"].as_str().unwrap().contains("would not be certified"));
    page.say(json!({ "type": "set", "key": "loop.method", "value": "trapezoidal" }));
    assert_eq!(page.hear_until("world", |world| world["generation"] != 0)["generation"], 1);
    drop((live, page));

    let (live, _hands) = on_a_motor(Guarding::Uncertified);
    let (mut page, _) = Page::new(&live);
    page.say(json!({ "type": "set", "key": "loop.method", "value": "forward-euler" }));
    assert_eq!(page.hear_until("world", |world| world["generation"] != 0)["generation"], 1);
}
