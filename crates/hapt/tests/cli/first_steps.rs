//! The first commands of a new user: init, worlds, explain with its schema, completions and manual.

use std::fs;
use std::io::pipe;
use std::path::Path;
use std::process::Stdio;

use hapt_model::{Source, World};
use serde_json::Value;

use crate::common::{Running, every_world, folder, hapt, hapt_reads, names, program, worlds};

const TEMPLATES: [&str; 8] =
    ["spring-mass", "wall", "detents", "damper", "inertia", "friction", "end-stops", "two-wheels"];
const NEW: [&str; 3] = ["init", "worlds", "explain"];

/// The output of a command, which prints nothing on standard error.
fn printed(args: &[&str]) -> String {
    let ended = hapt(Path::new("."), args).done();
    assert_eq!(ended.err, "", "{args:?}");
    assert!(ended.out.ends_with('\n'), "{args:?}: {}", ended.out);
    ended.out
}

fn topics() -> Vec<String> {
    printed(&["explain"]).lines().map(|line| line.split_whitespace().next().unwrap().to_string()).collect()
}

#[test]
fn every_template_makes_a_world_that_reads_runs_and_holds() {
    let at = folder(&[]);
    for template in TEMPLATES {
        let ended = hapt(at.path(), ["init", template, "--template", template]).done();
        assert!(ended.out.is_empty() && ended.err.contains("world.toml"), "{ended:?}");
        let here = at.path().join(template);
        assert_eq!(names(&here), ["hapt.schema.json", "world.toml"]);
        let text = fs::read_to_string(here.join("world.toml")).unwrap();
        assert!(text.starts_with("#:schema ./hapt.schema.json\n"), "{text}");

        let ended = hapt(&here, ["sim", "world.toml"]).done();
        let world = World::read(&Source::from_text(template, text), &[]).unwrap();
        assert!(world.scenarios.len() > 1, "{template}");
        for scenario in &world.scenarios {
            assert!(ended.out.contains(&format!("scenario {}: ", scenario.name)), "{}", ended.out);
        }
        assert!(!ended.out.contains("  asked for more"), "{template}: {}", ended.out);
        hapt(&here, ["check", "world.toml"]).done();
    }
}

/// Whatever a comment of a template proposes to `--set` is a key of it, and runs.
#[test]
fn what_the_comments_of_a_template_propose_runs() {
    let at = folder(&[]);
    let mut proposed = 0;
    for template in TEMPLATES {
        hapt(at.path(), ["init", template, "--template", template]).done();
        let here = at.path().join(template);
        let text = fs::read_to_string(here.join("world.toml")).unwrap();
        let comments = text.lines().filter_map(|line| line.split_once('#')).map(|(_, comment)| comment);
        for proposal in comments.flat_map(|comment| comment.split("--set ").skip(1)) {
            let set = proposal.split([' ', ',', ':', ';']).next().unwrap();
            hapt(&here, ["sim", "world.toml", "--set", set]).done();
            proposed += 1;
        }
    }
    assert!(proposed >= 12, "{proposed}");
}

#[test]
fn without_a_template_it_is_the_spring_and_mass_in_the_current_folder() {
    let at = folder(&[]);
    hapt(at.path(), ["init"]).done();
    assert_eq!(names(at.path()), ["hapt.schema.json", "world.toml"]);
    hapt(at.path(), ["init", "deep/er", "--template", "spring-mass"]).done();
    let read = |path: &str| fs::read(at.path().join(path)).unwrap();
    assert!(read("world.toml") == read("deep/er/world.toml"));
    assert!(read("hapt.schema.json") == printed(&["explain", "schema"]).into_bytes());
}

#[test]
fn init_overwrites_nothing() {
    let at = folder(&[("world.toml", "mine")]);
    hapt(at.path(), ["init"]).refused(2, &["world.toml is there already", "overwrites nothing"]);
    assert_eq!(names(at.path()), ["world.toml"]);
    assert_eq!(fs::read(at.path().join("world.toml")).unwrap(), b"mine");

    let at = folder(&[("hapt.schema.json", "mine")]);
    hapt(at.path(), ["init"]).refused(2, &["hapt.schema.json is there already"]);
    assert_eq!(names(at.path()), ["hapt.schema.json"]);

    let at = folder(&[]);
    hapt(at.path(), ["init"]).done();
    hapt(at.path(), ["init", "--template", "wall"]).refused(2, &["world.toml is there already"]);
    // Another world may be started next to an existing schema.
    fs::rename(at.path().join("world.toml"), at.path().join("mine.toml")).unwrap();
    hapt(at.path(), ["init"]).done();
    assert_eq!(names(at.path()), ["hapt.schema.json", "mine.toml", "world.toml"]);
}

#[test]
fn init_in_a_file_or_from_an_unknown_template_is_refused() {
    let at = folder(&[("file", "")]);
    hapt(at.path(), ["init", "file"]).refused(2, &["file is a file; init needs a folder"]);
    hapt(at.path(), ["init", "file/below"]).refused(2, &["file is a file; init needs a folder"]);
    hapt(at.path(), ["init", "mine/wheel.toml"]).refused(2, &["is the name of a file", "hapt init mine/wheel"]);
    let words = ["no template \"detent\"", "did you mean \"detents\"?", "spring-mass, wall, detents, damper"];
    hapt(at.path(), ["init", "--template", "detent"]).refused(2, &words);
    hapt(at.path(), ["init", "--template", "zebra"]).refused(2, &["; the templates are ", &TEMPLATES.join(", ")]);
    assert_eq!(names(at.path()), ["file"]);
}

#[test]
fn the_schema_is_json_of_a_draft_that_editors_know() {
    let schema: Value = serde_json::from_str(&printed(&["explain", "schema"])).unwrap();
    assert_eq!(schema["$schema"], "http://json-schema.org/draft-07/schema#");
}

#[test]
fn every_world_that_comes_along_is_built_in() {
    let at = folder(&[]);
    let list = printed(&["worlds"]);
    let listed: Vec<&str> = list.lines().filter(|line| line.starts_with('@')).collect();
    assert_eq!(listed.len(), every_world().len());
    for path in every_world() {
        let name = path.strip_prefix(worlds()).unwrap().with_extension("");
        let name = format!("@{}", name.to_str().unwrap().replace('\\', "/"));
        let world = World::read(&Source::open(&path).unwrap(), &[]).unwrap();
        let title = world.title.unwrap();
        let row = listed.iter().find(|line| line.split_once(' ').is_some_and(|(at, _)| at == name)).unwrap();
        assert!(row.ends_with(&title), "{row}");

        // The same, but for the name in messages.
        let [built_in, file] =
            [name.as_str().as_ref(), path.as_os_str()].map(|world| hapt(at.path(), ["check".as_ref(), world]));
        assert_eq!((built_in.code, &built_in.out), (file.code, &file.out));
        assert!(built_in.out.contains(&format!("\nworld     {title}: ")));
        assert_eq!(row.contains(" certified "), built_in.code == Some(0), "{row}");
    }
}

#[test]
fn a_built_in_world_takes_overrides_and_is_named_in_messages() {
    let at = folder(&[("turn.csv", "time_s,puck_deg\n0,0\n1,45\n")]);
    let ended = hapt(at.path(), ["sim", "@notes/euler", "--set", "loop.period=2ms", "--out", "out"]).done();
    assert!(ended.err.contains("5 001 rows"), "{}", ended.err);
    hapt(at.path(), ["sim", "@notes/euler", "--scenario", "no"]).refused(2, &["no scenario \"no\""]);
    let words = ["couplings.0.damping: not a key", " --> --set:1:13"];
    hapt(at.path(), ["check", "@notes/euler", "--set", "couplings.0.damping=1"]).refused(2, &words);
    let words = ["couplings.1.damping: there is no spring", " --> @notes/damped:"];
    hapt(at.path(), ["check", "@notes/damped", "--set", "couplings.0.between=[\"ground\", \"wheel\"]"])
        .refused(2, &words);

    // Path files are those of the current folder.
    let hand = "scenarios.step.hand={ kind = \"path\", file = \"turn.csv\" }";
    hapt(at.path(), ["sim", "@notes/wheel", "--set", hand]).done();
}

#[test]
fn an_unknown_built_in_world_is_refused_with_the_nearest() {
    let words = ["no world \"@notes/eulr\" is built in", "did you mean \"@notes/euler\"?", "hapt worlds"];
    for command in ["sim", "check"] {
        hapt(Path::new("."), [command, "@notes/eulr"]).refused(2, &words);
        hapt(Path::new("."), [command, "@"]).refused(2, &["no world \"@\" is built in"]);
    }
    // A file of such a name has a folder before it.
    let at = folder(&[("@mine", "[loop]\nperiod = 1\n[device]\ninertia = 1\n")]);
    hapt(at.path(), ["check", "./@mine"]).done();
}

#[test]
fn every_explanation_is_short_and_narrow() {
    let all = topics();
    assert!(all.len() > 30, "{all:?}");
    for topic in &all {
        let text = printed(&["explain", topic]);
        assert!((5..=12).contains(&text.lines().count()), "{topic}: {text}");
        for line in text.lines() {
            assert!(line.chars().count() <= 100 && line.trim_end() == line, "{topic}: {line}");
        }
    }
    assert!(printed(&["explain"]).lines().all(|line| line.chars().count() <= 100));
    let mut once = all.clone();
    once.sort();
    once.dedup();
    assert_eq!(once.len(), all.len());
}

#[test]
fn the_words_of_verdicts_loops_and_methods_are_topics() {
    let methods = hapt_model::Method::ALL.iter().map(|method| method.name());
    let outputs = hapt_model::EstimatorKind::ALL.iter().map(|kind| kind.name());
    let words = [
        "stable",
        "marginal",
        "unstable",
        "held",
        "growth",
        "critical-period",
        "passivity",
        "clipping",
        "limit",
        "levels",
        "encoder",
        "delay",
        "output",
        "estimator",
        "compensating",
        "dimension",
        "exit-codes",
        "duration",
        "unknown-key",
        "not-finite",
        "path",
        "Critical period",
        "Forward Euler",
        "nonlinear-at-a-body",
        "b = Tk",
    ];
    for word in words.into_iter().chain(methods).chain(outputs) {
        printed(&["explain", word]);
    }
    hapt(Path::new("."), ["explain", "grwoth"]).refused(2, &["no topic \"grwoth\"", "did you mean \"growth\"?"]);
    hapt(Path::new("."), ["explain", "zebra"]).refused(2, &["no topic \"zebra\"", "hapt explain lists them"]);
}

/// The text after a command in an explanation is in its output.
#[cfg(unix)]
#[test]
fn every_command_in_an_explanation_runs_and_prints_what_stands_beside_it() {
    use crate::common::shell;

    let at = folder(&[]);
    for topic in topics() {
        let text = printed(&["explain", &topic]);
        let commands = text.lines().filter_map(|line| line.strip_prefix("  ").filter(|line| line.starts_with("hapt ")));
        let mut count = 0;
        for line in commands {
            let (line, shown) = line.split_once("   ").unwrap_or((line, ""));
            let ended = Running::start(shell(at.path(), line)).end();
            // Behind a pipe the code is the reader's.
            let refused = !line.contains('|') && ended.out.starts_with("Not certified");
            assert_eq!(ended.code, Some(i32::from(refused)), "{topic}: {line}: {ended:?}");
            assert!(ended.out.contains(shown.trim()), "{topic}: {line} prints no {shown}: {}", ended.out);
            count += 1;
        }
        assert!(count > 0, "{topic} shows nothing");
    }
}

#[test]
fn completions_and_manual_know_every_command() {
    let help = printed(&["--help"]);
    let (_, commands) = help.split_once("Try it:\n").unwrap();
    let (commands, _) = commands.split_once("Options:\n").unwrap();
    let commands: Vec<&str> = commands
        .lines()
        // Between the names of groups; a longer description continues below, indented further.
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert!(NEW.iter().chain(&["sim", "check", "design"]).all(|command| commands.contains(command)), "{commands:?}");
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = printed(&["explain", "completions", shell]);
        for command in &commands {
            assert!(script.contains(command), "{shell}: {command}");
        }
        assert!(script.contains("--set") || script.contains("-l set"), "{shell}");
    }
    hapt(Path::new("."), ["explain", "completions", "tcsh"]).refused(2, &["tcsh", "bash"]);

    let page = printed(&["explain", "man"]);
    assert!(page.contains(".TH hapt 1"), "{page}");
    let at = folder(&[]);
    hapt(at.path(), ["explain", "man", "--out", "man"]).done();
    for command in commands.into_iter().filter(|command| *command != "help") {
        // A hyphen is escaped, so that no reader shows a minus.
        let name = format!("hapt-{command}").replace('-', "\\-");
        assert!(page.contains(&format!("{name}(1)")), "{command}: {page}");
        let own = fs::read_to_string(at.path().join(format!("man/hapt-{command}.1"))).unwrap();
        assert!(own.contains("Examples:") && own.contains(".SH SYNOPSIS"), "{own}");
    }
    assert_eq!(fs::read_to_string(at.path().join("man/hapt.1")).unwrap(), page);
    hapt(at.path(), ["explain", "man", "--out", "man/hapt.1"]).refused(2, &["is a file; expected a folder"]);
}

#[test]
fn a_reader_that_is_gone_ends_them_quietly() {
    for args in [
        &["worlds"][..],
        &["explain", "schema"],
        &["explain"],
        &["explain", "growth"],
        &["explain", "completions", "bash"],
        &["explain", "man"],
        &["check", "@notes/euler"],
    ] {
        let (reader, writer) = pipe().unwrap();
        drop(reader);
        let mut command = program(Path::new("."), args);
        command.stdout(writer).stderr(Stdio::piped());
        let ended = Running::start_as_it_is(command).end();
        assert_eq!((ended.code, ended.messages().len()), (Some(0), 0), "{args:?}: {ended:?}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_the_systems_failure() {
    for args in
        [&["worlds"][..], &["explain", "schema"], &["explain"], &["explain", "completions", "zsh"], &["explain", "man"]]
    {
        let mut command = program(Path::new("."), args);
        command.stdout(fs::OpenOptions::new().write(true).open("/dev/full").unwrap()).stderr(Stdio::piped());
        let ended = Running::start_as_it_is(command).end();
        assert_eq!(ended.code, Some(3), "{args:?}: {ended:?}");
        assert!(ended.err.starts_with("hapt: cannot write to standard output"), "{args:?}: {ended:?}");
    }
}

#[test]
fn a_template_on_standard_input_is_a_world_too() {
    let at = folder(&[]);
    hapt(at.path(), ["init", "--template", "two-wheels"]).done();
    let text = fs::read_to_string(at.path().join("world.toml")).unwrap();
    assert!(hapt_reads(at.path(), &text, ["check", "-"]).done().out.contains("stable: "));
}
