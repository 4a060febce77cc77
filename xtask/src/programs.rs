//! The programs of the workspace that the other chores run, and where cargo puts them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use serde_json::Value;

/// The one in which every test is built, xtask too (`.cargo/config.toml`).
pub const PROFILE: &str = "test";

/// All that is linted. `--all-targets` leaves out the targets that `cargo test` leaves out.
pub const TARGETS: &str = "--workspace --lib --bins --examples --test *";

/// The tests that `cargo test` leaves out (crates/hapt/Cargo.toml).
const OF_THE_PROGRAM: &str = "--bin hapt --test cli";

/// A program of tests, and the folder of its crate.
pub struct Program {
    file: PathBuf,
    folder: PathBuf,
}

impl Program {
    /// Ready to run.
    pub fn command(&self) -> Command {
        let mut command = Command::new(&self.file);
        command.current_dir(&self.folder).env("CARGO_MANIFEST_DIR", &self.folder);
        command
    }

    /// The same by another program, such as an emulator's.
    pub fn through(&self, mut command: Command) -> Command {
        command.arg(&self.file).current_dir(&self.folder).env("CARGO_MANIFEST_DIR", &self.folder);
        command
    }

    /// The crate's, and the program's without the hash of its file.
    pub fn name(&self) -> String {
        let [folder, file] =
            [&self.folder, &self.file].map(|path| path.file_name().unwrap_or_default().to_string_lossy());
        format!("{folder}/{}", file.rsplit_once('-').map_or(&*file, |(name, _)| name))
    }

    /// Its file.
    pub fn file(&self) -> &Path {
        &self.file
    }
}

/// Builds every test. A crate whose library or program has none (`test = false`) is not compiled a second time for it.
pub fn all_built() -> Result<Vec<Program>> {
    let mut all = build("")?;
    all.extend(build(OF_THE_PROGRAM)?);
    Ok(all)
}

/// Builds the tests of these names.
pub fn built(names: &[&str]) -> Result<Vec<Program>> {
    build(&names.iter().map(|name| format!("--test {name} ")).collect::<String>())
}

/// The whole workspace is chosen every time, for the features of dependencies depend on the choice: what has been built stays as it is.
fn build(choice: &str) -> Result<Vec<Program>> {
    let mut command = Command::new(env!("CARGO"));
    command.args(["test", "--quiet", "--profile", PROFILE, "--no-run", "--message-format", "json-render-diagnostics"]);
    programs(command.arg("--workspace").args(choice.split_whitespace()))
}

/// The programs of tests that cargo builds, by its messages in JSON.
pub fn programs(command: &mut Command) -> Result<Vec<Program>> {
    let output = command.stderr(Stdio::inherit()).output()?;
    ensure!(output.status.success(), "the tests do not build");
    let mut programs = Vec::new();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        let Ok(message) = serde_json::from_str::<Value>(line) else { continue };
        let (Some(file), true) = (message["executable"].as_str(), message["profile"]["test"] == true) else { continue };
        let manifest = message["manifest_path"].as_str().context("no manifest")?;
        let folder = Path::new(manifest).parent().context("no folder")?.to_path_buf();
        programs.push(Program { file: file.into(), folder });
    }
    Ok(programs)
}

/// Builds a program of the workspace in the tests' profile.
pub fn program(name: &str) -> Result<Command> {
    cargo(&format!("build --quiet --workspace --bin {name} --profile {PROFILE}"), "")?;
    Ok(binary_of(PROFILE, name))
}

/// Runs cargo, without its standard output.
pub fn cargo(arguments: &str, rustdoc_flags: &str) -> Result<()> {
    let status = Command::new(env!("CARGO"))
        .args(arguments.split_whitespace())
        .env("RUSTDOCFLAGS", rustdoc_flags)
        .stdout(Stdio::null())
        .status()?;
    ensure!(status.success(), "cargo {arguments}");
    Ok(())
}

/// The command line of a profile, which is built.
pub fn binary(build: &str) -> Command {
    binary_of(build, "hapt")
}

/// Builds an example of the workspace in the tests' profile. `cargo test` leaves the programs of examples out.
pub fn example(name: &str) -> Result<PathBuf> {
    cargo(&format!("build --quiet --workspace --example {name} --profile {PROFILE}"), "")?;
    Ok(folder(PROFILE).join("examples").join(format!("{name}{}", std::env::consts::EXE_SUFFIX)))
}

fn binary_of(build: &str, name: &str) -> Command {
    Command::new(folder(build).join(format!("{name}{}", std::env::consts::EXE_SUFFIX)))
}

/// Where cargo puts the programs of a profile.
pub fn folder(profile: &str) -> PathBuf {
    target().join(folder_name(profile))
}

/// The name of this folder, in that of a target too.
pub fn folder_name(profile: &str) -> &str {
    if profile == PROFILE { "debug" } else { profile }
}

/// Where cargo builds.
pub fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| PathBuf::from("target"), PathBuf::from)
}

/// Every world file in a folder.
pub fn worlds(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            files.extend(worlds(&path)?);
        } else if path.extension().is_some_and(|extension| extension == "toml") {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}
