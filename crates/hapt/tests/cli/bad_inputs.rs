//! Bad inputs and the exact words that answer each: what was given, where, and what would be right.
//!
//! The table is in `bad_inputs/cases.rs` and `cases/systems.rs`, the answers in `bad_inputs/*.txt`, one file a theme. `HAPT_BLESS=1 cargo
//! test --test cli bad_inputs` writes them anew; read the changes aloud before they are merged.

mod cases;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use cases::{Case, cases};

/// Messages are for people, who do not read longer ones.
const MAX_ANSWER_CHARS: usize = 2000;

#[test]
fn every_bad_input_is_answered_in_the_reviewed_words() {
    let mut themes: BTreeMap<&str, String> = BTreeMap::new();
    let all = cases();
    for case in &all {
        let text = themes.entry(case.theme).or_default();
        write!(text, "{}## {}\n{}", if text.is_empty() { "" } else { "\n" }, case.name, answered(case)).unwrap();
    }
    let mut wrong = String::new();
    for (theme, given) in &themes {
        let path = folder().join(format!("{theme}.txt"));
        if std::env::var_os("HAPT_BLESS").is_some() {
            fs::write(&path, given).unwrap();
        }
        wrong += &differences(theme, given, &fs::read_to_string(&path).unwrap_or_default());
    }
    assert!(wrong.is_empty(), "{wrong}\nHAPT_BLESS=1 writes the new answers");
}

#[test]
fn the_table_has_sixty_different_inputs_and_no_answer_without_one() {
    let all = cases();
    let mut names: Vec<_> = all.iter().map(|case| (case.theme, case.name)).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), all.len(), "two cases of one name");
    assert!(all.len() >= 60, "{} cases", all.len());
    for entry in fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        let theme = path.file_stem().unwrap().to_str().unwrap();
        let known = theme == "cases" || names.iter().any(|(known, _)| *known == theme);
        assert!(known, "{} answers nothing", path.display());
    }
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/bad_inputs")
}

/// The typed line, the exit code and standard error; there may be no other effect.
fn answered(case: &Case) -> String {
    let at = tempfile::tempdir().unwrap();
    for (name, bytes) in &case.files {
        fs::write(at.path().join(name), bytes).unwrap();
    }
    // This build's, or the one that `cargo xtask test` names.
    let program = std::env::var_os("HAPT_PROGRAM").unwrap_or_else(|| env!("CARGO_BIN_EXE_hapt").into());
    let mut command = Command::new(program);
    command.current_dir(at.path()).args(&case.args).env_remove("CLICOLOR_FORCE").env("COLUMNS", "100");
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    // A program need not read all of its input.
    let _ = input.write_all(&case.input);
    drop(input);
    let output = child.wait_with_output().unwrap();

    let name = case.name;
    let code = output.status.code().unwrap_or_else(|| panic!("{name}: ended by {:?}", output.status));
    assert!(code == 2, "{name}: exit code {code}: {}", String::from_utf8_lossy(&output.stderr));
    assert!(output.stdout.is_empty(), "{name}: {}", String::from_utf8_lossy(&output.stdout));
    // What a slow computer adds.
    let is_progress = |line: &&str| line.ends_with(" s so far\n");
    let message = String::from_utf8(output.stderr).unwrap();
    let message: String = message.split_inclusive('\n').filter(|line| !is_progress(line)).collect();
    assert!(message.len() < MAX_ANSWER_CHARS, "{name}: {} bytes of message", message.len());
    assert!(message.chars().all(|c| c == '\n' || !c.is_control()), "{name}: control characters in {message:?}");
    assert_eq!(fs::read_dir(at.path()).unwrap().count(), case.files.len(), "{name}: files were left");
    format!("$ {}\nexit {code}\n{message}", case.typed())
}

/// The cases whose answers differ, both sides of each.
fn differences(theme: &str, given: &str, reviewed: &str) -> String {
    let sections = |text: &str| -> BTreeMap<String, String> {
        let section =
            |part: &str| part.split_once('\n').map(|(name, text)| (name.to_string(), text.trim_end().to_string()));
        text.split("## ").filter_map(section).collect()
    };
    let (given, reviewed) = (sections(given), sections(reviewed));
    let mut out = String::new();
    for name in given.keys().chain(reviewed.keys().filter(|name| !given.contains_key(*name))) {
        let (now, then) = (given.get(name), reviewed.get(name));
        if now != then {
            let side = |text: Option<&String>| text.map_or("(nothing)", |text| text).replace('\n', "\n    ");
            writeln!(out, "{theme}: {name}\n  reviewed:\n    {}\n  now:\n    {}", side(then), side(now)).unwrap();
        }
    }
    out
}
