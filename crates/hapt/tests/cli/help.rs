//! Help and version.

use std::path::Path;

use crate::common::{Running, hapt, program};

const COMMANDS: &[&str] = &[
    "sim",
    "check",
    "design",
    "report",
    "plot",
    "log",
    "export",
    "sweep",
    "impedance",
    "boundary",
    "worst",
    "run",
    "flash",
    "identify",
    "devices",
    "simulate-drive",
    "latency",
    "live",
    "wheel",
    "init",
    "worlds",
    "explain",
];

/// Those below a command.
const SUBCOMMANDS: &[&[&str]] = &[
    &["export", "fmu"],
    &["export", "c"],
    &["log", "replay"],
    &["log", "convert"],
    &["explain", "schema"],
    &["explain", "man"],
    &["explain", "completions"],
    &["explain", "licences"],
];

/// The examples at the end of a help text, without their descriptions; a line that ends in \\ continues.
pub fn examples(help: &str) -> Vec<String> {
    let (_, examples) = help.split_once("Examples:\n").unwrap_or_else(|| panic!("no examples in {help}"));
    let examples = examples.replace("\\\n      ", "");
    let line = |line: &str| line.trim().split("   ").next().unwrap_or_default().trim().to_string();
    examples.lines().map(line).filter(|line| !line.is_empty()).collect()
}

pub fn help(args: &[&str]) -> String {
    let ended = hapt(Path::new("."), args).done();
    assert_eq!(ended.err, "");
    ended.out
}

#[test]
fn the_help_names_every_command_and_shows_examples() {
    let text = help(&["--help"]);
    for command in COMMANDS {
        assert!(text.contains(&format!("\n  {command} ")), "{text}");
    }
    assert!(examples(&text).iter().all(|line| line.starts_with("hapt")));
    assert!(examples(&text).len() > 1);
}

/// One space between any two words, however the lines are broken.
fn words(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn the_help_of_every_command_begins_with_what_the_list_says_of_it() {
    let list = words(&help(&["--help"]));
    for command in COMMANDS {
        let text = help(&[command, "--help"]);
        let about = words(text.split("\n\n").next().unwrap_or_default());
        assert!(list.contains(&format!(" {command} {}", about.trim_end_matches('.'))), "{command}: {about}");
    }
}

#[test]
fn the_help_of_every_command_has_an_example_of_it() {
    for command in COMMANDS {
        let text = help(&[command, "--help"]);
        let of_it = format!("hapt {command} ");
        assert!(examples(&text).iter().any(|line| format!("{line} ").contains(&of_it)), "{text}");
        assert!(text.contains(&format!("Usage: hapt {command}")), "{text}");
        assert_eq!(help(&["help", command]), text);
    }
    assert!(help(&["sim", "--help"]).contains("--set <KEY=VALUE>"));
    assert!(help(&["check", "--help"]).contains("--json"));
}

#[test]
fn no_example_is_broken_by_a_terminal_of_eighty_columns() {
    for args in [vec!["--help"]].into_iter().chain(COMMANDS.iter().map(|command| vec![*command, "--help"])) {
        let mut narrow = program(Path::new("."), &args);
        narrow.env("COLUMNS", "80");
        assert_eq!(examples(&Running::start(narrow).end().done().out), examples(&help(&args)));
    }
}

#[test]
fn the_version_is_the_packages() {
    for flag in ["--version", "-V"] {
        assert_eq!(help(&[flag]), format!("hapt {}\n", env!("CARGO_PKG_VERSION")));
    }
}

/// Every line of the examples, and of those that `hapt` without a command proposes, works when it is pasted into a shell.
#[cfg(unix)]
#[test]
fn every_example_runs_as_it_stands() {
    use crate::common::{WHEEL, folder, shell, worlds};

    let pair = "stations.left.world = \"wheel.toml\"\nstations.right.world = \"wheel.toml\"\n[[links]]\nkind = \"spring\"\n\
        between = [\"left\", \"right\"]\nstiffness = 0.1\nage_max = \"20 ms\"\n";
    let at = folder(&[("wheel.toml", WHEEL), ("pair.toml", pair)]);
    std::os::unix::fs::symlink(worlds(), at.path().join("worlds")).unwrap();

    let mut lines = examples(&help(&["--help"]));
    lines.extend(COMMANDS.iter().flat_map(|command| examples(&help(&[command, "--help"]))));
    for below in SUBCOMMANDS {
        lines.extend(examples(&help(&[*below, &["--help"]].concat())));
    }
    let proposed = help(&[]);
    let (_, proposed) = proposed.split_once("Next:\n").unwrap();
    lines.extend(examples(&format!("Examples:\n{proposed}")));
    assert!(lines.len() > 12, "{lines:?}");
    // Commands that run until they are ended, or need a board or a kernel module, have tests of their own.
    let runs = |line: &String| !["hapt live", "hapt wheel"].iter().any(|command| line.starts_with(command));
    for line in lines.into_iter().filter(|line| runs(line) && !line.contains(" hapt:")) {
        let ended = Running::start(shell(at.path(), &line)).end();
        let refused = line.contains("check")
            && (ended.out.starts_with("Not certified") || ended.out.contains("\"certified\": false"))
            || line.contains("worst")
                && !line.contains("||")
                && ["\nverdict   broken", "\"broken\": true"].iter().any(|answer| ended.out.contains(answer));
        assert_eq!(ended.code, Some(i32::from(refused)), "{line}: {ended:?}");
        assert!(!ended.err.contains("hapt: "), "{line}: {ended:?}");
    }
}
