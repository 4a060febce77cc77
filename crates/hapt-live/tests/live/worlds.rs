//! A page that switches between several worlds of one device.

use hapt_core::SafetyProfile;
use hapt_host::{Machine, VirtualHand};
use hapt_live::{Error, Live, Options};
use hapt_model::Source;
use serde_json::{Value, json};

use crate::common::{Page, arm};

const DEVICE: &str = "[device]\ninertia = \"6.4e-4 kg m^2\"\ndamping = \"5e-3 N m s/rad\"\nfriction = \"2 N mm\"\n\
                      limit = \"800 N mm\"\nencoder = 16384\n";

/// A world of one coupling between puck and ground. A busy computer may send heartbeats late.
fn world(name: &str, device: &str, law: &str) -> Source {
    let text = format!(
        "title = \"The {name}\"\n[loop]\nperiod = \"2 ms\"\nestimator = \"difference\"\n{device}[safety]\nstall = \"0 s\"\nlink = \"20 s\"\n\
         [[couplings]]\nbetween = [\"puck\", \"ground\"]\n{law}\n"
    );
    Source::from_text(format!("knobs/{name}.toml"), text)
}

/// Four worlds, the last of which no motor takes: 10 N m/rad need twice the device's damping.
fn worlds() -> Vec<Source> {
    vec![
        world("spring", DEVICE, "kind = \"spring\"\nstiffness = 0.5"),
        world("detent", DEVICE, "kind = \"detent\"\ntorque = 0.1\npitch = \"30 deg\""),
        world("shifted", DEVICE, "kind = \"detent\"\ntorque = 0.1\npitch = \"30 deg\"\nphase = \"10 deg\""),
        world("wall", DEVICE, "kind = \"wall\"\nside = \"above\"\nat = \"90 deg\"\nstiffness = 10"),
    ]
}

fn options(worlds: Vec<Source>) -> Options {
    Options { worlds, sets: Vec::new(), address: "127.0.0.1:0".parse().unwrap(), token: false, folder: ".".into() }
}

/// The worlds on a device with the supervisor's profile of a real one; its hand is the test's.
fn on_a_motor(worlds: Vec<Source>, profile: SafetyProfile) -> Result<(Live, VirtualHand), Error> {
    let mut hand = None;
    let live = Live::start_on(options(worlds), |world| {
        let machine = Machine::simulated(world);
        hand = Some(VirtualHand::new(world, machine.hands));
        Ok::<_, Error>(Machine { name: "motor".into(), hands: None, profile, ..machine })
    })?;
    Ok((live, hand.unwrap()))
}

/// Enters a world; the answer.
fn enter(page: &mut Page, world: usize) -> Value {
    page.say(json!({ "type": "enter", "world": world }));
    page.receive_any(&["refused", "world"])
}

#[test]
fn all_worlds_are_listed_and_each_is_entered_as_its_file_has_it() {
    let live = Live::start(options(worlds())).unwrap();
    let (mut page, _) = Page::new(&live);
    let first = page.receive("world");
    let names: Vec<&str> =
        first["worlds"].as_array().unwrap().iter().map(|world| world["name"].as_str().unwrap()).collect();
    assert_eq!(
        (names, &first["place"], &first["title"]),
        (vec!["spring", "detent", "shifted", "wall"], &json!(0), &json!("The spring"))
    );
    page.say(json!({ "type": "set", "key": "couplings.0.stiffness", "value": "1" }));
    assert_eq!(page.receive("world")["changes"], json!([["couplings.0.stiffness", "1"]]));
    for (generation, place) in [(2, 3), (3, 1), (4, 0)] {
        let world = enter(&mut page, place);
        assert_eq!((&world["place"], &world["generation"]), (&json!(place), &json!(generation)));
        assert_eq!((&world["title"], &world["changes"]), (&first["worlds"][place]["title"], &json!([])));
        // The certificate is of this world.
        let verdict = page.stay_until("verdict", |verdict| verdict["generation"] == generation);
        assert_eq!(verdict["certified"], place != 3, "{verdict}");
    }
    assert!(enter(&mut page, 4)["message"].as_str().unwrap().contains("there are 4"));
}

#[test]
fn on_a_motor_a_knob_enters_at_rest_wherever_it_stands_and_an_uncertified_world_is_refused() {
    let (live, mut hand) = on_a_motor(worlds(), SafetyProfile::Certified).unwrap();
    let (mut page, _) = Page::new(&live);
    arm(&mut page);
    let degree = std::f32::consts::PI / 180.0;
    for (place, turn, rest) in [(1, 0.3, 0.0), (2, -0.4, 10.0), (1, 0.2, 0.0), (0, 0.7, 0.0), (2, 0.5, 10.0)] {
        // On a busy computer the hand releases before the world arrives, and the knob turns.
        let mut places = Vec::new();
        while places.len() < 20 {
            hand.move_to(Some(turn));
            let still =
                |[last, low, high]: [f32; 3]| (f64::from(last) - turn).abs() < 0.2 * turn.abs() && high - low < 1e-3;
            while !still(page.frame().columns[2]) {
                hand.send();
                page.say(json!({ "type": "alive" }));
            }
            page.say(json!({ "type": "enter", "world": place }));
            let world = page.stay_until("world", |world| world["place"] == place);
            let generation = world["generation"].as_u64().unwrap() as u32;
            let mut frame = page.frame();
            while frame.generation != generation {
                page.say(json!({ "type": "alive" }));
                frame = page.frame();
            }
            // The hand does not move: its displacement by the last world's torque is a small part of a pitch.
            let at = frame.columns[2][0] / degree;
            places.push(at);
            if (at - rest).abs() < 7.0 {
                break;
            }
        }
        assert!(places.len() < 20, "world {place} begins at {places:?} degrees, not {rest}");
        let status = page.stay_until("status", |_| true);
        assert_eq!(status["phase"], "running", "{status}");
    }
    page.say(json!({ "type": "enter", "world": 3 }));
    assert!(page.stay_until("refused", |_| true)["message"].as_str().unwrap().contains("would not be certified"));

    let (live, _hands) = on_a_motor(worlds(), SafetyProfile::Uncertified).unwrap();
    let (mut page, _) = Page::new(&live);
    page.receive("world");
    assert_eq!(enter(&mut page, 3)["place"], 3);
}

#[test]
fn worlds_of_another_device_or_of_other_times_do_not_start() {
    let other = |device: String| {
        let odd = world("odd", &device, "kind = \"spring\"\nstiffness = 0.5");
        let [first, ..] = &worlds()[..] else { unreachable!() };
        Live::start(options(vec![first.clone(), odd])).map(drop).unwrap_err().to_string()
    };
    let same = DEVICE.to_string();
    for (device, what) in [
        (same.replace("800", "801"), "[device]"),
        (same.replace("16384", "4096"), "[device]"),
        (same.replace("5e-3", "6e-3"), "[device]"),
        (format!("delay = \"1 ms\"\n{same}"), "loop.delay"),
        (format!("interval_max = \"3 ms\"\n{same}"), "loop.interval_max"),
    ] {
        let message = other(device);
        assert!(message.contains("odd.toml") && message.contains("spring.toml") && message.contains(what), "{message}");
    }
    // A world that a motor does not take is named before anything runs.
    let exact = Source::from_text("exact.toml", worlds()[1].text.replace("\"difference\"", "\"exact\""));
    let message =
        on_a_motor(vec![worlds()[0].clone(), exact], SafetyProfile::Certified).map(drop).unwrap_err().to_string();
    assert!(message.contains("exact.toml: loop.estimator"), "{message}");
}
