//! A page runs as the simulation does, and answers as `hapt live` does.

mod network;

use std::collections::BTreeMap;
use std::time::Duration;

use hapt_host::describe;
use hapt_host::messages::{ServerMessage, WorldFile};
use hapt_host::{WorldConfig, rule};
use hapt_model::{Source, World};
use hapt_sim::{Simulation, world_energy};
use hapt_web::{Message, Page};
use serde_json::{Value, json};

const WHEEL: &str = r#"
[loop]
period = "1 ms"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
friction = "1 N mm"
limit = "822.25 N mm"
encoder = 4096
[bodies.wheel]
inertia = "0.02580123 kg m^2"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "17.8 N mm/deg"
limit = "500 N mm"
[[couplings]]
kind = "damper"
between = ["puck", "wheel"]
damping = "1e-3 N m s/rad"
[[couplings]]
kind = "wall"
between = ["wheel", "ground"]
side = "above"
at = "80 deg"
stiffness = "1 N m/rad"
damping = "1e-3 N m s/rad"
[[couplings]]
kind = "detent"
between = ["puck", "ground"]
torque = "20 N mm"
pitch = "15 deg"
[[couplings]]
kind = "friction"
between = ["wheel", "ground"]
torque = "2 N mm"
[[couplings]]
kind = "constant"
between = ["wheel", "ground"]
torque = "1 N mm"
[scenarios.step]
duration = "2 s"
hand = { kind = "step", to = "45 deg", at = "0.3 s", release = "1 s" }
"#;

/// A page whose time passes in ms.
struct Run {
    page: Page,
    ms: u64,
}

impl Run {
    fn new(sets: &[&str]) -> Run {
        let sets = sets.iter().map(|set| set.to_string()).collect();
        let file = WorldFile { name: "wheel.toml".into(), text: WHEEL.into(), files: BTreeMap::new(), sets };
        Run { page: Page::new(&json!(file).to_string()).unwrap(), ms: 0 }
    }

    fn send(&mut self, message: &Value) {
        self.page.send(&message.to_string());
    }

    /// The next ms: the columns at its last sample, if it has one.
    fn step(&mut self) -> Option<Vec<f64>> {
        self.page.poll(Duration::from_millis(self.ms));
        self.ms += 1;
        let columns = self.page.columns();
        (!columns.is_empty()).then(|| columns.iter().map(|[last, ..]| *last).collect())
    }

    /// A time in ms, each ms with its columns; a hand swings the puck about in the middle of them.
    fn swing(&mut self, length: u32) -> Vec<Option<Vec<f64>>> {
        let ms = |k: u32| {
            if (length / 4..length / 2).contains(&k) {
                self.send(&json!({ "type": "hand", "grip": true, "position": 1.5 * (f64::from(k) * 5e-3).sin() }));
            } else if k == length / 2 {
                self.send(&json!({ "type": "hand", "grip": false }));
            }
            self.step()
        };
        (0..length).map(ms).collect()
    }

    /// The messages that wait; frames are left out.
    fn received(&mut self) -> Vec<Value> {
        let messages = std::iter::from_fn(|| self.page.next_message());
        let text = |message| match message {
            Message::Text(text) => Some(serde_json::from_str(&text).unwrap()),
            Message::Frame(_) => None,
        };
        messages.filter_map(text).collect()
    }

    fn refused(&mut self) -> String {
        let received = self.received();
        let refused = received.iter().find(|message| message["type"] == "refused" || message["type"] == "error");
        refused.unwrap_or_else(|| panic!("nothing was refused: {received:?}"))["message"].as_str().unwrap().to_string()
    }
}

#[test]
fn a_scenario_in_a_page_is_the_simulations_once_it_has_faded_in() {
    // The page's torque fades in over 0.1 s, in which nothing happens here: the step comes at 0.3 s.
    let set = "couplings.5.torque=0 N m";
    let world = World::read(&Source::from_text("wheel.toml", WHEEL), &[set.to_string()]).unwrap();
    let mut run = Run::new(&[set]);
    run.send(&json!({ "type": "scenario", "name": "step" }));
    // The hand is sent at the end of the first poll: the scenario begins with the next sample.
    run.step();
    let mut simulation = Simulation::new(&world, &world.scenarios[0]).unwrap();
    let mut moved = 0.0_f64;
    while let Some(row) = simulation.next() {
        let row = row.unwrap();
        let last = run.step().unwrap();
        let energy = world_energy(&world, row.puck, &row.bodies, &[]);
        let own = [row.puck, row.puck_velocity, row.measured, row.measured_velocity, row.torque, row.command];
        assert_eq!(last[..6], own, "at {} s", row.time);
        assert_eq!(last[7..10], [energy, row.bodies[0].0, row.bodies[0].1], "at {} s", row.time);
        let torques = (0..world.couplings.len())
            .map(|i| world.spec().coupling_torque(i, (row.puck, row.puck_velocity), &row.bodies));
        assert_eq!(last[10..], Vec::from_iter(torques), "at {} s", row.time);
        moved = moved.max(row.bodies[0].0);
    }
    assert!(moved > 0.5);
    let received = run.received();
    let status = received.iter().rfind(|message| message["type"] == "status").unwrap();
    assert_eq!((&status["phase"], &status["reason"]), (&json!("running"), &Value::Null));
}

#[test]
fn every_key_is_set_or_refused_as_by_hapt_live() {
    let mut run = Run::new(&[]);
    let mut config = WorldConfig::checked(Source::from_text("wheel.toml", WHEEL), Vec::new(), rule::check).unwrap();
    let (mut tried, mut refused) = (0, 0);
    for key in config.keys().to_vec() {
        let ends = [key.min, key.max].map(|end| match key.kind {
            "whole" => format!("{}", end.round()),
            _ => format!("{} {}", end / key.factor, key.unit),
        });
        let numbers = ends.iter().filter(|_| key.kind != "choice").map(String::as_str);
        for value in numbers.chain(key.choices.iter().copied()) {
            run.received();
            run.send(&json!({ "type": "set", "key": key.path, "value": value }));
            (0..2).for_each(|_| drop(run.step()));
            tried += 1;
            match config.with(&key.path, value) {
                Ok(next) => {
                    let expected = ServerMessage::World(Box::new(describe(&next))).json();
                    let expected: Value = serde_json::from_str(&expected).unwrap();
                    assert!(run.received().contains(&expected), "{} = {value}", key.path);
                    config = next.reset().unwrap();
                    run.send(&json!({ "type": "reset" }));
                    (0..2).for_each(|_| drop(run.step()));
                }
                Err(message) => {
                    assert_eq!(run.refused(), message, "{} = {value}", key.path);
                    refused += 1;
                }
            }
        }
    }
    assert!(tried > 60 && refused < tried / 4, "{tried} tried, {refused} refused");
}

#[test]
fn what_is_changed_while_it_runs_goes_on_where_it_is_and_without_a_step_of_torque() {
    let mut run = Run::new(&[]);
    run.swing(3000);
    for (key, value) in
        [("couplings.0.stiffness", "3 N m/rad"), ("loop.method", "backward-euler"), ("loop.period", "1.3 ms")]
    {
        let before = run.step().unwrap();
        run.received();
        run.send(&json!({ "type": "set", "key": key, "value": value }));
        let after = std::iter::repeat_with(|| run.step()).flatten().next().unwrap();
        // Within one sample nothing goes far: a speed of v, and a fade of 100 samples.
        let travel = 2e-3 * (before[1].abs() + before[9].abs() + 1.0);
        assert!((after[0] - before[0]).abs() < travel && (after[8] - before[8]).abs() < travel, "{key}");
        assert!((after[6] - before[6]).abs() < 0.05, "{key}: from {} to {} N m", before[6], after[6]);
        let received = std::iter::repeat_with(|| (run.step(), run.received()).1).take(5).flatten();
        let world = received.into_iter().find(|message| message["type"] == "world").unwrap();
        let keys = world["keys"].as_array().unwrap();
        let key = keys.iter().find(|own| own["path"] == key).unwrap();
        assert!(key["written"] == value && key["changed"] == true && key["fixed"] == false, "{key}");
    }
}

#[test]
fn what_cannot_run_is_refused_in_a_sentence_and_what_ran_goes_on() {
    let (mut run, mut other) = (Run::new(&[]), Run::new(&[]));
    for (key, value, word) in [
        ("loop.period", "0 ms", "period"),
        ("loop.period", "1 us", "50 us to 100 ms"),
        // These methods do not find torques over a step, and a wall is at a body.
        ("loop.method", "tustin", "tustin"),
        ("couplings.0.stiffness", "-1 N m/rad", "stiffness"),
        ("couplings.0.stiffness", "3 bananas", "bananas"),
        ("couplings.6.stiffness", "1 N m/rad", "cannot be set"),
        ("bodies.wheel.inertia", "0 kg m^2", "inertia"),
        ("scenarios.step.duration", "1 s", "cannot be set"),
    ] {
        run.received();
        run.send(&json!({ "type": "set", "key": key, "value": value }));
        for run in [&mut run, &mut other] {
            (0..2).for_each(|_| drop(run.step()));
        }
        let message = run.refused();
        assert!(message.contains(word), "{key} = {value}: {message}");
    }
    for (message, word) in [
        (json!({ "type": "record", "on": true }), "hapt live"),
        (json!({ "type": "scenario", "name": "none" }), "none"),
        (json!({ "type": "fly" }), "fly"),
    ] {
        run.send(&message);
        let refused = run.refused();
        assert!(refused.contains(word), "{message}: {refused}");
        other.send(&json!({ "type": "scenario", "name": null }));
    }
    assert_eq!(run.swing(2000), other.swing(2000));
}

#[test]
fn a_stop_takes_the_torque_away_until_it_is_cleared_and_armed() {
    let mut run = Run::new(&[]);
    run.swing(1000);
    let phase = |run: &mut Run| {
        (0..150).for_each(|_| drop(run.step()));
        let received = run.received();
        received.iter().rfind(|message| message["type"] == "status").map(|status| status["phase"].clone())
    };
    for (order, then) in [("stop", "faulted"), ("clear", "disarmed"), ("arm", "running")] {
        run.send(&json!({ "type": "order", "order": order }));
        assert_eq!(phase(&mut run), Some(json!(then)), "{order}");
    }
}

#[test]
fn a_page_that_was_asleep_lets_go_and_catches_up_no_more_than_a_tenth_of_a_second() {
    let mut run = Run::new(&[]);
    run.send(&json!({ "type": "hand", "grip": true, "position": 0.5 }));
    (0..500).for_each(|_| drop(run.step()));
    assert!((run.step().unwrap()[0] - 0.5).abs() < 0.15);
    run.ms += 60_000;
    run.step();
    let frames = std::iter::from_fn(|| run.page.next_message());
    let frames = frames.filter_map(|message| match message {
        Message::Frame(bytes) => Some(f64::from_le_bytes(bytes[8..16].try_into().unwrap())),
        Message::Text(_) => None,
    });
    let times: Vec<f64> = frames.collect();
    let [.., last, after] = times[..] else { panic!("{times:?}") };
    assert!((after - last - 0.1).abs() < 1e-9, "from {last} to {after} s");
    // Hands-off, the spring and its wheel pull the puck away.
    let farthest = (0..500).map(|_| (run.step().unwrap()[0] - 0.5).abs()).fold(0.0, f64::max);
    assert!(farthest > 0.2, "{farthest}");
}

#[test]
fn a_world_that_names_a_file_brings_it_along() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR"));
    std::fs::write(folder.join("wave.csv"), "waveform\n1\n-1\n").unwrap();
    let texture = "[[couplings]]\nkind = \"texture\"\nbetween = [\"puck\", \"ground\"]\ntorque = \"1 N mm\"\n\
                   pitch = \"1 deg\"\nfile = \"wave.csv\"\n";
    let source = Source { folder: folder.into(), ..Source::from_text("wheel.toml", format!("{WHEEL}{texture}")) };
    let file = WorldFile::new(&source, Vec::new()).unwrap();
    assert_eq!(file.files["wave.csv"], "waveform\n1\n-1\n");
    std::fs::remove_file(folder.join("wave.csv")).unwrap();
    assert!(Page::new(&json!(file).to_string()).is_ok());
    let missing = WorldFile { files: BTreeMap::new(), ..file };
    assert!(Page::new(&json!(missing).to_string()).is_err_and(|error| error.contains("wave.csv")));
}
