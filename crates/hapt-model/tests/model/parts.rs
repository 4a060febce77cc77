//! The lists in CONTRIBUTING.md of the parts of a method, an estimator, a measure and a drive are those of the sources.

use std::fs;
use std::path::{Path, PathBuf};

/// One of the sections: the enum's file and name, and a variant that represents all in the search for files.
struct Part {
    what: &'static str,
    file: &'static str,
    names: &'static [&'static str],
    /// How its rows by hand may name the last variant.
    words: &'static [&'static str],
}

const PARTS: [Part; 4] = [
    Part { what: "method", file: "crates/hapt-core/src/spec.rs", names: &["Method"], words: &["foh", "Method::ALL"] },
    Part {
        what: "estimator",
        file: "crates/hapt-model/src/kinds.rs",
        names: &["EstimatorKind", "Estimator", "Kind"],
        words: &["levant"],
    },
    Part {
        what: "measure",
        file: "crates/hapt-sweep/src/sweep/measure.rs",
        names: &["Measure"],
        words: &["settling_time", "settlingtime"],
    },
    Part { what: "drive", file: "crates/hapt-drive/src/address.rs", names: &["Make"], words: &["simplefoc"] },
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn text(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// The files of the list below this line.
fn listed(header: &str) -> Vec<String> {
    let all = text("CONTRIBUTING.md");
    let (_, list) = all.split_once(&format!("{header}:\n")).unwrap_or_else(|| panic!("no list {header}"));
    let row = |line: &str| line.strip_prefix("- `").and_then(|rest| rest.split('`').next()).map(str::to_string);
    let files: Vec<String> = list.lines().skip(1).map_while(row).collect();
    assert!(files.len() > 1, "{header}");
    files
}

fn variants(part: &Part) -> Vec<String> {
    let source = text(part.file);
    let name = part.names[0];
    let (_, body) = source.split_once(&format!("pub enum {name} {{")).unwrap();
    let (body, _) = body.split_once("\n    }").unwrap();
    let name = |line: &str| Some(line.trim().split_once(" => ")?.0.split(" = ").next()?.to_string());
    let variants: Vec<String> = body.lines().filter_map(name).collect();
    assert!(variants.len() > 1, "{variants:?}");
    variants
}

/// Whether the text names a variant, not only a longer one.
fn has(source: &str, part: &Part, variant: &str) -> bool {
    part.names.iter().any(|name| {
        let full = format!("{name}::{variant}");
        source.match_indices(&full).any(|(at, _)| !source[at + full.len()..].starts_with(char::is_alphanumeric))
    })
}

#[test]
fn every_file_that_the_compiler_leads_to_names_every_variant() {
    for part in &PARTS {
        let variants = variants(part);
        for path in listed(&format!("every {}", part.what)) {
            let source = text(&path);
            for variant in &variants {
                let row = path == part.file && source.contains(&format!("{variant} => \""));
                assert!(row || has(&source, part, variant), "{path} lacks {variant}");
            }
        }
    }
}

#[test]
fn every_row_by_hand_is_there() {
    for part in &PARTS {
        let of = if part.what.starts_with('e') { "an" } else { "a" };
        for path in listed(&format!("row of {of} {}", part.what)) {
            let source = text(&path).to_lowercase();
            let found = part.words.iter().any(|word| source.contains(&word.to_lowercase()));
            assert!(found, "{path} has no row for the last {}", part.what);
        }
    }
}

/// A file that names all variants is in the list.
#[test]
fn no_file_of_the_sources_is_left_out() {
    for part in &PARTS {
        let of = if part.what.starts_with('e') { "an" } else { "a" };
        let (every, rows) = (listed(&format!("every {}", part.what)), listed(&format!("row of {of} {}", part.what)));
        let variants = variants(part);
        let mut folders: Vec<PathBuf> =
            ["crates", "xtask", "fuzz", "web/core"].map(|folder| root().join(folder)).into();
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() && !path.ends_with("target") && !path.ends_with("tests") {
                    folders.push(path);
                } else if path.extension().is_some_and(|ending| ending == "rs") {
                    let source = fs::read_to_string(&path).unwrap();
                    let source = source.split("#[cfg(test)]").next().unwrap();
                    if variants.iter().all(|variant| has(source, part, variant)) {
                        let inside = path.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/");
                        assert!(
                            every.contains(&inside) || rows.contains(&inside),
                            "{inside} is not in CONTRIBUTING.md"
                        );
                    }
                }
            }
        }
    }
}
