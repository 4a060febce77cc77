//! `hapt sweep`: tables, pictures, and the rows that an interruption leaves.

use std::fs;
use std::path::Path;

use parquet::file::reader::{FileReader, SerializedFileReader};

use crate::common::{WHEEL, folder, hapt, names};

/// A sweep of the wheel's period.
fn sweep(at: &Path, more: &[&str]) -> crate::common::Ended {
    let args = ["sweep", "w.toml", "--vary", "loop.period=1ms..9ms:5", "--measure", "peak_torque,held_growth_per_s"];
    hapt(at, args.iter().chain(more))
}

#[test]
fn a_sweep_writes_a_row_a_cell_and_a_curve() {
    let at = folder(&[("w.toml", WHEEL)]);
    let ended = sweep(at.path(), &["--out", "t.csv", "--plot", "t.svg"]);
    assert_eq!((ended.code, ended.out.as_str()), (Some(0), ""), "{ended:?}");
    assert_eq!(names(at.path()), ["t.csv", "t.svg", "w.toml"]);
    let text = fs::read_to_string(at.path().join("t.csv")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[0], "loop.period,peak_torque,held_growth_per_s");
    assert_eq!(lines.len(), 6);
    assert!(lines[5].starts_with("0.009,"), "{text}");
    let svg = fs::read_to_string(at.path().join("t.svg")).unwrap();
    assert!(svg.contains("peak torque (N·m)") && svg.contains("sampling period (ms)"), "{svg}");
}

#[test]
fn threads_and_format_do_not_change_what_stands_in_the_table() {
    let at = folder(&[("w.toml", WHEEL)]);
    let table = |more: &[&str]| {
        sweep(at.path(), more).done();
        fs::read(at.path().join(more[1])).unwrap()
    };
    let one = table(&["--out", "one.csv", "--threads", "1"]);
    assert_eq!(one, table(&["--out", "three.csv", "--threads", "3"]));
    let columnar = table(&["--out", "one.parquet", "--threads", "1"]);
    assert_eq!(columnar, table(&["--out", "three.parquet", "--threads", "3"]));
    assert_eq!((&columnar[..4], &columnar[columnar.len() - 4..]), (&b"PAR1"[..], &b"PAR1"[..]));
}

#[test]
fn a_map_shows_both_axes_and_the_edge_of_growth() {
    let at = folder(&[("w.toml", WHEEL)]);
    let args = "sweep w.toml --set loop.method=forward-euler --vary loop.period=1ms..40ms:30 --vary device.damping=0..1:7 \
        --measure held_growth_per_s --out map.csv --plot map.svg";
    hapt(at.path(), args.split_whitespace()).done();
    assert_eq!(fs::read_to_string(at.path().join("map.csv")).unwrap().lines().count(), 211);
    let svg = fs::read_to_string(at.path().join("map.svg")).unwrap();
    assert!(svg.contains("sampling period (ms)") && svg.contains("damping of the device (N·m·s/rad)"), "{svg}");
    assert!(svg.contains("class=\"cell"), "{svg}");
}

/// A figure for a paper is as wide as its column, has no title, as the paper has its caption, and names its measure and axes itself.
#[test]
fn a_figure_for_a_paper_has_its_width_and_no_title() {
    let at = folder(&[("w.toml", WHEEL)]);
    let args =
        ["sweep", "w.toml", "--vary", "couplings.0.stiffness=10..30Nmm/deg:5", "--vary", "loop.period=1ms..9ms:5"];
    let measure = [
        "--measure",
        "held_growth_per_s",
        "--out",
        "m.csv",
        "--plot",
        "m.svg",
        "--width",
        "3.5 in",
        "--font-size",
        "7",
    ];
    hapt(at.path(), args.into_iter().chain(measure)).done();
    let svg = fs::read_to_string(at.path().join("m.svg")).unwrap();
    for part in [" width=\"88.9mm\"", ">held growth (1/s)</text>", ">stiffness of the spring puck–", "(N·mm/°)</text>"]
    {
        assert!(svg.contains(part), "{part}: {svg}");
    }
    let title = svg.split("<title>").nth(1).unwrap().split('<').next().unwrap();
    assert!(!svg.contains(&format!(">{title}</text>")), "{title}");
    for (more, part) in [
        (vec!["--width", "20 mm"], "expected"),
        (vec!["--width", "88 mm", "--font-size", "nan"], "text of NaN points"),
        (vec!["--font-size", "7"], "--width"),
        (vec!["--dpi", "601"], "601 is not in 50..=600"),
    ] {
        let ended = hapt(
            at.path(),
            args.into_iter().chain(["--measure", "held_growth_per_s", "--out", "x.csv", "--plot", "x.png"]).chain(more),
        );
        assert!(ended.code == Some(2) && ended.err.contains(part), "{ended:?}");
    }
    let ended = hapt(
        at.path(),
        args.into_iter().chain(["--measure", "held_growth_per_s", "--out", "x.csv", "--width", "88 mm"]),
    );
    assert!(ended.code == Some(2) && ended.err.contains("without --plot"), "{ended:?}");
    assert_eq!(names(at.path()), ["m.csv", "m.svg", "w.toml"]);
}

#[test]
fn what_cannot_be_swept_is_said_and_leaves_nothing() {
    let at = folder(&[("w.toml", WHEEL)]);
    for (more, parts) in [
        (&["--out", "t.txt"][..], &["t.txt", "FILE.csv or FILE.parquet"][..]),
        (&["--out", "t"], &["FILE.csv or FILE.parquet"]),
        (&["--out", "t.csv", "--measure", "speed"], &["no \"speed\"", "peak_torque"]),
        (&["--out", "t.csv", "--scenario", "walk"], &["no scenario \"walk\""]),
        (&["--out", "t.csv", "--threads", "0"], &["--threads 0"]),
        (&["--out", "t.csv", "--vary", "loop.period=1ms..2ms:2"], &["varied twice"]),
        (
            &[
                "--out",
                "t.csv",
                "--vary",
                "device.damping=0..1:2",
                "--vary",
                "device.friction=0..1:2",
                "--plot",
                "t.svg",
            ],
            &["--plot", "two"],
        ),
        (
            &["--out", "t.csv", "--vary", "device.damping=0..1:1000000000", "--plot", "t.svg"],
            &["up to 10 000 000 cells", "5 000 000 000", "no --plot"],
        ),
        (&["--out", "t.csv", "--vary", "device.damping=0..1:10000000000"], &["10000000000 cells"]),
        (&["--out", "t.csv", "--vary", "device.damping=0..1:99999999999999999999"], &["not a number of values"]),
        (&["--out", "t.csv", "--vary", "device.damping=0..1e-3:3:log"], &["on one side of 0"]),
        (&["--out", "t.csv", "--vary", "loop.method=zoh..foh:2"], &["loop.method"]),
        (&["--out", "t.csv", "--vary", "device.encoder=1000..2000:7"], &["whole"]),
    ] {
        sweep(at.path(), more).refused(2, parts);
        assert_eq!(names(at.path()), ["w.toml"], "{more:?}");
    }
    sweep(at.path(), &["--out", "none/t.csv"]).refused(3, &["cannot write", "none"]);
}

#[test]
fn a_cell_without_a_value_is_empty_and_counted() {
    // Forward Euler leaves the numbers at the longer periods.
    let at = folder(&[("w.toml", WHEEL)]);
    let args = "sweep w.toml --set loop.method=forward-euler --set scenarios.step.duration=500s --vary loop.period=1ms..0.4s:3 \
                --measure peak_torque --out t.csv";
    let ended = hapt(at.path(), args.split_whitespace().filter(|word| *word != "\\"));
    assert_eq!(ended.code, Some(0), "{ended:?}");
    assert!(ended.err.contains("peak_torque has no value in 2 of them"), "{ended:?}");
    let table = fs::read_to_string(at.path().join("t.csv")).unwrap();
    assert_eq!(table.lines().filter(|line| line.ends_with(',')).count(), 2, "{table}");
}

#[test]
fn the_shards_of_a_table_one_after_the_other_are_the_table() {
    let at = folder(&[("w.toml", WHEEL)]);
    let table = |more: &[&str]| {
        sweep(at.path(), more).done();
        fs::read_to_string(at.path().join(more[1])).unwrap()
    };
    let whole = table(&["--out", "whole.csv"]);
    // Also with more shards than rows.
    for count in [1, 2, 3, 5, 7] {
        let shards: Vec<String> =
            (0..count).map(|i| table(&["--out", "shard.csv", "--shard", &format!("{i}/{count}")])).collect();
        assert_eq!(shards.concat(), whole, "{count}");
    }
    let parquet: Vec<String> = (0..2).map(|i| format!("{i}.parquet")).collect();
    for (i, name) in parquet.iter().enumerate() {
        sweep(at.path(), &["--out", name, "--shard", &format!("{i}/2")]).done();
    }
    let rows = |name: &str| {
        let file = fs::File::open(at.path().join(name)).unwrap();
        let reader = SerializedFileReader::new(file).unwrap();
        reader.metadata().file_metadata().num_rows()
    };
    assert_eq!(parquet.iter().map(|name| rows(name)).collect::<Vec<_>>(), [2, 3]);

    for (wrong, hint) in [("3/3", "2/3"), ("0/0", "I/N"), ("1", "I/N"), ("-1/3", "I/N"), ("a/3", "I/N")] {
        let ended = sweep(at.path(), &["--out", "t.csv", &format!("--shard={wrong}")]);
        assert!(ended.code == Some(2) && ended.err.contains(hint), "{wrong}: {ended:?}");
    }
    let ended = sweep(at.path(), &["--out", "t.csv", "--shard", "0/2", "--plot", "t.svg"]);
    assert_eq!(ended.code, Some(2), "{ended:?}");
}

/// A finished table is replaced by its own rows only, in either format, unless `--resume` is left out.
#[test]
fn a_resumed_sweep_replaces_no_other_table() {
    let at = folder(&[("w.toml", WHEEL), ("notes.csv", "a line\n")]);
    for name in ["t.csv", "t.parquet"] {
        let shard = |i: usize, more: &[&str]| {
            sweep(at.path(), &[&["--out", name, "--shard", &format!("{i}/2")], more].concat())
        };
        let bytes = || fs::read(at.path().join(name)).unwrap();
        shard(0, &["--resume"]).done();
        let first = bytes();
        // 2 of the 5 periods are the first shard's, 3 the second's, which begins with 5 ms.
        let parts = ["it holds 2 rows from loop.period = 0.001 on", "3 rows from loop.period = 0.005 on", "t.2."];
        shard(1, &["--resume"]).refused(2, &parts);
        sweep(at.path(), &["--out", name, "--resume"]).refused(2, &["it holds 2 rows", "the sweep is 5 rows"]);
        assert!(bytes() == first, "{name}");
        shard(0, &["--resume"]).done();
        assert!(bytes() == first, "{name}");
        shard(1, &[]).done();
        assert!(bytes() != first, "{name}");
    }
    sweep(at.path(), &["--out", "notes.csv", "--resume"]).refused(2, &["no table of this sweep"]);
    assert_eq!(names(at.path()), ["notes.csv", "t.csv", "t.parquet", "w.toml"]);
}

#[cfg(unix)]
mod interrupted {
    use std::sync::OnceLock;

    use super::*;
    use crate::common::{Running, program};

    /// On one thread, long enough that a machine that stands still for a moment does not miss it.
    const LONG: &str = "sweep w.toml --set scenarios.step.duration=40s --vary device.damping=0..1:300 --measure peak_torque --threads 1 \
        --out t.csv";

    /// The table of [`LONG`], made without an interruption.
    fn whole() -> &'static [u8] {
        static WHOLE: OnceLock<Vec<u8>> = OnceLock::new();
        WHOLE.get_or_init(|| {
            let at = folder(&[("w.toml", WHEEL)]);
            hapt(at.path(), LONG.split_whitespace()).done();
            fs::read(at.path().join("t.csv")).unwrap()
        })
    }

    fn partial(at: &Path) -> Option<String> {
        names(at).into_iter().find(|name| name.ends_with(".partial"))
    }

    #[test]
    fn an_interrupted_sweep_goes_on_where_it_was() {
        let at = folder(&[("w.toml", WHEEL)]);
        let mut running = Running::start(program(at.path(), LONG.split_whitespace()));
        let lines =
            || partial(at.path()).map_or(0, |name| fs::read_to_string(at.path().join(name)).unwrap().lines().count());
        running.until("some rows are there", |_, _| lines() > 5);
        running.signal("INT");
        let ended = running.end();
        assert_eq!((ended.code, ended.out.as_str()), (Some(130), ""), "{ended:?}");
        assert!(ended.err.contains("--resume"), "{ended:?}");
        assert!(!names(at.path()).contains(&"t.csv".to_string()));

        // Half a line more, as a kill in the middle of a write would leave it.
        let path = at.path().join(partial(at.path()).unwrap());
        let rows = fs::read_to_string(&path).unwrap();
        fs::write(&path, format!("{rows}0.5,0.3")).unwrap();
        let resumed = hapt(at.path(), LONG.split_whitespace().chain(["--resume"]));
        assert_eq!(resumed.code, Some(0), "{resumed:?}");
        assert!(resumed.err.contains(&format!("going on behind {}", rows.lines().count() - 1)), "{resumed:?}");
        assert_eq!(names(at.path()), ["t.csv", "w.toml"]);
        assert!(fs::read(at.path().join("t.csv")).unwrap() == whole());
    }

    #[test]
    fn an_interrupted_shard_goes_on_as_itself() {
        let at = folder(&[("w.toml", WHEEL)]);
        let shard = |i: usize| LONG.split_whitespace().map(String::from).chain(["--shard".into(), format!("{i}/2")]);
        let mut running = Running::start(program(at.path(), shard(1)));
        let rows =
            || partial(at.path()).map_or(0, |name| fs::read_to_string(at.path().join(name)).unwrap().lines().count());
        running.until("some rows are there", |_, _| rows() > 5);
        running.signal("INT");
        assert_eq!(running.end().code, Some(130));
        let kept = rows();
        // The other shard does not use its rows.
        let other = hapt(at.path(), shard(0).chain(["--resume".into()]));
        assert!(other.code == Some(0) && other.err.contains("to continue from"), "{other:?}");
        // Nor is it replaced by them.
        let first = fs::read_to_string(at.path().join("t.csv")).unwrap();
        hapt(at.path(), shard(1).chain(["--resume".into()])).refused(
            2,
            &["t.csv", "it holds 150 rows from device.damping = 0 on", "the shard is 150 rows", "t.150.csv"],
        );
        assert_eq!(fs::read_to_string(at.path().join("t.csv")).unwrap(), first);
        assert_eq!(rows(), kept);
        fs::rename(at.path().join("t.csv"), at.path().join("first.csv")).unwrap();
        let resumed = hapt(at.path(), shard(1).chain(["--resume".into()]));
        assert!(resumed.err.contains(&format!("going on behind {kept}")), "{resumed:?}");
        let second = fs::read_to_string(at.path().join("t.csv")).unwrap();
        assert!((first + &second).as_bytes() == whole());
    }

    #[test]
    fn another_sweep_does_not_go_on_from_it() {
        let at = folder(&[("w.toml", WHEEL)]);
        let mut running = Running::start(program(at.path(), LONG.split_whitespace()));
        running.until("it is begun", |_, _| partial(at.path()).is_some());
        running.signal("TERM");
        assert_eq!(running.end().code, Some(143));
        let kept = partial(at.path()).unwrap();
        let other = LONG.replace("40s", "1s");
        let ended = hapt(at.path(), other.split_whitespace().chain(["--resume"]));
        assert_eq!(ended.code, Some(0), "{ended:?}");
        assert!(ended.err.contains("to continue from"), "{ended:?}");
        assert_eq!(names(at.path()), ["t.csv".to_string(), kept, "w.toml".to_string()]);
    }
}
