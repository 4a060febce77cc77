//! The dependencies and compilers of hapt: licences and sources of the dependencies, and the oldest Rust that builds it.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};

/// The core's oldest Rust, and the newest of the compilers that are searched.
const CORE: &str = "1.85";

/// The target of the boards with a Cortex-M4F or M7.
pub const BOARD_TARGET: &str = "thumbv7em-none-eabihf";
/// The target of the boards with a Cortex-M33.
pub const M33_TARGET: &str = "thumbv8m.main-none-eabihf";
/// The target of the page's core.
pub const PAGE_TARGET: &str = "wasm32-unknown-unknown";

/// `cargo deny`, where it is installed. Its advisories are not checked here: their database is on the network.
pub fn licences() -> Result<()> {
    let there = Command::new("cargo-deny").arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    if !there.is_ok_and(|status| status.success()) {
        println!("        (skipped: cargo install cargo-deny)");
        return Ok(());
    }
    let output =
        Command::new("cargo-deny").args(["--log-level", "error", "check", "licenses", "bans", "sources"]).output()?;
    ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Ok(())
}

/// No dependency needs a newer Rust than the workspace's `rust-version`, and the core builds with its own one, where that is
/// installed. Clippy finds uses of a newer standard library in our own code, by the same number (incompatible_msrv).
pub fn oldest_rust() -> Result<()> {
    let output = Command::new(env!("CARGO")).args(["metadata", "--format-version", "1", "--locked"]).output()?;
    ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout)?;
    let packages = metadata["packages"].as_array().context("no packages")?;
    let (mut ours, mut newest) = (None, ((0, 0), "nothing"));
    for package in packages {
        let name = package["name"].as_str().context("no name")?;
        let Some(rust) = package["rust_version"].as_str().and_then(version) else { continue };
        if name == "hapt" {
            ours = Some(rust);
        } else if package["source"].is_string() && rust > newest.0 {
            newest = (rust, name);
        }
    }
    let ours = ours.context("hapt names no rust-version")?;
    ensure!(newest.0 <= ours, "{} needs Rust {:?}, the workspace requires {ours:?}", newest.1, newest.0);
    core()
}

/// Whether rustup's compiler has a target's standard library. If not, or with `HAPT_CROSS=distribution`, the distribution's compiler builds
/// one: with both installed, both can be tried.
pub fn has_target(target: &str) -> bool {
    if std::env::var_os("HAPT_CROSS").is_some_and(|which| which == "distribution") {
        return false;
    }
    let output = Command::new("rustc").args(["--print", "target-libdir", "--target", target]).output();
    output.is_ok_and(|output| Path::new(String::from_utf8_lossy(&output.stdout).trim()).exists())
}

/// xtask is built with the features that its dependencies have in the whole workspace. Otherwise `cargo xtask test` builds most crates
/// twice: once for itself, once for the tests.
pub fn built_once() -> Result<()> {
    let units = |arguments: &[&str]| -> Result<BTreeSet<String>> {
        let mut command = Command::new(env!("CARGO"));
        command.args(["tree", "--locked", "--prefix", "none", "--format", "{p} with features {f}"]).args(arguments);
        let output = command.output()?;
        ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        Ok(String::from_utf8_lossy(&output.stdout).lines().map(|line| line.trim_end_matches(" (*)").into()).collect())
    };
    let ours = units(&["--package", "xtask", "--edges", "normal,build"])?;
    let all = units(&["--workspace", "--edges", "normal,build,dev"])?;
    let twice: Vec<&String> = ours.difference(&all).collect();
    ensure!(twice.is_empty(), "built for xtask alone: {twice:?}; xtask/Cargo.toml lists the features of the others");
    Ok(())
}

/// The first two numbers of a version.
fn version(text: &str) -> Option<(u32, u32)> {
    let mut numbers = text.split('.').map(|number| number.parse().ok());
    Some((numbers.next()??, numbers.next()??))
}

/// The core with the oldest compiler that it promises: rustup's, or the distribution's.
fn core() -> Result<()> {
    let rustup = || {
        let mut command = Command::new("rustup");
        command.args(["run", CORE, "cargo"]);
        command
    };
    let system = || {
        let mut command = Command::new("/usr/bin/cargo");
        command.env("RUSTC", "/usr/bin/rustc");
        command
    };
    let is_it = |mut command: Command| {
        let output = command.arg("--version").stderr(Stdio::null()).output();
        output.is_ok_and(|output| String::from_utf8_lossy(&output.stdout).contains(&format!(" {CORE}.")))
    };
    let mut command = if is_it(rustup()) {
        rustup()
    } else if Path::new("/usr/bin/cargo").exists() && is_it(system()) {
        system()
    } else {
        println!("        (the core with Rust {CORE} skipped: rustup toolchain install {CORE})");
        return Ok(());
    };
    // The proof's workspace has only the core and libm: the others need a newer cargo to be read.
    let status = command
        .args(["build", "--quiet", "--release", "--locked", "--manifest-path", "crates/hapt-core/proof/Cargo.toml"])
        .args(["--target-dir", "target/oldest"])
        .env_remove("RUSTUP_TOOLCHAIN")
        .env_remove("RUSTFLAGS")
        .status()?;
    ensure!(status.success(), "hapt-core does not build with Rust {CORE}");
    Ok(())
}
