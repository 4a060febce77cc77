//! Networks, loops in real time, motor drives, pages, and records of devices.

use super::{Table, WORLD, words};

pub(super) fn networks(t: &mut Table) {
    let pair = "[stations.left]\nworld = \"w.toml\"\n[stations.right]\nworld = \"w.toml\"\n[[links]]\nkind = \"spring\"\n\
        between = [\"left\", \"right\"]\nstiffness = 0.1\nage_max = \"20 ms\"\n";
    let [stiff, age] = ["links.0.stiffness=0..1", "links.0.age_max=5ms..30ms"];
    for (name, args) in [
        ("an edge over a link that is not there", &["boundary", "--vary", "links.1.stiffness=0..1", "--vary", age][..]),
        ("an edge over a key that no link has", &["boundary", "--vary", "links.0.inertia=0..1", "--vary", age]),
        (
            "an edge over a station that is not there",
            &["boundary", "--vary", "stations.up.device.damping=0..1", "--vary", age],
        ),
        ("an edge over a world's key", &["boundary", "--vary", "loop.period=1ms..2ms", "--vary", age]),
        (
            "an edge over ages that no link can have",
            &["boundary", "--vary", stiff, "--vary", "links.0.age_max=0.5ms..30ms"],
        ),
        ("an edge of worlds in a network", &["boundary", "--vary", stiff, "--vary", age, "--of", "free"]),
        (
            "a measure of worlds",
            &["sweep", "--vary", "links.0.stiffness=0..1:3", "--measure", "required_damping", "--out", "t.csv"],
        ),
        (
            "a run of a scenario that no station has",
            &[
                "sweep",
                "--vary",
                "links.0.stiffness=0..1:3",
                "--measure",
                "let_go",
                "--scenario",
                "stop",
                "--out",
                "t.csv",
            ],
        ),
        (
            "losses beyond all messages",
            &["sweep", "--vary", "links.0.loss=0..2:3", "--measure", "let_go", "--out", "t.csv"],
        ),
        ("the worst hands into one of its files", &["worst", "--out", "w.toml"]),
        ("the worst hands into a device, which has no files beside it", &["worst", "--out", "/dev/full"]),
        ("an impedance at no one puck", &["impedance"]),
        ("no station is left", &["check", "--set", "stations={}", "--set", "links=[]"]),
    ] {
        let args = [&[args[0], "pair.toml"][..], &args[1..]].concat();
        t.add(name, vec![("w.toml", WORLD.into()), ("pair.toml", pair.into())], words(&args));
    }
    t.typed(
        "an edge of networks of a world",
        &[
            "boundary",
            "w.toml",
            "--vary",
            "loop.period=1ms..2ms",
            "--vary",
            "couplings.0.stiffness=0..2",
            "--of",
            "fixed",
        ],
    );
    t.typed(
        "a measure of networks",
        &["sweep", "w.toml", "--vary", "loop.period=1ms..2ms:3", "--measure", "let_go", "--out", "t.csv"],
    );
}

pub(super) fn realtime(t: &mut Table) {
    for (name, args) in [
        ("a device that is none", &["--device", "wheel"][..]),
        ("a board at no port", &["--device", "hapt:"]),
        ("a board at a speed that no port has", &["--device", "hapt:/dev/ttyACM0@7"]),
        ("a world that no board should have", &["--device", "hapt:/dev/ttyACM0"]),
        ("a drive nowhere", &["--device", "moteus:"]),
        ("an identifier that no drive has", &["--device", "moteus:can0#127"]),
        ("an identifier that is no number", &["--device", "moteus:/dev/ttyACM0#one"]),
        ("a node that no drive has", &["--device", "odrive:can0#63"]),
        ("a rate that no adapter has", &["--device", "odrive:/dev/ttyACM0@300k"]),
        ("a rate for a bus that is the system's", &["--device", "odrive:can0@250k"]),
        ("a rate for a drive that has but one", &["--device", "moteus:/dev/ttyACM0@1M"]),
        ("a board without its motor's constant", &["--device", "simplefoc:/dev/ttyACM0"]),
        ("a board with a constant that no motor has", &["--device", "simplefoc:/dev/ttyACM0?torque-constant=0"]),
        ("a board with an option that none has", &["--device", "simplefoc:/dev/ttyACM0?kv=100"]),
        ("a board on a bus", &["--device", "simplefoc:can0?volts-per-torque=20"]),
        ("a drive for a world that is not certified", &["--device", "moteus:/dev/ttyACM0"]),
        ("a scenario for a drive", &["--device", "moteus:/dev/ttyACM0", "--scenario", "step"]),
        ("a replay of nothing", &["--device", "replay:"]),
        ("a replay of a file that is not there", &["--device", "replay:runs/step.csv"]),
        ("a replay of what is no run", &["--device", "replay:w.toml"]),
        ("a scenario for a device without a hand", &["--device", "replay:w.toml", "--scenario", "step"]),
        ("a scenario that is not there", &["--scenario", "stpe"]),
        ("no time at all", &["--duration", "0 s"]),
        ("a time in metres", &["--duration", "2 m"]),
        ("spinning for longer than half a period", &["--spin", "0.6 ms"]),
        ("spinning for less than nothing", &["--spin=-1us"]),
        ("a priority that is none", &["--priority", "100"]),
        ("a period that no clock keeps", &["--set", "loop.period=5us"]),
    ] {
        t.typed(name, &[&["run", "w.toml"], args].concat());
    }
    t.typed(
        "a board without a limit",
        &["flash", "w.toml", "--device", "hapt:/dev/ttyACM0", "--set", "device={inertia=1}"],
    );
    t.typed("a simulation that is to be flashed", &["flash", "w.toml", "--device", "sim"]);
    t.typed("the latency of a world that is not there", &["latency", "wheel.toml"]);
    t.typed("a latency measured for no time", &["latency", "--duration", "0"]);
}

/// Drives that are not simulated.
pub(super) fn drives(t: &mut Table) {
    for (name, args) in [
        ("a drive that nobody makes", &["simulate-drive", "vesc", "--pty"][..]),
        ("a motor's constant for a drive that has none", &["simulate-drive", "moteus?torque-constant=1", "--pty"]),
        ("a motor's constant of no motor", &["simulate-drive", "simplefoc?kv=100", "--pty"]),
        ("a drive at the end of nothing", &["simulate-drive", "moteus"]),
        ("a port and a bus at once", &["simulate-drive", "moteus", "--pty", "--can", "vcan0"]),
        ("the identifier of everybody", &["simulate-drive", "moteus", "--pty", "--id", "127"]),
        ("the node of everybody", &["simulate-drive", "odrive", "--pty", "--id", "63"]),
        ("a board on a bus", &["simulate-drive", "simplefoc", "--can", "vcan0"]),
        ("a board that is not alone on its port", &["simulate-drive", "simplefoc", "--pty", "--id", "2"]),
        ("a wheel that is not there", &["simulate-drive", "moteus", "--pty", "no-such.toml"]),
        ("a hand that is not there", &["simulate-drive", "moteus", "--pty", "w.toml", "--scenario", "stpe"]),
    ] {
        t.typed(name, args);
    }
}

pub(super) fn live(t: &mut Table) {
    for (name, args) in [
        ("a world with an error", &["--port", "0", "--set", "loop.period=1 kg"][..]),
        ("a period that nobody can watch", &["--port", "0", "--set", "loop.period=1 us"]),
        ("a name for an address", &["--port", "0", "--listen", "localhost"]),
        ("an address with its port", &["--port", "0", "--listen", "0.0.0.0:80"]),
        ("a device that is none", &["--port", "0", "--device", "simulation"]),
        ("a motor for a world that is not certified", &["--port", "0", "--device", "moteus:/dev/ttyACM0"]),
        ("a board for a world that is not certified", &["--port", "0", "--device", "hapt:/dev/ttyACM0"]),
        ("a port that is none", &["--port", "65536"]),
    ] {
        let args: Vec<&str> = ["live", "w.toml"].into_iter().chain(args.iter().copied()).collect();
        t.typed(name, &args);
    }
}

/// A table of a puck that swings, with a torque or without.
fn swing(header: &str, samples: usize, row: impl Fn(usize) -> String) -> Vec<u8> {
    let rows: String = (0..samples).map(|k| row(k) + "\n").collect();
    format!("{header}\n{rows}").into()
}

pub(super) fn identify(t: &mut Table) {
    let at = |k: usize| ((0.05 * k as f64).sin() * 100.0).round();
    let good = |k: usize| format!("{k},{},{}", at(k), if k % 100 < 50 { 1.0 } else { -1.0 });
    let header = "t_ms,angle_deg,tau_mNm";
    let mut log = |name, bytes: Vec<u8>, more: &[&str]| {
        t.add(name, vec![("log.csv", bytes)], words(&[&["identify", "log.csv"], more].concat()));
    };
    log("a log without a header", swing("0,1,2", 600, good), &[]);
    log("a log without torques", swing("t_ms,angle_deg", 600, |k| format!("{k},{}", at(k))), &[]);
    log("a log with a position in newtons", swing("t_ms,angle_N,tau_mNm", 600, good), &[]);
    log("a log with a torque without a unit", swing("t_ms,angle_deg,tau", 600, good), &[]);
    log("a log with counts, and nobody says how many", swing("t_ms,angle_counts,tau_mNm", 600, good), &[]);
    log(
        "a log of which every fifth sample is NaN",
        swing(header, 600, |k| if k % 5 == 0 { format!("{k},1,nan") } else { good(k) }),
        &[],
    );
    log("a log of NaN alone", swing(header, 600, |k| format!("{k},nan,nan")), &[]);
    log("a log with words in it", swing(header, 600, |k| if k == 300 { "300,1,off".into() } else { good(k) }), &[]);
    log("a log in which time runs backwards", swing(header, 600, |k| good(600 - k)), &[]);
    log("a log of three samples", swing(header, 3, |k| format!("{k},{k},{}", k % 2)), &[]);
    log(
        "a log with two columns of one name",
        swing("t_ms,angle_deg,angle_deg", 600, good),
        &["--columns", "position=angle_deg,torque=angle_deg"],
    );
    log(
        "a log with two positions",
        swing("t_ms,angle_deg,angle_rad,tau_mNm", 600, |k| format!("{k},{0},{0},{0}", at(k))),
        &[],
    );
    log("a log in volts", swing("t_ms,angle_deg,torque_V", 600, good), &[]);
    log(
        "a log in volts with a constant alone",
        swing("t_ms,angle_deg,torque_V", 600, good),
        &["--torque-constant", "0.05"],
    );
    log("a motor without resistance", swing("t_ms,angle_deg,torque_V", 600, good), &["--resistance", "0"]);
    log("a log with a header without units", swing("t,angle,tau", 600, good), &[]);
    log(
        "a log with a force that stands still",
        swing("t_ms,angle_deg,tau_mNm,push_N", 600, |k| good(k) + ",3"),
        &["--force", "push_N"],
    );
    log("a force that is not there", swing(header, 600, good), &["--force", "push_N"]);
    log("a torque named twice", swing(header, 600, good), &["--torque", "tau_mNm", "--columns", "torque=angle_deg"]);
    let mut mat = b"MATLAB 5.0 MAT-file".to_vec();
    mat.resize(124, b' ');
    log("a .mat file without arrays", [&mat[..], b"\x00\x01IM"].concat(), &[]);
    log("a .mat file of level 7.3", [&mat[..], b"\x00\x02IM"].concat(), &[]);
    log("a .mat file that is cut short", mat, &[]);
    log("a log in milliamperes, and nobody says what they make", swing("t_ms,angle_deg,torque_mA", 600, good), &[]);
    log(
        "a motor that makes less than nothing of a current",
        swing("t_ms,angle_deg,torque_mA", 600, good),
        &["--torque-constant", "-1"],
    );
    log("a gear of no turns", swing(header, 600, good), &["--ratio", "0"]);
    log("a log whose torque stands still at 0", swing(header, 600, |k| format!("{k},{},0", at(k))), &[]);
    log("a log in which time stands still", swing(header, 600, |k| good(k.min(400))), &[]);
    log("a log of a tenth of a second", swing(header, 100, good), &[]);
    log("a log in which nothing moves", swing(header, 600, |k| format!("{k},0,1")), &[]);
    log("a log without excitation", swing(header, 600, |k| format!("{k},{},5", at(k))), &[]);
    log("a column that is not there", swing(header, 600, good), &["--columns", "position=elbow_deg"]);
    log("a column for something else", swing(header, 600, good), &["--columns", "speed=angle_deg"]);
    log("nothing between two times", swing(header, 600, good), &["--from", "0.5 s", "--to", "0.2 s"]);
    log("an inertia in grams", swing(header, 600, good), &["--inertia", "5 g"]);
    let mut against = |name, log: Vec<u8>, more: &[&str]| {
        let args = words(&[&["identify", "log.csv", "--against", "w.toml"], more].concat());
        t.add(name, vec![("log.csv", log), ("w.toml", WORLD.into())], args);
    };
    against("a linear log against a world that turns", swing("t_ms,position_mm,force_N", 600, good), &[]);
    let slow = |k: usize| good(k).replacen(&k.to_string(), &(3 * k).to_string(), 1);
    against("a log of another period against a world", swing(header, 600, slow), &[]);
    against("a log without torques against a world", swing("t_ms,angle_deg", 600, |k| format!("{k},{}", at(k))), &[]);
    against("a tolerance of twice the damping", swing(header, 600, good), &["--set", "device.damping=1e-3 ± 200 %"]);
    against("a table to write from a comparison", swing(header, 600, good), &["--write", "device.toml"]);
    t.typed("a world against nothing", &["identify", "log.csv", "--against"]);
    t.typed("neither a log nor a device", &["identify", "wheel.csv"]);
    t.typed("a device without a world", &["identify", "sim"]);
    t.typed("more torque than the motor has", &["identify", "sim", "--world", "w.toml", "--torque", "1 N m"]);
    t.typed("an experiment with a column", &["identify", "sim", "--world", "w.toml", "--position", "arm_rad"]);
    t.typed("an experiment of no time", &["identify", "sim", "--world", "w.toml", "--duration", "1 ms"]);
    t.typed("a coast-down by an experiment", &["identify", "sim", "--world", "w.toml", "--coast"]);
    t.typed("a motor that nobody has agreed to move", &["identify", "moteus:/dev/ttyACM0", "--world", "w.toml"]);
}
