//! Wheels of the Python package, by maturin: each is run where this machine can, and inspected where it can't.

use std::fs;
use std::path::{Path, PathBuf, absolute};
use std::process::Command;

use anyhow::{Context, Result, ensure};

use super::{Made, SHIPPED, done, emptied, folder, only};
use crate::{macos, programs, tools};

/// A wheel's target, and maturin's arguments for it. zig links for an old glibc, and for macOS.
pub const TARGETS: [(&str, &[&str]); 5] = [
    ("x86_64-unknown-linux-gnu", &["--zig", "--compatibility", "manylinux2014"]),
    ("aarch64-unknown-linux-gnu", &["--zig", "--compatibility", "manylinux2014"]),
    ("x86_64-pc-windows-gnu", &[]),
    ("x86_64-apple-darwin", &["--zig"]),
    ("aarch64-apple-darwin", &["--zig"]),
];
/// The Pythons in whose empty environments the wheel for Linux is tried, where they are there.
const PYTHONS: [&str; 5] = ["3.9", "3.10", "3.11", "3.12", "3.13"];
/// The program that each of them runs; the answers are the same. An FMU takes the program, where that is built.
const TRY: &str = "\
import hapt, hashlib, os, pathlib
world = hapt.load('@notes/euler')
print(world.simulate()['torque_Nm'].max().hex(), world.check()['certified'], end=' ')
if program := os.environ.get('HAPT_PROGRAM'):
    world.export_fmu('tried.fmu', program=program)
    print('FMU', hashlib.sha1(pathlib.Path('tried.fmu').read_bytes()).hexdigest(), end='')
print()
";

/// Builds the wheel of a target, and tries it where it runs.
pub fn build(target: &str) -> Result<Made> {
    let (_, options) = TARGETS.iter().find(|(name, _)| *name == target).context("no such wheel")?;
    let environment = tools::packaging()?;
    let out = folder()?.join("wheels").join(target);
    emptied(&out)?;
    let mut maturin = tools::python(&environment)?;
    maturin.args(["-m", "maturin", "build", "--quiet", "--profile", SHIPPED, "--target", target, "--out"]);
    maturin.arg(&out).args(*options);
    // Where zig is: the environment's own.
    maturin.env("PATH", tools::path_with(&environment.join("bin"))?);
    if target.contains("apple") {
        maturin.env("RUSTFLAGS", macos::frameworks()?);
    }
    done(&mut maturin)?;
    let wheel = only(&out)?;
    let how = match target {
        "x86_64-unknown-linux-gnu" => tried(&wheel)?,
        _ => {
            holds_library(&wheel, target)?;
            None
        }
    };
    Ok(Made { file: wheel, tried: how })
}

/// Imports the wheel in an empty environment of each Python that is here.
fn tried(wheel: &Path) -> Result<Option<String>> {
    let (mut answers, mut versions) = (Vec::new(), Vec::new());
    for version in PYTHONS {
        let Some(python) = interpreter(version) else {
            println!("  Python {version}: not here");
            continue;
        };
        let environment = folder()?.join(format!("python-{version}"));
        done(Command::new(python).args(["-m", "venv", "--clear"]).arg(&environment))?;
        let python = environment.join("bin/python");
        done(
            Command::new(&python).args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]).arg(wheel),
        )?;
        let mut tries = Command::new(&python);
        tries.args(["-c", TRY]).current_dir(folder()?);
        let program = absolute(programs::binary(SHIPPED).get_program())?;
        if program.exists() {
            tries.env("HAPT_PROGRAM", program);
        }
        let answer = done(&mut tries)?;
        println!("  Python {version}: {}", answer.trim());
        answers.push(answer);
        versions.push(version);
    }
    ensure!(!answers.is_empty(), "no Python of {} is here", PYTHONS.join(", "));
    ensure!(answers.iter().all(|answer| *answer == answers[0]), "the Pythons differ");
    Ok(Some(format!("used in Python {}", versions.join(", "))))
}

/// A Python of this version, on the path or of pyenv.
fn interpreter(version: &str) -> Option<PathBuf> {
    let name = PathBuf::from(format!("python{version}"));
    let runs = |path: &Path| {
        Command::new(path).args(["-c", "import ensurepip"]).output().is_ok_and(|output| output.status.success())
    };
    if runs(&name) {
        return Some(name);
    }
    let home = std::env::var_os("HOME").map(PathBuf::from)?;
    let versions = fs::read_dir(home.join(".pyenv/versions")).ok()?;
    let paths = versions.filter_map(|entry| Some(entry.ok()?.path()));
    let own = paths
        .filter(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(&format!("{version}."))));
    own.map(|path| path.join("bin/python")).find(|path| runs(path))
}

/// A wheel for another system has a library of that system, which needs only that system's own libraries.
fn holds_library(wheel: &Path, target: &str) -> Result<()> {
    let unpacked = wheel.with_extension("");
    emptied(&unpacked)?;
    done(Command::new("python3").args(["-m", "zipfile", "-e"]).arg(wheel).arg(&unpacked))?;
    let name = if target.contains("windows") { "_hapt.pyd" } else { "_hapt.abi3.so" };
    let bytes =
        fs::read(unpacked.join("hapt").join(name)).with_context(|| format!("{} without {name}", wheel.display()))?;
    ensure!(bytes.starts_with(super::head(target)), "{name} is no library for {target}");
    Ok(())
}
