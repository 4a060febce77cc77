//! The Debian package, by cargo-deb: installed into an empty root, and used there.

use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use super::{Made, SHIPPED, done, emptied, folder, shell};
use crate::programs;

/// The Debian package: built, installed into an empty root by dpkg, and run there.
pub fn build() -> Result<Made> {
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
    shell(Path::new(programs::binary(SHIPPED).get_program()), &folder()?.join("shell"))?;
    let package = folder()?.join(format!("hapt_{}_{}.deb", super::version(), std::env::consts::ARCH));
    let mut deb = Command::new(env!("CARGO"));
    deb.args(["deb", "--quiet", "--no-build", "--profile", SHIPPED, "--package", "hapt", "--output"]).arg(&package);
    done(&mut deb).context("cargo install cargo-deb")?;
    println!("{}", done(Command::new("dpkg-deb").arg("--field").arg(&package))?.trim());
    installed(&package)?;
    Ok(Made { file: package, tried: Some("installed into an empty root and used".into()) })
}

/// Installs the package into an empty root, and runs its contents: the program, its pages, its completions, an FMU.
fn installed(package: &Path) -> Result<()> {
    let root = folder()?.join("root");
    emptied(&root)?;
    fs::create_dir_all(root.join("var/lib/dpkg/updates"))?;
    fs::write(root.join("var/lib/dpkg/status"), "")?;
    // Its dependencies are in this system, not in that root.
    let mut dpkg = Command::new("dpkg");
    dpkg.args(["--force-depends", "--force-not-root", "--root"])
        .arg(&root)
        .arg("--log=/dev/null")
        .arg("--install")
        .arg(package);
    done(&mut dpkg)?;
    let hapt = root.join("usr/bin/hapt");
    let printed = done(Command::new(&hapt).args(["check", "@notes/default"]).current_dir(&root))?;
    ensure!(printed.contains("certified"), "hapt check: {printed}");
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
