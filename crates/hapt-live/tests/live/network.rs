//! The verdict on a network while its pages change it.

use std::sync::Mutex;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use hapt_analysis::check_network;
use hapt_host::messages::{ClientMessage, NetworkChange, NetworkInfo, ServerMessage};
use hapt_host::{Machine, PageSession, Session, WorldConfig};
use hapt_live::network::{StationEnd, connect, connect_by};
use hapt_model::{Source, System};
use hapt_rt::Outside;

/// A time beyond which a test fails: far longer than on the slowest machine.
const TEST_TIMEOUT: Duration = Duration::from_secs(60);

fn source() -> Source {
    let mut source = Source::from_text(
        "pair.toml",
        r#"
        stations.left = { world = "wheel.toml", drift = -200 }
        stations.right.world = "wheel.toml"
        links = [{ kind = "spring", between = ["left", "right"], stiffness = 0.05, age_max = "50 ms" }]
        "#,
    );
    let wheel = r#"
        loop.period = "1 ms"
        device = { inertia = "6.4e-4 kg m^2", damping = "5 N mm s/rad" }
        couplings = [{ kind = "spring", between = ["puck", "ground"], stiffness = 0.1 }]
        "#;
    source.files.insert("wheel.toml".into(), wheel.into());
    source
}

/// The stations' running sessions behind their pages.
fn pages(network: &System, ends: Vec<StationEnd>) -> Vec<PageSession> {
    pages_in(std::path::Path::new("."), network, ends)
}

/// The same with a folder for their recordings.
fn pages_in(folder: &std::path::Path, network: &System, ends: Vec<StationEnd>) -> Vec<PageSession> {
    let page = |(station, StationEnd { ports, view }): (&hapt_model::Station, StationEnd)| {
        let config = WorldConfig::new(station.source.clone(), station.sets.clone()).unwrap();
        let machine = Machine::simulated(&config.world).with_outside(Outside::linked(ports)).unwrap();
        let machine = Machine { network: Some(view), ..machine };
        PageSession::new(Session::start_in(config, machine, folder.into(), || ()).unwrap())
    };
    network.stations.iter().zip(ends).map(page).collect()
}

#[test]
fn stations_that_record_at_once_have_a_file_each_with_their_name() {
    let folder = tempfile::tempdir().unwrap();
    let network = System::read(&source(), &[]).unwrap();
    let mut pages = pages_in(folder.path(), &network, connect(&network).unwrap());
    for page in &mut pages {
        say(page, ClientMessage::Record { on: true });
    }
    let begin = Instant::now();
    while pages.iter().any(|page| page.session.recording().is_none_or(|recording| recording.seconds < 0.1)) {
        assert!(begin.elapsed() < TEST_TIMEOUT);
        for page in &mut pages {
            page.poll(begin.elapsed(), |_, _| ());
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    for (page, station) in pages.iter().zip(["left", "right"]) {
        let recording = page.session.recording().unwrap();
        assert_eq!((recording.lost, &recording.error), (0, &None));
        assert_eq!(recording.file.file_name().unwrap().to_str().unwrap(), format!("live-{station}-0001.mcap"));
    }
}

fn info(page: &PageSession) -> NetworkInfo {
    let ServerMessage::Status(status) = page.status(1) else { panic!("no status") };
    status.network.unwrap()
}

fn say(page: &mut PageSession, message: ClientMessage) {
    let epoch = page.session.handle().epoch();
    let refused = page.handle(1, message, epoch);
    assert!(refused.is_none(), "{refused:?}");
}

fn set(page: &mut PageSession, key: &str, value: &str) {
    say(page, ClientMessage::Set { key: key.into(), value: value.into() });
}

fn soften(page: &mut PageSession, stiffness: f64) {
    say(page, ClientMessage::Network(NetworkChange { stiffness: Some(stiffness), ..NetworkChange::default() }));
}

/// Polls them until the condition holds, by the number of worlds begun and of telemetry frames of each.
fn until(what: &str, pages: &mut [PageSession], mut is_so: impl FnMut(&[PageSession], &[[usize; 2]]) -> bool) {
    let begin = Instant::now();
    let mut counts = vec![[0; 2]; pages.len()];
    while !is_so(pages, &counts) {
        for (page, [worlds, frames]) in pages.iter_mut().zip(&mut counts) {
            let ended = page.poll(begin.elapsed(), |_, message| match message {
                ServerMessage::World(_) => *worlds += 1,
                other => panic!("{other:?}"),
            });
            assert!(ended.is_none(), "{ended:?}");
            *frames += usize::from(page.frame().is_some());
        }
        assert!(begin.elapsed() < TEST_TIMEOUT, "{what}: {counts:?}, {:?}", info(&pages[0]));
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// For any key of any station the verdict becomes the one of the files with that key.
#[test]
fn the_verdict_follows_the_settings_of_every_station() {
    let network = System::read(&source(), &[]).unwrap();
    let mut pages = pages(&network, connect(&network).unwrap());
    let mut sets: Vec<String> = Vec::new();
    let mut verdicts = [0, 0];
    for (station, key, value) in [
        (0, "couplings.0.stiffness", "9"),
        (0, "couplings.0.stiffness", "2"),
        (1, "device.damping", "1 N mm s/rad"),
        (1, "device.damping", "9 N mm s/rad"),
        (0, "loop.period", "6 ms"),
        (0, "loop.period", "0.5 ms"),
    ] {
        set(&mut pages[station], key, value);
        until("a new world", &mut pages, |_, counts| counts[station][0] == 1);
        until("its verdict", &mut pages, |pages, _| !info(&pages[0]).outdated);
        sets.push(format!("stations.{}.{key}={value}", network.stations[station].name));
        let check = check_network(&System::read(&source(), &sets).unwrap()).unwrap();
        for page in &pages {
            let shown = info(page);
            assert_eq!((shown.certified, shown.sentence), (check.certified, check.verdict_sentence()), "{sets:?}");
        }
        verdicts[usize::from(check.certified)] += 1;
    }
    assert!(verdicts.iter().all(|verdicts| *verdicts >= 2), "{verdicts:?}");
    // With the links' sliders too: the certificate is for both changes together.
    soften(&mut pages[1], 10.0);
    until("the verdict of stiffer links", &mut pages, |pages, _| !info(&pages[0]).outdated);
    sets.push("links.0.stiffness=0.5".into());
    let check = check_network(&System::read(&source(), &sets).unwrap()).unwrap();
    assert_eq!(info(&pages[0]).sentence, check.verdict_sentence());
    assert!(!check.certified && !info(&pages[0]).remedies.is_empty());
}

/// While a verdict is computed the loops and their pages continue, and the pages mark the older verdict. Of many questions the newest is answered.
#[test]
fn a_slow_verdict_blocks_neither_loops_nor_pages() {
    let network = System::read(&source(), &[]).unwrap();
    let (entered, enters) = channel();
    let (leave, leaves) = channel::<()>();
    let leaves = Mutex::new(leaves);
    let slow = move |network: &System| {
        let check = check_network(network);
        entered.send(network.links[0].stiffness()).unwrap();
        // An error means that the test is over.
        let _ = leaves.lock().unwrap().recv();
        check
    };
    leave.send(()).unwrap();
    let mut pages = pages(&network, connect_by(&network, slow).unwrap());
    assert_eq!(enters.recv(), Ok(0.05));
    let before = info(&pages[0]);
    assert!(before.certified && !before.outdated);
    soften(&mut pages[0], 5.0);
    assert_eq!(enters.recv_timeout(TEST_TIMEOUT), Ok(0.25));
    for more in 1..=20 {
        soften(&mut pages[more % 2], 5.0 + more as f64);
        set(&mut pages[0], "couplings.0.stiffness", &format!("{}", 1.0 + 0.1 * more as f64));
        until("frames", &mut pages, |pages, counts| {
            let shown = info(&pages[1]);
            assert!(shown.outdated && shown.sentence == before.sentence && shown.stiffness == 5.0 + more as f64);
            counts.iter().all(|[_, frames]| *frames >= 5)
        });
    }
    assert!(enters.try_recv().is_err(), "one at a time");
    leave.send(()).unwrap();
    leave.send(()).unwrap();
    until("the newest verdict", &mut pages, |pages, _| !info(&pages[0]).outdated);
    assert_eq!(enters.try_iter().collect::<Vec<_>>(), [25.0 * 0.05]);
    assert!(!info(&pages[0]).certified);
}
