//! Stations of a network on one CAN bus, each a program of its own: behind slcan adapters here, on an interface in `cargo xtask guest`.

#![cfg(target_os = "linux")]

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::{Duration, Instant};

use hapt_drive::{Bus, Frame, Socket, slcan};

use crate::common::{Running, folder, hapt, program};

const WHEEL: &str = "loop.period = \"2 ms\"\nsafety.stall = \"10 s\"\n\
    device = { inertia = 1e-3, damping = 0.01, limit = 0.5, encoder = 4000 }\n";
const PAIR: &str = "stations.left.world = \"wheel.toml\"\nstations.right.world = \"wheel.toml\"\n\
    [[links]]\nkind = \"spring\"\nbetween = [\"left\", \"right\"]\nstiffness = 0.01\nperiod = \"5 ms\"\nage_max = \"400 ms\"\n";

fn files() -> tempfile::TempDir {
    folder(&[("wheel.toml", WHEEL), ("net.toml", PAIR), ("pair.key", "both stations know this one\n")])
}

fn station(at: &Path, name: &str, listen: &str, more: &str) -> Running {
    let line = format!("run net.toml --station {name} --listen {listen} {more}");
    Running::start(program(at, line.split_whitespace()))
}

/// A bus with an slcan adapter for each program: every other adapter receives what one sends.
struct Adapters {
    addresses: Vec<String>,
    /// Frames so far.
    frames: Arc<AtomicUsize>,
    cut: Arc<AtomicBool>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Adapters {
    fn new(count: usize) -> Self {
        let (lines, paths): (Vec<_>, Vec<_>) = (0..count).map(|_| hapt_drive::pty().unwrap()).unzip();
        let addresses = paths.iter().map(|path| format!("can:{}@1M", path.display())).collect();
        let (frames, cut, stop) =
            (Arc::<AtomicUsize>::default(), Arc::<AtomicBool>::default(), Arc::<AtomicBool>::default());
        let (counts, cuts, stops) = (Arc::clone(&frames), Arc::clone(&cut), Arc::clone(&stop));
        let thread = spawn(move || {
            let mut buses: Vec<_> = lines.into_iter().map(slcan::Adapter::new).collect();
            while !stops.load(Ordering::Relaxed) {
                for from in 0..buses.len() {
                    while let Ok(Some(frame)) = buses[from].receive(Instant::now()) {
                        counts.fetch_add(1, Ordering::Relaxed);
                        for to in (0..buses.len()).filter(|to| *to != from && !cuts.load(Ordering::Relaxed)) {
                            let _ = buses[to].send(&frame, Instant::now() + Duration::from_millis(1));
                        }
                    }
                }
                sleep(Duration::from_micros(200));
            }
        });
        Adapters { addresses, frames, cut, stop, thread: Some(thread) }
    }
}

impl Drop for Adapters {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn couple_over_bus(addresses: [&str; 2], cut: impl Fn(bool)) {
    // A computer that delays the loops for long ends them.
    hapt_testing::in_time(|| couple_once(addresses, &cut));
}

fn couple_once(addresses: [&str; 2], cut: &impl Fn(bool)) {
    cut(false);
    let at = files();
    let mut left = station(at.path(), "left", addresses[0], "--log left.mcap");
    let mut right = station(at.path(), "right", addresses[1], "");
    left.until("the link", |_, err| err.contains("the link to right acts"));
    right.until("the link", |_, err| err.contains("the link to left acts"));
    left.until("the bus", |_, err| err.contains("no authentication") && err.contains("kbit/s"));
    left.until("the rounding", |_, err| {
        err.contains("frames round positions to 2.4e-7 rad; all hands together may draw up to ")
    });
    cut(true);
    left.until("the end", |_, err| err.contains("the link to right has let go"));
    cut(false);
    left.until("the link again", |_, err| err.matches("the link to right acts").count() > 1);
    left.signal("INT");
    let ended = left.end();
    assert_eq!(ended.code, Some(130), "{ended:?}");
    assert!(ended.out.contains("link         to right: acted in "), "{ended:?}");
    assert!(ended.out.contains("for a closed bus"), "{ended:?}");
    right.until("the other's end", |_, err| err.rfind("has let go") > err.rfind("the link to left acts"));
    drop(right);
    let replayed = hapt(at.path(), ["log", "replay", "left.mcap"]).done().out;
    assert!(replayed.contains("to the bit"), "{replayed}");
}

#[test]
fn two_stations_are_coupled_over_adapters() {
    let adapters = Adapters::new(2);
    couple_over_bus([&adapters.addresses[0], &adapters.addresses[1]], |cut| adapters.cut.store(cut, Ordering::Relaxed));
    assert!(adapters.frames.load(Ordering::Relaxed) > 100);
}

/// With other traffic on the bus, some of it on the identifiers of the links.
#[test]
fn two_stations_are_coupled_over_an_interface() {
    let Ok(interface) = std::env::var("HAPT_CAN") else {
        println!("SKIPPED: needs a CAN interface in HAPT_CAN, such as vcan0; cargo xtask guest has one");
        return;
    };
    let set_link = |state: &str| {
        let status = std::process::Command::new("ip").args(["link", "set", &interface, state]).status();
        assert!(status.is_ok_and(|status| status.success()), "ip link set {interface} {state}");
    };
    let ended = Arc::<AtomicBool>::default();
    let (stop, name) = (Arc::clone(&ended), interface.clone());
    let traffic = spawn(move || {
        let mut socket = Socket::open(&name).unwrap();
        while !stop.load(Ordering::Relaxed) {
            for id in [0x1000_0000_u32 ^ 1 << 14, 0x1000_0000, 0x1000_2000, 0x2e, 0x101] {
                let frame = Frame::classic(id, &[0x55; 8]).with_extended(id > 0x7ff);
                // Sending fails while the interface is down.
                let _ = socket.send(&frame, Instant::now());
            }
            // The emulated machine has one slow core: more traffic would delay the recorder beyond the time that an interrupt allows for the
            // end of the log.
            sleep(Duration::from_millis(10));
        }
    });
    let address = format!("can:{interface}");
    couple_over_bus([&address, &address], |cut| set_link(if cut { "down" } else { "up" }));
    ended.store(true, Ordering::Relaxed);
    traffic.join().unwrap();
}

#[test]
fn stations_of_another_file_and_a_station_that_runs_twice_are_refused() {
    let at = files();
    let adapters = Adapters::new(3);
    let [left, right, third] = [0, 1, 2].map(|at| adapters.addresses[at].as_str());
    let mut running =
        [station(at.path(), "left", left, ""), station(at.path(), "right", right, "--set links.0.stiffness=0.02")];
    for running in &mut running {
        running.until("the refusal", |_, err| err.contains("another network file"));
    }
    let mut again = station(at.path(), "left", third, "");
    again.until("the refusal", |_, err| err.contains("messages of the same station"));
}

#[test]
fn settings_that_a_bus_cannot_carry_are_refused() {
    let at = files();
    let lines: [(&str, i32, &[&str]); 10] = [
        ("--listen can:", 2, &["the bus is missing", "can:can0"]),
        ("--listen can:can0#512", 2, &["\"512\"", "1 to 511"]),
        ("--listen can:can0@500k", 2, &["the system sets its rate", "ip link set can0"]),
        ("--listen can:/dev/ttyACM0@3M", 2, &["not a bit rate", "500k"]),
        ("--listen can:can0 --peer right=10.0.0.8:7000", 2, &["--peer", "no addresses"]),
        ("--listen can:can0 --key pair.key", 2, &["--key", "no room for an authentication", "UDP"]),
        ("--listen can0", 2, &["can:can0"]),
        ("--listen can:hapt-none", 3, &["--listen can:hapt-none#256", "cannot open it", "no CAN"]),
        ("--listen can:/dev/hapt-none@10k", 2, &["80 kbit/s", "the bus carries 10 kbit/s"]),
        ("--listen can:can0 --set links.0.age_max=700ms", 2, &["175 messages", "127", "6.51 ms"]),
    ];
    for (line, code, words) in lines {
        let line = format!("run net.toml --station left {line}");
        hapt(at.path(), line.split_whitespace()).refused(code, words);
    }
}
