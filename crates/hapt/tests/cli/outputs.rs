//! The format of a file's ending is written or refused, by every option of every command.

use std::fs;

use crate::common::{WHEEL, folder, hapt, names, program};

const SWEEP: [&str; 7] = ["sweep", "w.toml", "--vary", "device.damping=0..0.01:3", "--measure", "certified", "--out"];
const BOUNDARY: [&str; 6] =
    ["boundary", "w.toml", "--vary", "loop.period=1ms..2ms", "--vary", "device.damping=0..0.01"];

/// Runs of another world are kept. A world with other overrides, or named by another path, is the same world.
#[test]
fn a_run_replaces_no_file_of_another_world_unless_it_is_forced() {
    let other = WHEEL.replace("45 deg", "30 deg");
    let at = folder(&[("w.toml", WHEEL), ("other.toml", &other)]);
    let step = || fs::read(at.path().join("runs/step.csv")).unwrap();
    let sim = ["sim", "w.toml", "--out", "runs"];
    hapt(at.path(), sim).done();
    let first = step();
    hapt(at.path(), sim.iter().chain(&["--set", "loop.period=2ms"])).done();
    assert_ne!(step(), first);
    hapt(at.path(), ["sim", "./w.toml", "--out", "runs"]).done();
    assert_eq!(step(), first);
    let theirs = ["sim", "other.toml", "--out", "runs"];
    hapt(at.path(), theirs).refused(2, &["step.csv is a run of another world", "w.toml", "\"wheel\"", "--force"]);
    assert_eq!(step(), first);
    // Another name next to it is free.
    hapt(at.path(), theirs.iter().chain(&["--format", "mcap"])).done();
    hapt(at.path(), theirs.iter().chain(&["--force"])).done();
    assert_ne!(step(), first);
    hapt(at.path(), sim).refused(2, &["other.toml"]);
    assert_eq!(names(&at.path().join("runs")), ["step.csv", "step.mcap"]);
    // A file that is in no list may be replaced.
    fs::remove_file(at.path().join("runs/.hapt-runs.json")).unwrap();
    hapt(at.path(), sim).done();
    assert_eq!(step(), first);
    fs::write(at.path().join("runs/.hapt-runs.json"), "mine").unwrap();
    hapt(at.path(), sim).refused(2, &[".hapt-runs.json", "not a list"]);
}

#[test]
fn every_figure_is_a_png_or_a_pdf_where_its_name_says_so() {
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
        for (ending, first) in
            [("png", &b"\x89PNG\r\n"[..]), ("PNG", b"\x89PNG\r\n"), ("pdf", b"%PDF-"), ("svg", b"<svg ")]
        {
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

/// The format of standard output, and of a file without an ending; an ending decides.
#[test]
fn a_figures_format_is_that_of_its_ending_or_of_the_flag() {
    let at = folder(&[("w.toml", WHEEL)]);
    hapt(at.path(), ["sim", "w.toml", "--out", "."]).done();
    let plot = |more: &[&str]| hapt(at.path(), ["plot", "step.csv"].iter().chain(more));
    let piped = program(at.path(), ["plot", "step.csv", "--format", "pdf"]).output().unwrap();
    assert!(piped.status.success() && piped.stdout.starts_with(b"%PDF-"));
    plot(&["--format", "png", "--out", "f"]).done();
    assert!(fs::read(at.path().join("f")).unwrap().starts_with(b"\x89PNG\r\n"));
    plot(&["--format", "pdf", "--out", "f.PDF"]).done();
    plot(&["--out", "g.pdf"]).done();
    let [first, second] = ["f.PDF", "g.pdf"].map(|name| fs::read(at.path().join(name)).unwrap());
    assert!(first == second && first == piped.stdout, "the same figure is the same bytes");
    plot(&["--format", "pdf", "--out", "h.svg"]).refused(2, &["--format pdf", "h.svg", "expected one of the two"]);
    assert!(!at.path().join("h.svg").exists());
    hapt(at.path(), ["impedance", "w.toml", "--format", "pdf"]).refused(2, &["--format", "without --plot"]);
}

/// A style has a size of its own, and a typed one wins.
#[test]
fn a_style_has_a_size_and_lines_and_flags_win() {
    let at = folder(&[("w.toml", WHEEL)]);
    hapt(at.path(), ["sim", "w.toml", "--out", "."]).done();
    let plot = |more: &[&str]| hapt(at.path(), ["plot", "step.csv"].iter().chain(more)).done().out;
    let millimetres = |svg: &str, side: &str| -> f64 {
        svg.split(&format!(" {side}=\"")).nth(1).unwrap().split("mm").next().unwrap().parse().unwrap()
    };
    let is_titled = |svg: &str| svg.contains(">step</text>");
    let (paper, slide) = (plot(&["--style", "paper"]), plot(&["--style", "slide"]));
    assert_eq!((millimetres(&paper, "width"), millimetres(&slide, "width")), (88.0, 254.0));
    assert!(!is_titled(&paper) && is_titled(&slide));
    let shape = millimetres(&slide, "width") / millimetres(&slide, "height");
    assert!((shape * 9.0 / 16.0 - 1.0).abs() < 0.01, "16:9, and it is {shape}");
    assert_eq!(plot(&["--width", "88 mm"]), paper, "a width alone is a paper's");
    let wide = plot(&["--style", "slide", "--width", "200 mm", "--font-size", "10"]);
    assert_eq!(millimetres(&wide, "width"), 200.0);
    hapt(at.path(), ["plot", "step.csv", "--font-size", "9"]).refused(2, &["--font-size", "--style"]);
    hapt(at.path(), ["plot", "step.csv", "--style", "poster"]).refused(2, &["poster", "paper", "slide"]);
}

#[test]
fn an_ending_that_contradicts_the_format_is_refused_and_nothing_is_written() {
    let at = folder(&[("w.toml", WHEEL)]);
    hapt(at.path(), ["sim", "w.toml", "--out", "."]).done();
    let before = names(at.path());
    let with = |args: &[&'static str], more: &[&'static str]| [args, more].concat();
    for (args, name, wanted) in [
        (with(&["plot", "step.csv", "--out"], &["e.csv"]), "e.csv", "FILE.svg, FILE.png or FILE.pdf"),
        (with(&["plot", "step.csv", "--out"], &["e.jpg"]), "e.jpg", "FILE.svg, FILE.png or FILE.pdf"),
        (with(&SWEEP, &["t.csv", "--plot", "m.eps"]), "m.eps", "FILE.svg, FILE.png or FILE.pdf"),
        (with(&SWEEP, &["t.mcap"]), "t.mcap", "FILE.csv or FILE.parquet"),
        (with(&["impedance", "w.toml", "--out"], &["i.parquet"]), "i.parquet", "FILE.csv"),
        (with(&["impedance", "w.toml", "--plot"], &["i.csv"]), "i.csv", "FILE.svg, FILE.png or FILE.pdf"),
        (with(&BOUNDARY, &["--out", "b.svg"]), "b.svg", "FILE.csv"),
        (with(&BOUNDARY, &["--plot", "b.csv"]), "b.csv", "FILE.svg, FILE.png or FILE.pdf"),
        (with(&["run", "w.toml", "--duration", "1s", "--log"], &["x.csv"]), "x.csv", "FILE.mcap"),
        (with(&["worst", "w.toml", "--out"], &["w.json"]), "w.json", "FILE.toml"),
        (with(&["identify", "step.csv", "--write"], &["d.json"]), "d.json", "FILE.toml"),
        (with(&["identify", "step.csv", "--plot"], &["d.txt"]), "d.txt", "FILE.svg, FILE.png or FILE.pdf"),
        (with(&["identify", "sim", "--world", "w.toml", "--log"], &["d.csv"]), "d.csv", "FILE.mcap"),
        (with(&["log", "convert", "step.csv", "-o"], &["c.png"]), "c.png", "FILE.csv, FILE.parquet or FILE.mcap"),
        (with(&["sim", "w.toml", "--out"], &["step2.csv"]), "step2.csv", "a folder"),
        (with(&["sim", "w.toml", "--out"], &["step.JSON"]), "step.JSON", "a folder"),
        (with(&["sim", "w.toml", "--out"], &["step.txt"]), "step.txt", "a folder"),
        (with(&["report", "w.toml", "--out"], &["r.html"]), "r.html", "a folder"),
        (with(&["live", "w.toml", "--port", "0", "--log-dir"], &["l.mcap"]), "l.mcap", "a folder"),
    ] {
        hapt(at.path(), &args).refused(2, &[name, wanted, "expected"]);
        assert_eq!(names(at.path()), before, "{args:?}");
    }
    hapt(at.path(), ["sim", "w.toml", "--format", "mcap"]).refused(2, &["--format mcap", "--out DIR"]);
}

#[test]
fn no_output_replaces_what_is_read_or_another_output() {
    let path = format!(
        "{WHEEL}\n[scenarios.motion]\nduration = \"10 ms\"\nhand = {{ kind = \"path\", file = \"motion.csv\" }}\n"
    );
    let at = folder(&[
        ("w.toml", WHEEL),
        ("w", WHEEL),
        ("p.toml", &path),
        ("motion.csv", "time_s,puck_rad\n0,0\n0.02,0.1\n"),
    ]);
    hapt(at.path(), ["sim", "w.toml", "--scenario", "step", "--out", ".", "--format", "csv", "--format", "mcap"])
        .done();
    fs::copy(at.path().join("step.csv"), at.path().join("c")).unwrap();
    let with = |args: &[&'static str], more: &[&'static str]| [args, more].concat();
    let all =
        || -> Vec<_> { names(at.path()).into_iter().map(|name| fs::read(at.path().join(name)).unwrap()).collect() };
    let before = (names(at.path()), all());
    for (args, message) in [
        (with(&["sim", "p.toml", "--out"], &["."]), "that is the path of a hand itself"),
        (
            with(&["run", "w.toml", "--device", "replay:step.mcap", "--log"], &["step.mcap"]),
            "that is the recording itself",
        ),
        (with(&["impedance", "w", "--points", "3", "--out"], &["w"]), "that is the world itself"),
        (with(&["impedance", "w.toml", "--points", "3"], &["--out", "f", "--plot", "./f"]), "are the same file"),
        (with(&["boundary", "w"], &[&BOUNDARY[2..], &["--plot", "./w"]].concat()), "that is the world itself"),
        (with(&["plot", "c"], &["--out", "c"]), "that is the run itself"),
        (with(&BOUNDARY, &["--out", "f", "--plot", "f"]), "are the same file"),
        (with(&["identify", "step.csv", "--world", "w.toml", "--write"], &["w.toml"]), "that is the world itself"),
        (with(&["identify", "w", "--write"], &["w"]), "that is what is read itself"),
        (with(&["identify", "step.csv"], &["--write", "f", "--plot", "f"]), "are the same file"),
    ] {
        hapt(at.path(), &args).refused(2, &[message]);
        assert_eq!((names(at.path()), all()), before, "{args:?}");
    }
    // Devices may be named twice.
    let null = if cfg!(windows) { "NUL" } else { "/dev/null" };
    hapt(at.path(), BOUNDARY.iter().copied().chain(["--out", null, "--plot", null])).done();
    assert_eq!(names(at.path()), before.0);
}

#[cfg(unix)]
#[test]
fn a_sweeps_table_follows_links_and_its_ending_may_be_written_large() {
    use std::os::unix::fs::symlink;

    let at = folder(&[("w.toml", WHEEL), ("real", "old")]);
    let link = at.path().join("t.CSV");
    symlink("real", &link).unwrap();
    hapt(at.path(), SWEEP.iter().copied().chain(["t.CSV"])).done();
    assert!(link.is_symlink());
    assert!(fs::read_to_string(at.path().join("real")).unwrap().starts_with("device.damping"));
    symlink("round", at.path().join("round")).unwrap();
    fs::rename(at.path().join("round"), at.path().join("l.csv")).unwrap();
    symlink("l.csv", at.path().join("round")).unwrap();
    hapt(at.path(), SWEEP.iter().copied().chain(["l.csv"])).refused(3, &["too many links"]);
    assert!(at.path().join("l.csv").is_symlink());
}

#[cfg(unix)]
#[test]
fn a_file_keeps_who_may_read_it_and_a_write_protected_one_stays() {
    use std::os::unix::fs::PermissionsExt;

    let at = folder(&[("w.toml", WHEEL), ("i.csv", "old"), ("t.csv", "old")]);
    let mode = |name: &str| fs::metadata(at.path().join(name)).unwrap().permissions().mode() & 0o777;
    let set = |name: &str, mode| fs::set_permissions(at.path().join(name), fs::Permissions::from_mode(mode)).unwrap();
    let impedance = ["impedance", "w.toml", "--points", "3", "--out", "i.csv"];
    let sweep: Vec<_> = SWEEP.iter().copied().chain(["t.csv"]).collect();
    for (args, name) in [(&impedance[..], "i.csv"), (&sweep[..], "t.csv")] {
        set(name, 0o444);
        hapt(at.path(), args).refused(3, &[name, "write-protected"]);
        assert_eq!(fs::read_to_string(at.path().join(name)).unwrap(), "old");
        set(name, 0o600);
        hapt(at.path(), args).done();
        assert_eq!(mode(name), 0o600);
    }
}
