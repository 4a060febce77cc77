//! The messages between pages and server.

use hapt_host::frames::columns_of;
use hapt_live::{Live, Options};
use hapt_model::{Delay, Source, World};
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::Message;

use crate::common::{Page, WORLD, live};

#[test]
fn a_page_receives_hello_world_verdict_and_frames() {
    let live = live(WORLD);
    let (mut page, hello) = Page::new(&live);
    assert_eq!((&hello["v"], &hello["control"]), (&json!(1), &hello["client"]), "the first has control");
    let world = page.receive("world");
    assert_eq!(world["generation"], 0);
    assert_eq!(world["motion"], "rotary");
    assert_eq!(world["units"], json!({ "position": "rad", "velocity": "rad/s", "effort": "N m" }));
    assert_eq!(world["bodies"], json!([{ "name": "wheel", "inertia": 0.02580123 }]));
    assert_eq!(world["couplings"][0]["between"], json!(["puck", "wheel"]));
    assert_eq!(world["scenarios"][0], json!({ "name": "step", "duration_s": 600.0, "hand": "step" }));
    let columns = columns_of(&World::read(&Source::from_text("w.toml", WORLD), &[]).unwrap());
    let columns: Vec<Value> = columns.iter().map(|c| json!({ "name": c.name, "unit": c.unit })).collect();
    assert_eq!(world["columns"], json!(columns));
    let verdict = page.receive("verdict");
    assert_eq!((&verdict["generation"], &verdict["certified"]), (&json!(0), &json!(true)), "{verdict}");
    assert_eq!(verdict["sentences"].as_array().unwrap().len(), 3);
    // Remedies follow once they are found, or with the first verdict of a page that joins later, and a range for every number.
    if !verdict["remedies"].is_array() {
        page.stay_until("verdict", |verdict| verdict["remedies"].is_array());
    }
    let range = page.stay_until("range", |range| range["key"] == "couplings.0.stiffness");
    assert!(!range["certified"].as_array().unwrap().is_empty(), "{range}");

    let mut time = 0.0;
    for _ in 0..10 {
        let frame = page.frame();
        assert_eq!((frame.columns.len(), frame.generation), (columns.len(), 0));
        assert!(frame.time > time, "time advances");
        time = frame.time;
        for [last, smallest, largest] in frame.columns {
            assert!(smallest <= last && last <= largest);
        }
    }
    let status = page.receive_until("status", |status| status["phase"] == "running");
    assert_eq!((&status["code"], &status["clients"]), (&Value::Null, &json!(1)));
    assert!(status["timing"]["samples"].as_u64().unwrap() > 0);
    let histogram = &status["timing"]["histogram"];
    let (edges, bars) = (histogram["edges_us"].as_array().unwrap(), histogram["latency"].as_array().unwrap());
    assert_eq!(edges.len(), bars.len() + 1);
    assert_eq!(
        bars.iter().map(|bar| bar.as_u64().unwrap()).sum::<u64>(),
        status["timing"]["samples"].as_u64().unwrap()
    );
    // The file states no times.
    assert_eq!(status["timing"]["certified"], Value::Null);
}

#[test]
fn the_status_shows_whether_the_loop_keeps_the_times_that_the_file_states() {
    // Counted, without a fade-out: this test checks the numbers, on a machine that may be slow.
    let times = "interval_max = \"1.5 ms\"\n[safety]\nlate = \"count\"\n[device]";
    let live = live(&WORLD.replace("[device]", times));
    let (mut page, _) = Page::new(&live);
    let status = page.receive_until("status", |status| status["timing"]["certified"]["samples"].as_u64() > Some(100));
    let certified = &status["timing"]["certified"];
    let number = |name: &str| certified[name].as_f64().unwrap();
    assert!(number("inside") <= number("samples"), "{certified}");
    assert!((number("interval_max_us") - 1500.0).abs() < 1e-6 && number("longest_us") > 0.0, "{certified}");
    assert!(certified["delay_max_us"].is_null() && number("longest_delay_us") > 0.0, "{certified}");
    let outside = number("inside") < number("samples");
    assert!(outside || number("longest_us") <= 1500.1, "{certified}");
}

#[test]
fn setting_a_key_gives_another_world_with_its_own_verdict() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    page.say(json!({ "type": "set", "key": "loop.method", "value": "forward-euler" }));
    let world = page.receive_until("world", |world| world["generation"] == 1);
    let method = world["keys"].as_array().unwrap().iter().find(|key| key["path"] == "loop.method").unwrap();
    assert_eq!((&method["written"], &method["changed"]), (&json!("forward-euler"), &json!(true)));
    let verdict = page.receive_until("verdict", |verdict| verdict["generation"] == 1);
    assert_eq!(verdict["certified"], false);
    assert!(verdict["growth_per_s"].as_f64().unwrap() > 0.0);
    page.frame_until(|frame| frame.generation == 1);

    page.say(json!({ "type": "reset" }));
    let world = page.receive_until("world", |world| world["generation"] == 2);
    assert!(world["keys"].as_array().unwrap().iter().all(|key| key["changed"] == false));
    let verdict = page.receive_until("verdict", |verdict| verdict["generation"] == 2);
    assert_eq!(verdict["certified"], true);
}

#[test]
fn a_saved_world_has_every_change_that_was_requested_before_it() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    for (period, delay) in [(2.0, 0.5), (3.0, 1.0), (1.0, 0.25), (4.0, 2.0)] {
        // Nothing is waited for in between.
        page.say(json!({ "type": "set", "key": "loop.period", "value": format!("{period} ms") }));
        page.say(json!({ "type": "set", "key": "loop.delay", "value": format!("{delay} ms") }));
        page.say(json!({ "type": "file" }));
        page.say(json!({ "type": "set", "key": "loop.delay", "value": "0.75 ms" }));
        let file = page.receive("file");
        assert_eq!(file["name"], "wheel.toml");
        let saved = Source::from_text("wheel.toml", file["text"].as_str().unwrap());
        let saved = World::read(&saved, &[]).unwrap().sampling;
        assert_eq!((saved.period, saved.delay), (1e-3 * period, Delay::Seconds(1e-3 * delay)));
    }
}

#[test]
fn an_invalid_key_is_refused_with_the_readers_message_and_changes_nothing() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    for (key, value, word) in [
        ("loop.period", "2 kg", "a time (s)"),
        ("loop.period", "10 s", "50 us to 100 ms"),
        ("loop.period", "-1 ms", "above 0"),
        ("couplings.0.stiffness", "", "stiffness"),
        ("couplings.7.stiffness", "1 N m/rad", "cannot be set while the loop runs"),
        ("couplings.0.kind", "wall", "cannot be set while the loop runs"),
        ("title", "x", "cannot be set while the loop runs"),
        ("loop.method", "newton", "forward-euler"),
        ("loop.period=1 ms\nloop.method", "zoh", "cannot be set while the loop runs"),
        ("scenarios.step.hand.to", "1 rad", "cannot be set while the loop runs"),
    ] {
        page.say(json!({ "type": "set", "key": key, "value": value }));
        let refused = page.receive("refused");
        assert_eq!(refused["key"], key);
        assert!(refused["message"].as_str().unwrap().contains(word), "{refused}");
    }
    // The generation is still the first.
    page.say(json!({ "type": "set", "key": "loop.delay", "value": "1 ms" }));
    assert_eq!(page.receive_until("world", |world| world["generation"] != 0)["generation"], 1);
}

#[test]
fn invalid_messages_are_answered_and_dropped_and_too_many_close_the_socket() {
    let live = live(WORLD);
    let mut page = Page::open(&live);
    page.say(json!({ "type": "alive" }));
    assert!(page.receive("error")["message"].as_str().unwrap().contains("the first message must be hello"));
    page.say(json!({ "type": "hello", "v": 2 }));
    assert!(page.receive("error")["message"].as_str().unwrap().contains("version 1"));
    page.say(json!({ "type": "hello", "v": 1 }));
    page.receive("hello");
    for text in ["", "{", "[]", "{\"type\":\"fly\"}", "{\"type\":\"hand\",\"grip\":true,\"position\":1e400}"] {
        page.send(Message::text(text));
        page.receive("error");
        // Valid messages still count.
        page.say(json!({ "type": "alive" }));
    }
    page.send(Message::binary(vec![1, 2, 3]));
    page.receive("error");
    for _ in 0..40 {
        page.send(Message::text("garbage"));
    }
    assert!([1008, 0].contains(&page.closed()));
    // The server still accepts pages.
    Page::new(&live);
}

#[test]
fn too_long_a_message_and_too_many_close_the_socket() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    page.say(json!({ "type": "set", "key": "loop.period", "value": "1 ms".repeat(2000) }));
    assert_eq!(page.closed(), 1009);
    let (mut page, _) = Page::new(&live);
    // Thousands in the time of two hundred.
    let sent = (0..20_000).take_while(|_| page.send(Message::text("{\"type\":\"alive\"}"))).count();
    assert!([1008, 0].contains(&page.closed()), "{sent} sent");
    Page::new(&live);
}

#[test]
fn commands_change_the_supervisor_and_every_client_may_stop() {
    let live = live(WORLD);
    let (mut page, _) = Page::new(&live);
    let (mut watcher, hello) = Page::new(&live);
    page.receive_until("status", |status| status["phase"] == "running");
    page.say(json!({ "type": "order", "order": "disarm" }));
    page.receive_until("status", |status| status["phase"] == "disarmed");
    page.say(json!({ "type": "order", "order": "arm" }));
    page.receive_until("status", |status| status["phase"] == "running");
    assert_ne!(hello["client"], hello["control"]);
    watcher.say(json!({ "type": "order", "order": "stop" }));
    let status = page.receive_until("status", |status| status["phase"] == "faulted");
    assert_eq!((&status["code"], &status["reason"]), (&json!(1), &json!("stop")));
    assert!(status["sentence"].is_string() && status["clear"].is_string());
    // A watcher may not clear.
    watcher.say(json!({ "type": "order", "order": "clear" }));
    assert!(watcher.receive("error")["message"].as_str().unwrap().contains("control"));
    // The supervisor requires some samples at rest first.
    loop {
        page.say(json!({ "type": "order", "order": "clear" }));
        if page.receive("status")["phase"] == "disarmed" {
            return;
        }
    }
}

#[test]
fn with_a_removed_file_every_change_is_refused_and_the_loop_continues() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("way.csv");
    std::fs::write(&path, "time_s,puck_deg\n0,0\n1,10\n").unwrap();
    let text =
        format!("{WORLD}[scenarios.way]\nduration = \"1 s\"\nhand = {{ kind = \"path\", file = \"way.csv\" }}\n");
    let file = folder.path().join("wheel.toml");
    std::fs::write(&file, text).unwrap();
    let address = "127.0.0.1:0".parse().unwrap();
    let source = Source::open(&file).unwrap();
    let live =
        Live::start(Options { worlds: vec![source], sets: Vec::new(), address, token: false, folder: ".".into() })
            .unwrap();
    let (mut page, _) = Page::new(&live);
    // The world file itself has been read; the path is read again with each change.
    std::fs::remove_file(&file).unwrap();
    page.say(json!({ "type": "set", "key": "loop.delay", "value": "1 ms" }));
    assert_eq!(page.receive_until("world", |world| world["generation"] != 0)["generation"], 1);
    std::fs::remove_file(&path).unwrap();
    page.say(json!({ "type": "set", "key": "loop.delay", "value": "2 ms" }));
    assert!(page.receive("refused")["message"].as_str().unwrap().contains("way.csv"));
    let time = page.frame().time;
    page.frame_until(|frame| frame.time > time && frame.generation == 1);
}
