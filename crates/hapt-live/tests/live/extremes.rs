//! Extreme numbers: for any settings the server keeps answering, and the loop continues.

use serde_json::json;

use crate::common::{Page, WORLD, live};

/// Numbers without a unit, in SI, as a page may send them.
const EXTREMES: [&str; 30] = [
    "1e308",
    "-1e308",
    "1e-320",
    "5e-324",
    "0",
    "-0",
    "1e-12",
    "1e-9",
    "1e12",
    "1e9",
    "9e8",
    "1e300",
    "1e-300",
    "inf",
    "nan",
    "-1",
    "1",
    "1e6",
    "1e-6",
    "1000",
    "0.001",
    "1e15",
    "1e-15",
    "4e9",
    "9007199254740993",
    "\"\"",
    "[1]",
    "{}",
    "true",
    "1e3",
];

/// xorshift: the same random numbers in every run.
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % n as u64) as usize
    }
}

/// A world with every key.
const RICH: &str = r#"
[[couplings]]
kind = "wall"
between = ["puck", "ground"]
side = "above"
at = 1
stiffness = 1
damping = 0.001
[[couplings]]
kind = "detent"
between = ["puck", "ground"]
torque = 0.05
pitch = 0.2
[[couplings]]
kind = "friction"
between = ["puck", "ground"]
coulomb = 0.01
stribeck = 0.02
stribeck_velocity = 0.1
bristle_stiffness = 3
bristle_damping = 0.01
viscous = 0.01
[[couplings]]
kind = "damper"
between = ["puck", "wheel"]
damping = 0.001
[[couplings]]
kind = "friction"
between = ["puck", "ground"]
torque = 0.01
[[couplings]]
kind = "constant"
between = ["puck", "ground"]
torque = 0.01
"#;

/// The world with every key, in which every path of a number or name can be set.
fn rich() -> String {
    let (head, scenarios) = WORLD.split_once("[scenarios.step]").unwrap();
    format!("{head}{RICH}[scenarios.step]{scenarios}")
        .replace("limit =", "friction = 0.001\nencoder = 4000\nlevels = 2048\nlimit =")
        .replace("period =", "delay = 0.001\nperiod =")
}

#[test]
fn random_keys_with_extreme_values_never_end_the_server() {
    let live = live(&rich());
    let (mut page, _) = Page::new(&live);
    let world = page.receive("world");
    let keys: Vec<String> =
        world["keys"].as_array().unwrap().iter().map(|key| key["path"].as_str().unwrap().to_string()).collect();
    let choices = |world: &serde_json::Value, path: &str| -> Vec<String> {
        let key = world["keys"].as_array().unwrap().iter().find(|key| key["path"] == path).unwrap();
        key["choices"].as_array().unwrap().iter().map(|choice| choice.as_str().unwrap().to_string()).collect()
    };
    let mut dice = Dice(0x9e37_79b9_7f4a_7c15);
    let (mut taken, mut refused) = (0, 0);
    for round in 0..150 {
        let mut sets = Vec::new();
        for _ in 0..=dice.below(3) {
            let key = &keys[dice.below(keys.len())];
            let names = choices(&world, key);
            let value = match names.is_empty() || dice.below(4) == 0 {
                true if dice.below(2) == 0 => EXTREMES[dice.below(EXTREMES.len())].to_string(),
                true => format!("{}e{}", 1 + dice.below(9), dice.below(24) as i32 - 14),
                false => names[dice.below(names.len())].clone(),
            };
            sets.push((key.clone(), value));
        }
        page.say(json!({ "type": "sets", "sets": sets }));
        let answer = loop {
            page.say(json!({ "type": "alive" }));
            let message = page.receive_any(&["world", "refused", "status"]);
            if message["type"] != "status" {
                break message;
            }
        };
        *if answer["type"] == "world" { &mut taken } else { &mut refused } += 1;
        // Meanwhile a hand grips and throws the puck, and faults are cleared.
        page.say(json!({ "type": "hand", "grip": round % 3 != 0, "position": 3.0 - (round % 7) as f64 }));
        for order in ["clear", "arm"] {
            page.say(json!({ "type": "order", "order": order }));
        }
        if round % 5 == 0 {
            page.say(json!({ "type": "restart" }));
        }
        if round % 8 == 7 {
            page.say(json!({ "type": "reset" }));
            page.receive_any(&["world", "refused"]);
        }
        // The loop continues.
        let time = page.frame().time;
        page.frame_until(|frame| frame.time > time);
    }
    assert!(taken > 10 && refused > 10, "{taken} taken, {refused} refused");
    // And all settings can be reset.
    page.say(json!({ "type": "reset" }));
    page.receive("world");
    page.say(json!({ "type": "restart" }));
    page.stay_until("status", |status| status["phase"] == "running");
    assert!(live.wait(std::time::Duration::ZERO).is_ok());
}

#[test]
fn a_world_that_diverges_is_a_fault_that_can_be_cleared() {
    // Forward Euler far beyond its stability: every body overflows within a second.
    let live = live(&WORLD.replace("0.02580123", "1e-9").replace("limit = \"822.25 N mm\"", ""));
    let (mut page, _) = Page::new(&live);
    page.say(json!({ "type": "set", "key": "loop.method", "value": "forward-euler" }));
    page.receive_until("world", |world| world["generation"] == 1);
    page.say(json!({ "type": "hand", "grip": true, "position": 1.0 }));
    let status = page.stay_until("status", |status| status["phase"] == "faulted");
    assert_eq!(status["reason"], "not-finite", "{status}");
    page.say(json!({ "type": "set", "key": "loop.method", "value": "zoh" }));
    page.receive_until("world", |world| world["generation"] == 2);
    page.say(json!({ "type": "restart" }));
    page.stay_until("status", |status| status["phase"] == "running");
    let frame = page.frame();
    assert!(frame.columns.iter().flatten().all(|value| value.is_finite()), "{:?}", frame.columns);
}

#[test]
fn numbers_out_of_range_are_refused_at_the_start_too() {
    for set in ["device.inertia=1e-320", "device.damping=1e308", "bodies.wheel.inertia=1e-300", "loop.delay=10 s"] {
        let source = hapt_model::Source::from_text("wheel.toml", WORLD);
        let address = "127.0.0.1:0".parse().unwrap();
        let options = hapt_live::Options {
            worlds: vec![source],
            sets: vec![set.into()],
            address,
            token: false,
            folder: ".".into(),
        };
        let error = hapt_live::Live::start(options).err().unwrap().to_string();
        assert!(error.starts_with(set.split('=').next().unwrap()), "{set}: {error}");
    }
}
