//! `hapt worst`: its verdicts, its scenario, and its files.

use std::fs;

use crate::common::{WHEEL, folder, hapt, names};

#[test]
fn a_certified_wheel_survives() {
    let at = folder(&[("w.toml", WHEEL)]);
    let ended = hapt(at.path(), ["worst", "w.toml"]).done();
    assert!(ended.out.contains("verdict   survived, as certified") && ended.err.is_empty(), "{ended:?}");
    assert!(ended.out.contains("the device has 0.0012 N m s/rad"), "{ended:?}");
    // The lines to paste are a scenario of the file.
    let (_, lines) = ended.out.split_once("\n[scenarios.worst]").unwrap();
    fs::write(at.path().join("more.toml"), format!("{WHEEL}\n[scenarios.worst]{lines}")).unwrap();
    hapt(at.path(), ["sim", "more.toml", "--scenario", "worst"]).done();
}

#[test]
fn a_refused_wheel_falls_and_its_file_shows_it() {
    let at = folder(&[("w.toml", WHEEL)]);
    let ended = hapt(at.path(), ["worst", "w.toml", "--set", "loop.output=start", "--out", "b.toml"]);
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(ended.out.contains("verdict   broken: a passive hand draws energy from it"), "{ended:?}");
    assert!(ended.out.contains("no device damping is enough for the certificate"), "{ended:?}");
    assert!(ended.err.contains("wrote b.toml") && ended.out.contains("hapt sim b.toml shows it"), "{ended:?}");
    assert_eq!(names(at.path()), ["b.toml", "w.toml"]);
    // The override is in the file, the other scenario is not; the hand gets more than it gives.
    let shown = hapt(at.path(), ["sim", "b.toml"]).done();
    assert!(shown.out.contains("torque from the start of the step") && shown.out.contains("hand gave -"), "{shown:?}");
    assert!(!fs::read_to_string(at.path().join("b.toml")).unwrap().contains("scenarios.step"));
}

#[test]
fn its_json_has_the_numbers_in_si() {
    let at = folder(&[("w.toml", WHEEL)]);
    let json = |more: &[&str]| {
        let ended = hapt(at.path(), ["worst", "w.toml", "--json"].iter().chain(more));
        let value: serde_json::Value = serde_json::from_str(&ended.out).unwrap();
        assert_eq!(ended.code, Some(i32::from(value["broken"].as_bool().unwrap())), "{ended:?}");
        value
    };
    let good = json(&[]);
    assert!(good["certified"] == true && good["broken"] == false && good["linear"].is_null(), "{good}");
    assert_eq!(good["gap"]["device_damping"], 1.2e-3);
    assert!(good["gap"]["breaking_damping"].as_f64().unwrap() <= good["gap"]["required_damping"].as_f64().unwrap());
    let bad = json(&["--set", "loop.output=start"]);
    assert!(
        bad["gap"]["required_damping"].is_null() && bad["linear"]["growth_per_s"].as_f64().unwrap() > 1e-6,
        "{bad}"
    );
    assert!(bad["drawn"]["gain"].as_f64().unwrap() > 0.0, "{bad}");
}

#[test]
fn a_linear_world_is_spoken_of_in_its_units() {
    let world = "motion = \"linear\"\n[loop]\nperiod = 1e-3\n[device]\ninertia = \"0.2 kg\"\ndamping = \"0.1 N s/m\"\n\
        [[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = \"500 N/m\"\n";
    let at = folder(&[("w.toml", world)]);
    let ended = hapt(at.path(), ["worst", "w.toml"]);
    assert_eq!(ended.code, Some(1), "{ended:?}");
    for words in ["requires a device damping of 0.25 N s/m", " kg and ", " N/m", " mm at first"] {
        assert!(ended.out.contains(words), "{words}: {ended:?}");
    }
}

#[test]
fn a_file_that_cannot_be_is_said_and_nothing_is_left() {
    let at = folder(&[("w.toml", WHEEL)]);
    hapt(at.path(), ["worst", "w.toml", "--out", "w.toml"]).refused(2, &["that is the world itself"]);
    hapt(at.path(), ["worst", "w.toml", "--out", "."]).refused(2, &["it is a folder"]);
    hapt(at.path(), ["worst", "w.toml", "--out", "none/b.toml"]).refused(3, &["cannot write", "none"]);
    assert_eq!(names(at.path()), ["w.toml"]);
}

/// A motion breaks a world that no grip breaks: its points are in a file next to the world, and `hapt sim` shows that the hand has gained
/// energy.
#[test]
fn a_motion_that_breaks_a_world_is_written_beside_it() {
    let world = "[loop]\nperiod = 1e-3\nestimator = \"exact\"\n[device]\ninertia = 6.4e-4\ndamping = 1.2e-3\n\
        [[couplings]]\nkind = \"damper\"\nbetween = [\"puck\", \"ground\"]\ndamping = 5e-4\n";
    let at = folder(&[("w.toml", world)]);
    let ended = hapt(at.path(), ["worst", "w.toml", "--out", "b.toml"]);
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(
        ended.out.contains("broken, where no theorem covers the world: a motion of the hand draws energy"),
        "{ended:?}"
    );
    assert!(ended.out.contains("turns round within each sample"), "{ended:?}");
    assert_eq!(names(at.path()), ["b-motion.csv", "b.toml", "w.toml"]);
    let shown = hapt(at.path(), ["sim", "b.toml"]).done();
    assert!(shown.out.contains("hand gave -"), "{shown:?}");
    // Proved of the difference, and no motion breaks that.
    let proved = hapt(at.path(), ["worst", "w.toml", "--set", "loop.estimator=difference"]).done();
    assert!(proved.out.contains("survived, as certified"), "{proved:?}");
}

/// A loop that grows is called certified only with the reason for it.
#[test]
fn a_wheel_that_friction_certifies_says_so_beside_its_growth() {
    let world = "safety = { overspeed = \"0.5 rad/s\" }\n[loop]\nperiod = \"1 ms\"\n[device]\ninertia = 6.4e-4\ndamping = 1.2e-3\nfriction = 0.02\n\
        [[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = 3\n";
    let at = folder(&[("w.toml", world)]);
    let kept = hapt(at.path(), ["worst", "w.toml"]).done();
    assert!(kept.out.contains("survived, as certified by the device's friction up to safety.overspeed"), "{kept:?}");
    assert!(kept.out.contains("the loop grows by"), "{kept:?}");
    let fast = hapt(at.path(), ["worst", "w.toml", "--set", "device.friction=0"]);
    assert!(fast.code == Some(1) && fast.out.contains("verdict   broken: a passive hand"), "{fast:?}");
}

#[test]
fn a_draw_that_is_given_back_is_shown_at_its_time() {
    // The wall gives energy for two seconds; then the device's damping dissipates all of it and more.
    let world = "[loop]\nperiod = \"1 ms\"\n[device]\ninertia = \"6.4e-4 kg m^2\"\ndamping = \"1.2e-3 N m s/rad\"\n[[couplings]]\nkind = \"wall\"\n\
        between = [\"puck\", \"ground\"]\nside = \"above\"\nat = \"10 deg\"\nstiffness = \"50 N mm/deg\"\n";
    let at = folder(&[("w.toml", world)]);
    let ended = hapt(at.path(), ["worst", "w.toml", "--out", "b.toml"]);
    assert_eq!(ended.code, Some(1), "{ended:?}");
    let words = ended.out.split_once(", where --set ").and_then(|(_, words)| words.split_once(" ends the run"));
    let (set, _) = words.unwrap_or_else(|| panic!("{ended:?}"));
    let all = hapt(at.path(), ["sim", "b.toml"]).done();
    let shown = hapt(at.path(), ["sim", "b.toml", "--set", set]).done();
    assert!(!all.out.contains("hand gave -") && shown.out.contains("hand gave -"), "{shown:?}");
}
