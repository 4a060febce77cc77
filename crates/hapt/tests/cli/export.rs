//! `hapt export`: FMUs as files. What is in them, and what importers make of it, is tested in `fmi/`.

use std::fs;

use crate::common::{WHEEL, binary, folder, hapt, hapt_reads};

#[test]
fn an_fmu_is_the_same_bytes_every_time_and_of_each_world() {
    let at = folder(&[("w.toml", WHEEL)]);
    let export = |out: &str, more: &[&str]| {
        hapt(at.path(), ["export", "fmu", "w.toml", "-o", out].iter().chain(more)).done();
        fs::read(at.path().join(out)).unwrap()
    };
    let two = export("a.fmu", &[]);
    assert!(two.starts_with(b"PK") && two == export("b.fmu", &["--fmi", "2"]));
    for more in [&["--fmi", "3"][..], &["--whole"], &["--set", "loop.period=2ms"]] {
        assert!(export("c.fmu", more) != two, "{more:?}");
    }
    let piped = hapt_reads(at.path(), WHEEL, ["export", "fmu", "-", "-o", "d.fmu"]).done();
    assert!(piped.err.starts_with("wrote d.fmu, FMI 2.0, "), "{}", piped.err);
    assert!(fs::read(at.path().join("d.fmu")).unwrap() == two);
}

#[test]
fn what_cannot_be_exported_is_refused_and_writes_nothing() {
    let at = folder(&[("w.toml", WHEEL), ("none.dll", "#!/bin/sh")]);
    let refused = |args: &[&str], words: &[&str]| {
        hapt(at.path(), ["export", "fmu"].iter().chain(args)).refused(2, words);
        assert!(!at.path().join("o.fmu").exists());
    };
    refused(&["w.toml", "-o", "o.zip"], &["-o o.zip: expected FILE.fmu"]);
    refused(&["w.toml"], &["--out <FILE>"]);
    refused(&["w.toml", "-o", "o.fmu", "--fmi", "1"], &["'1'", "2, 3"]);
    refused(&["w.toml", "-o", "o.fmu", "--set", "loop.period=0"], &["loop.period: "]);
    refused(&["w.toml", "-o", "o.fmu", "--platform", "none.dll"], &["none.dll: it is no library"]);
    refused(&["w.toml", "-o", "o.fmu", "--platform", "no.so"], &["cannot read no.so"]);
    refused(&["gone.toml", "-o", "o.fmu"], &["cannot read gone.toml"]);
}

/// A program that was copied away from its library says where the library would be, and how it is built.
#[test]
fn a_missing_library_is_named_with_its_places() {
    let at = folder(&[("w.toml", WHEEL)]);
    let alone = at.path().join(binary().file_name().unwrap());
    fs::copy(binary(), &alone).unwrap();
    let mut command = std::process::Command::new(&alone);
    let ended = command.args(["export", "fmu", "w.toml", "-o", "o.fmu"]).current_dir(at.path()).output().unwrap();
    let said = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(2), "{said}");
    for words in [at.path().to_str().unwrap(), "deps", "lib/hapt", "cargo build --release -p hapt-fmi"] {
        assert!(said.contains(words), "{words} in {said}");
    }
    assert!(!at.path().join("o.fmu").exists());
}
