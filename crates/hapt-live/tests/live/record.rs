//! The recording of a running loop.

use std::path::Path;
use std::time::Duration;

use hapt_core::wheel::{Device, Timing, Wheel};
use hapt_host::Machine;
use hapt_live::{Error, Live, Options};
use hapt_log::{Ending, Log, replay};
use hapt_model::Source;
use hapt_rt::{Outside, effects};
use hapt_wire::pid::{FULL, Kind, Operation, Pool, Report, Scale};
use serde_json::json;

use crate::common::{Page, WORLD};

#[test]
fn a_recording_is_a_log_of_the_worlds_that_ran_and_replays_their_torques() {
    let folder = tempfile::tempdir().unwrap();
    let source = Source::from_text("wheel.toml", WORLD);
    let address = "127.0.0.1:0".parse().unwrap();
    let live = Live::start(Options {
        worlds: vec![source],
        sets: Vec::new(),
        address,
        token: false,
        folder: folder.path().into(),
    })
    .unwrap();
    let (mut page, _) = Page::new(&live);
    // The loop is armed, and a hand moves it: the recording begins during a run.
    page.say(json!({ "type": "hand", "grip": true, "position": 0.4 }));
    page.frame_until(|frame| frame.columns[0][0].abs() > 0.1);
    page.say(json!({ "type": "record", "on": true }));
    let long = |least: f64| {
        move |status: &serde_json::Value| status["recording"]["seconds"].as_f64().is_some_and(|seconds| seconds > least)
    };
    let status = page.receive_until("status", long(0.2));
    assert!(status["recording"]["error"].is_null() && status["recording"]["lost"] == 0, "{status}");
    page.say(json!({ "type": "set", "key": "loop.delay", "value": "1 ms" }));
    page.frame_until(|frame| frame.generation == 1);
    page.receive_until("status", long(0.5));
    page.say(json!({ "type": "record", "on": false }));
    page.receive_until("status", |status| status["recording"].is_null());

    let file = folder.path().join("live-0001.mcap");
    assert_eq!(status["recording"]["file"], file.display().to_string());
    // It is finished on another thread.
    while !is_whole(&file) {
        std::thread::sleep(Duration::from_millis(20));
    }
    let mut log = Log::open(&file).unwrap();
    let (mut plans, mut samples, mut torques) = (Vec::new(), 0, 0);
    while let Some(sample) = log.next().unwrap() {
        let inputs = sample.inputs().unwrap();
        assert!(samples > 0 || (inputs.sample > 0 && sample.snapshot.is_some()), "it begins with the loop's state");
        (samples, torques) = (samples + 1, torques + u64::from(inputs.output != 0.0));
        let plan = sample.plan.number;
        if plans.last() != Some(&plan) {
            plans.push(plan);
        }
    }
    assert_eq!(plans, [0, 1]);
    assert!(torques > 100, "{torques} of {samples} samples with a torque");
    let again = replay(&mut Log::open(&file).unwrap()).unwrap();
    assert_eq!((again.compared, again.skipped, again.gaps, again.first), (samples, 0, 0, None));
}

#[test]
fn a_recording_with_a_games_effects_has_their_torque_in_a_separate_column() {
    let folder = tempfile::tempdir().unwrap();
    let (port, mut wire) =
        effects(Wheel::new(&Device::ideal(Timing::even(1e-3), 1e-3, 0.4)).unwrap(), Scale::of_wheel(0.4, 1.0));
    let options = Options {
        worlds: vec![Source::from_text("wheel.toml", WORLD)],
        sets: Vec::new(),
        address: "127.0.0.1:0".parse().unwrap(),
        token: false,
        folder: folder.path().into(),
    };
    let machine = |world: &_| Ok::<_, Error>(Machine::simulated(world).with_outside(Outside::playing(port)).unwrap());
    let live = Live::start_on(options, machine).unwrap();
    let (mut page, _) = Page::new(&live);
    let mut pool = Pool::new();
    for report in [
        Report::Create(Kind::Constant),
        Report::Constant { block: 0, magnitude: FULL / 2 },
        Report::Operation { block: 0, operation: Operation::Start, loops: 1 },
    ] {
        assert!(pool.take(&report, 0));
    }
    assert!(wire.pools.push(pool).is_ok());
    page.frame_until(|frame| frame.columns[0][0].abs() > 0.01);
    page.say(json!({ "type": "record", "on": true }));
    page.receive_until("status", |status| status["recording"]["seconds"].as_f64().is_some_and(|seconds| seconds > 0.2));
    page.say(json!({ "type": "record", "on": false }));
    page.receive_until("status", |status| status["recording"].is_null());

    let file = folder.path().join("live-0001.mcap");
    while !is_whole(&file) {
        std::thread::sleep(Duration::from_millis(20));
    }
    let mut log = Log::open(&file).unwrap();
    let mut links = Vec::new();
    while let Some(sample) = log.next().unwrap() {
        assert_eq!(sample.plan.columns.last().unwrap().name, "link_Nm");
        links.push(sample.inputs().unwrap().link.unwrap());
    }
    assert!(links.len() > 100 && links.iter().all(|link| (link.abs() - 0.2).abs() < 1e-3), "{links:?}");
    let again = replay(&mut Log::open(&file).unwrap()).unwrap();
    assert_eq!((again.compared, again.first), (links.len() as u64, None));
}

/// Independent programs that record into one folder at once.
#[test]
fn recordings_into_one_folder_have_a_file_each_and_lose_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let live = |_| {
        let source = Source::from_text("wheel.toml", WORLD);
        let address = "127.0.0.1:0".parse().unwrap();
        Live::start(Options {
            worlds: vec![source],
            sets: Vec::new(),
            address,
            token: false,
            folder: folder.path().into(),
        })
        .unwrap()
    };
    let lives: Vec<Live> = (0..4).map(live).collect();
    let mut pages: Vec<Page> = lives.iter().map(|live| Page::new(live).0).collect();
    for page in &mut pages {
        page.say(json!({ "type": "record", "on": true }));
    }
    let mut files = Vec::new();
    for page in &mut pages {
        let status = page.receive_until("status", |status| {
            status["recording"]["seconds"].as_f64().is_some_and(|seconds| seconds > 0.2)
        });
        files.push(std::path::PathBuf::from(status["recording"]["file"].as_str().unwrap()));
        page.say(json!({ "type": "record", "on": false }));
        page.receive_until("status", |status| status["recording"].is_null());
    }
    for file in &files {
        while !is_whole(file) {
            std::thread::sleep(Duration::from_millis(20));
        }
        assert_eq!(replay(&mut Log::open(file).unwrap()).unwrap().first, None);
    }
    files.sort();
    files.dedup();
    assert_eq!(files.len(), lives.len(), "{files:?}");
}

fn is_whole(file: &Path) -> bool {
    let mut log = Log::open(file).unwrap();
    while log.next().unwrap().is_some() {}
    log.ending() == &Ending::Whole
}

#[test]
fn a_folder_that_takes_no_file_is_refused_in_words() {
    let source = Source::from_text("wheel.toml", WORLD);
    let address = "127.0.0.1:0".parse().unwrap();
    let live = Live::start(Options {
        worlds: vec![source],
        sets: Vec::new(),
        address,
        token: false,
        folder: "/proc/no/such".into(),
    })
    .unwrap();
    let (mut page, _) = Page::new(&live);
    page.say(json!({ "type": "record", "on": true }));
    let refused = page.receive("refused");
    assert!(refused["message"].as_str().unwrap().contains("/proc/no/such"), "{refused}");
}
