//! Networks of stations on the command line.

use std::fs;

use crate::common::{Running, folder, hapt, names, program};

const WHEEL: &str = "loop.period = \"1 ms\"\ndevice = { inertia = 1e-3, damping = 0.01 }\n\
    [scenarios.push]\nduration = \"0.1 s\"\nhand = { kind = \"step\", to = \"10 deg\", at = \"20 ms\" }\n";
const FREE: &str = "loop.period = \"2 ms\"\ndevice = { inertia = 1e-3, damping = 0.01 }\n";
const PAIR: &str = "stations.left.world = \"wheel.toml\"\nstations.right.world = \"free.toml\"\n[[links]]\nkind = \"spring\"\n\
    between = [\"left\", \"right\"]\nstiffness = 0.2\nage_max = \"20 ms\"\n";

#[test]
fn a_network_is_certified_or_not_and_says_where_it_lacks() {
    let at = folder(&[("wheel.toml", WHEEL), ("free.toml", FREE), ("pair.toml", PAIR)]);
    let text = hapt(at.path(), ["check", "pair.toml"]).done().out;
    assert!(text.starts_with("Certified: ") && text.contains("station   left: passive"), "{text}");
    let json = hapt(at.path(), ["check", "pair.toml", "--json"]).done().out;
    let check: serde_json::Value = serde_json::from_str(&json).unwrap();
    // K (T/2 + age_max)
    let required = |name: &str| check["stations"][name]["required_damping"].as_f64().unwrap();
    assert!((required("left") - 0.2 * 20.5e-3).abs() < 1e-12 && (required("right") - 0.2 * 21e-3).abs() < 1e-12);
    assert_eq!(check["stations"]["left"]["local"]["period_s"], 1e-3);
    assert_eq!(check["links"][0]["age_max_s"], 0.02);
    assert_eq!(check["certified"], true);
    // A station's own remedies are those of its world, and the network's are for its links.
    let of_world = hapt(at.path(), ["check", "wheel.toml", "--json"]).done().out;
    let of_world: serde_json::Value = serde_json::from_str(&of_world).unwrap();
    assert_eq!(check["stations"]["left"]["local"], of_world);
    assert!(check["remedies"]["stiffness_scale"].as_f64().unwrap() > 1.0 && text.contains("\nmargins "), "{text}");
    let json = hapt(at.path(), ["check", "pair.toml", "--json", "--no-remedies"]).done().out;
    let check: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert!(check["remedies"].is_null() && check["stations"]["left"]["local"]["remedies"].is_null(), "{json}");
    let text = hapt(at.path(), ["check", "pair.toml", "--no-remedies"]).done().out;
    assert!(text.starts_with("Certified: ") && !text.contains("margins"), "{text}");
    let weak = hapt(at.path(), ["check", "pair.toml", "--set", "stations.right.device.damping=1e-4"]);
    assert!(weak.code == Some(1) && weak.out.contains("too little damping: right"), "{weak:?}");
}

#[test]
fn a_run_of_a_network_is_a_file_for_each_station() {
    let at = folder(&[("wheel.toml", WHEEL), ("free.toml", FREE), ("pair.toml", PAIR)]);
    hapt(at.path(), ["sim", "pair.toml", "--out", "runs"]).done();
    assert_eq!(names(&at.path().join("runs")), ["push.left.csv", "push.right.csv"]);
    let lines = |name: &str| fs::read_to_string(at.path().join("runs").join(name)).unwrap().lines().count();
    assert_eq!([lines("push.left.csv"), lines("push.right.csv")], [1 + 101, 1 + 51]);
    let table = fs::read_to_string(at.path().join("runs/push.right.csv")).unwrap();
    assert!(table.starts_with("time_s,puck_rad,") && table.lines().next().unwrap().ends_with(",link_Nm"), "{table}");
    let text = hapt(at.path(), ["sim", "pair.toml"]).done().out;
    assert!(text.contains("left: 101 samples") && text.contains("right: 51 samples"), "{text}");
    // No input file is overwritten.
    fs::create_dir(at.path().join("own")).unwrap();
    hapt(at.path(), ["sim", "pair.toml", "--out", "own", "--format", "mcap"]).refused(2, &["--format mcap", "csv"]);
    hapt(at.path(), ["sim", "pair.toml", "--out", "new", "--format", "mcap"]).refused(2, &["--format mcap", "csv"]);
    assert!(!at.path().join("new").exists(), "nothing is made by what is refused");
    assert!(names(&at.path().join("own")).is_empty());
}

#[test]
fn a_scenario_that_cannot_be_run_is_refused_before_the_file_of_another() {
    let times: String = (0..=100).map(|k| format!("{}\n", 1e-3 * f64::from(k))).collect();
    let recorded = "[scenarios.recorded]\nduration = \"0.1 s\"\nhand = { kind = \"step\", to = \"10 deg\" }\n\
        timing = { kind = \"recorded\", file = \"times.csv\" }\n";
    let at = folder(&[
        ("wheel.toml", &format!("loop.interval_max = \"2 ms\"\n{WHEEL}{recorded}")),
        ("free.toml", FREE),
        ("pair.toml", PAIR),
        ("times.csv", &format!("time_s\n{times}")),
    ]);
    // By a fast clock the recording takes less time than the scenario.
    hapt(at.path(), ["sim", "pair.toml", "--out", "runs", "--set", "stations.left.drift=5000"])
        .refused(2, &["stations.left.drift: ", "the recording lasts 0.0995"]);
    assert!(!at.path().join("runs").exists());
    hapt(at.path(), ["sim", "pair.toml", "--out", "runs"]).done();
    assert_eq!(names(&at.path().join("runs")).len(), 4);
}

#[test]
fn a_mistake_in_a_network_is_named_with_its_place() {
    let at = folder(&[
        ("wheel.toml", WHEEL),
        ("free.toml", FREE),
        ("line.toml", "motion = \"linear\"\nloop.period = 1e-3\ndevice.inertia = 1\n"),
    ]);
    let mistakes: [(&str, &str, &[&str]); 14] = [
        ("\"free.toml\"", "\"none.toml\"", &["stations.right.world", "none.toml"]),
        ("\"free.toml\"", "\"../free.toml\"", &["stations.right.world", "leads out of"]),
        ("\"free.toml\"", "\"line.toml\"", &["stations.right.world", "linear", "move alike"]),
        ("\"free.toml\"", "\"pair.toml\"", &["stations.right.world", "is itself a network"]),
        ("\"left\", \"right\"", "\"left\", \"rihgt\"", &["links.0.between", "rihgt", "did you mean \"right\""]),
        ("\"left\", \"right\"", "\"left\", \"left\"", &["links.0.between", "two different stations"]),
        ("\"20 ms\"", "\"1.5 ms\"", &["links.0.age_max", "right sends every 0.002 s"]),
        ("\"20 ms\"", "\"20 ms\"\nperiod = \"25 ms\"", &["links.0.period", "let go between two messages"]),
        ("\"20 ms\"", "\"20 ms\"\nperiod = \"1 ms\"", &["links.0.period", "right", "0.002 s or more"]),
        ("\"20 ms\"", "\"20 ms\"\ndelay = \"19.5 ms\"", &["links.0.age_max", "or more"]),
        ("\"20 ms\"", "\"20 ms\"\ndelay = \"3 ms\"\ndelay_max = \"2 ms\"", &["links.0.delay_max", "0.003 s or more"]),
        ("\"20 ms\"", "\"20 ms\"\nloss = 1.5", &["links.0.loss", "0 to 1"]),
        ("\"spring\"", "\"damper\"", &["links.0.kind", "\"spring\" or \"wall\""]),
        ("stations.right.world", "stations.left.world", &["pair.toml:2"]),
    ];
    for (good, wrong, words) in mistakes {
        fs::write(at.path().join("pair.toml"), PAIR.replace(good, wrong)).unwrap();
        for command in ["check", "sim"] {
            hapt(at.path(), [command, "pair.toml"]).refused(2, words);
        }
    }
    fs::write(at.path().join("pair.toml"), PAIR).unwrap();
    hapt(at.path(), ["check", "pair.toml", "--set", "stations.up.loop.period=2ms"]).refused(2, &["no station \"up\""]);
    hapt(at.path(), ["check", "pair.toml", "--set", "stations.left.loop.period=2 kg"])
        .refused(2, &["loop.period", "time"]);
    hapt(at.path(), ["sim", "pair.toml", "--scenario", "pull"])
        .refused(2, &["no station's world has a scenario \"pull\""]);
    // A slow clock makes uneven samples, and a command on the line while the next is taken is of even ones.
    for command in ["sim", "worst"] {
        let args = [command, "pair.toml", "--set", "stations.left.loop.delay=1.5ms", "--set"];
        hapt(at.path(), [&args[..], &["stations.left.drift=-1"]].concat())
            .refused(2, &["stations.left.drift: ", "0.0015 s, is longer than the period, 0.001 s"]);
        hapt(at.path(), [&args[..], &["stations.left.drift=0"]].concat()).done();
    }
    // A command for a world names the file as a network.
    hapt(at.path(), ["impedance", "pair.toml"]).refused(2, &["is a network"]);
}

const PLANE: [&str; 6] =
    ["boundary", "pair.toml", "--vary", "links.0.stiffness=0.05..8", "--vary", "links.0.age_max=5ms..60ms"];

#[test]
fn a_boundary_of_a_network_has_its_edges_and_a_picture() {
    let at = folder(&[("wheel.toml", WHEEL), ("free.toml", FREE), ("pair.toml", PAIR)]);
    let ended = hapt(at.path(), PLANE.iter().chain(&["--out", "e.csv", "--plot", "e.svg"])).done();
    assert!(ended.out.contains("passive   from ") && ended.out.contains("fixed     from "), "{}", ended.out);
    let table = fs::read_to_string(at.path().join("e.csv")).unwrap();
    let mut rows = table.lines();
    assert_eq!(rows.next(), Some("edge,piece,links.0.stiffness,links.0.age_max,hz,beyond"));
    let mut passive = 0;
    for row in rows.filter(|row| row.starts_with("passive,")) {
        let fields: Vec<&str> = row.split(',').collect();
        let [stiffness, age] = [2, 3].map(|i| fields[i].parse::<f64>().unwrap());
        // (b - K T/2) of both, their product (K age)^2
        let left = (0.01 - stiffness * 0.5e-3) * (0.01 - stiffness * 1e-3) / (stiffness * age).powi(2);
        assert!((left - 1.0).abs() < 1e-7 && fields[5].starts_with("+links.0."), "{row}");
        passive += 1;
    }
    assert!(passive > 20);
    let picture = fs::read_to_string(at.path().join("e.svg")).unwrap();
    assert!(
        ["passive for any clocks", "passive at fixed times only", "the file&#39;s own network"]
            .iter()
            .all(|words| picture.contains(words) || picture.contains(&words.replace("&#39;", "'")))
    );
    let of = |more: &[&str]| hapt(at.path(), PLANE.iter().chain(more));
    of(&["--of", "held"]).refused(2, &["--of: \"held\" is no edge of a network; expected passive, fixed"]);
    of(&["--out", "wheel.csv", "--set", "stations.up.loop.period=2ms"]).refused(2, &["no station \"up\""]);
    of(&["--out", "."]).refused(2, &["--out .: it is a folder"]);
    of(&["--plot", "."]).refused(2, &["--plot .: it is a folder"]);
    let missing = of(&["--out", "none/e.csv"]).refused(3, &["cannot write none/e.csv"]);
    assert!(!missing.err.contains(".partial"), "{}", missing.err);
    let lost = of(&["--set", "links.0.loss=0.1", "--out", "l.csv"]).done().out;
    assert!(lost.contains("fixed     no verdict: ") && lost.contains("lost"), "{lost}");
}

#[test]
fn the_worst_hands_of_a_network_are_shown_by_a_run() {
    let weak = WHEEL.replace("0.01", "0.003");
    let at = folder(&[("wheel.toml", &weak), ("free.toml", &FREE.replace("0.01", "0.003")), ("pair.toml", PAIR)]);
    let worst = hapt(at.path(), ["worst", "pair.toml", "--out", "broken.toml", "--json"]);
    assert_eq!(worst.code, Some(1), "{worst:?}");
    let json: serde_json::Value = serde_json::from_str(&worst.out).unwrap();
    assert!(json["broken"] == true && json["certified"] == false, "{json}");
    let gain = json["drawn"]["gain"].as_f64().unwrap();
    assert!(gain > 0.0 && json["stations"]["left"]["hand"]["grip"]["inertia"].as_f64().unwrap() > 0.0);
    assert!((json["stations"]["left"]["required_damping"].as_f64().unwrap() - 0.2 * 20.5e-3).abs() < 1e-12);
    assert_eq!(
        names(at.path()),
        ["broken-left.toml", "broken-right.toml", "broken.toml", "free.toml", "pair.toml", "wheel.toml"]
    );
    let text = hapt(at.path(), ["sim", "broken.toml"]).done().out;
    let given = text.lines().filter_map(|line| line.split_once("the hand gave ")).map(|(_, energy)| energy);
    assert!(given.clone().count() == 2 && given.clone().any(|energy| energy.starts_with('-')), "{text}");
    // A certified one is not broken, and no input file is overwritten.
    let safe = folder(&[("wheel.toml", WHEEL), ("free.toml", FREE), ("pair.toml", PAIR)]);
    let text = hapt(safe.path(), ["worst", "pair.toml"]).done().out;
    assert!(text.contains("verdict   survived, as certified") && text.contains("[scenarios.worst]"), "{text}");
    hapt(safe.path(), ["worst", "pair.toml", "--out", "pair.toml"]).refused(2, &["--out", "pair.toml"]);
    assert_eq!(fs::read_to_string(safe.path().join("pair.toml")).unwrap(), PAIR);
}

#[test]
fn a_sweep_of_a_network_is_a_table_that_is_resumed_and_split_as_any() {
    let at = folder(&[("wheel.toml", WHEEL), ("free.toml", FREE), ("pair.toml", PAIR)]);
    let sweep = |more: &[&str]| {
        let axes = ["sweep", "pair.toml", "--vary", "links.0.stiffness=0.1..0.4:4", "--vary", "links.0.delay=0..4ms:3"];
        hapt(at.path(), axes.iter().chain(more))
    };
    let measures = ["--measure", "certified,damping_margin,peak_torque,let_go,fixed_passive"];
    sweep(&[&measures[..], &["--out", "t.csv", "--plot", "t.svg"]].concat()).done();
    let table = fs::read_to_string(at.path().join("t.csv")).unwrap();
    let header = "links.0.stiffness,links.0.delay,certified,damping_margin,peak_torque,let_go,fixed_passive";
    assert!(table.starts_with(&format!("{header}\n")) && table.lines().count() == 13, "{table}");
    let last: Vec<f64> = table.lines().last().unwrap().split(',').map(|number| number.parse().unwrap()).collect();
    assert!(last[2] == 1.0 && (last[3] - (0.01 - 0.4 * 21e-3)).abs() < 1e-12, "{last:?}");
    for shard in ["0/2", "1/2"] {
        let out = format!("{}.csv", &shard[..1]);
        sweep(&[&measures[..], &["--shard", shard, "--out", &out]].concat()).done();
    }
    let read = |name: &str| fs::read_to_string(at.path().join(name)).unwrap();
    assert_eq!(read("0.csv") + &read("1.csv"), table);
    sweep(&[&measures[..], &["--out", "t.parquet"]].concat()).done();
    sweep(&["--measure", "held_verdict", "--out", "x.csv"])
        .refused(2, &["held_verdict is no measure of a network", "damping_margin"]);
    sweep(&["--measure", "let_go", "--scenario", "pull", "--out", "x.csv"]).refused(2, &["\"pull\"", "there is push"]);
    sweep(&["--measure", "let_go", "--out", "pair.toml.csv", "--set", "links.0.age_max=1ms"])
        .refused(2, &["links.0.age_max"]);
}

#[test]
fn a_report_has_the_certificate_every_link_and_every_station() {
    let tie =
        PAIR.replace("\"left\", \"right\"]", "\"left\", \"right\"]\nloss = 0.5").replace("\"20 ms\"", "\"12 ms\"");
    let at = folder(&[("wheel.toml", WHEEL), ("free.toml", FREE), ("pair.toml", PAIR), ("loose.toml", &tie)]);
    hapt(at.path(), ["report", "pair.toml", "loose.toml", "wheel.toml", "--out", "out"]).done();
    let out = at.path().join("out");
    let read = |name: &str| fs::read_to_string(out.join(name)).unwrap();
    let verdict = hapt(at.path(), ["check", "pair.toml"]).done().out;
    let page = read("pair.html");
    for line in verdict.lines().filter(|line| line.starts_with("station ")) {
        let sentence = line.split_once(": ").unwrap().1;
        assert!(page.contains(sentence), "{sentence}: {page}");
    }
    for words in
        ["<b>Certified</b>", "left to right", "20 ms", "Scenario push", "Station left", "free.toml, 2 ms a sample"]
    {
        assert!(page.contains(words), "{words}: {page}");
    }
    for figure in ["pair-push-motion.svg", "pair-push-links.svg", "pair-left-world.svg", "pair-right-world.svg"] {
        assert!(read(figure).starts_with("<svg"), "{figure}");
    }
    // Half of the messages are lost: positions are older than 12 ms now and then.
    assert!(read("loose.html").contains("let go "));
    let index = read("index.html");
    assert!(["pair.html", "loose.html", "wheel.html"].iter().all(|page| index.contains(page)), "{index}");
    // The page with both wheels is complete; a station too fast for a page is named.
    assert!(page.contains("href=\"live/pair.html\"") && read("live/pair.html").contains("./pair.js"));
    let data = read("live/pair.js");
    for part in [
        "\"stations\":[\"left\",\"right\"]",
        "\"command\":\"pair.toml\"",
        "\"free.toml\":",
        "\"wheel.toml\":",
        "../pair.html",
    ] {
        assert!(data.contains(part), "{part}: {data}");
    }
    let fast =
        hapt(at.path(), ["report", "pair.toml", "--set", "stations.right.loop.period=20us", "--out", "fast"]).done();
    assert!(
        fast.messages()[0].contains("right: loop.period: ") && fast.messages()[0].contains("50 us to 100 ms"),
        "{fast:?}"
    );
    assert!(!at.path().join("fast/live").exists());
    let broken = hapt(at.path(), ["report", "pair.toml", "--set", "links.0.age_max=1ms", "--out", "none"]);
    broken.refused(2, &["links.0.age_max"]);
    assert!(!at.path().join("none").exists());
}

#[test]
fn live_simulates_every_station_on_a_port_of_its_own() {
    let at = folder(&[("wheel.toml", WHEEL), ("free.toml", FREE), ("pair.toml", PAIR)]);
    hapt(at.path(), ["live", "pair.toml", "--device", "moteus:can0"])
        .refused(2, &["simulates every station", "hapt run --station"]);
    hapt(at.path(), ["live", "pair.toml", "--port", "65535"]).refused(2, &["--port 65535", "a port of its own"]);
    let mut live = Running::start(program(at.path(), ["live", "pair.toml", "--port", "0"]));
    live.until("both links", |out, _| out.lines().count() == 2);
    live.until("both names", |out, _| {
        out.starts_with("left   http://127.0.0.1:") && out.contains("right  http://127.0.0.1:")
    });
}
