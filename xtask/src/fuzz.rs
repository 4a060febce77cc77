//! `cargo xtask fuzz`: arbitrary bytes, on stable for seconds, and by libFuzzer for any time; and whole commands
//! on random worlds, for as long ([`crate::commands`]).

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};

use crate::{commands, programs};

/// The folder of builds, corpora and logs, apart from the workspace's own build.
const SCRATCH: &str = "target/fuzz";

/// The seed of the worlds of whole commands.
const SEED: u64 = 1;

/// `[--seconds N] [TARGET]...` drives the targets on stable, `--minutes N [TARGET]...` by libFuzzer, two at a time.
pub fn run(arguments: &[&str]) -> Result<()> {
    match arguments {
        ["--minutes", minutes, names @ ..] => long(minutes.parse().context("--minutes N")?, names),
        ["--seconds", seconds, names @ ..] => bounded(seconds, names),
        names if names.iter().all(|name| !name.starts_with('-')) => bounded("20", names),
        _ => bail!("cargo xtask fuzz [--seconds N | --minutes N] [TARGET]..."),
    }
}

/// For `cargo xtask test`: every seed and every earlier finding, and a few seconds of edits.
pub fn is_quiet() -> Result<()> {
    bounded("2", &[])
}

/// Each target for this time, then whole commands for the same time.
fn bounded(seconds: &str, names: &[&str]) -> Result<()> {
    let (commands, names): (Vec<&str>, Vec<&str>) = names.iter().partition(|name| **name == commands::NAME);
    if commands.is_empty() || !names.is_empty() {
        drive(seconds, &names)?;
    }
    if !commands.is_empty() || names.is_empty() {
        commands::campaign(Duration::from_secs_f64(seconds.parse().context("--seconds N")?), SEED)?;
    }
    Ok(())
}

fn drive(seconds: &str, names: &[&str]) -> Result<()> {
    let status = driver()?.args(["--seconds", seconds]).args(names).status()?;
    ensure!(status.success(), "fuzzing found something: fuzz/findings");
    Ok(())
}

/// The driver on stable, built in the tests' profile: its overflow checks and assertions are what a run is for.
fn driver() -> Result<Command> {
    programs::program("bounded")
}

/// All targets in the order of the driver, by the folders of their seeds.
fn targets(corpus: &Path) -> Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(corpus)? {
        names.push(entry?.file_name().into_string().ok().context("a name")?);
    }
    names.sort();
    Ok(names)
}

/// libFuzzer with coverage and an address sanitiser: needs `cargo-fuzz` and a nightly toolchain.
fn long(minutes: u64, names: &[&str]) -> Result<()> {
    let (commands, names): (Vec<&str>, Vec<&str>) = names.iter().partition(|name| **name == commands::NAME);
    if !commands.is_empty() || names.is_empty() {
        // Other worlds than those of every test.
        commands::campaign(Duration::from_secs(60 * minutes), SEED + minutes)?;
    }
    if !commands.is_empty() && names.is_empty() {
        return Ok(());
    }
    let corpus = PathBuf::from(SCRATCH).join("corpus");
    ensure!(driver()?.arg("--corpus").arg(&corpus).status()?.success(), "no seeds");
    let words = driver()?.arg("--dictionary").stderr(Stdio::inherit()).output()?;
    let dictionary = PathBuf::from(SCRATCH).join("words.dict");
    fs::write(&dictionary, words.stdout)?;
    let all = targets(&corpus)?;
    let chosen: Vec<&str> = if names.is_empty() { all.iter().map(String::as_str).collect() } else { names };

    ensure!(nightly("build").status()?.success(), "cargo +nightly fuzz build");
    println!("| target | executions | edges | features | inputs kept |\n| --- | --- | --- | --- | --- |");
    for pair in chosen.chunks(2) {
        let mut running = Vec::new();
        for name in pair {
            let log = PathBuf::from(SCRATCH).join(format!("{name}.log"));
            let child = nightly("run")
                .arg(name)
                .arg(fs::canonicalize(corpus.join(name))?)
                .args(["--", "-rss_limit_mb=2048", "-timeout=30", "-print_final_stats=1", "-max_len=16384"])
                .arg(format!("-max_total_time={}", 60 * minutes))
                .arg(format!("-dict={}", fs::canonicalize(&dictionary)?.display()))
                .stderr(fs::File::create(&log)?)
                .spawn()?;
            running.push((name, log, child));
        }
        for (name, log, mut child) in running {
            let status = child.wait()?;
            let text = String::from_utf8_lossy(&fs::read(&log)?).into_owned();
            println!("{}", row(name, &text).with_context(|| format!("no end in {}", log.display()))?);
            ensure!(status.success(), "{name} found something: {}", log.display());
        }
    }
    Ok(())
}

/// cargo-fuzz, on nightly even where cargo runs us on another toolchain.
fn nightly(what: &str) -> Command {
    let mut command = Command::new("rustup");
    command.args(["run", "nightly", "cargo", "fuzz", what, "--fuzz-dir", "fuzz", "--features", "libfuzzer"]);
    command.args(["--target-dir", SCRATCH]);
    command.env_remove("CARGO").env_remove("RUSTC").env_remove("RUSTUP_TOOLCHAIN");
    command
}

/// libFuzzer's last line about its coverage, and the number of its runs.
fn row(name: &str, log: &str) -> Option<String> {
    let after = |line: &str, word: &str| Some(line.split_once(word)?.1.split_whitespace().next()?.to_string());
    let executions = log.lines().find_map(|line| after(line, "stat::number_of_executed_units:"))?;
    let last = log.lines().rev().find(|line| line.contains(" cov: ") && line.contains(" ft: "))?;
    let (edges, features, corpus) = (after(last, " cov: ")?, after(last, " ft: ")?, after(last, " corp: ")?);
    let kept = corpus.split('/').next()?;
    Some(format!("| `{name}` | {executions} | {edges} | {features} | {kept} |"))
}
