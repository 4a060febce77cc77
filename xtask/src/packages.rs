//! What is installed: wheels for Linux, Windows and macOS, the Debian package, and the crates as packages. Each is tried where it can be.

use std::fs;
use std::path::{Path, PathBuf, absolute};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};

use crate::{macos, test, tools};

/// The wheels: the target, and what maturin is told of it. zig links for an old glibc, and for macOS.
const WHEELS: [(&str, &[&str]); 4] = [
    ("x86_64-unknown-linux-gnu", &["--zig", "--compatibility", "manylinux2014"]),
    ("x86_64-pc-windows-gnu", &[]),
    ("x86_64-apple-darwin", &["--zig"]),
    ("aarch64-apple-darwin", &["--zig"]),
];
/// The profile of the program in packages.
const SHIPPED: &str = "dist";
/// The Pythons in whose empty environments the wheel for Linux is tried, where they are there.
const PYTHONS: [&str; 5] = ["3.9", "3.10", "3.11", "3.12", "3.13"];
/// What each of them runs; the answers are the same. An FMU takes the program, where that is built.
const TRY: &str = "\
import hapt, hashlib, os, pathlib
world = hapt.load('@notes/euler')
print(world.simulate()['torque_Nm'].max().hex(), world.check()['certified'], end=' ')
if program := os.environ.get('HAPT_PROGRAM'):
    world.export_fmu('tried.fmu', program=program)
    print('FMU', hashlib.sha1(pathlib.Path('tried.fmu').read_bytes()).hexdigest(), end='')
print()
";
/// Crates that are on no registry.
const PRIVATE: [&str; 6] = ["hapt-bench", "hapt-fuzz", "hapt-python", "hapt-testing", "hapt-web", "xtask"];

pub fn command(arguments: &[String]) -> Result<()> {
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => wheels(&WHEELS).and_then(|()| debian()).and_then(|()| crates()),
        ["wheels"] => wheels(&WHEELS),
        ["wheels", target] => {
            let wanted: Vec<_> = WHEELS.into_iter().filter(|(name, _)| *name == target).collect();
            ensure!(!wanted.is_empty(), "wheels are for {}", WHEELS.map(|(name, _)| name).join(", "));
            wheels(&wanted)
        }
        ["debian"] => debian(),
        ["crates"] => crates(),
        _ => bail!("cargo xtask packages [wheels [TARGET]|debian|crates]"),
    }
}

/// Where the packages are written.
fn folder() -> Result<PathBuf> {
    let folder = absolute(test::target().join("packages"))?;
    fs::create_dir_all(&folder)?;
    Ok(folder)
}

/// Builds wheels, and tries the one that runs here.
fn wheels(wanted: &[(&str, &[&str])]) -> Result<()> {
    let environment = tools::packaging()?;
    for (target, options) in wanted {
        let out = folder()?.join(target);
        emptied(&out)?;
        let mut maturin = tools::python(&environment)?;
        maturin.args(["-m", "maturin", "build", "--quiet", "--target", target, "--out"]).arg(&out).args(*options);
        // Where zig is: the environment's own.
        maturin.env("PATH", tools::path_with(&environment.join("bin"))?);
        if target.contains("apple") {
            maturin.env("RUSTFLAGS", macos::frameworks()?);
        }
        done(&mut maturin)?;
        let wheel = only(&out)?;
        println!("{}", wheel.display());
        match *target {
            "x86_64-unknown-linux-gnu" => tried(&wheel)?,
            _ => holds_library(&wheel, target)?,
        }
    }
    Ok(())
}

/// Imports the wheel in an empty environment of each Python that is here.
fn tried(wheel: &Path) -> Result<()> {
    let mut answers = Vec::new();
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
        let program = absolute(test::binary(SHIPPED).get_program())?;
        if program.exists() {
            tries.env("HAPT_PROGRAM", program);
        }
        let answer = done(&mut tries)?;
        println!("  Python {version}: {}", answer.trim());
        answers.push(answer);
    }
    ensure!(!answers.is_empty(), "no Python of {} is here", PYTHONS.join(", "));
    ensure!(answers.iter().all(|answer| *answer == answers[0]), "the Pythons differ");
    Ok(())
}

/// A Python of this version, on the path or of pyenv.
fn interpreter(version: &str) -> Option<PathBuf> {
    let name = PathBuf::from(format!("python{version}"));
    let runs = |path: &Path| {
        Command::new(path).args(["-c", "import ensurepip"]).output().is_ok_and(|said| said.status.success())
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

/// A wheel for elsewhere has a library of that system, which needs that system's own libraries alone.
fn holds_library(wheel: &Path, target: &str) -> Result<()> {
    let unpacked = wheel.with_extension("");
    emptied(&unpacked)?;
    done(Command::new("python3").args(["-m", "zipfile", "-e"]).arg(wheel).arg(&unpacked))?;
    let name = if target.contains("windows") { "_hapt.pyd" } else { "_hapt.abi3.so" };
    let bytes =
        fs::read(unpacked.join("hapt").join(name)).with_context(|| format!("{} without {name}", wheel.display()))?;
    let head: &[u8] = if target.contains("windows") { b"MZ" } else { &[0xcf, 0xfa, 0xed, 0xfe] };
    ensure!(bytes.starts_with(head), "{name} is no library for {target}");
    Ok(())
}

/// The Debian package: built, installed into an empty root by dpkg, and run there.
fn debian() -> Result<()> {
    done(Command::new(env!("CARGO")).args([
        "build",
        "--quiet",
        "--profile",
        SHIPPED,
        "--locked",
        "--package",
        "hapt",
        "--package",
        "hapt-fmi",
    ]))?;
    let hapt = absolute(test::binary(SHIPPED).get_program())?;
    let shell = folder()?.join("shell");
    emptied(&shell)?;
    done(Command::new(&hapt).args(["explain", "man", "--out"]).arg(shell.join("man")))?;
    for (name, file) in [("bash", "hapt"), ("zsh", "_hapt"), ("fish", "hapt.fish")] {
        fs::write(shell.join(file), done(Command::new(&hapt).args(["explain", "completions", name]))?)?;
    }
    let package = folder()?.join("hapt.deb");
    let mut deb = Command::new(env!("CARGO"));
    deb.args(["deb", "--quiet", "--no-build", "--profile", SHIPPED, "--package", "hapt", "--output"]).arg(&package);
    done(&mut deb).context("cargo install cargo-deb")?;
    println!("{}", package.display());
    println!("{}", done(Command::new("dpkg-deb").arg("--field").arg(&package))?.trim());
    installed(&package)
}

/// Installs the package into an empty root, and runs what it brought: the program, its pages, its completions, an FMU.
fn installed(package: &Path) -> Result<()> {
    let root = folder()?.join("root");
    emptied(&root)?;
    fs::create_dir_all(root.join("var/lib/dpkg/updates"))?;
    fs::write(root.join("var/lib/dpkg/status"), "")?;
    // What it depends on is in this system, not in that root.
    let mut dpkg = Command::new("dpkg");
    dpkg.args(["--force-depends", "--force-not-root", "--root"])
        .arg(&root)
        .arg("--log=/dev/null")
        .arg("--install")
        .arg(package);
    done(&mut dpkg)?;
    let hapt = root.join("usr/bin/hapt");
    let said = done(Command::new(&hapt).args(["check", "@notes/default"]).current_dir(&root))?;
    ensure!(said.contains("certified"), "hapt check: {said}");
    done(Command::new(&hapt).args(["export", "fmu", "@notes/default", "-o", "wheel.fmu"]).current_dir(&root))?;
    let pages = fs::read_dir(root.join("usr/share/man/man1"))?.count();
    ensure!(pages > 20, "{pages} manual pages");
    let page = root.join("usr/share/man/man1/hapt-check.1.gz");
    let page = done(Command::new("man").arg("--local-file").arg(page).env("MANWIDTH", "80"))?;
    ensure!(
        page.contains("hapt-check") && page.contains("EXAMPLES") || page.contains("OPTIONS"),
        "the manual page: {page}"
    );
    let completions = root.join("usr/share/bash-completion/completions/hapt");
    let line = "source \"$0\" && COMP_WORDS=(hapt ch) COMP_CWORD=1 && _hapt hapt ch hapt && echo ${COMPREPLY[@]}";
    let offered = done(Command::new("bash").args(["-c", line]).arg(completions))?;
    ensure!(offered.split_whitespace().any(|word| word == "check"), "completions offer {offered:?}");
    println!("installed with {pages} manual pages and completions, and run");
    Ok(())
}

/// Every crate as a package, built from what is in it.
fn crates() -> Result<()> {
    let mut package = Command::new(env!("CARGO"));
    package.args(["package", "--quiet", "--workspace", "--locked", "--allow-dirty"]);
    for name in PRIVATE {
        package.args(["--exclude", name]);
    }
    done(&mut package)?;
    let packages = fs::read_dir(test::target().join("package"))?;
    let names = packages.filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()));
    let mut names: Vec<String> = names.filter(|name| name.ends_with(".crate")).collect();
    names.sort();
    println!("{} crates, each built from its package: {}", names.len(), names.join(" "));
    Ok(())
}

/// What a command prints; an error with its messages where it fails.
fn done(command: &mut Command) -> Result<String> {
    let said = command.output().with_context(|| format!("{command:?}"))?;
    ensure!(said.status.success(), "{command:?}: {}", String::from_utf8_lossy(&said.stderr));
    Ok(String::from_utf8_lossy(&said.stdout).into_owned())
}

fn emptied(folder: &Path) -> Result<()> {
    if folder.exists() {
        fs::remove_dir_all(folder)?;
    }
    Ok(fs::create_dir_all(folder)?)
}

/// The only file of a folder.
fn only(folder: &Path) -> Result<PathBuf> {
    let mut files = fs::read_dir(folder)?;
    let file = files.next().with_context(|| format!("nothing in {}", folder.display()))??.path();
    ensure!(files.next().is_none(), "more than one file in {}", folder.display());
    Ok(file)
}
