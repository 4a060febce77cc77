//! `hapt impedance`: rows, pictures and sentences, and the Z-width.

use std::fs;
use std::path::Path;

use crate::common::{Ended, Table, WHEEL, folder, hapt, names, near};

fn impedance(at: &Path, more: &[&str]) -> Ended {
    hapt(at, ["impedance", "w.toml"].iter().chain(more))
}

/// The number before `unit` in the line that begins with `head`.
fn value(text: &str, head: &str, unit: &str) -> f64 {
    let line = text.lines().find(|line| line.starts_with(head)).unwrap_or_else(|| panic!("no {head} in {text}"));
    let (before, _) = line.rsplit_once(unit).unwrap_or_else(|| panic!("no {unit} in {line}"));
    before.split_whitespace().next_back().unwrap().parse().unwrap()
}

#[test]
fn the_wheel_is_said_to_be_an_inertia_up_to_a_frequency() {
    let at = folder(&[("w.toml", WHEEL)]);
    let text = impedance(at.path(), &[]).done().out;
    near(value(&text, "asked ", " kg m^2: rendered"), 0.02580123, 1e-5);
    // 1 Hz/√11
    near(value(&text, "asked ", " Hz"), 1.0 / 11f64.sqrt(), 1e-4);
    near(value(&text, "resonance", " Hz with"), 1.0, 1e-6);
    assert!(text.contains("device    adds inertia 0.00064 kg m^2 and damping 0.0012 N m s/rad"), "{text}");
    // Re K = k sin φ/φ at 100 Hz, φ = 0.2 π.
    let row = text.lines().find(|line| line.starts_with("100 ")).unwrap();
    let phi = 0.2 * std::f64::consts::PI;
    near(row.split_whitespace().nth(1).unwrap().parse().unwrap(), 1.018592 * phi.sin() / phi, 1e-3);
    assert_eq!(names(at.path()), ["w.toml"]);
}

#[test]
fn rows_and_picture_are_files() {
    let at = folder(&[("w.toml", WHEEL)]);
    let args = ["--from", "0.5 Hz", "--to", "0.05kHz", "--points", "5", "--out", "f.csv", "--plot", "f.svg"];
    let ended = impedance(at.path(), &args).done();
    assert_eq!(ended.out, "");
    assert!(ended.err.contains("wrote f.csv") && ended.err.contains("wrote f.svg"), "{}", ended.err);
    assert_eq!(names(at.path()), ["f.csv", "f.svg", "w.toml"]);
    let text = fs::read_to_string(at.path().join("f.csv")).unwrap();
    let head = "frequency_hz,stiffness_Nm_per_rad,damping_Nms_per_rad,inertia_kgm2,ideal_stiffness_Nm_per_rad,";
    assert!(text.starts_with(head), "{text}");
    let table = Table::read(&at.path().join("f.csv"));
    let column = |name: &str| table.column(name);
    let hz = column("frequency_hz");
    assert_eq!((hz.len(), hz[0], hz[4]), (5, 0.5, 50.0));
    for (i, hz) in hz.iter().enumerate() {
        let square = (std::f64::consts::TAU * hz).powi(2);
        near(column("inertia_kgm2")[i], -column("stiffness_Nm_per_rad")[i] / square, 1e-12);
        near(column("whole_inertia_kgm2")[i] - column("inertia_kgm2")[i], 6.4e-4, 1e-9);
        near(column("whole_damping_Nms_per_rad")[i] - column("damping_Nms_per_rad")[i], 1.2e-3, 1e-9);
        near(column("ideal_inertia_kgm2")[i], 0.02580123 / (1.0 - square * 0.02580123 / 1.018592), 1e-9);
    }
    let svg = fs::read_to_string(at.path().join("f.svg")).unwrap();
    for word in ["stiffness (N·m/rad)", "damping (N·m·s/rad)", "inertia (kg·m²)", "frequency (Hz)", "ideal, above 0"]
    {
        assert!(svg.contains(word), "{word}");
    }
}

#[test]
fn a_resonance_that_nothing_damps_leaves_its_row_empty() {
    let inertia = "0.45031637174372346 N mm/(deg/s^2)";
    let world = WHEEL.replace("0.02580123 kg m^2", inertia).replace("1.018592 N m/rad", "17.77777777777778 N mm/deg");
    let at = folder(&[("w.toml", &world)]);
    impedance(at.path(), &["--from", "1 Hz", "--to", "100 Hz", "--points", "3", "--out", "f.csv"]).done();
    let text = fs::read_to_string(at.path().join("f.csv")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[1], "1.0,,,,,,,,,");
    assert!(lines[2].starts_with("10.0,1.02") && !text.contains("NaN") && !text.contains("inf"), "{text}");
    let text = impedance(at.path(), &[]).done().out;
    assert!(text.lines().any(|line| line.starts_with("1 ") && line.contains("unbounded")), "{text}");
}

#[test]
fn a_linear_world_speaks_of_newtons_and_metres() {
    let world = r#"motion = "linear"
[loop]
period = "1 ms"
estimator = "difference"
[device]
inertia = "0.1 kg"
damping = "2 N s/m"
encoder = "5 um"
friction = "0.5 N"
[[couplings]]
kind = "wall"
between = ["puck", "ground"]
side = "above"
at = "0 m"
stiffness = "1000 N/m"
"#;
    let at = folder(&[("w.toml", world)]);
    let text = impedance(at.path(), &[]).done().out;
    assert!(text.contains("stiffness 1000 N/m") && text.contains("0.1 kg") && text.contains("2 N s/m"), "{text}");
    assert!(text.contains("steepest rise"), "{text}");
    assert!(impedance(at.path(), &["--slopes", "flat"]).done().out.contains("asked     nothing"));
    impedance(at.path(), &["--out", "f.csv"]).done();
    assert!(
        fs::read_to_string(at.path().join("f.csv"))
            .unwrap()
            .starts_with("frequency_hz,stiffness_N_per_m,damping_Ns_per_m,inertia_kg,")
    );
    impedance(at.path(), &["--z-width", "--points", "6", "--out", "z.csv", "--plot", "z.svg"]).done();
    let text = fs::read_to_string(at.path().join("z.csv")).unwrap();
    let head = "damping_Ns_per_m,passive_stiffness_N_per_m,stable_stiffness_N_per_m,counts_stiffness_N_per_m";
    assert_eq!(text.lines().next(), Some(head));
    let first: Vec<f64> = text.lines().nth(1).unwrap().split(',').map(|cell| cell.parse().unwrap()).collect();
    // 2b/T; from there on a damper of 2 N s/m is too much.
    near(first[1], 4000.0, 1e-9);
    near(first[3], 4000.0, 1e-9);
    assert!(text.lines().last().unwrap().split(',').nth(1) == Some(""), "{text}");
    let svg = fs::read_to_string(at.path().join("z.svg")).unwrap();
    assert!(svg.contains("spring (N/m)") && svg.contains("damper (N·s/m)") && svg.contains("counts"), "{svg}");
}

#[test]
fn the_z_width_is_of_the_device_whatever_the_world() {
    let at = folder(&[("w.toml", WHEEL)]);
    let more = ["--z-width", "--set", "loop.estimator=difference"];
    let text = impedance(at.path(), &more).done().out;
    assert!(text.contains("passive   up to 2.4 N m/rad without a damper, and up to 0.0012 N m s/rad"), "{text}");
    let other = impedance(at.path(), &[&more[..], &["--set", "bodies.wheel.inertia=1 kg m^2"]].concat()).done().out;
    assert_eq!(text, other);
    assert!(impedance(at.path(), &["--z-width"]).done().out.contains("note      stable with the true velocity"));
}

#[test]
fn json_has_every_number() {
    let at = folder(&[("w.toml", WHEEL)]);
    let read = |more: &[&str]| -> serde_json::Value {
        serde_json::from_str(&impedance(at.path(), &[&["--json"], more].concat()).done().out).unwrap()
    };
    let felt = read(&["--points", "7"]);
    assert_eq!(felt["nyquist_hz"], 500.0);
    assert_eq!(felt["asked"][0]["element"], "inertia");
    assert_eq!(felt["rows"].as_array().unwrap().len(), 7);
    assert!(felt["rows"][6]["rendered"]["damping"].as_f64().unwrap() < 0.0);
    assert_eq!(felt["resonances"][0]["damping_ratio"], 0.0);
    let width = read(&["--z-width", "--points", "8"]);
    near(width["passive_damping"].as_f64().unwrap(), 1.2e-3, 1e-9);
    assert!(width["edges"].as_array().unwrap().len() >= 8);
    assert!(width["counts"].is_null());
}

#[test]
fn what_cannot_be_had_is_said_and_leaves_nothing() {
    let at = folder(&[("w.toml", WHEEL)]);
    for (more, words) in [
        (&["--to", "600 Hz"][..], &["--to", "600 Hz", "500 Hz", "half of the sampling rate"][..]),
        (&["--from", "0"], &["--from", "positive"]),
        (&["--from", "2 ms"], &["--from"]),
        (&["--from", "20", "--to", "10"], &["--from: 20 Hz must be below --to, which is 10 Hz"]),
        (&["--points", "0"], &["--points 0: expected 1 to 100000"]),
        (&["--z-width", "--points", "3000"], &["1 to 2000"]),
        (&["--z-width", "--to", "10"], &["--z-width", "--to"]),
        (&["--slopes", "some"], &["steep", "flat"]),
        (&["--out", "f", "--plot", "f"], &["--out and --plot are the same file"]),
    ] {
        impedance(at.path(), more).refused(2, words);
        assert_eq!(names(at.path()), ["w.toml"], "{more:?}");
    }
    let files = ["--out", "f.csv", "--plot", "nowhere/f.svg"];
    impedance(at.path(), &files).refused(3, &["cannot write nowhere/f.svg"]);
    assert_eq!(names(at.path()), ["w.toml"]);
}
