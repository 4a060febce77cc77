//! `hapt live`: from the first line to the end.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;

use crate::common::{Running, WHEEL, folder, program};
use crate::help::{examples, help};

/// The running program, and the link in its first line.
fn started(folder: &Path, args: &[&str]) -> (Running, String) {
    let mut running = Running::start(program(folder, args));
    let mut link = String::new();
    running.until("the page's address", |out, _| {
        link = out.lines().next().unwrap_or_default().to_string();
        out.contains('\n')
    });
    (running, link)
}

#[test]
fn the_first_line_is_the_pages_address_and_there_it_is() {
    let at = folder(&[("wheel.toml", WHEEL)]);
    for args in [&["live", "--port", "0"][..], &["live", "wheel.toml", "--port", "0"]] {
        let (running, link) = started(at.path(), args);
        let own = link.strip_prefix("http://").and_then(|link| link.strip_suffix('/')).unwrap();
        assert!(own.starts_with("127.0.0.1:"), "{link}");
        let mut stream = TcpStream::connect(own).unwrap();
        write!(stream, "GET / HTTP/1.1\r\nHost: {own}\r\nConnection: close\r\n\r\n").unwrap();
        let mut page = String::new();
        stream.read_to_string(&mut page).unwrap();
        assert!(page.starts_with("HTTP/1.1 200 OK\r\n"), "{page}");
        drop(running);
    }
}

#[cfg(unix)]
#[test]
fn a_signal_ends_it_with_its_own_code_and_quietly() {
    let at = folder(&[("wheel.toml", WHEEL)]);
    for (signal, code) in [("INT", 130), ("TERM", 143)] {
        let (running, link) = started(at.path(), &["live", "wheel.toml", "--port", "0"]);
        running.signal(signal);
        let ended = running.end();
        assert_eq!((ended.code, ended.out, ended.err.as_str()), (Some(code), format!("{link}\n"), ""));
    }
}

#[test]
fn a_port_that_is_taken_is_said_with_the_way_out() {
    let at = folder(&[("wheel.toml", WHEEL)]);
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let ended = Running::start(program(at.path(), ["live", "wheel.toml", "--port", &port])).end();
    ended.refused(3, &[&port, "is taken", "--port 0"]);
    let ended = Running::start(program(at.path(), ["live", "--port", "0", "--listen", "192.0.2.1"])).end();
    ended.refused(3, &["192.0.2.1", "no address of this machine"]);
}

#[test]
fn a_page_for_other_machines_has_a_token_in_its_link_and_that_is_said() {
    let at = folder(&[("wheel.toml", WHEEL)]);
    let (mut running, link) = started(at.path(), &["live", "wheel.toml", "--port", "0", "--listen", "0.0.0.0"]);
    let (address, token) = link.split_once("/#").unwrap();
    assert!(address.starts_with("http://127.0.0.1:") && token.len() == 32, "{link}");
    running.until("a word about it", |_, err| err.contains("other machines") && err.contains("token"));
    running.until("the token printed once", |out, err| !err.contains(token) && out.matches(token).count() == 1);
}

#[test]
fn several_worlds_are_of_one_device_and_no_network() {
    let other = WHEEL.replace("6.4e-4", "6.5e-4");
    let knob = "loop.period = \"1 ms\"\ndevice.inertia = 1e-3\n";
    let network = "stations.one.world = \"wheel.toml\"\nstations.two.world = \"wheel.toml\"\nlinks = [{ kind = \"spring\", between = [\"one\", \"two\"], stiffness = 0.05, age_max = \"50 ms\" }]\n";
    let at = folder(&[("wheel.toml", WHEEL), ("other.toml", &other), ("pair.toml", network)]);
    for (name, text) in [("knobs/a.toml", knob), ("knobs/b.toml", knob), ("none/a.txt", "")] {
        let path = at.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    for worlds in [&["knobs"][..], &["knobs/a.toml", "knobs/b.toml"], &["@knob"]] {
        let args: Vec<&str> = ["live", "--port", "0"].iter().chain(worlds).copied().collect();
        drop(started(at.path(), &args));
    }
    for (worlds, words) in [
        (&["wheel.toml", "other.toml"][..], &["other.toml", "[device]", "wheel.toml", "one device"][..]),
        (&["knobs", "wheel.toml"], &["wheel.toml", "[device]", "a.toml"]),
        (&["wheel.toml", "pair.toml"], &["pair.toml", "network"]),
        (&["none"], &["none", "*.toml"]),
        (&["knobs", "gone.toml"], &["gone.toml"]),
        (&["@nob"], &["@nob", "hapt worlds"]),
    ] {
        let args: Vec<&str> = ["live", "--port", "0"].iter().chain(worlds).copied().collect();
        Running::start(program(at.path(), args)).end().refused(2, words);
    }
}

/// The examples of its help, at any free port, up to their first line and ended then.
#[cfg(unix)]
#[test]
fn every_example_of_it_runs_until_it_is_ended() {
    let at = folder(&[("wheel.toml", WHEEL)]);
    let lines = examples(&help(&["live", "--help"]));
    assert!(lines.len() >= 3, "{lines:?}");
    // An example with a board does not run anywhere: board.rs has one.
    for line in lines.into_iter().filter(|line| !line.contains(" hapt:")) {
        let line = if line.contains("--port") { line } else { format!("{line} --port 0") };
        let args: Vec<&str> = line.split_whitespace().skip(1).collect();
        let (running, _) = started(at.path(), &args);
        running.signal("INT");
        assert_eq!(running.end().code, Some(130), "{line}");
    }
}
