//! The command line for macOS: lints for both processors, and links by zig. Nothing is run: that needs Apple's system.

use std::path::absolute;
use std::process::Command;

use anyhow::{Result, ensure};

use crate::programs::{self, PROFILE};
use crate::tools;

const TARGETS: [&str; 2] = ["aarch64-apple-darwin", "x86_64-apple-darwin"];
/// The program and the library of FMUs, with all that they are made of.
const PACKAGES: [&str; 4] = ["-p", "hapt", "-p", "hapt-fmi"];
/// Apple's frameworks that a linker needs, as lists of their names.
const FRAMEWORKS: &str = "xtask/macos";

pub fn holds() -> Result<()> {
    let environment = tools::packaging()?;
    for target in TARGETS {
        let mut clippy = Command::new(env!("CARGO"));
        clippy.args(["clippy", "--quiet", "--target", target]).args(PACKAGES);
        ensure!(clippy.args(["--", "-D", "warnings"]).status()?.success(), "lints for {target}");
        println!("{target}: no warning");

        let mut link = Command::new(absolute(environment.join("bin/cargo-zigbuild"))?);
        link.args(["zigbuild", "--quiet", "--profile", PROFILE, "--target", target]).args(PACKAGES);
        link.env("RUSTFLAGS", frameworks()?);
        link.env("PATH", tools::path_with(&environment.join("bin"))?);
        ensure!(link.status()?.success(), "links for {target}");
        for file in ["hapt", "libhapt_fmi.dylib"] {
            let path = programs::target().join(target).join(programs::folder_name(PROFILE)).join(file);
            let bytes = std::fs::read(&path)?;
            ensure!(bytes.starts_with(&[0xcf, 0xfa, 0xed, 0xfe]), "{} is no program for macOS", path.display());
            println!("{target}: linked {file}, {} bytes; not run", bytes.len());
        }
    }
    Ok(())
}

/// The linker's argument for the frameworks: of Apple's libraries zig has only the C library.
pub fn frameworks() -> Result<String> {
    Ok(format!("-Clink-arg=-F{}", absolute(FRAMEWORKS)?.display()))
}
