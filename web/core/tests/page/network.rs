//! All stations of a network in one page.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use hapt_analysis::check_network;
use hapt_host::messages::NetworkFile;
use hapt_model::{Source, System};
use hapt_web::{Message, NetworkPage};
use serde_json::{Value, json};

/// A page whose time passes in frames of 16 ms.
struct Run {
    page: NetworkPage,
    network: System,
    frame: u64,
    /// For each station: the last status, and its puck's position in the last frame.
    status: Vec<Value>,
    place: Vec<f64>,
    refused: Vec<String>,
}

impl Run {
    fn of(source: &Source) -> Run {
        let network = System::read(source, &[]).unwrap();
        let file = NetworkFile::new(source, Vec::new(), &network, &check_network(&network).unwrap()).unwrap();
        let page = NetworkPage::new(&json!(file).to_string()).unwrap();
        let stations = network.stations.len();
        let (status, place) = (vec![Value::Null; stations], vec![0.0; stations]);
        Run { page, network, frame: 0, status, place, refused: Vec::new() }
    }

    fn file(name: &str) -> Run {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../networks");
        Run::of(&Source::open(folder.join(name)).unwrap())
    }

    fn send(&mut self, station: usize, message: &Value) {
        self.page.station(station).unwrap().send(&message.to_string());
    }

    fn hold(&mut self, station: usize, position: Option<f64>) {
        let hand = json!({ "type": "hand", "grip": position.is_some(), "position": position.unwrap_or(0.0) });
        self.send(station, &hand);
    }

    /// Runs for a time in s; returns the largest displacement of each puck from 0.
    fn pass(&mut self, seconds: f64) -> Vec<f64> {
        let mut most = vec![0.0_f64; self.place.len()];
        for _ in 0..(seconds / 16e-3).round() as u32 {
            self.frame += 1;
            self.page.poll(Duration::from_millis(16 * self.frame));
            for (at, most) in most.iter_mut().enumerate() {
                let page = self.page.station(at).unwrap();
                if let Some([last, ..]) = page.columns().first() {
                    self.place[at] = *last;
                    *most = most.max(last.abs());
                }
                while let Some(message) = page.next_message() {
                    let Message::Text(text) = message else { continue };
                    let message: Value = serde_json::from_str(&text).unwrap();
                    match message["type"].as_str() {
                        Some("status") => self.status[at] = message,
                        Some("refused" | "error") => {
                            self.refused.push(message["message"].as_str().unwrap().to_string());
                        }
                        _ => {}
                    }
                }
            }
        }
        most
    }

    fn info(&self, station: usize) -> &Value {
        &self.status[station]["network"]
    }
}

/// Two wheels, each as of its own file, whose messages take `delay`.
fn pair(delay: &str) -> Run {
    let mut source = Source::from_text(
        "pair.toml",
        format!(
            "stations = {{ left = {{ world = \"a/wheel.toml\" }}, right = {{ world = \"slow.toml\" }} }}\n[[links]]\nkind = \"spring\"\n\
             between = [\"left\", \"right\"]\nstiffness = 0.2\ndelay = \"{delay}\"\nage_max = \"60 ms\"\n"
        ),
    );
    let wheel = |period: &str| {
        format!("loop.period = '{period}'\ndevice = {{ inertia = '6.4e-4 kg m^2', damping = '20 N mm s/rad' }}\n")
    };
    source.files = BTreeMap::from([("a/wheel.toml".into(), wheel("1 ms")), ("slow.toml".into(), wheel("2.5 ms"))]);
    Run::of(&source)
}

/// With any values of the sliders, the page shows the verdict of `hapt check` on the file with these numbers.
#[test]
fn the_verdict_in_the_page_is_that_of_the_command_line() {
    let mut verdicts = [0, 0];
    for name in ["pair.toml", "chain.toml"] {
        let mut run = Run::file(name);
        for (stiffness, age) in [(1.0, 1.0), (0.3, 3.0), (1.2, 1.0), (0.05, 30.0), (9.0, 0.1), (1.0, 10.0), (0.02, 1.0)]
        {
            run.send(0, &json!({ "type": "network", "stiffness": stiffness, "age": age }));
            run.pass(0.3);
            let mut network = run.network.clone();
            for link in &mut network.links {
                *link = link.with_stiffness(stiffness * link.stiffness());
                link.age_max *= age;
            }
            let check = check_network(&network).unwrap();
            for station in 0..network.stations.len() {
                let shown = run.info(station);
                assert_eq!(shown["sentence"], check.verdict_sentence(), "{name} {stiffness} {age}");
                assert_eq!((&shown["certified"], &shown["outdated"]), (&json!(check.certified), &json!(false)));
            }
            verdicts[usize::from(check.certified)] += 1;
        }
    }
    assert!(verdicts.iter().all(|verdicts| *verdicts >= 4), "{verdicts:?}");
}

#[test]
fn a_wheel_that_is_turned_takes_the_other_along_and_its_position_is_as_old_as_the_way_there_and_back() {
    for (delay, travel_time) in [("2 ms", 4e-3), ("10 ms", 20e-3), ("20 ms", 40e-3)] {
        let mut run = pair(delay);
        run.pass(1.0);
        run.hold(0, Some(0.5));
        run.pass(3.0);
        assert!((run.place[1] - 0.5).abs() < 0.02, "{delay}: {:?}", run.place);
        for station in 0..2 {
            let link = &run.info(station)["links"][0];
            let age = link["age_s"].as_f64().unwrap();
            // Samples of both, the own hold, and how often messages are passed on.
            assert!(link["acts"] == true && age >= travel_time && age < travel_time + 9e-3, "{delay}: {link}");
        }
        // No message arrives: both ends release, and nothing moves the free wheel.
        run.send(1, &json!({ "type": "network", "loss": 1 }));
        run.pass(0.3);
        let before = run.place[1];
        run.hold(0, Some(-0.5));
        run.pass(1.0);
        assert!(run.info(0)["links"][0]["acts"] == false && run.info(1)["links"][0]["acts"] == false);
        assert!((run.place[1] - before).abs() < 1e-6 && run.place[0] < -0.4, "{:?}", run.place);
        assert!(run.info(0)["warnings"][0].as_str().unwrap().contains("The link to right has let go"));
    }
}

#[test]
fn late_wheels_ring_as_the_page_has_said_until_its_remedy_is_taken() {
    let mut run = Run::file("pair.toml");
    run.send(0, &json!({ "type": "network", "delay_s": 0.075, "loss": 0, "age": 10 }));
    run.pass(1.0);
    assert_eq!(run.info(0)["certified"], false);
    run.hold(0, Some(0.3));
    run.pass(0.6);
    run.hold(0, None);
    run.pass(0.3);
    let (early, late) = (run.pass(1.0), run.pass(1.0));
    assert!(late[0] > 1.5 * early[0], "{early:?} {late:?}");
    let remedy = run.info(0)["remedies"][0].clone();
    assert!(remedy["text"].as_str().unwrap().starts_with("Soften every link to"));
    run.send(1, &json!({ "type": "network", "stiffness": remedy["stiffness"] }));
    // A wheel that was too fast has faulted: all start over, and are pulled once more.
    (0..2).for_each(|station| run.send(station, &json!({ "type": "restart" })));
    run.pass(1.0);
    assert_eq!(run.info(0)["certified"], true);
    run.hold(0, Some(0.3));
    run.pass(0.6);
    run.hold(0, None);
    run.pass(3.0);
    let place = run.place.clone();
    run.pass(1.0);
    for (now, before) in run.place.iter().zip(place) {
        assert!((now - before).abs() < 0.01, "they rest: {:?}", run.place);
    }
}

#[test]
fn a_world_of_a_station_stays_as_it_is_and_a_page_asleep_holds_nothing() {
    let mut run = pair("2 ms");
    run.pass(0.5);
    for message in [
        json!({ "type": "set", "key": "device.damping", "value": "1 N mm s/rad" }),
        json!({ "type": "sets", "sets": [["device.damping", "1 N mm s/rad"]] }),
        json!({ "type": "reset" }),
    ] {
        run.send(1, &message);
    }
    run.hold(0, Some(0.4));
    run.pass(1.0);
    assert_eq!(run.refused.len(), 3);
    assert!(run.refused.iter().all(|why| why.contains("its worlds stay as they are")), "{:?}", run.refused);
    assert!((run.place[0] - 0.4).abs() < 0.01);
    // A minute without a frame, then the other wheel is turned: no hand holds the first.
    run.frame += 60_000 / 16;
    run.pass(0.1);
    run.hold(1, Some(-0.4));
    run.pass(2.0);
    assert!(run.place[0] < -0.3, "{:?}", run.place);
}

/// At equal periods the age is the round trip in samples: two periods for stations that sample at one instant, one where the instants
/// differ, and alternating where a clock drifts. The own hold is added.
#[test]
fn every_station_of_a_page_has_the_phase_and_the_clock_of_the_file() {
    for (clock, ages) in [("phase = 0", [30, 30]), ("phase = \"5 ms\"", [20, 20]), ("drift = 9000", [20, 30])] {
        let mut source = Source::from_text(
            "pair.toml",
            format!(
                "[stations]\nleft = {{ world = \"w.toml\" }}\nright = {{ world = \"w.toml\", {clock} }}\n[[links]]\nkind = \"spring\"\n\
                 between = [\"left\", \"right\"]\nstiffness = 0.01\nage_max = \"60 ms\"\n"
            ),
        );
        let wheel = "loop.period = '10 ms'\ndevice = { inertia = '6.4e-4 kg m^2', damping = '20 N mm s/rad' }\n";
        source.files.insert("w.toml".into(), wheel.into());
        let mut run = Run::of(&source);
        run.pass(1.0);
        let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
        for _ in 0..300 {
            run.pass(16e-3);
            let age = run.info(0)["links"][0]["age_s"].as_f64().unwrap();
            (least, most) = (least.min(age), most.max(age));
        }
        let found = [least, most].map(|age| (1e3 * age).round() as i32);
        assert!((0..2).all(|at| (found[at] - ages[at]).abs() <= 1), "{clock}: {found:?} ms");
    }
}

/// A damper without a spring pulls the other wheel along, against the damping of its device: a wheel that is turned at one speed turns the
/// other at D/(D + b) of it, and no torque is left where nothing is damped.
#[test]
fn a_damped_link_drags_the_other_wheel_along() {
    for damping in [0.0, 0.02] {
        let mut source = Source::from_text(
            "pair.toml",
            format!(
                "stations = {{ left = {{ world = \"w.toml\" }}, right = {{ world = \"w.toml\", phase = \"0.4 ms\" }} }}\n[[links]]\nkind = \"spring\"\n\
                 between = [\"left\", \"right\"]\nstiffness = 0\ndamping = {damping}\ndelay = \"2 ms\"\nage_max = \"60 ms\"\n"
            ),
        );
        let wheel = "loop = { period = '1 ms', estimator = 'difference' }\ndevice = { inertia = '2e-4 kg m^2', damping = '20 N mm s/rad' }\n";
        source.files.insert("w.toml".into(), wheel.into());
        let mut run = Run::of(&source);
        run.pass(0.5);
        let (mut place, mut begin) = (0.0, [0.0; 2]);
        for frame in 0..150 {
            place += 0.02;
            run.hold(0, Some(place));
            run.pass(16e-3);
            if frame == 50 {
                begin = [run.place[0], run.place[1]];
            }
        }
        let travels = [run.place[0] - begin[0], run.place[1] - begin[1]];
        let part = travels[1] / travels[0];
        assert!(travels[0] > 1.0 && (part - damping / (damping + 0.02)).abs() < 0.05, "{damping}: {travels:?}");
    }
}
