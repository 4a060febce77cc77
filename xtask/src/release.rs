//! `cargo xtask release`: the contents of a release, in target/packages: archives of the program, wheels, the Debian package, the crates
//! and the site, with their checksums. Each is tried as far as this machine can, and the table states for each how.

mod archive;
mod debian;
mod minutes;
mod wheel;

use std::fs;
use std::path::{Path, PathBuf, absolute};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};

use crate::{programs, site};

const USAGE: &str = "\
cargo xtask release [--dry-run], or parts of it, which publish nothing: archives [TARGET], wheels [TARGET], debian, crates, site,
minutes [--write]";

/// The profile of programs that are shipped.
const SHIPPED: &str = "dist";
/// Crates that are on no registry.
const PRIVATE: [&str; 6] = ["hapt-bench", "hapt-fuzz", "hapt-python", "hapt-testing", "hapt-web", "xtask"];
/// The text of the draft on GitHub, and the sums of its files.
const NOTES: &str = "NOTES.md";
const SUMS: &str = "SHA256SUMS";

/// A file of a release.
struct Made {
    file: PathBuf,
    /// How it was tried, in words; `None` was never run.
    tried: Option<String>,
}

pub fn command(arguments: &[String]) -> Result<()> {
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => publish(),
        ["--dry-run"] => rehearsed(),
        ["archives"] => archives(&archive::TARGETS).map(drop),
        ["archives", target] => archives(&[known(target, &archive::TARGETS)?]).map(drop),
        ["wheels"] => wheels(&wheel::TARGETS.map(|(target, _)| target)).map(drop),
        ["wheels", target] => wheels(&[known(target, &wheel::TARGETS.map(|(target, _)| target))?]).map(drop),
        ["debian"] => debian::build().map(|made| say(&made)),
        ["crates"] => crates(),
        ["site"] => packed_site().map(|made| say(&made)),
        ["minutes"] => minutes::publish(false),
        ["minutes", "--write"] => minutes::publish(true),
        _ => bail!("{USAGE}"),
    }
}

/// The step of the tests: the archive for this machine, of the program that `cargo build --release` made, is packed, unpacked in an empty
/// root and used there, with its sums and its notes. Nothing is published. A release packs the profile `dist`, which compiles for longer.
pub fn rehearsed() -> Result<()> {
    if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        println!("        (skipped: the archive that is tried is for Linux on x86-64)");
        return Ok(());
    }
    let made = archive::of_this_machine("release")?;
    say(&made);
    written(&[made])
}

/// Makes everything and drafts the release on GitHub, where a maintainer reviews it before it is public.
fn publish() -> Result<()> {
    let tag = format!("v{}", version());
    let changed = done(Command::new("git").args(["status", "--porcelain"]))?;
    ensure!(changed.is_empty(), "a release is made of what is committed:\n{changed}");
    let log = fs::read_to_string("CHANGELOG.md")?;
    ensure!(
        log.contains(&format!("## [{}] - ", version())),
        "CHANGELOG.md has no section [{}] with its date",
        version()
    );
    let tagged = done(Command::new("git").args(["tag", "--points-at", "HEAD"]))?;
    ensure!(
        tagged.lines().any(|name| name == tag),
        "the commit has no tag {tag}: git tag {tag}, git push origin {tag}"
    );
    done(Command::new("gh").args(["auth", "status"])).context("GitHub's gh drafts the release: gh auth login")?;

    let mut all = archives(&archive::TARGETS)?;
    all.extend(wheels(&wheel::TARGETS.map(|(target, _)| target))?);
    all.push(debian::build()?);
    crates()?;
    all.push(packed_site()?);
    written(&all)?;
    let mut draft = Command::new("gh");
    draft.args(["release", "create", &tag, "--draft", "--title", &format!("hapt {}", version()), "--notes-file"]);
    draft.arg(folder()?.join(NOTES)).args(all.iter().map(|made| &made.file)).arg(folder()?.join(SUMS));
    println!("{}the crates: cargo publish --workspace", done(&mut draft)?);
    Ok(())
}

fn archives(targets: &[&str]) -> Result<Vec<Made>> {
    targets.iter().map(|target| archive::build(target).inspect(say)).collect()
}

fn wheels(targets: &[&str]) -> Result<Vec<Made>> {
    targets.iter().map(|target| wheel::build(target).inspect(say)).collect()
}

fn known<'a>(target: &'a str, all: &[&str]) -> Result<&'a str> {
    ensure!(all.contains(&target), "{target} is none of {}", all.join(", "));
    Ok(target)
}

fn say(made: &Made) {
    println!("{}: {}", made.file.display(), made.tried.as_deref().unwrap_or("never run"));
}

/// Every public crate as a package, built from what is in it.
fn crates() -> Result<()> {
    let mut package = Command::new(env!("CARGO"));
    package.args(["package", "--quiet", "--workspace", "--locked", "--allow-dirty"]);
    for name in PRIVATE {
        package.args(["--exclude", name]);
    }
    done(&mut package)?;
    let packages = fs::read_dir(programs::target().join("package"))?;
    let names = packages.filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()));
    let mut names: Vec<String> = names.filter(|name| name.ends_with(".crate")).collect();
    names.sort();
    println!("{} crates, each built from its package: {}", names.len(), names.join(" "));
    Ok(())
}

/// The book with its wheels, which a web server gives out as files.
fn packed_site() -> Result<Made> {
    site::build()?;
    let file = folder()?.join(format!("hapt-{}-site.tar.gz", version()));
    packed(Path::new(site::SITE), &file)?;
    Ok(Made { file, tried: Some("its links followed".into()) })
}

/// The sums and the notes of these files.
fn written(all: &[Made]) -> Result<()> {
    let (mut sums, mut rows) = (String::new(), String::new());
    for Made { file, tried } in all {
        let name = file.file_name().context("no name")?.to_string_lossy();
        let output = done(Command::new("sha256sum").arg(file))?;
        let sum = output.split_whitespace().next().context("sha256sum says nothing")?;
        sums += &format!("{sum}  {name}\n");
        let megabytes = fs::metadata(file)?.len() as f64 / 1e6;
        let (name, tried) = match tried {
            Some(how) => (name.into_owned(), how.as_str()),
            None => (format!("{name} (never run)"), "compiled and linked"),
        };
        rows += &format!("| {name} | {megabytes:.1} MB | {tried} |\n");
    }
    fs::write(folder()?.join(SUMS), sums)?;
    let installing = archive::install_line();
    let notes = format!(
        "On Linux (x86-64):\n\n```sh\n{installing}\n```\n\nPython: `pip install` and the wheel's address. The sums of the files are in \
         {SUMS}.\n\n| file | size | tried on the machine that built it |\n| --- | --- | --- |\n{rows}"
    );
    fs::write(folder()?.join(NOTES), notes)?;
    println!("{}", folder()?.join(NOTES).display());
    Ok(())
}

/// The version of all crates, this one among them.
fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}

/// Where the files of a release are written.
fn folder() -> Result<PathBuf> {
    let folder = absolute(programs::target().join("packages"))?;
    fs::create_dir_all(&folder)?;
    Ok(folder)
}

/// The first bytes of a program or library of a target.
fn head(target: &str) -> &'static [u8] {
    match target {
        _ if target.contains("windows") => b"MZ",
        _ if target.contains("apple") => &[0xcf, 0xfa, 0xed, 0xfe],
        _ => b"\x7fELF",
    }
}

/// The manual pages and the completions that a program writes, into an emptied folder.
fn shell(hapt: &Path, folder: &Path) -> Result<()> {
    emptied(folder)?;
    done(Command::new(absolute(hapt)?).args(["explain", "man", "--out"]).arg(folder.join("man")))?;
    for (name, file) in [("bash", "hapt"), ("zsh", "_hapt"), ("fish", "hapt.fish")] {
        fs::write(folder.join(file), done(Command::new(absolute(hapt)?).args(["explain", "completions", name]))?)?;
    }
    Ok(())
}

/// A folder as an archive, whose bytes depend only on the files.
fn packed(of: &Path, file: &Path) -> Result<()> {
    let (parent, name) = (of.parent().context("no parent")?, of.file_name().context("no name")?);
    if file.extension().is_some_and(|extension| extension == "zip") {
        let mut zip = Command::new("python3");
        zip.args(["-m", "zipfile", "-c"]).arg(file).arg(name).current_dir(absolute(parent)?);
        return done(&mut zip).map(drop);
    }
    let mut tar = Command::new("tar");
    tar.args(["--create", "--sort=name", "--owner=0", "--group=0", "--numeric-owner", "--mtime=@0"]);
    tar.args(["--use-compress-program", "gzip -9 -n", "--file"]).arg(file).arg("--directory");
    done(tar.arg(if parent.as_os_str().is_empty() { Path::new(".") } else { parent }).arg(name)).map(drop)
}

/// The output of a command; an error with its messages where it fails.
fn done(command: &mut Command) -> Result<String> {
    let output = command.output().with_context(|| format!("{command:?}"))?;
    ensure!(output.status.success(), "{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
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
