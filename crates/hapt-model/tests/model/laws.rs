//! The list in CONTRIBUTING.md of the parts of a coupling law is that of the sources.

use std::fs;
use std::path::{Path, PathBuf};

use hapt_core::{Law, spec::Range};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn text(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The files of the section's two lists: those that contain every law, and those in which each has a row.
fn lists() -> [Vec<String>; 2] {
    let all = text("CONTRIBUTING.md");
    let section = all.split("\n## ").find(|section| section.starts_with("A coupling law")).unwrap();
    let (every, rows) = section.split_once("a row of a law, added by hand:").unwrap();
    [every, rows].map(|part| {
        let row = |line: &str| line.strip_prefix("- `").and_then(|rest| rest.split('`').next()).map(str::to_string);
        part.lines().filter_map(row).collect()
    })
}

/// The variants of the core's enum.
fn variants() -> Vec<String> {
    let core = text("crates/hapt-core/src/law/mod.rs");
    let body = core.split("pub enum Law {").nth(1).and_then(|rest| rest.split("\n}").next()).unwrap();
    let name = |line: &str| line.strip_prefix("    ")?.strip_suffix(" {").map(str::to_string);
    body.lines().filter_map(name).filter(|name| name.starts_with(char::is_uppercase)).collect()
}

#[test]
fn every_file_that_the_compiler_leads_to_names_every_law() {
    let (variants, [every, _]) = (variants(), lists());
    assert!(variants.len() >= 12 && every.len() >= 6, "{variants:?} {every:?}");
    for path in every {
        let source = text(&path);
        for variant in &variants {
            assert!(
                source.contains(&format!("Law::{variant}")) || source.contains(&format!("Core::{variant}")),
                "{path} lacks {variant}"
            );
        }
    }
}

#[test]
fn every_law_is_among_all_with_numbers_of_its_ranges() {
    let mut named: Vec<String> =
        Law::ALL.iter().map(|law| format!("{law:?}").split(' ').next().unwrap().to_string()).collect();
    named.dedup();
    assert_eq!(named, variants());
    for mut law in Law::ALL {
        let of = format!("{law:?}");
        for quantity in law.quantities() {
            let fits = match quantity.range {
                Range::Any => quantity.value.is_finite(),
                Range::ZeroOrMore => *quantity.value >= 0.0,
                Range::Positive => *quantity.value > 0.0,
            };
            assert!(fits, "{} of {of}", quantity.name);
        }
    }
}

/// Every file that names a magnet is in the list, and every file of the list names a magnet.
#[test]
fn the_list_is_that_of_the_sources() {
    let [every, rows] = lists();
    let listed: Vec<String> = every.into_iter().chain(rows).collect();
    for path in &listed {
        assert!(text(path).to_lowercase().contains("magnet"), "{path} has no row for a magnet");
    }
    let mut folders: Vec<PathBuf> =
        ["crates", "xtask/src", "fuzz/src", "testing/src"].map(|folder| root().join(folder)).into();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() && !path.ends_with("target") {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "rs")
                && !path.ends_with("law/magnet.rs")
                && !path.ends_with("model/laws.rs")
                && fs::read_to_string(&path).unwrap().contains("Law::Magnet")
            {
                let inside = path.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/");
                assert!(listed.contains(&inside), "{inside} is not in CONTRIBUTING.md");
            }
        }
    }
}
