//! `hapt report` and `hapt plot`: their outputs, and their refusals.

use std::fs;

use crate::common::{WHEEL, folder, hapt, hapt_reads, names, shipped};

#[test]
fn a_report_is_a_page_and_its_figures() {
    let at = folder(&[("wheel.toml", WHEEL)]);
    let ended = hapt(at.path(), ["report", "wheel.toml", "--out", "pages"]).done();
    assert!(ended.out.is_empty() && ended.messages()[0].starts_with("wrote pages/wheel.html"), "{ended:?}");
    let figures = ["eigenvalues", "free-eigenvalues", "free-periods", "periods", "step-energy", "step-motion", "world"];
    let mut wanted: Vec<String> = figures.iter().map(|name| format!("wheel-{name}.svg")).collect();
    wanted.extend(["live".into(), "wheel.html".into()]);
    wanted.sort();
    assert_eq!(names(&at.path().join("pages")), wanted);
    let page = fs::read_to_string(at.path().join("pages/wheel.html")).unwrap();
    assert!(page.contains("<title>wheel</title>") && page.contains("822.25 N mm") && page.contains("0.82225 N m"));
}

#[test]
fn a_report_leads_to_a_page_on_which_the_world_runs_and_all_that_this_asks_for_is_there() {
    let at = folder(&[("wheel.toml", WHEEL)]);
    let args = ["report", "wheel.toml", "@notes/euler", "--set", "loop.period=2 ms", "--out", "pages"];
    hapt(at.path(), args).done();
    let live = at.path().join("pages/live");
    let files: Vec<String> = names(&live);
    assert_eq!(files, ["assets", "euler.html", "euler.js", "wheel.html", "wheel.js"]);
    for stem in ["wheel", "euler"] {
        let report = fs::read_to_string(at.path().join(format!("pages/{stem}.html"))).unwrap();
        assert!(report.contains(&format!("href=\"live/{stem}.html\"")));
        let page = fs::read_to_string(live.join(format!("{stem}.html"))).unwrap();
        let loaded: Vec<&str> = page.split('"').filter(|word| word.starts_with("./")).collect();
        assert!(loaded.len() >= 4 && loaded.contains(&format!("./{stem}.js").as_str()), "{loaded:?}");
        for file in loaded {
            assert!(live.join(file).is_file(), "{file}");
        }
        // Features that a page opened from a folder cannot use.
        assert!(!page.contains("type=\"module\"") && !page.contains("crossorigin"));
    }
    let data = fs::read_to_string(live.join("wheel.js")).unwrap();
    assert!(data.contains("\"command\":\"wheel.toml --set 'loop.period=2 ms'\"") && data.contains("../wheel.html"));
    // Two runs write the same bytes: nothing in them depends on the time.
    hapt(at.path(), ["report", "wheel.toml", "--set", "loop.period=2 ms", "--out", "again"]).done();
    assert_eq!(fs::read_to_string(at.path().join("again/live/wheel.js")).unwrap(), data);
}

#[test]
fn a_world_too_fast_for_a_page_has_a_report_and_a_word_why() {
    let at = folder(&[("wheel.toml", WHEEL)]);
    let fast = ["--set", "loop.period=20 us", "--set", "scenarios.step.duration=10 ms"];
    let ended = hapt(at.path(), ["report", "wheel.toml", "--out", "pages"].iter().chain(&fast)).done();
    assert!(ended.messages()[0].contains("50 us to 100 ms"), "{ended:?}");
    let report = fs::read_to_string(at.path().join("pages/wheel.html")).unwrap();
    assert!(!report.contains("href=\"live") && !at.path().join("pages/live").exists());
}

#[test]
fn several_worlds_have_an_index_and_each_its_own_name() {
    let at = folder(&[("wheel.toml", WHEEL)]);
    fs::create_dir(at.path().join("b")).unwrap();
    fs::write(at.path().join("b/Wheel.toml"), WHEEL).unwrap();
    fs::write(at.path().join("b/index.toml"), WHEEL).unwrap();
    hapt(at.path(), ["report", "wheel.toml", "b/Wheel.toml", "b/index.toml", "--out", "pages"]).done();
    let pages: Vec<String> = names(&at.path().join("pages")).into_iter().filter(|n| n.ends_with(".html")).collect();
    assert_eq!(pages, ["Wheel-2.html", "index-2.html", "index.html", "wheel.html"]);
    let index = fs::read_to_string(at.path().join("pages/index.html")).unwrap();
    for page in ["Wheel-2.html", "index-2.html", "wheel.html"] {
        assert!(index.contains(&format!("href=\"{page}\"")), "{page}");
    }
}

#[test]
fn a_world_on_standard_input_is_called_world_and_takes_overrides() {
    let at = folder(&[]);
    hapt_reads(at.path(), WHEEL, ["report", "-", "--set", "loop.period=2ms", "--out", "."]).done();
    let page = fs::read_to_string(at.path().join("world.html")).unwrap();
    assert!(page.contains("present period, 2 ms"));
}

#[test]
fn a_report_with_anything_wrong_writes_nothing() {
    let at = folder(&[("wheel.toml", WHEEL), ("bad.toml", "[loop]\nperiod = \"1 kg\"\n"), ("file", "")]);
    for (args, words) in [
        (&["report", "wheel.toml", "missing.toml", "--out", "pages"][..], "missing.toml"),
        (&["report", "wheel.toml", "bad.toml", "--out", "pages"], "1 kg"),
        (&["report", "wheel.toml", "--set", "loop.perod=2ms", "--out", "pages"], "perod"),
        (&["report", "wheel.toml", "--out", "file"], "is a file"),
        (&["report", "-", "-", "--out", "pages"], "only once"),
        (&["report", "wheel.toml"], "--out"),
        (&["report", "--out", "pages"], "WORLD"),
    ] {
        hapt(at.path(), args).refused(2, &[words]);
        assert_eq!(names(at.path()), ["bad.toml", "file", "wheel.toml"], "{args:?}");
    }
}

#[test]
fn a_file_where_the_pages_folder_belongs_is_left_alone() {
    let at = folder(&[("wheel.toml", WHEEL)]);
    fs::create_dir(at.path().join("pages")).unwrap();
    fs::write(at.path().join("pages/live"), "mine").unwrap();
    hapt(at.path(), ["report", "wheel.toml", "--out", "pages"]).refused(2, &["pages/live is a file"]);
    assert_eq!(names(&at.path().join("pages")), ["live"]);
}

#[test]
fn a_world_that_runs_away_is_shown_up_to_there() {
    let at = folder(&[("wheel.toml", WHEEL)]);
    let away =
        ["--set", "loop.method=forward-euler", "--set", "loop.period=1 s", "--set", "scenarios.step.duration=1000 s"];
    let ended = hapt(at.path(), ["report", "wheel.toml", "--out", "pages"].iter().chain(&away));
    assert_eq!(ended.code, Some(3), "{ended:?}");
    let page = fs::read_to_string(at.path().join("pages/wheel.html")).unwrap();
    assert!(page.contains("stops being finite at t = "));
}

#[cfg(unix)]
#[test]
fn an_interrupted_report_leaves_nothing_half_written() {
    use crate::common::{Running, program};

    let at = folder(&[("wheel.toml", WHEEL)]);
    let endless = ["--set", "loop.period=1 us", "--set", "scenarios.step.duration=9999 s"];
    let mut running =
        Running::start(program(at.path(), ["report", "wheel.toml", "--out", "pages"].iter().chain(&endless)));
    running.until("it runs", |_, err| err.contains(" samples"));
    running.signal("INT");
    let ended = running.end();
    assert_eq!(ended.code, Some(130), "{ended:?}");
    assert_eq!(names(at.path()), ["wheel.toml"]);
}

#[test]
fn a_run_is_drawn_again_from_its_csv_as_the_report_draws_it() {
    let at = folder(&[]);
    let world = shipped("notes/resonance.toml");
    hapt(at.path(), ["report", &world, "--out", "pages"]).done();
    hapt(at.path(), ["sim", &world, "--out", "runs"]).done();
    let runs = at.path().join("runs");
    let run = runs.join(&names(&runs)[0]);
    let svg = hapt(at.path(), ["plot", run.to_str().unwrap(), "--limit", "822.25 N mm"]).done().out;
    let name = run.file_stem().unwrap().to_str().unwrap().to_string();
    let reported = fs::read_to_string(at.path().join(format!("pages/resonance-{name}-motion.svg"))).unwrap();
    let curves = |svg: &str| {
        svg.split("<path").filter(|path| path.contains("class=\"line s")).map(String::from).collect::<Vec<_>>()
    };
    assert!(!curves(&svg).is_empty());
    assert_eq!(curves(&svg), curves(&reported));
}

#[test]
fn a_csv_that_is_no_run_is_refused_with_its_line() {
    let good = "time_s,puck_rad,puck_rad_per_s,torque_Nm,applied_Nm\n0,0,0,0,0\n";
    let at = folder(&[("bad.csv", &good.replace("0,0,0,0,0", "0,0,0,0")), ("good.csv", good)]);
    let plot = |args: &[&str]| hapt(at.path(), ["plot"].iter().chain(args));
    plot(&["missing.csv"]).refused(2, &["missing.csv"]);
    plot(&["bad.csv", "--out", "bad.svg"]).refused(2, &["bad.csv, line 2", "4 fields"]);
    plot(&["good.csv", "--limit", "5 N", "--out", "bad.svg"]).refused(2, &["--limit", "a torque"]);
    plot(&["good.csv", "--limit=-5 N m", "--out", "bad.svg"]).refused(2, &["--limit", "positive"]);
    assert_eq!(names(at.path()), ["bad.csv", "good.csv"]);
    plot(&["good.csv", "--out", "good.svg"]).done();
    assert!(fs::read_to_string(at.path().join("good.svg")).unwrap().starts_with("<svg xmlns="));
}
