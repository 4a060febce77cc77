//! The licences in the shipped program: each crate with its terms, and every text that has to be included.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

/// The text of `hapt explain licences`.
const FILE: &str = "crates/hapt/src/explain/licences.txt";
/// The licences that may be chosen, by preference.
const CHOICE: [&str; 8] =
    ["MIT", "Apache-2.0", "Zlib", "Unicode-3.0", "CC0-1.0", "MIT-0", "BSD-2-Clause", "BSD-3-Clause"];
/// The head of the text.
const HEAD: &str = "\
hapt is licensed under MIT or Apache-2.0, at your choice. Its program holds the work of others, on every platform no more than
the crates below, under these terms; each is followed by the number of its text.
";
/// Parts of the program that are not crates: name, terms, text.
const OTHERS: [(&str, &str, &str); 3] = [
    ("uPlot (the page's plots)", "MIT", "web/node_modules/uplot/LICENSE"),
    ("uqr (the page's QR code)", "MIT", "web/node_modules/uqr/LICENSE"),
    ("DejaVu fonts (in figures)", "Bitstream Vera and Arev", "crates/hapt-report/fonts/LICENSE"),
];

/// A crate in the program.
struct Part {
    /// "serde 1.0.0"
    name: String,
    licence: String,
    authors: String,
    folder: PathBuf,
}

/// Makes the file anew.
pub fn write() -> Result<()> {
    let (mut list, mut texts) = (String::new(), Vec::new());
    let mut number = |text: String| -> usize {
        let at = texts.iter().position(|known: &String| *known == text);
        at.unwrap_or_else(|| {
            texts.push(text);
            texts.len() - 1
        }) + 1
    };
    for part in parts()? {
        let numbers: BTreeSet<usize> = part.texts()?.into_iter().map(&mut number).collect();
        let numbers = numbers.iter().map(|n| format!("[{n}]")).collect::<Vec<_>>().join(" ");
        list += &format!("{:<40} {:<52} {numbers}\n", part.name, part.licence);
    }
    for (name, licence, file) in OTHERS {
        let text = fs::read_to_string(file).with_context(|| format!("{file}: npm ci in web/ first"))?;
        list += &format!("{name:<40} {licence:<52} [{}]\n", number(tidy(&text)));
    }
    let rust = "Copyright (c) The Rust Project Contributors".to_string();
    list += &format!("{:<40} {:<52} [{}]\n", "Rust's standard library", "MIT OR Apache-2.0", number(mit(&rust)?));
    let rule = "-".repeat(100);
    let texts: String = texts.iter().enumerate().map(|(i, text)| format!("\n[{}] {rule}\n\n{text}\n", i + 1)).collect();
    fs::write(FILE, format!("{HEAD}\n{list}{texts}"))?;
    println!("{FILE}: {} bytes", fs::metadata(FILE)?.len());
    Ok(())
}

/// The file names every crate of the program, in its version and with its terms, and no other.
pub fn is_current() -> Result<()> {
    let kept = fs::read_to_string(FILE)?;
    let listed: BTreeSet<(String, String)> = kept
        .lines()
        .skip(HEAD.lines().count())
        .take_while(|line| !line.starts_with("[1]"))
        .filter_map(|line| Some((line.get(..40)?.trim().to_string(), line.get(41..93)?.trim().to_string())))
        .filter(|(name, _)| OTHERS.iter().all(|other| name != other.0) && !name.starts_with("Rust's"))
        .collect();
    let wanted: BTreeSet<(String, String)> = parts()?.into_iter().map(|part| (part.name, part.licence)).collect();
    let differ: Vec<&str> = listed.symmetric_difference(&wanted).map(|(name, _)| name.as_str()).collect();
    ensure!(differ.is_empty(), "{FILE} is not of today's crates ({}): cargo xtask licences", differ.join(", "));
    Ok(())
}

/// The crates whose code is in the program, on any platform: hapt's dependencies at run time, their dependencies, and no macros.
fn parts() -> Result<Vec<Part>> {
    let output = Command::new(env!("CARGO")).args(["metadata", "--format-version", "1", "--locked"]).output()?;
    ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout)?;
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let packages: BTreeMap<String, Value> =
        list(&metadata["packages"]).into_iter().map(|package| (text(&package["id"]), package)).collect();
    let nodes: BTreeMap<String, Value> =
        list(&metadata["resolve"]["nodes"]).into_iter().map(|node| (text(&node["id"]), node)).collect();
    let hapt = packages.iter().find(|(_, package)| package["name"] == "hapt").context("no hapt")?.0.clone();
    let is_macro = |id: &String| {
        list(&packages[id]["targets"]).iter().any(|t| list(&t["kind"]).contains(&Value::from("proc-macro")))
    };
    let (mut seen, mut open) = (BTreeSet::from([hapt.clone()]), vec![hapt]);
    while let Some(id) = open.pop() {
        for dependency in list(&nodes[&id]["deps"]) {
            let runs = list(&dependency["dep_kinds"]).iter().any(|kind| kind["kind"].is_null());
            let id = text(&dependency["pkg"]);
            if runs && !is_macro(&id) && seen.insert(id.clone()) {
                open.push(id);
            }
        }
    }
    let part = |id: &String| {
        let package = &packages[id];
        let authors = list(&package["authors"]).iter().map(text).collect::<Vec<_>>().join(", ");
        Part {
            name: format!("{} {}", text(&package["name"]), text(&package["version"])),
            licence: text(&package["license"]),
            authors: if authors.is_empty() { format!("the authors of {}", text(&package["name"])) } else { authors },
            folder: Path::new(&text(&package["manifest_path"])).parent().unwrap_or(Path::new("")).to_path_buf(),
        }
    };
    // Ours have no source.
    Ok(seen.iter().filter(|id| packages[*id]["source"].is_string()).map(part).collect())
}

fn text(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_string()
}

impl Part {
    /// The texts of the licences that are chosen of its terms, as it has them; where it has none, the licence's standard text and its
    /// authors. Any notice is included.
    fn texts(&self) -> Result<Vec<String>> {
        let mut texts = Vec::new();
        for name in self.chosen()? {
            let own = self.file(name)?;
            texts.push(match (own, name) {
                (Some(own), _) => own,
                (None, "MIT" | "MIT-0") => mit(&format!("Copyright (c) {}", self.authors))?,
                (None, "Apache-2.0") => tidy(&fs::read_to_string("LICENSE-APACHE")?),
                (None, name) => anyhow::bail!("{} has no text of {name}", self.name),
            });
        }
        for entry in fs::read_dir(&self.folder)? {
            let path = entry?.path();
            if path.file_name().is_some_and(|name| name.to_string_lossy().to_uppercase().starts_with("NOTICE")) {
                texts.push(tidy(&fs::read_to_string(path)?));
            }
        }
        Ok(texts)
    }

    /// All licences that apply: of alternatives the first of [`CHOICE`].
    fn chosen(&self) -> Result<Vec<&'static str>> {
        let all = self.licence.replace('/', " OR ").replace(['(', ')'], " ");
        let of = |terms: &str| {
            let terms: Vec<&str> = terms.split(" OR ").map(str::trim).collect();
            CHOICE
                .into_iter()
                .find(|choice| terms.contains(choice))
                .with_context(|| format!("{}: {}", self.name, self.licence))
        };
        all.split(" AND ").map(of).collect()
    }

    /// Its own text of this licence.
    fn file(&self, name: &str) -> Result<Option<String>> {
        let mut files = Vec::new();
        for entry in fs::read_dir(&self.folder)? {
            let path = entry?.path();
            let file = path.file_name().map(|name| name.to_string_lossy().to_uppercase()).unwrap_or_default();
            if path.is_file()
                && ["LICENSE", "LICENCE", "COPYING", "UNLICENSE"].iter().any(|start| file.starts_with(start))
            {
                files.push((file, tidy(&fs::read_to_string(path)?)));
            }
        }
        files.sort();
        let mark = match name {
            "MIT" | "MIT-0" => "Permission is hereby granted",
            "Apache-2.0" => "Apache License",
            "Zlib" => "provided 'as-is'",
            "Unicode-3.0" => "UNICODE LICENSE",
            "BSD-2-Clause" | "BSD-3-Clause" => "Redistribution and use in source and binary forms",
            _ => "CC0",
        };
        let is_it =
            |(_, text): &&(String, String)| text.split_whitespace().collect::<Vec<_>>().join(" ").contains(mark);
        Ok(files.iter().find(is_it).map(|(_, text)| text.clone()))
    }
}

/// Without trailing blanks, so that equal texts are one.
fn tidy(text: &str) -> String {
    text.replace('\r', "").lines().map(str::trim_end).collect::<Vec<_>>().join("\n").trim_matches('\n').to_string()
}

/// The MIT licence of another project: this one's with another copyright.
fn mit(copyright: &str) -> Result<String> {
    let ours = tidy(&fs::read_to_string("LICENSE-MIT")?);
    let lines = ours.lines().map(|line| if line.starts_with("Copyright") { copyright } else { line });
    Ok(lines.collect::<Vec<_>>().join("\n"))
}
