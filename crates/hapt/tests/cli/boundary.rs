//! `hapt boundary`: the table, the summary and the picture.

use std::fs;
use std::path::Path;

use crate::common::{Ended, folder, hapt, names};

/// A wall that requires b = KT/2 + B: at 1 ms and 1.2e-3 N m s/rad, K up to 2.4 N m/rad.
const WALL: &str = r#"
title = "A wall"
[loop]
period    = "1 ms"
estimator = "difference"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
[[couplings]]
kind      = "wall"
between   = ["puck", "ground"]
side      = "above"
at        = "10 deg"
stiffness = "1 N m/rad"
"#;

const AXES: [&str; 4] = ["--vary", "couplings.0.damping=0..0.002", "--vary", "couplings.0.stiffness=0..100 N mm/deg"];

fn boundary(at: &Path, more: &[&str]) -> Ended {
    hapt(at, ["boundary", "w.toml"].iter().chain(&AXES).chain(more)).done()
}

#[test]
fn the_table_goes_to_standard_output_or_into_a_file() {
    let at = folder(&[("w.toml", WALL)]);
    let ended = boundary(at.path(), &[]);
    let lines: Vec<&str> = ended.out.lines().collect();
    assert_eq!(lines[0], "edge,piece,couplings.0.damping,couplings.0.stiffness,hz,beyond");
    assert!(ended.err.starts_with("A wall\n\nplane "), "{}", ended.err);
    let passive: Vec<Vec<&str>> =
        lines.iter().filter(|line| line.starts_with("passive,1,")).map(|line| line.split(',').collect()).collect();
    assert!(passive.len() > 4 && lines.iter().any(|line| line.starts_with("free,1,")), "{}", ended.out);
    for row in &passive {
        let [damping, stiffness] = [2, 3].map(|i| row[i].parse::<f64>().unwrap());
        assert!((0.5e-3 * stiffness + damping - 1.2e-3).abs() < 1e-12, "{row:?}");
        assert_eq!(&row[5][..1], "+");
    }

    let filed = boundary(at.path(), &["--out", "e.csv", "--plot", "e.svg"]);
    assert_eq!(fs::read_to_string(at.path().join("e.csv")).unwrap(), ended.out);
    assert_eq!((filed.out.as_str(), filed.err.as_str()), (ended.err.as_str(), "wrote e.csv\nwrote e.svg\n"));
    assert_eq!(names(at.path()), ["e.csv", "e.svg", "w.toml"]);
}

#[test]
fn the_summary_speaks_in_the_units_typed_and_says_which_side_is_which() {
    let at = folder(&[("w.toml", WALL)]);
    let text = boundary(at.path(), &["--of", "passive,held", "--out", "e.csv"]).out;
    assert!(text.contains("couplings.0.stiffness from 0 to 100 N mm/deg\n"), "{text}");
    // 2.4 N m/rad are 41.89 N mm/deg.
    assert!(
        text.contains("\npassive   from (0, 41.89) to (0.0012, 0), ") && text.contains(" not passive toward larger "),
        "{text}"
    );
    assert!(text.contains("\nheld      nowhere unstable\n") && !text.contains("\nfree "), "{text}");
    assert!(text.contains("checked "), "{text}");
}

#[test]
fn the_picture_names_its_colours_and_its_edges() {
    let at = folder(&[("w.toml", WALL)]);
    boundary(at.path(), &["--out", "e.csv", "--plot", "e.svg"]);
    let svg = fs::read_to_string(at.path().join("e.svg")).unwrap();
    for part in [
        "certified",
        "stable, not passive",
        ">unstable<",
        "edge of passivity",
        "edge of stability, free",
        "(N·mm/°)",
        "evenodd",
    ] {
        assert!(svg.contains(part), "{part}: {svg}");
    }
    // Held, nothing moves: no edge, no name of one.
    assert!(!svg.contains("edge of stability, held"));
}

#[test]
fn what_cannot_be_written_leaves_nothing() {
    let at = folder(&[("w.toml", WALL)]);
    let args = ["boundary", "w.toml"].iter().chain(&AXES).chain(&["--out", "e.csv", "--plot", "no/e.svg"]);
    let ended = hapt(at.path(), args);
    assert_eq!(ended.code, Some(3), "{ended:?}");
    assert_eq!(names(at.path()), ["w.toml"]);
}
