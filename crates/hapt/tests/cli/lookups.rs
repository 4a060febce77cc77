//! The answers to a misspelt name and to a number without a unit, and output without colours.

use std::fs;
use std::path::Path;

use crate::common::{WHEEL, folder, hapt};

#[test]
fn what_is_misspelt_is_answered_with_what_was_meant() {
    let at = folder(&[("wheel.toml", WHEEL), ("step.csv", "time_s\n")]);
    let refused = |args: &[&str], wanted: &str| hapt(at.path(), args).refused(2, &[wanted]);
    refused(&["check", "whele.toml"], "did you mean \"wheel.toml\"?");
    refused(&["sim", "wheel"], "did you mean \"wheel.toml\"?");
    refused(&["sim", "notes/eulr"], "did you mean \"@notes/euler\"?");
    refused(&["check", "@euler"], "did you mean \"@notes/euler\"?");
    refused(&["plot", "stpe.csv"], "did you mean \"step.csv\"?");
    refused(&["log", "replay", "stpe.csv"], "did you mean \"step.csv\"?");
    refused(&["explain", "stifness"], "did you mean \"stiffness\"?");
    refused(&["explain", "eigenvalues"], "it stands in: held");
    refused(&["run", "wheel.toml", "--device", "moteous:/dev/x"], "did you mean \"moteus\"?");
    refused(&["run", "wheel.toml", "--device", "/dev/x"], "\"hapt:/dev/x\"");
    let vary = ["sweep", "wheel.toml", "--vary", "loop.period=1ms..2ms:2", "--out", "t.csv", "--measure"];
    let sweep = |measure| [&vary[..], &[measure]].concat();
    refused(&sweep("certifed"), "did you mean \"certified\"?");
}

#[test]
fn measure_help_lists_the_measures_and_asks_for_nothing_else() {
    for args in [["sweep", "--measure", "help"].as_slice(), &["sweep", "w.toml", "--measure=help"]] {
        let out = hapt(Path::new("."), args).done().out;
        for measure in hapt_sweep_measures() {
            assert!(out.lines().any(|line| line.starts_with(&format!("{measure} "))), "{measure}: {out}");
        }
    }
}

/// As the contract names them.
fn hapt_sweep_measures() -> [&'static str; 7] {
    [
        "peak_torque",
        "final_energy",
        "settling_time",
        "held_growth_per_s",
        "free_growth_per_s",
        "required_damping",
        "certified",
    ]
}

#[test]
fn the_basic_words_are_explained() {
    for word in [
        "puck",
        "wall",
        "detent",
        "stiffness",
        "damping",
        "spring",
        "damper",
        "friction",
        "body",
        "ground",
        "hand",
        "coupling",
        "period",
        "handle",
        "device",
        "inertia",
        "world",
        "scenario",
        "motor",
        "encoder",
        "torque",
    ]
    .iter()
    .chain(hapt_model::CouplingKind::NAMES)
    {
        let text = hapt(Path::new("."), ["explain", word]).done().out;
        assert!(text.lines().count() >= 5, "{word}: {text}");
    }
}

#[test]
fn a_number_without_a_unit_is_answered_with_the_unit_that_was_assumed() {
    let design = |travel| {
        hapt(Path::new("."), ["design", "--travel", travel, "--torque", "800 N mm", "--frequency", "1 Hz"]).done()
    };
    let bare = design("45");
    assert!(bare.err.contains("--travel 45 has no unit and is taken as 45 rad; write '45 deg'"), "{}", bare.err);
    assert_eq!(design("45 deg").err, "");
}

#[test]
fn torques_are_printed_in_the_unit_that_the_file_has_them_in() {
    let at = folder(&[("mm.toml", WHEEL), ("m.toml", &WHEEL.replace("822.25 N mm", "0.82225 N m"))]);
    let peak = |file| {
        let out = hapt(at.path(), ["sim", file]).done().out;
        out.lines().find(|line| line.contains("limit")).unwrap().to_string()
    };
    assert!(peak("mm.toml").ends_with("822.25 N mm"), "{}", peak("mm.toml"));
    assert!(peak("m.toml").ends_with("0.82225 N m"), "{}", peak("m.toml"));
}

#[test]
fn nothing_is_coloured_in_a_pipe() {
    for world in ["@notes/default", "@notes/euler"] {
        let ended = hapt(Path::new("."), ["check", world]);
        assert!(!ended.out.contains('\x1b') && !ended.err.contains('\x1b'), "{ended:?}");
    }
}

#[test]
fn several_runs_are_drawn_over_each_other_and_a_part_of_them_alone() {
    let at = folder(&[("w.toml", WHEEL)]);
    for (folder, period) in [("a", "1 ms"), ("b", "2 ms")] {
        hapt(at.path(), ["sim", "w.toml", "--out", folder, "--set", &format!("loop.period={period}")]).done();
    }
    let plot = |args: &[&str]| hapt(at.path(), ["plot"].iter().chain(args));
    let both = plot(&["a/step.csv", "b/step.csv", "--signals", "torque"]).done().out;
    assert!(both.contains("a/step.csv") && both.contains("b/step.csv") && both.contains("torque ("), "{both}");
    assert!(!both.contains("velocity ("), "{both}");
    let part = plot(&["a/step.csv", "--from", "0.2s", "--to", "0.3s"]).done().out;
    assert!(part.contains("200 ms to 300 ms"), "{part}");
    plot(&["a/step.csv", "--from", "20s"]).refused(2, &["no rows from 20 s on"]);
    plot(&["a/step.csv", "--from", "2s", "--to", "1s"]).refused(2, &["--to: 1 s is not after --from, 2 s"]);
    plot(&["a/step.csv", "--signals", "velocty"]).refused(2, &["did you mean \"velocity\"?"]);
}

/// One key is on one axis in both pictures, and the file's own values are marked where they are.
#[test]
fn a_sweep_and_a_boundary_are_drawn_alike() {
    let at = folder(&[("w.toml", WHEEL)]);
    let world = ["w.toml", "--vary"];
    let (period, damping) = ("loop.period=0.5ms..3ms", "device.damping=0..0.004");
    let boundary =
        [&["boundary"], &world[..], &[period, "--vary", damping, "--out", "e.csv", "--plot", "e.svg"]].concat();
    hapt(at.path(), boundary).done();
    let sweep = [format!("{period}:9"), format!("{damping}:7")];
    let more = ["--measure", "certified", "--out", "m.csv", "--plot", "m.svg"];
    hapt(at.path(), [&["sweep"], &world[..], &[&sweep[0], "--vary", &sweep[1]], &more].concat()).done();
    for file in ["e.svg", "m.svg"] {
        let svg = fs::read_to_string(at.path().join(file)).unwrap();
        let place = |text: &str| svg.find(text).unwrap_or_else(|| panic!("{file} has no {text}"));
        // The vertical axis's name comes first, the horizontal one's last.
        assert!(place("damping of the device (") < place("sampling period ("), "{file}");
        assert!(svg.contains("the file's own world") && svg.contains("certified"), "{file}");
        // The colour of what is certified.
        assert!(svg.contains("cell n1"), "{file}");
    }
    // Elsewhere there is no mark.
    let far = ["sweep", "w.toml", "--vary", "loop.period=2ms..3ms:3", "--vary", &sweep[1]];
    hapt(at.path(), [&far[..], &more].concat()).done();
    assert!(!fs::read_to_string(at.path().join("m.svg")).unwrap().contains("own world"));
}

#[test]
fn a_delay_in_samples_is_swept_along_with_the_period() {
    let at = folder(&[("w.toml", &WHEEL.replace("period = \"1 ms\"", "period = \"1 ms\"\ndelay = \"1.5 samples\""))]);
    let measured = |set: &[&str], vary: &str| {
        let args = ["sweep", "w.toml", "--vary", vary, "--measure", "free_growth_per_s", "--out", "t.csv"];
        hapt(at.path(), args.iter().chain(set)).done();
        let text = fs::read_to_string(at.path().join("t.csv")).unwrap();
        text.lines().skip(1).map(|line| line.split(',').nth(1).unwrap().to_string()).collect::<Vec<_>>()
    };
    let swept = measured(&[], "loop.period=1ms..3ms:3");
    let check = |period: &str, delay: &str| {
        measured(&["--set", &format!("loop.delay={delay}")], &format!("loop.period={period}..{period}:1")).remove(0)
    };
    let growth = |text: &String| text.parse::<f64>().unwrap();
    for (i, (period, delay)) in [("1ms", "1.5 ms"), ("2ms", "3 ms"), ("3ms", "4.5 ms")].into_iter().enumerate() {
        let (swept, check) = (growth(&swept[i]), growth(&check(period, delay)));
        assert!((swept - check).abs() <= 1e-9 * check.abs().max(1.0), "{period}: {swept} {check}");
    }
}

#[test]
fn a_delay_is_said_with_the_loop_and_its_unit_is_looked_for() {
    let at = folder(&[("w.toml", &WHEEL.replace("period = \"1 ms\"", "period = \"1 ms\"\ndelay = \"1.5 samples\""))]);
    for args in [&["check", "w.toml"][..], &["sim", "w.toml"], &["impedance", "w.toml", "--points", "3"]] {
        let printed = hapt(at.path(), args).out;
        assert!(printed.contains("of the step, 1.5 ms late"), "{args:?}: {printed}");
        let printed = hapt(at.path(), args.iter().chain(&["--set", "loop.delay=0"])).out;
        assert!(printed.contains("of the step") && !printed.contains("late"), "{args:?}: {printed}");
    }
    let misspelt = hapt(at.path(), ["check", "w.toml", "--set", "loop.delay=1.5 sampels"]);
    misspelt.refused(2, &["unknown unit \"sampels\"; did you mean \"samples\"?"]);
}

/// The list is that of the built-in crates: every crate is in the lock file in that version, and has a text.
#[test]
fn the_licences_name_the_crates_that_the_program_is_built_of_and_bring_their_texts() {
    let text = hapt(Path::new("."), ["explain", "licences"]).done().out;
    let lock = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../Cargo.lock")).unwrap();
    let list: Vec<&str> = text.lines().skip(3).take_while(|line| !line.is_empty()).collect();
    for name in ["clap", "serde", "toml", "tungstenite", "rustix", "parquet", "uPlot", "DejaVu"] {
        assert!(list.iter().any(|line| line.starts_with(name)), "{name}");
    }
    let no_crate = |line: &str| ["uPlot", "uqr", "Rust's", "DejaVu"].iter().any(|name| line.starts_with(name));
    for line in list.iter().filter(|line| !no_crate(line)) {
        let (name, version) = line.split_once(' ').unwrap();
        let version = version.split_whitespace().next().unwrap();
        assert!(
            lock.contains(&format!("name = \"{name}\"\nversion = \"{version}\"")),
            "{name} {version}: cargo xtask licences"
        );
    }
    for line in &list {
        let number = line.rsplit_once('[').unwrap().1;
        assert!(text.contains(&format!("\n[{number} ---")), "{line}");
    }
    assert!(text.contains("Permission is hereby granted") && text.contains("Apache License"));
}

/// A bare number that no usual device has is taken, and the answer names the unit that was probably meant; a number with a unit gives no
/// warning. In a network the station is named.
#[test]
fn a_bare_number_far_from_what_is_usual_is_warned_about() {
    let at = folder(&[("w.toml", WHEEL)]);
    let doubt = "warning: loop.period = 2 is 2 s; usual values are 10 us to 100 ms. Was 2 ms meant? Write loop.period = \"2 ms\"";
    for args in [&["check", "w.toml", "--json"][..], &["sim", "w.toml"], &["impedance", "w.toml"], &["worst", "w.toml"]]
    {
        let with =
            |value: &str| hapt(at.path(), args.iter().copied().chain(["--set", &format!("loop.period={value}")]));
        assert!(with("2").err.lines().any(|line| line == doubt), "{args:?}: {}", with("2").err);
        assert!(!with("2 s").err.contains("warning"), "{args:?}: {}", with("2 s").err);
    }
    let network = "[stations.left]\nworld = \"w.toml\"\n[stations.right]\nworld = \"w.toml\"\n[[links]]\nkind = \"spring\"\n\
                   between = [\"left\", \"right\"]\nstiffness = 5e6\nage_max = \"40 ms\"\n";
    let at = folder(&[("w.toml", WHEEL), ("n.toml", network)]);
    let ended = hapt(at.path(), ["check", "n.toml", "--no-remedies", "--set", "stations.left.device.inertia=640"]);
    for part in ["warning: station left: device.inertia = 640 is", "warning: links.0.stiffness = 5e6 is"] {
        assert!(ended.err.contains(part), "{part}: {}", ended.err);
    }
}
