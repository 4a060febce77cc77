//! What a file's ending asks for: honoured or refused, by every option of every command.

use std::fs;

use crate::common::{WHEEL, folder, hapt, names};

const SWEEP: [&str; 7] = ["sweep", "w.toml", "--vary", "device.damping=0..0.01:3", "--measure", "certified", "--out"];
const BOUNDARY: [&str; 6] =
    ["boundary", "w.toml", "--vary", "loop.period=1ms..2ms", "--vary", "device.damping=0..0.01"];

#[test]
fn every_figure_is_a_png_where_its_name_says_so() {
    let at = folder(&[("w.toml", WHEEL)]);
    hapt(at.path(), ["sim", "w.toml", "--out", ".", "--format", "csv", "--format", "mcap"]).done();
    let identify = ["identify", "step.mcap", "--coast", "--plot"];
    for (args, can_fail) in [
        (&["plot", "step.csv", "--out"][..], false),
        (&["plot", "step.mcap", "--out"], false),
        (&["impedance", "w.toml", "--points", "9", "--plot"], false),
        (&["impedance", "w.toml", "--z-width", "--points", "3", "--plot"], false),
        (&[&SWEEP[..], &["t.csv", "--plot"]].concat(), false),
        (&[&BOUNDARY[..], &["--plot"]].concat(), false),
        // A held puck shows no device; what is refused leaves no picture.
        (&identify, true),
    ] {
        let name = |ending: &str| at.path().join(format!("f.{ending}"));
        for (ending, first) in [("png", &b"\x89PNG\r\n"[..]), ("PNG", b"\x89PNG\r\n"), ("svg", b"<svg ")] {
            let ended = hapt(at.path(), args.iter().copied().chain([format!("f.{ending}").as_str()]));
            if can_fail && ended.code == Some(2) {
                assert!(!name(ending).exists(), "{args:?}");
                continue;
            }
            ended.done();
            assert!(fs::read(name(ending)).unwrap().starts_with(first), "{args:?} {ending}");
            fs::remove_file(name(ending)).unwrap();
        }
    }
}

#[test]
fn an_ending_that_contradicts_the_format_is_refused_and_nothing_is_written() {
    let at = folder(&[("w.toml", WHEEL)]);
    hapt(at.path(), ["sim", "w.toml", "--out", "."]).done();
    let before = names(at.path());
    let with = |args: &[&'static str], more: &[&'static str]| [args, more].concat();
    for (args, name, wanted) in [
        (with(&["plot", "step.csv", "--out"], &["e.csv"]), "e.csv", "FILE.svg or FILE.png"),
        (with(&["plot", "step.csv", "--out"], &["e.jpg"]), "e.jpg", "FILE.svg or FILE.png"),
        (with(&SWEEP, &["t.csv", "--plot", "m.pdf"]), "m.pdf", "FILE.svg or FILE.png"),
        (with(&SWEEP, &["t.mcap"]), "t.mcap", "FILE.csv or FILE.parquet"),
        (with(&["impedance", "w.toml", "--out"], &["i.parquet"]), "i.parquet", "FILE.csv"),
        (with(&["impedance", "w.toml", "--plot"], &["i.csv"]), "i.csv", "FILE.svg or FILE.png"),
        (with(&BOUNDARY, &["--out", "b.svg"]), "b.svg", "FILE.csv"),
        (with(&BOUNDARY, &["--plot", "b.csv"]), "b.csv", "FILE.svg or FILE.png"),
        (with(&["run", "w.toml", "--duration", "1s", "--log"], &["x.csv"]), "x.csv", "FILE.mcap"),
        (with(&["worst", "w.toml", "--out"], &["w.json"]), "w.json", "FILE.toml"),
        (with(&["identify", "step.csv", "--write"], &["d.json"]), "d.json", "FILE.toml"),
        (with(&["identify", "step.csv", "--plot"], &["d.txt"]), "d.txt", "FILE.svg or FILE.png"),
        (with(&["identify", "sim", "--world", "w.toml", "--log"], &["d.csv"]), "d.csv", "FILE.mcap"),
        (with(&["convert", "step.csv", "-o"], &["c.png"]), "c.png", "FILE.csv, FILE.parquet or FILE.mcap"),
        (with(&["sim", "w.toml", "--out"], &["step2.csv"]), "step2.csv", "a folder"),
        (with(&["report", "w.toml", "--out"], &["r.html"]), "r.html", "a folder"),
        (with(&["live", "w.toml", "--port", "0", "--log-dir"], &["l.mcap"]), "l.mcap", "a folder"),
    ] {
        hapt(at.path(), &args).refused(2, &[name, wanted, "is wanted"]);
        assert_eq!(names(at.path()), before, "{args:?}");
    }
    hapt(at.path(), ["sim", "w.toml", "--format", "csv"]).refused(2, &["--out"]);
}
