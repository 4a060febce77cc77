//! Bad usage and bad input: exit code 2, one message that names the key and the place, and nothing done.

use std::fs;
use std::path::Path;

use crate::common::{Ended, WHEEL, folder, hapt, hapt_reads, names, shipped};

/// A world with a row of every sort, each key on a line of its own.
const EVERYTHING: &str = r#"[loop]
period = "1 ms"
estimator = "low-pass"
cutoff = "50 Hz"
window = 8
delay = "0 ms"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
friction = "5 N mm"
limit = "0.8 N m"
encoder = 4000
levels = 2048
[bodies.wheel]
inertia = "0.03 kg m^2"
position = "1 deg"
[[couplings]]
kind = "spring"
between = ["puck", "wheel"]
stiffness = "1 N m/rad"
[[couplings]]
kind = "damper"
between = ["wheel", "ground"]
damping = "0.1 N m s/rad"
[[couplings]]
kind = "detent"
between = ["puck", "ground"]
pitch = "15 deg"
torque = "8 N mm"
[[couplings]]
kind = "friction"
between = ["puck", "ground"]
coulomb = 0.1
stribeck = 0.2
stribeck_velocity = "0.1 rad/s"
bristle_stiffness = 100
bristle_damping = 1
viscous = 0
[scenarios.turn]
duration = "0.1 s"
[scenarios.turn.hand]
kind = "sine"
amplitude = "5 deg"
frequency = "1 Hz"
release = "0.05 s"
[scenarios.lead]
duration = "0.1 s"
[scenarios.lead.hand]
kind = "ramp"
to = "5 deg"
over = "0.05 s"
"#;

/// Every key that must be positive, and its value in [`EVERYTHING`].
const POSITIVE: [(&str, &str); 13] = [
    ("loop.period", "\"1 ms\""),
    ("loop.cutoff", "\"50 Hz\""),
    ("loop.window", "8"),
    ("device.inertia", "\"6.4e-4 kg m^2\""),
    ("device.limit", "\"0.8 N m\""),
    ("device.encoder", "4000"),
    ("device.levels", "2048"),
    ("bodies.wheel.inertia", "\"0.03 kg m^2\""),
    ("couplings.2.pitch", "\"15 deg\""),
    ("couplings.3.stribeck_velocity", "\"0.1 rad/s\""),
    ("scenarios.turn.duration", "\"0.1 s\""),
    ("scenarios.turn.hand.frequency", "\"1 Hz\""),
    ("scenarios.lead.hand.over", "\"0.05 s\""),
];

/// Runs a world that is refused with these words, by both commands, and checks that nothing was written.
#[track_caller]
fn refused(world: &str, args: &[&str], words: &[&str]) -> Ended {
    let at = folder(&[("w.toml", world)]);
    hapt(at.path(), ["check", "w.toml"].iter().chain(args)).refused(2, words);
    let ended = hapt(at.path(), ["sim", "w.toml", "--out", "out"].iter().chain(args)).refused(2, words);
    assert_eq!(names(at.path()), ["w.toml"]);
    ended
}

/// The same for an override of the wheel.
#[track_caller]
fn set_refused(set: &str, words: &[&str]) {
    let at = format!(" --> --set:1:{}", set.find('=').map_or(0, |at| at + 2));
    refused(WHEEL, &["--set", set], &[words, &[&at]].concat());
}

#[test]
fn the_world_that_everything_is_tried_on_is_fine() {
    let at = folder(&[("w.toml", EVERYTHING)]);
    hapt(at.path(), ["sim", "w.toml"]).done();
    let checked = hapt(at.path(), ["check", "w.toml"]);
    assert!(matches!(checked.code, Some(0 | 1)), "{checked:?}");
}

#[test]
fn what_must_be_positive_is_refused_when_it_is_not() {
    for (key, value) in POSITIVE {
        let line = format!("{} = {value}\n", key.rsplit('.').next().unwrap());
        let (above, _) = EVERYTHING.split_once(&line).unwrap_or_else(|| panic!("{line}"));
        // The first of equal lines; the others are the keys of another table.
        let number = above.lines().count() + 1;
        for bad in ["0", "-1", "nan", "inf", "-inf", "1e400"] {
            let edited = EVERYTHING.replacen(&line, &line.replace(value, bad), 1);
            let at = folder(&[("w.toml", &edited)]);
            let words = [format!("hapt: {key}: "), format!("w.toml:{number}:")];
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            hapt(at.path(), ["sim", "w.toml", "--out", "out"]).refused(2, &words);

            let set = format!("{key}={bad}");
            let words = [format!("hapt: {key}: "), format!("--set:1:{}", key.len() + 2)];
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            fs::write(at.path().join("w.toml"), EVERYTHING).unwrap();
            hapt(at.path(), ["sim", "w.toml", "--out", "out", "--set", &set]).refused(2, &words);
            assert_eq!(names(at.path()), ["w.toml"]);
        }
    }
}

#[test]
fn quantities_that_are_no_finite_numbers_above_zero_are_refused_with_their_units() {
    for bad in ["0 ms", "-1 ms", "nan ms", "inf s", "1e400 s", "ms", "", "1 ms 2", "--1 ms"] {
        set_refused(&format!("loop.period=\"{bad}\""), &["hapt: loop.period: ", "a time (s)"]);
    }
    for (set, words) in [
        ("couplings.0.stiffness=-1", "is negative"),
        ("device.damping=-1e-9", "is negative"),
        ("device.friction=-0.1 N m", "is negative"),
        ("loop.delay=-1 us", "is negative"),
        ("couplings.0.rest=nan", "finite"),
        ("bodies.wheel.velocity=inf", "finite"),
        ("scenarios.step.hand.to=-inf", "finite"),
        ("scenarios.step.hand.at=-1 s", "is negative"),
        ("device.levels=7", "odd"),
        ("device.encoder=4000.5", "whole number"),
        ("loop.window=257", "out of range"),
        ("loop.window=1e300", "out of range"),
    ] {
        set_refused(set, &[set.split('=').next().unwrap(), words]);
    }
}

#[test]
fn zero_is_fine_where_nothing_may_be() {
    for set in ["couplings.0.stiffness=0", "device.damping=0", "device.friction=0 N m", "loop.delay=0", "loop.delay=-0"]
    {
        let checked = hapt_reads(Path::new("."), WHEEL, ["check", "-", "--set", set]);
        assert!(matches!(checked.code, Some(0 | 1)), "{set}: {checked:?}");
    }
}

#[test]
fn a_quantity_of_the_wrong_dimension_names_both() {
    for (set, given, wanted) in [
        ("loop.period=\"1 kg\"", "a mass (kg)", "a time (s)"),
        ("device.inertia=\"1 kg\"", "a mass (kg)", "an inertia"),
        ("couplings.0.stiffness=\"1 N m\"", "a torque", "N m/rad"),
        ("device.limit=\"1 N m/rad\"", "N m/rad", "a torque"),
        ("scenarios.step.hand.to=\"5 mm\"", "a length (m)", "an angle (rad)"),
        ("scenarios.step.duration=\"10 Hz\"", "a frequency", "a time (s)"),
    ] {
        set_refused(set, &[set.split('=').next().unwrap(), given, wanted]);
    }
}

#[test]
fn a_misspelt_word_is_met_with_the_nearest_right_one() {
    for (line, edited, words) in [
        ("period = \"1 ms\"", "period = \"1 msec\"", ["loop.period", "\"msec\"", "w.toml:4:10"]),
        ("period = \"1 ms\"", "perod = \"1 ms\"", ["loop.perod", "did you mean \"period\"?", "w.toml:4:1"]),
        ("[device]", "[devise]", ["devise", "did you mean \"device\"?", "w.toml:6:2"]),
        ("period = ", "method = \"trapezodial\"\nperiod = ", ["loop.method", "\"trapezoidal\"", "w.toml:4:10"]),
        ("kind = \"spring\"", "kind = \"sprig\"", ["couplings.0.kind", "\"spring\"", "w.toml:15:8"]),
        ("\"wheel\"]", "\"whel\"]", ["couplings.0.between", "did you mean \"wheel\"?", "w.toml:16:20"]),
        ("stiffness = ", "damping = ", ["couplings.0.damping", "\"spring\" takes", "w.toml:17:1"]),
        ("to = ", "amplitude = ", ["scenarios.step.hand.amplitude", "\"step\" takes", "w.toml:21:25"]),
    ] {
        assert!(WHEEL.contains(line));
        refused(&WHEEL.replacen(line, edited, 1), &[], &words);
    }
    refused(WHEEL, &["--set", "bodies.whel.inertia=1"], &["bodies.whel", "did you mean \"wheel\"?", "--set:1:8"]);
    refused(WHEEL, &["--set", "couplings.1.rest=1"], &["couplings.1", "--set:1:11"]);
    refused(WHEEL, &["--set", "loop.period"], &["KEY=VALUE", "--set:1:1"]);
    refused(WHEEL, &["--set", ""], &["KEY=VALUE", "--set:1:1"]);
}

#[test]
fn what_is_missing_is_named() {
    for (line, key) in [
        ("period = \"1 ms\"\n", "loop.period"),
        ("inertia = \"6.4e-4 kg m^2\"\n", "device.inertia"),
        ("inertia = \"0.02580123 kg m^2\"\n", "bodies.wheel.inertia"),
        ("stiffness = \"1.018592 N m/rad\"\n", "couplings.0.stiffness"),
        ("kind = \"spring\"\n", "couplings.0.kind"),
        ("duration = \"0.5 s\"\n", "scenarios.step.duration"),
        (", to = \"45 deg\"", "scenarios.step.hand.to"),
    ] {
        assert!(WHEEL.contains(line));
        refused(&WHEEL.replacen(line, "", 1), &[], &[&format!("hapt: {key}: missing"), " --> w.toml:"]);
    }
}

#[test]
fn keys_that_do_not_go_together_are_refused() {
    let compensating =
        "[[couplings]]\nkind = \"damper\"\nbetween = [\"puck\", \"ground\"]\ndamping = \"compensating\"\n";
    for (world, args, words) in [
        (WHEEL.to_string(), &["--set", "loop.estimator=low-pass"][..], &["loop.cutoff", "missing"][..]),
        (
            WHEEL.replace("limit = \"822.25 N mm\"\n", ""),
            &["--set", "device.levels=8"],
            &["device.levels", "device.limit"],
        ),
        (WHEEL.to_string(), &["--set", "loop.output=start", "--set", "loop.advance=1"], &["loop.advance", "\"end\""]),
        (
            WHEEL.to_string(),
            &["--set", "loop.method=tustin", "--set", "loop.output=end"],
            &["loop.output", "\"start\""],
        ),
        (
            WHEEL.to_string(),
            &["--set", "loop.method=foh", "--set", "loop.output=middle"],
            &["loop.output", "\"start\""],
        ),
        (WHEEL.to_string(), &["--set", "loop.delay=1001 s"], &["loop.delay", "million"]),
        (format!("{WHEEL}{compensating}"), &[], &["couplings.1.damping", "spring"]),
        (WHEEL.replace("[\"puck\", \"wheel\"]", "[\"wheel\", \"wheel\"]"), &[], &["couplings.0.between"]),
        (WHEEL.replace("wheel]", "measured]"), &[], &["bodies", "\"measured\" cannot name a body"]),
        (WHEEL.replace("scenarios.step", "scenarios.\"a/b\""), &[], &["scenarios", "\"a/b\" cannot name a scenario"]),
        (WHEEL.replace("scenarios.step", "scenarios.\"..\""), &[], &["scenarios", "\"..\" cannot name a scenario"]),
        (format!("{WHEEL}{}", compensating.repeat(64)), &[], &["couplings", "the limit is 64"]),
    ] {
        refused(&world, args, words);
    }
}

#[test]
fn a_nonlinear_coupling_at_a_body_names_the_methods_that_take_it() {
    let detent = "[[couplings]]\nkind = \"detent\"\nbetween = [\"wheel\", \"ground\"]\ntorque = 0.1\npitch = 0.1\n";
    let lugre = "[[couplings]]\nkind = \"friction\"\nbetween = [\"wheel\", \"ground\"]\ncoulomb = 1\nstribeck = 1\n\
                 stribeck_velocity = 1\nbristle_stiffness = 1\nbristle_damping = 1\nviscous = 1\n";
    let (detent, lugre) = (format!("{WHEEL}{detent}"), format!("{WHEEL}{lugre}"));
    for (world, method) in [(&detent, "tustin"), (&detent, "foh"), (&lugre, "zoh"), (&lugre, "tustin")] {
        let words = ["hapt: couplings.1.kind: ", "at a body", method, "\"rk4\"", "w.toml:23:8"];
        refused(world, &["--set", &format!("loop.method={method}")], &words);
    }
    for method in ["forward-euler", "semi-implicit-euler", "rk4"] {
        for world in [&detent, &lugre] {
            hapt_reads(Path::new("."), world, ["sim", "-", "--set", &format!("loop.method={method}")]).done();
        }
    }
    for method in ["zoh", "trapezoidal", "backward-euler"] {
        hapt_reads(Path::new("."), &detent, ["sim", "-", "--set", &format!("loop.method={method}")]).done();
    }
}

#[test]
fn a_world_beyond_the_range_of_numbers_is_refused_before_anything_is_written() {
    let at = folder(&[("w.toml", WHEEL)]);
    let sets = ["--set", "loop.method=rk4", "--set", "bodies.wheel.inertia=1e-200"];
    for args in [&["sim", "w.toml", "--out", "out"][..], &["sim", "w.toml"], &["check", "w.toml"]] {
        hapt(at.path(), args.iter().chain(&sets)).refused(2, &[]);
    }
    assert_eq!(names(at.path()), ["w.toml"]);
}

#[test]
fn a_scenario_of_more_than_ten_thousand_million_samples_is_refused_wherever_it_goes() {
    for duration in ["10000000 s", "1e29"] {
        let args = ["--set".to_string(), format!("scenarios.step.duration={duration}")];
        refused(WHEEL, &[&args[0], &args[1]], &["hapt: scenarios.step.duration: ", "1e10", "--set:1:25"]);
    }
    let short = ["--set", "loop.period=1 ps"];
    refused(
        &WHEEL.replace("0.5 s", "20 s"),
        &["--set", "loop.period=1e-9"],
        &["scenarios.step.duration", "w.toml:20:12"],
    );
    refused(WHEEL, &short, &["loop.period", "\"ps\""]);
    // One scenario less does not change a check.
    hapt_reads(Path::new("."), WHEEL, ["check", "-", "--set", "scenarios.step.duration=9999999 s"]).done();
}

#[test]
fn a_world_that_cannot_be_read_is_named() {
    let at = folder(&[("text.toml", "[loop\nperiod = 1"), ("big.toml", &"#".repeat((1 << 20) + 1))]);
    fs::write(at.path().join("bytes.toml"), b"title = \"\xff\"\n").unwrap();
    fs::create_dir(at.path().join("folder")).unwrap();
    for (world, words) in [
        ("missing.toml", &["cannot read missing.toml"][..]),
        ("folder", &["folder"]),
        ("big.toml", &["big.toml", "1 MiB"]),
        ("bytes.toml", &["UTF-8", "bytes.toml:1:10"]),
        ("text.toml", &["TOML", "text.toml:1:"]),
    ] {
        hapt(at.path(), ["check", world]).refused(2, words);
        hapt(at.path(), ["sim", world, "--out", "out"]).refused(2, words);
        assert!(!at.path().join("out").exists());
    }
    hapt_reads(at.path(), "", ["sim", "-"]).refused(2, &["loop.period: missing", "<stdin>:1:1"]);
    for nested in ["[".repeat(200_000), "{a=".repeat(200_000), "a.".repeat(200_000)] {
        hapt_reads(at.path(), &format!("a = {nested}"), ["check", "-"]).refused(2, &["TOML", "<stdin>:1:"]);
    }
}

#[test]
fn a_world_without_scenarios_is_checked_and_cannot_be_run() {
    let world = WHEEL.split("[scenarios").next().unwrap();
    let at = folder(&[("w.toml", world)]);
    hapt(at.path(), ["check", "w.toml"]).done();
    hapt(at.path(), ["sim", "w.toml", "--out", "out"]).refused(2, &["no scenario"]);
    assert_eq!(names(at.path()), ["w.toml"]);
}

#[test]
fn an_unknown_scenario_is_met_with_the_nearest_name() {
    let (world, at) = (shipped("notes/pumped-and-damped.toml"), folder(&[]));
    for (args, words) in [
        (&["--scenario", "pmup"][..], ["\"pmup\"", "did you mean \"pump\"?"]),
        (&["--scenario", "damp", "--scenario", "dump"], ["\"dump\"", "did you mean"]),
        (&["--scenario", "x"], ["\"damp\"", "\"pump\""]),
        (&["--scenario", ""], ["\"damp\"", "\"pump\""]),
    ] {
        hapt(at.path(), ["sim", &world, "--out", "out"].iter().chain(args)).refused(2, &words);
        hapt(at.path(), ["sim", &world].iter().chain(args)).refused(2, &words);
    }
    assert_eq!(names(at.path()), [""; 0]);
}

#[test]
fn an_out_that_names_a_file_is_refused_and_the_file_stays() {
    let at = folder(&[("w.toml", WHEEL), ("file", "mine")]);
    hapt(at.path(), ["sim", "w.toml", "--out", "file"]).refused(2, &["--out file", "expected a folder"]);
    hapt(at.path(), ["sim", "w.toml", "--out", "file/below/it"]).refused(2, &["--out file", "expected a folder"]);
    assert_eq!(fs::read_to_string(at.path().join("file")).unwrap(), "mine");
    assert_eq!(names(at.path()), ["file", "w.toml"]);
}

#[test]
fn usage_that_is_wrong_is_said_and_nothing_is_done() {
    let at = folder(&[("w.toml", WHEEL)]);
    for (args, words) in [
        (&["frobnicate"][..], &["frobnicate"][..]),
        (&["sim"], &["<WORLD>"]),
        (&["check"], &["<WORLD>"]),
        (&["sim", "w.toml", "--out"], &["--out"]),
        (&["sim", "w.toml", "--out", ""], &["--out"]),
        (&["sim", "w.toml", "--bogus", "--out", "out"], &["--bogus"]),
        (&["sim", "w.toml", "--out", "out", "--json"], &["--json"]),
        (&["check", "w.toml", "--out", "out"], &["--out"]),
        (&["check", "w.toml", "w.toml"], &["w.toml"]),
        (&["sim", "w.toml", "--out", "out", "--format", "mcpa"], &["mcpa", "--format", "csv"]),
        (&["sim", "w.toml", "--set"], &["--set"]),
        (&["design", "--travel", "45 deg"], &["--torque", "--frequency"]),
    ] {
        hapt(at.path(), args).refused(2, words);
    }
    assert_eq!(names(at.path()), ["w.toml"]);
}

#[cfg(unix)]
#[test]
fn arguments_that_are_not_text_are_refused() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;

    let bytes = OsStr::from_bytes(b"loop.period=\xff");
    hapt(Path::new("."), ["check".as_ref(), "w.toml".as_ref(), "--set".as_ref(), bytes]).refused(2, &["UTF-8"]);
    hapt(Path::new("."), ["check".as_ref(), bytes]).refused(2, &["cannot read"]);
}

#[test]
fn a_specification_that_makes_no_wheel_is_refused() {
    let good = [("--travel", "45 deg"), ("--torque", "800 N mm"), ("--frequency", "1 Hz"), ("--period", "1 ms")];
    let design = |bad: Option<(&str, &str)>| {
        let args = good.iter().map(|&(flag, value)| {
            let value = bad.filter(|(other, _)| *other == flag).map_or(value, |(_, value)| value);
            format!("{flag}={value}")
        });
        hapt(Path::new("."), std::iter::once("design".to_string()).chain(args))
    };
    design(None).done();
    for (flag, _) in good {
        for value in ["0", "-1", "nan", "inf", "1e400", "", "1 kg", "1 furlong", "45 N deg s"] {
            design(Some((flag, value))).refused(2, &[flag]);
        }
    }
    // Each is valid by itself; together they leave double precision.
    design(Some(("--travel", "1e-320"))).refused(2, &["stiffness"]);
    design(Some(("--frequency", "1e200"))).refused(2, &["inertia"]);
}

/// A world whose hand follows this file.
fn following(file: &str) -> String {
    WHEEL.replace("kind = \"step\", to = \"45 deg\"", &format!("kind = \"path\", file = '{file}'"))
}

#[test]
fn a_path_stays_beside_its_world() {
    let at = folder(&[("secret.csv", "time_s,puck_deg\n0,0\n")]);
    let worlds = at.path().join("worlds");
    fs::create_dir(&worlds).unwrap();
    let absolute = worlds.join("way.csv").display().to_string();
    let outside = at.path().join("secret.csv").display().to_string();
    for (file, word) in [
        ("../secret.csv", "leads out"),
        ("below/../../secret.csv", "leads out"),
        (&outside, "leads out"),
        ("missing.csv", "cannot read"),
        ("", "is not a file"),
        (".", "is not a file"),
    ] {
        fs::write(&absolute, "time_s,puck_deg\n0,0\n").unwrap();
        fs::write(worlds.join("w.toml"), following(file)).unwrap();
        let words = ["hapt: scenarios.step.hand.file: ", word, "w.toml:21:"];
        for from in [at.path().join("worlds/w.toml"), "worlds/w.toml".into()] {
            hapt(at.path(), ["check".as_ref(), from.as_os_str()]).refused(2, &words);
            hapt(at.path(), ["sim".as_ref(), from.as_os_str(), "--out".as_ref(), "out".as_ref()]).refused(2, &words);
        }
        hapt_reads(&worlds, &following(file), ["sim", "-", "--out", "out"]).refused(2, &words[..2]);
    }
    assert_eq!(names(at.path()), ["secret.csv", "worlds"]);
    assert_eq!(names(&worlds), ["w.toml", "way.csv"]);
    // A path from the root is fine where it lies in the folder.
    fs::write(worlds.join("w.toml"), following(&absolute)).unwrap();
    hapt(at.path(), ["sim", "worlds/w.toml"]).done();
    hapt_reads(&worlds, &following(&absolute), ["sim", "-"]).done();
}

#[test]
fn a_path_that_is_no_path_is_shown_where_it_is_wrong() {
    for (text, words) in [
        ("", ["time_s,puck_deg", "way.csv:1:1"]),
        ("0,1\n1,2\n", ["time_s,puck_deg", "way.csv:1:1"]),
        ("time_s,puck_deg\n", ["at least one point", "way.csv:2:1"]),
        ("time_s,puck_mm\n0,0\n", ["an angle (rad)", "way.csv:1:1"]),
        ("time_s,torque_Nm\n0,0\n", ["time_s,puck_deg", "way.csv:1:1"]),
        ("time_s,puck_deg\n0,0\n1\n", ["two columns", "way.csv:3:1"]),
        ("time_s,puck_deg\n0,0\n1,2,3\n", ["two columns", "way.csv:3:1"]),
        ("time_s,puck_deg\n0,0\n1, x\n", ["\"x\"", "way.csv:3:4"]),
        ("time_s,puck_deg\n0,0\n1,nan\n", ["\"nan\"", "way.csv:3:3"]),
        ("time_s,puck_deg\n0,0\n1,1e400\n", ["1e400", "way.csv:3:3"]),
        ("time_s,puck_deg\n1,0\n1,1\n", ["must increase", "way.csv:3:1"]),
    ] {
        let at = folder(&[("w.toml", &following("way.csv")), ("way.csv", text)]);
        let words = ["hapt: scenarios.step.hand.file: ", words[0], words[1]];
        hapt(at.path(), ["check", "w.toml"]).refused(2, &words);
        hapt(at.path(), ["sim", "w.toml", "--out", "out"]).refused(2, &words);
        assert_eq!(names(at.path()), ["w.toml", "way.csv"]);
    }
}

#[test]
fn values_that_begin_with_a_hyphen_are_values() {
    let scenario =
        "[scenarios.-x]\nduration = \"0.01 s\"\nhand = { kind = \"torque\", moves = { kind = \"step\", to = 0 } }\n";
    let at = folder(&[("w.toml", &format!("{WHEEL}\n{scenario}"))]);
    let one = hapt(at.path(), ["sim", "w.toml", "--scenario", "-x"]).done();
    assert!(one.out.contains("scenario -x: ") && !one.out.contains("scenario step"), "{one:?}");
    let design = |travel: &str, torque: &str| {
        hapt(at.path(), ["design", "--travel", travel, "--torque", torque, "--frequency", "1Hz"])
    };
    design("-30deg", "-800Nmm").refused(2, &["--travel", "-30deg"]);
    hapt(at.path(), ["sim", "w.toml", "--scenario", "-x", "--out", "runs"]).done();
    hapt(at.path(), ["plot", "runs/-x.csv", "--limit", "-1 N m"]).refused(2, &["--limit", "-1 N m"]);
}

#[test]
fn a_format_without_a_folder_is_refused_only_where_it_needs_one() {
    let at = folder(&[("w.toml", WHEEL)]);
    let summary = hapt(at.path(), ["sim", "w.toml"]).done();
    assert_eq!(hapt(at.path(), ["sim", "w.toml", "--format", "csv"]).done().out, summary.out);
    for format in ["mcap", "parquet"] {
        hapt(at.path(), ["sim", "w.toml", "--format", format])
            .refused(2, &[&format!("--format {format}"), "--out DIR"]);
    }
}
