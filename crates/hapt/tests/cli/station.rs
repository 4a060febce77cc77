//! Stations of a network in real time, each a program of its own.

use std::fs;
use std::net::UdpSocket;
use std::thread::sleep;
use std::time::Duration;

use crate::common::{Running, folder, hapt, program};

const WHEEL: &str = "loop.period = \"2 ms\"\nsafety.stall = \"10 s\"\ndevice = { inertia = 1e-3, damping = 0.01, limit = 0.5, encoder = 4000 }\n\
    [scenarios.push]\nduration = \"0.4 s\"\nhand = { kind = \"sine\", amplitude = \"10 deg\", frequency = \"5 Hz\" }\n";
const THREE: &str = "stations.left.world = \"wheel.toml\"\nstations.right.world = \"wheel.toml\"\nstations.away.world = \"wheel.toml\"\n\
    [[links]]\nkind = \"spring\"\nbetween = [\"left\", \"right\"]\nstiffness = 0.01\nage_max = \"400 ms\"\n";
const KEY: &str = "both stations know this one\n";

/// Ports that were free a moment ago.
fn ports() -> [String; 2] {
    let sockets = [(), ()].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
    sockets.each_ref().map(|socket| socket.local_addr().unwrap().to_string())
}

fn files() -> tempfile::TempDir {
    folder(&[("wheel.toml", WHEEL), ("net.toml", THREE), ("pair.key", KEY), ("short.key", "too short\n")])
}

fn station(line: &str) -> Vec<String> {
    ["run", "net.toml"].into_iter().chain(line.split_whitespace()).map(String::from).collect()
}

#[test]
fn two_programs_feel_each_other_and_the_log_needs_no_network() {
    let at = files();
    let [left, right] = ports();
    let line = format!("--station right --listen {right} --peer left={left} --key pair.key");
    let mut other = Running::start(program(at.path(), station(&line)));
    let line =
        format!("--station left --listen {left} --peer right={right} --key pair.key --duration 2s --log left.mcap");
    let mut run = Running::start(program(at.path(), station(&line)));
    other.until("the link", |_, err| err.contains("the link to left acts"));
    run.until("the link", |_, err| err.contains("the link to right acts"));
    let ended = run.end().done();
    assert!(ended.out.contains("link         to right: acted in "), "{ended:?}");
    assert!(ended.out.contains("of 400.0 ms"), "{ended:?}");
    other.until("the other's end", |_, err| err.contains("the link to left has let go"));
    drop(other);
    let replayed = hapt(at.path(), ["log", "replay", "left.mcap"]).done().out;
    assert!(replayed.contains("same ") && replayed.contains("to the bit"), "{replayed}");
    hapt(at.path(), ["log", "convert", "left.mcap", "--out", "left.csv"]).done();
    let table = fs::read_to_string(at.path().join("left.csv")).unwrap();
    assert!(table.lines().next().unwrap().ends_with(",link_Nm"), "{table}");
}

#[test]
fn what_a_station_lacks_is_named() {
    let at = files();
    let [own, other] = ports();
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let taken = taken.local_addr().unwrap().to_string();
    let all = format!("--listen {own} --peer right={other} --key pair.key");
    let lines: [(&str, i32, &[&str]); 17] = [
        ("", 2, &["is a network", "--station left or --station right or --station away"]),
        ("--station lfet @", 2, &["no station \"lfet\"", "did you mean \"left\""]),
        ("--station left", 2, &["needs --listen", "0.0.0.0:7000"]),
        ("--station left --listen 7000", 2, &["--listen 7000", "an IP address and a port"]),
        ("--station left --listen OWN", 2, &["a link joins it to right", "--peer right=HOST:PORT"]),
        ("--station left --listen OWN --peer OWN", 2, &["expected NAME=HOST:PORT"]),
        (
            "--station left --listen OWN --peer rihgt=OWN",
            2,
            &["--peer", "no station \"rihgt\"", "did you mean \"right\""],
        ),
        ("--station left --listen OWN --peer left=OWN", 2, &["no link joins left to the station left"]),
        ("--station left --listen OWN --peer away=OWN", 2, &["no link joins away to the station left"]),
        ("--station left @ --peer right=OWN", 2, &["right is given twice"]),
        ("--station left --listen OWN --peer right=nowhere", 2, &["a host and a port"]),
        ("--station left --listen OWN --peer right=[::1]:7000 --key pair.key", 2, &["is IPv6", "is IPv4"]),
        ("--station left --listen OWN --peer right=OWN", 2, &["needs --key", "head -c 32 /dev/urandom"]),
        ("--station left --listen OWN --peer right=OWN --key none.key", 2, &["--key none.key"]),
        ("--station left --listen OWN --peer right=OWN --key short.key", 2, &["9 bytes", "16 or more"]),
        ("--station left --listen TAKEN --peer right=OWN --key pair.key", 3, &["--listen", "cannot listen there"]),
        ("--station left @ --device hapt:/dev/null", 2, &["a board", "a loop of this computer"]),
    ];
    for (line, code, words) in lines {
        let line = line.replace('@', &all).replace("OWN", &own).replace("TAKEN", &taken);
        hapt(at.path(), station(&line)).refused(code, words);
    }
    hapt(at.path(), ["run", "wheel.toml", "--station", "left"]).refused(2, &["is one world", "a network file"]);
    hapt(at.path(), ["run", "wheel.toml", "--key", "pair.key"]).refused(2, &["--station"]);
}

#[test]
fn a_motor_needs_a_network_that_is_certified() {
    let at = files();
    let [own, other] = ports();
    let line = format!(
        "--station left --listen {own} --peer right={other} --key pair.key --device moteus:/dev/hapt-none --set links.0.stiffness=1"
    );
    let refused = ["not certified", "too little damping: left, right", "--uncertified"];
    hapt(at.path(), station(&line)).refused(2, &refused);
    // Certified, it continues to the drive, which does not exist.
    let certified = line.replace("stiffness=1", "stiffness=0.01");
    hapt(at.path(), station(&certified)).refused(3, &["/dev/hapt-none"]);
}

#[test]
fn stations_with_another_key_or_file_are_told_so() {
    let at = files();
    fs::write(at.path().join("other.key"), "another key of the same length\n").unwrap();
    for (more, words) in [
        ("--key other.key", "under another key"),
        ("--key pair.key --set links.0.stiffness=0.02", "another network file"),
    ] {
        let [left, right] = ports();
        let line = format!("--station right --listen {right} --peer left={left} {more}");
        let mut other = Running::start(program(at.path(), station(&line)));
        let line = format!("--station left --listen {left} --peer right={right} --key pair.key");
        let mut run = Running::start(program(at.path(), station(&line)));
        for running in [&mut other, &mut run] {
            running.until("the refusal", |_, err| err.contains(words));
        }
    }
    // Twice the same station.
    let [left, right] = ports();
    let line = |own: &str, to: &str| format!("--station left --listen {own} --peer right={to} --key pair.key");
    let mut other = Running::start(program(at.path(), station(&line(&right, &left))));
    let mut run = Running::start(program(at.path(), station(&line(&left, &right))));
    for running in [&mut other, &mut run] {
        running.until("the refusal", |_, err| err.contains("messages of the same station"));
    }
}

/// A program that is stopped for most of the time, as on a computer that is too slow.
#[cfg(unix)]
#[test]
fn a_station_without_enough_time_ends_with_the_devices_code() {
    let at = files();
    let [left, right] = ports();
    let line = format!("--station left --listen {left} --peer right={right} --key pair.key");
    let mut run = Running::start(program(at.path(), station(&line)));
    run.until("the loop", |_, err| err.contains("Ctrl-C"));
    // Five seconds of its samples are judged; where another program has this thread's time, the next five.
    while run.is_running() {
        run.signal("STOP");
        sleep(Duration::from_millis(220));
        run.signal("CONT");
        sleep(Duration::from_millis(20));
    }
    let ended = run.end();
    assert_eq!(ended.code, Some(3), "{ended:?}");
    for words in ["with the torque off", "too slow for the loop", "has missed", "a longer loop.period"] {
        assert!(ended.err.contains(words), "{words}: {}", ended.err);
    }
}
