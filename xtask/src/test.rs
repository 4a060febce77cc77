//! `cargo xtask test`: everything that has to hold before a change lands.
//!
//! Every test runs once, in the profile `tested`: optimised as what ships, with assertions and overflow checks. The program that
//! ships, optimised across its crates and without these checks, is built once: it runs every world (its bytes are those of `tested`),
//! the page in a browser, the tests of the command line's first steps and bad inputs, and the book.
//!
//! Lints, documentation, tests, xtask and the fuzz targets are built in one profile and with one set of features, so that no
//! dependency is built twice for them. The table at the end shows what each step took.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::spent::{Spent, Table};
use crate::{
    book, deps, faults, figure, fuzz, identify, licences, links, memory, notes, page, python, tools, truth, vm,
};

/// The one in which every test is built, xtask too (`.cargo/config.toml`).
pub const PROFILE: &str = "tested";

/// All that cargo builds for tests. `--all-targets` leaves out the targets that `cargo test` leaves out.
const TARGETS: &str = "--workspace --lib --bins --examples --test *";

/// What has passed and failed so far.
struct Tally {
    passed: u64,
    failed: u64,
    /// At the end of the last step.
    since: Spent,
    steps: Table,
    programs: Table,
}

pub fn run() -> Result<()> {
    let started = Spent::now();
    let mut tally = Tally { passed: 0, failed: 0, since: started, steps: Table::default(), programs: Table::default() };
    tally.step("format", cargo("fmt --all --check", ""));
    tally.step("nothing is built twice", deps::built_once());
    tally.step("lints", cargo(&format!("clippy {TARGETS} --profile {PROFILE} -- -D warnings"), ""));
    tally.step("programs for the tests", tools::installed());
    // Its last link is one long thread of work: it runs beside the tests, in a folder of its own.
    let shipped =
        Beside::start("target/shipped.log", env!("CARGO"), &["build", "--quiet", "--package", "hapt", "--release"])?;
    let programs = built(&[]);
    tally.step("the tests build", programs.as_ref().map(drop).map_err(|error| anyhow::anyhow!("{error:#}")));
    for program in programs.unwrap_or_default() {
        tally.program(&program)?;
    }
    tally.tests("examples in the documentation", &mut cargo_tests(&["--workspace", "--doc", "--profile", PROFILE]))?;
    tally.step("documentation", cargo(&format!("doc --workspace --no-deps --profile {PROFILE}"), "-D warnings"));
    tally.step("the program that ships", shipped.end());
    let program = std::path::absolute(binary("release").get_program())?;
    let cli = built(&["cli"])?.into_iter().next().context("there is no test cli")?;
    tally.tests("bad inputs with it", cli.command().arg("bad_inputs").env("HAPT_PROGRAM", program))?;
    for world in worlds(Path::new("worlds"))? {
        tally.step(&world.display().to_string(), same_bytes(&world));
    }
    tally.step("hapt-core cannot panic", cannot_panic());
    tally.step("the page's core gives the same bits", page::same_bits());
    tally.step("the page is what its sources build to", page::is_current());
    tally.step("the page works in a browser", page::works());
    tally.step("the Python package", python::holds());
    tally.step("drives on a CAN bus", vm::drives());
    // Only here: the steps above may install packages, which one alone can do at a time.
    let firmware = Beside::start("target/firmware.log", std::env::current_exe()?, &["firmware", "holds"])?;
    tally.step("fuzzing finds nothing in a few seconds", fuzz::is_quiet());
    tally.step("the certificate holds against brute force", truth::holds());
    tally.step("the supervisor catches faults, and nothing else", faults::are_caught());
    tally.step("intervals of identified devices cover the truth", identify::holds());
    tally.step("memory stays bounded", memory::is_bounded());
    tally.step("licences and sources", deps::licences());
    tally.step("licences of the program", licences::is_current());
    tally.step("the oldest Rust", deps::oldest_rust());
    tally.step("docs/notes.md is current", notes::is_current());
    tally.step("docs/notes.md names tests that exist", notes::names_real_tests());
    tally.step("the pictures are current", figure::is_current());
    tally.step("links of the documents", links::hold());
    for page in book::pages()? {
        tally.step(&page.display().to_string(), book::is_current(&page));
    }
    tally.step("the firmware holds on emulated boards", firmware.end());
    println!("\nThe steps:\n{}\nThe slowest test programs:\n{}", tally.steps, tally.programs);
    println!("{:.0} s, {:.0} s of processor time", started.since().wall, started.since().processor);
    println!("{} passed, {} failed", tally.passed, tally.failed);
    // The count is the last word: an error would print after it.
    std::process::exit(i32::from(tally.failed > 0))
}

impl Tally {
    /// One check, counted, with the seconds that it took.
    fn step(&mut self, name: &str, done: Result<()>) {
        let took = self.lap(name);
        match done {
            Ok(()) => {
                self.passed += 1;
                println!("ok     {took:4.0} s  {name}");
            }
            Err(error) => {
                self.failed += 1;
                println!("FAILED {took:4.0} s  {name}: {error:#}");
            }
        }
    }

    /// Seconds of the step that ends now.
    fn lap(&mut self, name: &str) -> f64 {
        let took = self.since.since();
        self.since = Spent::now();
        self.steps.row(name, took);
        took.wall
    }

    /// A test program, as cargo runs it.
    fn program(&mut self, program: &Program) -> Result<()> {
        let name = program.name();
        let before = Spent::now();
        self.tests(&name, &mut program.command())?;
        self.programs.row(&name, before.since());
        Ok(())
    }

    /// Tests, each counted; a test program that fails without a count is one failure.
    fn tests(&mut self, name: &str, command: &mut Command) -> Result<()> {
        let output = command.stdin(Stdio::null()).stderr(Stdio::inherit()).output()?;
        let (passed, failed) = (self.passed, self.failed);
        for line in String::from_utf8_lossy(&output.stdout).lines() {
            if let Some(result) = line.strip_prefix("test result: ") {
                self.passed += counted(result, "passed")?;
                self.failed += counted(result, "failed")?;
            } else if !line.is_empty() && !line.ends_with("... ok") && !line.starts_with("running ") {
                println!("{line}");
            }
        }
        if !output.status.success() && self.failed == failed {
            self.failed += 1;
        }
        let verdict = if self.failed == failed { "ok    " } else { "FAILED" };
        let took = self.lap(name);
        println!("{verdict} {took:4.0} s  {name}: {} passed, {} failed", self.passed - passed, self.failed - failed);
        Ok(())
    }
}

/// A command beside the steps that follow, which leave a core to it as it leaves one to them. Its output is kept until its end.
struct Beside {
    child: Child,
    log: &'static str,
    since: Instant,
}

impl Beside {
    fn start(log: &'static str, program: impl AsRef<OsStr>, arguments: &[&str]) -> Result<Beside> {
        fs::create_dir_all("target")?;
        let said = fs::File::create(log)?;
        let mut command = Command::new(program);
        command.args(arguments).stdin(Stdio::null()).stdout(said.try_clone()?).stderr(said);
        Ok(Beside { child: command.spawn()?, log, since: Instant::now() })
    }

    fn end(mut self) -> Result<()> {
        let status = self.child.wait()?;
        print!("{}", fs::read_to_string(self.log)?);
        println!("        (it took up to {:.0} s, beside the steps above)", self.since.elapsed().as_secs_f64());
        ensure!(status.success(), "it ends with {status}");
        Ok(())
    }
}

impl Drop for Beside {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A program of tests, and the folder of its crate.
pub struct Program {
    file: PathBuf,
    folder: PathBuf,
}

impl Program {
    /// Ready to run, with every case of random tests.
    pub fn command(&self) -> Command {
        let mut command = Command::new(&self.file);
        command.current_dir(&self.folder).env("CARGO_MANIFEST_DIR", &self.folder).env("HAPT_CASES", "all");
        command
    }

    /// The crate's, and the program's without the hash of its file.
    fn name(&self) -> String {
        let [folder, file] =
            [&self.folder, &self.file].map(|path| path.file_name().unwrap_or_default().to_string_lossy());
        format!("{folder}/{}", file.rsplit_once('-').map_or(&*file, |(name, _)| name))
    }

    /// Its file.
    pub fn file(&self) -> &Path {
        &self.file
    }
}

/// Builds the tests of these names, all of them when there are none. The whole workspace is chosen every time, for the features of
/// dependencies depend on the choice: what has been built stays as it is.
pub fn built(names: &[&str]) -> Result<Vec<Program>> {
    let mut command = Command::new(env!("CARGO"));
    command.args(["test", "--quiet", "--profile", PROFILE, "--no-run", "--message-format", "json-render-diagnostics"]);
    if names.is_empty() {
        command.args(TARGETS.split_whitespace());
    } else {
        command.arg("--workspace").args(names.iter().flat_map(|name| ["--test", name]));
    }
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

/// cargo's own tests, all of them even where one fails.
fn cargo_tests(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO"));
    command.args(["test", "--no-fail-fast"]).args(arguments);
    command
}

/// The number before `word` in "ok. 5 passed; 0 failed; ...".
fn counted(result: &str, word: &str) -> Result<u64> {
    let before = result.split(word).next().context("no count")?;
    Ok(before.split_whitespace().next_back().context("no count")?.parse()?)
}

fn cargo(arguments: &str, rustdoc_flags: &str) -> Result<()> {
    let status = Command::new(env!("CARGO"))
        .args(arguments.split_whitespace())
        .env("RUSTDOCFLAGS", rustdoc_flags)
        .stdout(Stdio::null())
        .status()?;
    ensure!(status.success(), "cargo {arguments}");
    Ok(())
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

/// The tested and the shipped program write the same bytes of every scenario and of the verdict, and the latter does so twice.
fn same_bytes(world: &Path) -> Result<()> {
    let scratch = PathBuf::from("target/worlds");
    let mut runs = Vec::new();
    for (i, build) in [PROFILE, "release", "release"].into_iter().enumerate() {
        let out = scratch.join(i.to_string()).join(world.file_stem().context("a name")?);
        if out.exists() {
            fs::remove_dir_all(&out)?;
        }
        let run = binary(build).arg("sim").arg(world).arg("--out").arg(&out).output()?;
        ensure!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
        let mut files = Vec::new();
        for entry in fs::read_dir(&out)? {
            let path = entry?.path();
            files.push((path.file_name().context("a name")?.to_owned(), fs::read(&path)?));
        }
        files.sort();
        ensure!(!files.is_empty(), "no scenario was run");
        let check = binary(build).arg("check").arg(world).arg("--json").output()?;
        let code = check.status.code().context("check was ended by a signal")?;
        ensure!(code == 0 || code == 1, "check ends with {code}");
        files.push(("the verdict".into(), check.stdout));
        runs.push(files);
    }
    ensure!(runs[0] == runs[1], "the tested program and the one that ships differ");
    ensure!(runs[1] == runs[2], "two runs differ");
    Ok(())
}

/// The command line of a profile, which is built.
pub fn binary(build: &str) -> Command {
    binary_of(build, "hapt")
}

fn binary_of(build: &str, name: &str) -> Command {
    Command::new(target().join(build).join(format!("{name}{}", std::env::consts::EXE_SUFFIX)))
}

/// Where cargo builds.
pub fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| PathBuf::from("target"), PathBuf::from)
}

/// Links the core alone and looks for the standard panic routines; a control with a way to panic must show them.
fn cannot_panic() -> Result<()> {
    if !cfg!(target_os = "linux") {
        println!("        (the proof is linked on Linux only)");
        return Ok(());
    }
    let look = |features: &[&str]| -> Result<bool> {
        let target = Path::new("target/proof");
        let status = Command::new(env!("CARGO"))
            .args([
                "build",
                "--quiet",
                "--release",
                "--manifest-path",
                "crates/hapt-core/proof/Cargo.toml",
                "--target-dir",
            ])
            .arg(target)
            .args(features)
            .status()?;
        ensure!(status.success(), "the proof does not build");
        let library = fs::read(target.join("release/libproof.so"))?;
        Ok(library.windows(9).any(|bytes| bytes == b"panicking"))
    };
    ensure!(look(&["--features", "control"])?, "the control shows no panic: the look is blind");
    ensure!(!look(&[])?, "a way through hapt-core leads to a panic");
    Ok(())
}
