//! The commands on good input: the worlds that come with the source, overrides, standard input, design.

use std::f64::consts::{PI, TAU};
use std::fs;
use std::path::Path;

use hapt_model::{Motion, Source, World};
use hapt_sim::Simulation;
use serde_json::Value;

use crate::common::{Table, WHEEL, every_world, folder, hapt, hapt_reads, names, near, shipped, simulated, worlds};

#[test]
fn without_arguments_the_notes_wheel_runs_under_four_loops() {
    let ended = hapt(Path::new("."), [""; 0]).done();
    assert!(ended.messages().is_empty(), "{}", ended.err);
    let rows: Vec<Vec<&str>> = ended
        .out
        .lines()
        .skip_while(|line| !line.starts_with("loop "))
        .take_while(|line| !line.is_empty())
        .map(|line| line.split("  ").map(str::trim).filter(|cell| !cell.is_empty()).collect())
        .collect();
    assert_eq!(rows[0], ["loop", "growth per s", "peak torque", "first clipped", "verdict"]);
    assert_eq!(rows.len(), 1 + 4, "{}", ended.out);

    // Forward Euler from rest, by its definition: the torque of x_k, and the first that the motor cannot give.
    let (x, z, period) = (TAU * 1e-3, PI / 4.0, 1e-3);
    let (stiffness, limit) = (0.8 / z, 0.82225);
    let (mut w, mut v, mut peak, mut first) = (0.0_f64, 0.0, 0.0_f64, None);
    for sample in 0..=10_000 {
        let torque = stiffness * (w - z);
        peak = peak.max(torque.abs());
        if torque.abs() > limit {
            first.get_or_insert(sample);
        }
        (w, v) = (w + period * v, v - period * (x / period).powi(2) * (w - z));
    }
    let first = first.unwrap();
    let clipped = format!("sample {first} ({} s)", f64::from(first) / 1e3);
    assert_eq!(rows[1][..2], ["forward Euler", "0.0197388"]);
    assert_eq!(rows[1][3..], [clipped.as_str(), "unstable"]);
    let shown: f64 = rows[1][2].strip_suffix(" N mm").unwrap().parse().unwrap();
    near(shown, 1e3 * peak, 1e-6);
    for row in &rows[2..] {
        assert_eq!(row[1..], ["0", "800 N mm", "never", "marginal"], "{row:?}");
    }
}

#[test]
fn every_world_that_comes_along_runs_and_is_summarised() {
    for world in every_world() {
        let ended = hapt(Path::new("."), ["sim".as_ref(), world.as_os_str()]).done();
        assert!(ended.messages().is_empty(), "{}: {}", world.display(), ended.err);
        let read = World::read(&Source::open(&world).unwrap(), &[]).unwrap();
        assert!(ended.out.starts_with(read.title.as_deref().unwrap()), "{}", ended.out);
        for scenario in &read.scenarios {
            let head = format!("\nscenario {}: ", scenario.name);
            assert_eq!(ended.out.matches(&head).count(), 1, "{}", ended.out);
        }
        assert_eq!(ended.out.matches("\n  peak torque ").count(), read.scenarios.len(), "{}", ended.out);
        assert_eq!(ended.out.matches("\n  device ").count(), read.scenarios.len(), "{}", ended.out);
    }
}

#[test]
fn every_world_that_comes_along_gives_whole_csv_files() {
    for world in every_world() {
        let at = folder(&[]);
        let out = at.path().join("a/b");
        let ended = hapt(at.path(), ["sim".as_ref(), world.as_os_str(), "--out".as_ref(), "a/b".as_ref()]).done();
        assert_eq!(ended.out, "", "{}", world.display());

        let read = World::read(&Source::open(&world).unwrap(), &[]).unwrap();
        let (position, velocity, effort) = match read.motion {
            Motion::Rotary => ("rad", "rad_per_s", "Nm"),
            Motion::Linear => ("m", "m_per_s", "N"),
        };
        let torque = if read.motion == Motion::Linear { "force_N" } else { "torque_Nm" };
        let mut header = vec!["time_s".to_string()];
        for name in ["puck", "measured"] {
            header.extend([format!("{name}_{position}"), format!("{name}_{velocity}")]);
        }
        header.extend([torque.into(), format!("command_{effort}"), format!("applied_{effort}")]);
        for name in &read.names {
            header.extend([format!("{name}_{position}"), format!("{name}_{velocity}")]);
        }

        let mut files: Vec<String> = read.scenarios.iter().map(|scenario| format!("{}.csv", scenario.name)).collect();
        files.sort();
        assert_eq!(names(&out), files);
        for scenario in &read.scenarios {
            let table = Table::read(&out.join(format!("{}.csv", scenario.name)));
            assert!(table.header.starts_with(&header), "{}: {:?}", world.display(), table.header);
            let samples = (scenario.duration / read.sampling.period).round() as usize;
            assert_eq!(table.rows.len(), samples + 1, "{}", world.display());
            assert!(ended.err.contains(&format!("{}.csv, ", scenario.name)), "{}", ended.err);

            // Written, and read again, every number is the very double of the run.
            let mut run = Simulation::new(&read, scenario).unwrap();
            for row in &table.rows {
                let wanted = run.next().unwrap().unwrap();
                let own = [wanted.time, wanted.puck, wanted.puck_velocity, wanted.measured, wanted.measured_velocity];
                let efforts = [wanted.torque, wanted.command, wanted.applied];
                let bodies = wanted.bodies.iter().flat_map(|&(w, v)| [w, v]);
                let wanted: Vec<u64> = own.into_iter().chain(efforts).chain(bodies).map(f64::to_bits).collect();
                let given: Vec<u64> = row.iter().take(wanted.len()).map(|x| x.to_bits()).collect();
                assert_eq!(given, wanted, "{}", world.display());
            }
        }
    }
}

#[test]
fn every_world_that_comes_along_is_checked_and_held_only_forward_euler_alone_is_unstable() {
    for world in every_world() {
        let unstable = world.ends_with("notes/euler.toml");
        let words = hapt(Path::new("."), ["check".as_ref(), world.as_os_str(), "--why".as_ref()]);
        let numbers = hapt(Path::new("."), ["check".as_ref(), world.as_os_str(), "--json".as_ref()]);
        let json: Value = serde_json::from_str(&numbers.out).unwrap();
        let certified = json["certified"].as_bool().unwrap();
        for ended in [&words, &numbers] {
            assert_eq!(ended.code, Some(i32::from(!certified)), "{}: {ended:?}", world.display());
            assert_eq!(ended.err, "", "{}", world.display());
        }
        assert_eq!(words.out.starts_with("Certified: "), certified, "{}", words.out);
        assert_eq!(words.out.contains("\nmargins "), certified, "{}", words.out);
        let verdict = json["held"]["verdict"].as_str().unwrap();
        assert_eq!(verdict == "unstable", unstable, "{}", world.display());
        let sentence = words.out.lines().find_map(|line| line.strip_prefix("held ")).unwrap().trim();
        assert!(sentence.starts_with(&format!("{verdict}: ")), "{sentence}");
        for note in json["notes"].as_array().unwrap() {
            assert!(words.out.contains(note.as_str().unwrap()), "{note} is not in {}", words.out);
        }
    }
}

/// No answer on a loop that grows hands-off under times that its file allows calls it safe hands-off, for any verdict at even samples.
#[test]
fn what_grows_at_a_late_sample_is_not_called_safe_to_let_go() {
    let at = folder(&[(
        "late.toml",
        "[loop]\nperiod = \"1 ms\"\ninterval_max = \"2.5 ms\"\n[device]\ninertia = 6.4e-4\ndamping = 1.2e-3\n\
         [[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = 2\n",
    )]);
    for (damping, safe) in [("1.2e-3", "not safe to let go"), ("2.6e-3", "safe to let go")] {
        let set = format!("device.damping={damping}");
        let ended = hapt(at.path(), ["check", "late.toml", "--set", &set]);
        let parts: Vec<&str> = ended.out.lines().next().unwrap().split([':', ';']).map(str::trim).collect();
        assert!(parts.contains(&safe), "{}", ended.out);
    }
}

/// The first lines can be read aloud: there are few of them, and they have every number that matters for all built-in worlds.
#[test]
fn a_check_begins_with_its_answer_and_a_line_each_for_held_free_and_passive() {
    for world in every_world() {
        let shown = hapt(Path::new("."), ["check".as_ref(), world.as_os_str(), "--no-remedies".as_ref()]).out;
        let json: Value = serde_json::from_str(
            &hapt(Path::new("."), ["check".as_ref(), world.as_os_str(), "--no-remedies".as_ref(), "--json".as_ref()])
                .out,
        )
        .unwrap();
        let first = shown.lines().next().unwrap();
        let grows = json["free"]["verdict"] == "unstable" || json["uneven"]["free"]["verdict"] == "broken";
        assert_eq!(first.starts_with("Certified: "), json["certified"] == true, "{shown}");
        assert!(
            !grows || first.contains("not safe to let go") || first.contains("as long as its speed is kept"),
            "{shown}"
        );
        assert_eq!(
            first.contains("; safe in any passive hand"),
            json["passivity"]["passive"] == true && json["uneven"]["passive"] == true,
            "{shown}"
        );
        let mut omitted: Vec<&str> =
            first.split("; not proved: ").nth(1).map_or(Vec::new(), |all| all.split(", ").collect());
        let count = omitted.len();
        omitted.sort_unstable();
        omitted.dedup();
        assert_eq!(omitted.len(), count, "{first}");
        let rows: Vec<&str> = shown.lines().skip(2).map(|line| line.split(' ').next().unwrap()).collect();
        assert!(rows.starts_with(&["world", "held", "free", "passive"]) && rows.len() <= 6, "{shown}");
        let share = json["passivity"]["required_damping"].as_f64().zip(json["passivity"]["device_damping"].as_f64());
        if let Some((required, device)) =
            share.filter(|(required, device)| required <= device && json["certified"] == true && *required > 0.0)
        {
            let line = shown.lines().find(|line| line.starts_with("passive ")).unwrap();
            let percent: f64 = line.split_once("with ").unwrap().1.split(' ').next().unwrap().parse().unwrap();
            assert!((percent / (100.0 * required / device) - 1.0).abs() < 1e-3, "{line}");
        }
    }
}

#[test]
fn an_override_is_the_same_as_an_edited_file() {
    let plain = csv(WHEEL, &[]);
    for (line, edited, set) in [
        ("period = \"1 ms\"", "period = \"2 ms\"", "loop.period=2ms"),
        ("period = \"1 ms\"", "period = \"1 ms\"\nmethod = \"rk4\"", "loop.method=rk4"),
        ("period = \"1 ms\"", "period = \"1 ms\"\ndelay = 0.0015", "loop.delay=0.0015"),
        ("limit = \"822.25 N mm\"", "limit = \"0.5 N m\"", "device.limit=0.5 N m"),
        ("limit = \"822.25 N mm\"", "limit = \"822.25 N mm\"\nencoder = 400", "device.encoder=400"),
        ("0.02580123 kg m^2", "0.03 kg m^2", "bodies.wheel.inertia=0.03 kg m^2"),
        ("1.018592 N m/rad", "2 N m/rad", "couplings.0.stiffness=2 N m/rad"),
        ("duration = \"0.5 s\"", "duration = 0.7", "scenarios.step.duration=0.7"),
        ("to = \"45 deg\"", "to = \"-30 deg\"", "scenarios.step.hand.to=-30 deg"),
        ("to = \"45 deg\"", "to = \"45 deg\", at = \"0.1 s\"", "scenarios.step.hand.at=0.1 s"),
    ] {
        assert_eq!(WHEEL.matches(line).count(), 1, "{line}");
        let by_hand = csv(&WHEEL.replace(line, edited), &[]);
        let by_set = csv(WHEEL, &["--set", set]);
        assert!(by_hand == by_set, "{set}");
        assert!(by_set != plain, "{set} changes nothing");
    }
}

#[test]
fn overrides_add_up_and_the_last_of_a_key_wins() {
    let edited = WHEEL.replace("1 ms", "2 ms").replace("45 deg", "30 deg");
    let sets = ["loop.period=5ms", "scenarios.step.hand.to=30deg", "loop.period=2ms"];
    let args: Vec<&str> = sets.iter().flat_map(|set| ["--set", set]).collect();
    assert!(csv(WHEEL, &args) == csv(&edited, &[]));
}

/// The bytes of step.csv.
fn csv(world: &str, args: &[&str]) -> Vec<u8> {
    let at = folder(&[("w.toml", world)]);
    hapt(at.path(), ["sim", "w.toml", "--out", "out"].iter().chain(args)).done();
    fs::read(at.path().join("out/step.csv")).unwrap()
}

#[test]
fn a_world_from_standard_input_is_the_world_from_a_file() {
    let path = WHEEL.replace("kind = \"step\", to = \"45 deg\"", "kind = \"path\", file = \"moves/way.csv\"");
    let at = folder(&[("w.toml", &path)]);
    fs::create_dir(at.path().join("moves")).unwrap();
    fs::write(at.path().join("moves/way.csv"), "time_s,puck_deg\n0,0\n0.1,30\n0.3,-10\n").unwrap();
    hapt(at.path(), ["sim", "w.toml", "--out", "file"]).done();
    hapt_reads(at.path(), &path, ["sim", "-", "--out", "stdin"]).done();
    let read = |folder: &str| fs::read(at.path().join(folder).join("step.csv")).unwrap();
    assert!(read("file") == read("stdin"));
    let puck = Table::read(&at.path().join("file/step.csv")).column("puck_rad");
    near(puck[100], PI / 6.0, 1e-12);

    for args in [["sim", "-", "--set=title=x"], ["check", "-", "--json"]] {
        let from_file: Vec<&str> = args.iter().map(|&arg| if arg == "-" { "w.toml" } else { arg }).collect();
        let (input, file) = (hapt_reads(at.path(), &path, args).done(), hapt(at.path(), from_file).done());
        assert_eq!((input.out, input.err), (file.out, file.err));
    }

    // From another folder, the file still finds the path next to it, and standard input does not.
    let (elsewhere, world) = (folder(&[]), at.path().join("w.toml"));
    hapt(elsewhere.path(), ["check".as_ref(), world.as_os_str()]).done();
    hapt_reads(elsewhere.path(), &path, ["check", "-"])
        .refused(2, &["scenarios.step.hand.file: ", "moves/way.csv", " --> <stdin>:21:"]);
}

#[test]
fn the_scenarios_named_are_the_ones_that_run() {
    let world = shipped("notes/pumped-and-damped.toml");
    for (named, files) in [
        (&[][..], &["damp.csv", "pump.csv"][..]),
        (&["pump"], &["pump.csv"]),
        (&["damp", "pump"], &["damp.csv", "pump.csv"]),
        (&["damp", "damp"], &["damp.csv"]),
    ] {
        let at = folder(&[]);
        let mut args = vec!["sim", &world, "--out", "."];
        args.extend(named.iter().flat_map(|name| ["--scenario", name]));
        hapt(at.path(), args).done();
        assert_eq!(names(at.path()), files);
    }
    let ended = hapt(Path::new("."), ["sim", &world, "--scenario", "damp"]).done();
    assert!(ended.out.contains("\nscenario damp: ") && !ended.out.contains("scenario pump"), "{}", ended.out);
}

#[test]
fn the_same_command_writes_the_same_bytes() {
    for world in ["notes/released.toml", "devices/eth-wall.toml"] {
        let (world, at) = (shipped(world), folder(&[]));
        hapt(at.path(), ["sim", &world, "--out", "one"]).done();
        hapt(at.path(), ["sim", &world, "--out", "two", "--format", "csv"]).done();
        for name in names(&at.path().join("one")) {
            let read = |folder: &str| fs::read(at.path().join(folder).join(&name)).unwrap();
            assert!(read("one") == read("two"), "{name}");
        }
    }
}

#[test]
fn a_run_takes_the_place_of_the_one_before() {
    let at = folder(&[("w.toml", WHEEL)]);
    hapt(at.path(), ["sim", "w.toml", "--out", "."]).done();
    hapt(at.path(), ["sim", "w.toml", "--out", ".", "--set", "scenarios.step.duration=10ms"]).done();
    assert_eq!(Table::read(&at.path().join("step.csv")).rows.len(), 11);
    assert_eq!(names(at.path()), ["step.csv", "w.toml"]);
}

#[test]
fn design_gives_the_notes_numbers_and_the_closed_forms_of_others() {
    let notes = designed(&["45 deg", "800 N mm", "1 Hz"], &[]);
    for (key, printed, relative) in [
        ("stiffness", 1.018592, 1e-6),
        ("inertia", 0.02580123, 1e-7),
        ("compensating_damping", 1.018592e-3, 1e-6),
        ("natural_frequency_hz", 1.0, 0.0),
        ("peak_torque", 0.8, 1e-15),
    ] {
        near(notes[key].as_f64().unwrap(), printed, relative);
    }
    for (given, period, travel, torque, frequency, seconds) in [
        (["30 deg", "0.5 N m", "2 Hz"], Some("0.5 ms"), PI / 6.0, 0.5, 2.0, 5e-4),
        (["1.5", "2", "3"], None, 1.5, 2.0, 3.0, 1e-3),
        (["0.25 rev", "70 mN m", "0.01 kHz"], Some("200 us"), PI / 2.0, 0.07, 10.0, 2e-4),
    ] {
        let json = designed(&given, &period.map_or(vec![], |period| vec!["--period", period]));
        let number = |key: &str| json[key].as_f64().unwrap();
        let stiffness = torque / travel;
        near(number("stiffness"), stiffness, 1e-14);
        near(number("inertia"), stiffness / (TAU * frequency).powi(2), 1e-14);
        near(number("compensating_damping"), stiffness * seconds, 1e-14);
        near(number("natural_frequency_hz"), frequency, 1e-14);
        near(number("peak_torque"), torque, 1e-14);
    }
}

fn specification<'a>([travel, torque, frequency]: &[&'a str; 3]) -> Vec<&'a str> {
    vec!["design", "--travel", travel, "--torque", torque, "--frequency", frequency]
}

fn designed(given: &[&str; 3], more: &[&str]) -> Value {
    let args = specification(given).into_iter().chain(["--json"]).chain(more.iter().copied());
    let ended = hapt(Path::new("."), args).done();
    assert_eq!(ended.err, "");
    let json: Value = serde_json::from_str(&ended.out).unwrap();
    let mut keys: Vec<&String> = json.as_object().unwrap().keys().collect();
    keys.sort();
    assert_eq!(keys, ["compensating_damping", "inertia", "natural_frequency_hz", "peak_torque", "stiffness"]);
    json
}

#[test]
fn what_design_prints_is_a_world_that_asks_for_the_torque_of_the_specification() {
    for (given, period, travel, torque, seconds) in [
        (["45 deg", "800 N mm", "1 Hz"], "1 ms", PI / 4.0, 0.8, 1e-3),
        (["30 deg", "0.5 N m", "2 Hz"], "0.5 ms", PI / 6.0, 0.5, 5e-4),
        (["0.1 rev", "0.7", "0.5"], "0.002", 0.1 * TAU, 0.7, 2e-3),
    ] {
        let printed = hapt(Path::new("."), specification(&given).into_iter().chain(["--period", period])).done();
        assert!(printed.err.lines().all(|line| line.contains("has no unit and is taken as")), "{}", printed.err);
        let at = folder(&[]);
        hapt_reads(at.path(), &printed.out, ["sim", "-", "--out", "."]).done();
        let table = Table::read(&at.path().join("step.csv"));
        let peak = table.column("torque_Nm").into_iter().fold(0.0, |peak: f64, x| peak.max(x.abs()));
        // Michigan's encoder resolves the travel to half a count: 45 deg are 500 counts.
        let count = TAU / 4000.0;
        let inexact = (travel / count - (travel / count).round()).abs() * count / travel;
        near(peak, torque, 1e-4 + inexact);
        near(table.column("puck_rad")[1], travel, 1e-14);
        near(table.column("time_s")[1], seconds, 1e-15);

        let json = hapt_reads(at.path(), &printed.out, ["check", "-", "--json"]);
        // Torque from the start of the step, and a swing that nothing damps: never passive.
        assert_eq!(json.code, Some(1), "{json:?}");
        let json: Value = serde_json::from_str(&json.out).unwrap();
        assert_eq!((&json["method"], &json["output"]), (&"forward-euler".into(), &"start".into()));
        assert_eq!(json["held"]["verdict"], "marginal");
        // And the device is Michigan's.
        let world = World::read(&Source::from_text("-", printed.out), &[]).unwrap();
        let notes = World::read(&Source::open(worlds().join("notes/damped.toml")).unwrap(), &[]).unwrap();
        assert_eq!(hapt_model::Device { encoder: None, ..world.device }, notes.device);
    }
}

#[test]
fn design_warns_where_its_damper_no_longer_balances_and_prints_the_world_all_the_same() {
    let ended = hapt(Path::new("."), specification(&["45 deg", "800 N mm", "400 Hz"])).done();
    assert!(ended.err.starts_with("hapt: ") && ended.err.lines().count() == 1, "{}", ended.err);
    hapt_reads(Path::new("."), &ended.out, ["check", "-"]);
    assert!(World::read(&Source::from_text("-", ended.out), &[]).is_ok());
}

#[test]
fn a_world_without_a_title_goes_by_its_files_name() {
    let at = folder(&[("w.toml", &WHEEL.replace("title = \"wheel\"\n", ""))]);
    assert!(hapt(at.path(), ["sim", "w.toml"]).done().out.starts_with("w.toml\n"));
    assert!(hapt(at.path(), ["check", "w.toml"]).done().out.contains("\nworld     w.toml: zoh at"));
    assert_eq!(simulated(WHEEL, &[]).rows.len(), 501);
}
