//! `hapt export`: FMUs and C as files. Their contents are tested in `fmi/` and `crates/hapt-export-c`.

use std::fs;
use std::path::Path;

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
    let copy = at.path().join(binary().file_name().unwrap());
    fs::copy(binary(), &copy).unwrap();
    let mut command = std::process::Command::new(&copy);
    command.args(["export", "fmu", "w.toml", "-o", "o.fmu"]).current_dir(at.path());
    let ended = loop {
        match command.output() {
            // A process that another test begins holds the copy open for a moment.
            Err(error) if error.kind() == std::io::ErrorKind::ExecutableFileBusy => std::thread::yield_now(),
            ended => break ended.unwrap(),
        }
    };
    let printed = String::from_utf8(ended.stderr).unwrap();
    assert_eq!(ended.status.code(), Some(2), "{printed}");
    for words in [at.path().to_str().unwrap(), "deps", "lib/hapt", "cargo build --release -p hapt-fmi"] {
        assert!(printed.contains(words), "{words} in {printed}");
    }
    assert!(!at.path().join("o.fmu").exists());
}

/// A passive world that is certified with a velocity from an encoder.
const SPRING: &str = r#"title = "A spring"
[loop]
period = "1 ms"
[device]
inertia = "6.4e-4 kg m^2"
damping = "1.2e-3 N m s/rad"
limit = "822.25 N mm"
[[couplings]]
kind = "spring"
between = ["puck", "ground"]
stiffness = "1 N m/rad"
"#;

#[test]
fn a_world_as_c_is_a_file_and_its_header_the_same_every_time() {
    let at = folder(&[("w.toml", SPRING)]);
    let read = |name: &str| fs::read_to_string(at.path().join(name)).unwrap();
    let done = hapt(at.path(), ["export", "c", "w.toml", "-o", "knob.c"]).done();
    assert!(done.err.contains("wrote knob.h") && done.err.contains("wrote knob.c"), "{}", done.err);
    let (source, header) = (read("knob.c"), read("knob.h"));
    assert!(source.contains("#include \"knob.h\"") && header.contains("knob_arm(knob_controller"), "{header}");
    assert!(
        source.starts_with("/* A spring, written as C by hapt") && source.contains("verdict   certified"),
        "{source}"
    );
    // Hapt may replace its own file.
    hapt(at.path(), ["export", "c", "w.toml", "-o", "knob.c", "--arduino", "Knob"]).done();
    assert!(source == read("knob.c") && source == read("Knob/src/knob.c") && header == read("Knob/src/knob.h"));
    assert!(read("Knob/library.properties").contains("includes=knob.h"));
    assert!(read("Knob/examples/simplefoc/simplefoc.ino").contains("knob_step_reading"));
    // The header of another file is not replaced.
    let words = ["export", "c", "w.toml", "-o", "two.c", "--header", "knob.h"];
    hapt(at.path(), words).refused(2, &["--header knob.h: this file is there, without two_init()"]);
    assert!(header == read("knob.h") && !at.path().join("two.c").exists());
    hapt(at.path(), ["export", "c", "w.toml", "-o", "knob.c", "--header", "other.h", "--float", "f64"]).done();
    assert!(read("knob.c").contains("#include \"other.h\"") && read("other.h").contains("typedef double knob_real;"));
}

/// A spring between puck and ground, certified up to 2 b/T: every value of the range is, and none beyond it.
#[test]
fn a_number_that_c_changes_has_the_range_that_is_certified() {
    let at = folder(&[("w.toml", SPRING)]);
    let done = hapt(at.path(), ["export", "c", "w.toml", "-o", "knob.c", "--tune", "couplings.0.stiffness"]).done();
    assert!(done.err.contains("wrote knob.h"), "{}", done.err);
    let header = fs::read_to_string(at.path().join("knob.h")).unwrap();
    let line = header.lines().find(|line| line.contains("couplings.0.stiffness: from ")).unwrap();
    let numbers: Vec<f64> = line.split([' ', ',']).filter_map(|word| word.parse().ok()).collect();
    let [low, high, file] = numbers[..] else { panic!("{line}") };
    assert!((low - 0.01).abs() < 1e-6 && file == 1.0, "{line}");
    for (value, is_certified) in [(low, true), (high, true), (1.001 * high, false)] {
        let set = format!("couplings.0.stiffness={value}");
        let ended = hapt(at.path(), ["check", "w.toml", "--set", set.as_str()]);
        assert_eq!(ended.code, Some(if is_certified { 0 } else { 1 }), "{value}: {ended:?}");
    }
    assert!(header.contains("knob_set(knob_controller *self, knob_parameter parameter, knob_real value);"), "{header}");
    hapt(at.path(), ["export", "c", "w.toml", "-o", "knob.c", "--tune", "all", "--arduino", "Knob"]).done();
    assert_eq!(header, fs::read_to_string(at.path().join("Knob/src/knob.h")).unwrap());
    let before = fs::read_to_string(at.path().join("knob.c")).unwrap();
    for (key, words) in [
        ("couplings.0.softness", &["--tune couplings.0.softness", "couplings.0.stiffness"][..]),
        ("couplings.1.stiffness", &["--tune couplings.1.stiffness"]),
        ("couplings.0.rest", &["--tune couplings.0.rest", "positive"]),
    ] {
        hapt(at.path(), ["export", "c", "w.toml", "-o", "knob.c", "--tune", key]).refused(2, words);
        assert_eq!(before, fs::read_to_string(at.path().join("knob.c")).unwrap());
    }
    let wheel = "bodies = { wheel = { inertia = 1e-3 } }\n";
    fs::write(at.path().join("wheel.toml"), format!("{wheel}{SPRING}")).unwrap();
    hapt(at.path(), ["export", "c", "wheel.toml", "-o", "o.c", "--tune", "bodies.wheel.inertia"])
        .refused(2, &["--tune bodies.wheel.inertia: a body's numbers go through the matrices of the method"]);
    let stiff = ["export", "c", "w.toml", "-o", "o.c", "--uncertified", "--set", "couplings.0.stiffness=1000"];
    for key in ["couplings.0.stiffness", "all"] {
        hapt(at.path(), stiff.iter().chain(&["--tune", key])).refused(2, &["--tune: the world is not certified"]);
    }
    assert!(!at.path().join("o.c").exists());
}

#[test]
fn a_world_that_c_cannot_hold_or_that_is_not_certified_writes_nothing() {
    let unlimited = SPRING.replace("limit = \"822.25 N mm\"\n", "");
    let stiff = SPRING.replace("1 N m/rad", "1000 N m/rad");
    let files =
        [("w.toml", SPRING), ("u.toml", unlimited.as_str()), ("s.toml", stiff.as_str()), ("mine.h", "int mine;\n")];
    let at = folder(&files);
    fs::create_dir(at.path().join("folder.h")).unwrap();
    let refused = |args: &[&str], words: &[&str]| {
        hapt(at.path(), ["export", "c"].iter().chain(args)).refused(2, words);
        assert!(!at.path().join("o.c").exists() && !at.path().join("o.h").exists() && !at.path().join("O").exists());
        assert_eq!(fs::read_to_string(at.path().join("mine.h")).unwrap(), "int mine;\n");
    };
    refused(&["w.toml", "-o", "o.cpp"], &["-o o.cpp: expected FILE.c"]);
    refused(&["w.toml", "-o", "int.c"], &["-o int.c: \"int\" cannot begin the names in C"]);
    refused(&["w.toml", "-o", "o.c", "--header", "mine.h"], &["--header mine.h: this file is there"]);
    refused(&["w.toml", "-o", "o.c", "--header", "folder.h"], &["--header folder.h: it is a folder"]);
    #[cfg(unix)]
    {
        assert!(std::process::Command::new("mkfifo").arg(at.path().join("pipe.h")).status().unwrap().success());
        refused(&["w.toml", "-o", "o.c", "--header", "pipe.h"], &["--header pipe.h: this is no file"]);
    }
    refused(&["u.toml", "-o", "o.c"], &["device.limit"]);
    refused(&["s.toml", "-o", "o.c", "--arduino", "O"], &["not certified", "--uncertified"]);
    hapt(at.path(), ["export", "c", "s.toml", "-o", "o.c", "--uncertified"]).done();
    let source = fs::read_to_string(at.path().join("o.c")).unwrap();
    assert!(
        source.lines().next().unwrap().contains("NOT CERTIFIED") && source.contains("o_arm_uncertified"),
        "{source}"
    );
}

/// The mandatory rules of MISRA C:2012 with its amendments. The required and advisory ones are not claimed.
const MANDATORY: [&str; 16] = [
    "9.1", "12.5", "13.6", "17.3", "17.4", "17.6", "19.1", "21.13", "21.17", "21.18", "21.19", "21.20", "22.2", "22.4",
    "22.5", "22.6",
];

/// The findings of cppcheck and its MISRA addon in files: of a mandatory rule, or of an error or warning of cppcheck's own.
fn broken_rules(folder: &Path, files: &[String]) -> Vec<String> {
    let mut cppcheck = std::process::Command::new("cppcheck");
    cppcheck.args(["--addon=misra", "--enable=style,warning,portability", "--std=c99", "--quiet", "-j2"]);
    cppcheck.args(["--suppress=missingIncludeSystem", "--template={file}:{line} {severity} {id}"]).args(files);
    let ended = cppcheck.current_dir(folder).output().unwrap();
    let printed = String::from_utf8_lossy(&ended.stderr);
    assert!(printed.contains("misra-c2012-"), "the addon finds advisory rules at least: {printed}");
    let is_broken = |line: &&str| match line.split_once(" misra-c2012-") {
        Some((_, rule)) => MANDATORY.contains(&rule),
        None => [" error ", " warning ", " portability "].iter().any(|severity| line.contains(severity)),
    };
    printed.lines().filter(is_broken).map(str::to_owned).collect()
}

/// Every built-in world that has a limit, with all numbers that can be tuned; an eighth of them in `cargo test`.
#[test]
fn no_built_in_world_as_c_breaks_a_mandatory_rule_of_misra() {
    if std::process::Command::new("cppcheck").arg("--version").output().is_err() {
        assert!(std::env::var_os("CI").is_none(), "cppcheck has to be there where CI is set");
        println!("SKIPPED: MISRA C, apt-get install cppcheck");
        return;
    }
    let at = folder(&[("broken.c", "int f(int x);\nint f(int x)\n{\n    return (int)sizeof(x++);\n}\n")]);
    let found = broken_rules(at.path(), &["broken.c".to_owned()]);
    assert!(found.iter().any(|line| line.ends_with("misra-c2012-13.6")), "a rule that is broken is found: {found:?}");
    let listed = hapt(at.path(), ["worlds"]).done().out;
    let names: Vec<&str> = listed.split_whitespace().filter(|word| word.starts_with('@')).collect();
    let some = hapt_testing::seeds(64).end as usize;
    let every = (64 / some).max(1);
    let mut files = Vec::new();
    for (i, name) in names.iter().enumerate().filter(|(i, _)| i % every == 0) {
        let file = format!("w{i}.c");
        let world = ["export", "c", name, "-o", file.as_str(), "--uncertified"];
        let tuned = hapt(at.path(), world.iter().chain(&["--tune", "all"]));
        let ended = if tuned.code == Some(0) { tuned } else { hapt(at.path(), world) };
        if ended.code == Some(0) {
            files.push(file);
        } else {
            ended.refused(2, &[]);
        }
    }
    assert!(files.len() * every * 3 > names.len(), "{} of {}", files.len(), names.len());
    let broken = broken_rules(at.path(), &files);
    assert!(broken.is_empty(), "{broken:#?}");
}
