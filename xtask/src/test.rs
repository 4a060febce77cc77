//! `cargo xtask test`: everything that has to hold before a change is merged. `cargo xtask test released`: what has to hold of the optimised
//! program, that of `cargo build --release`, as well, on schedule.
//!
//! Every test runs once, in the profile `test`, as `cargo test` has it: optimised nearly as `release`, with assertions and overflow checks. `release`, without
//! them, is the same sources: that its bits are the same needs no look before every merge, and building it is an eighth of the whole test.
//!
//! Lints, documentation, tests, xtask and the fuzz targets are built in one profile and with one set of features, so that no
//! dependency is built twice for them. Steps run side by side; the table at the end shows the time of each.

use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

use crate::programs::{PROFILE, Program, TARGETS, all_built, binary, built, cargo, worlds};
use crate::steps::{Step, Tally};
use crate::{
    book, deps, faults, figure, fmi, fuzz, identify, licences, links, memory, modules, notes, page, proof, python,
    release, tools, truth, vm,
};

/// Tests of the command line that depend on the clock, as those of drives do.
const BY_THE_CLOCK: [&str; 4] = ["drives::", "odrive::", "realtime::", "station::"];

pub fn run() -> Result<()> {
    let mut tally = Tally::new();
    // Packages come while the processor compiles. Nothing else installs any.
    tally.run(vec![
        Step::check("programs for the tests", tools::installed),
        Step::check("format", || cargo("fmt --all --check", "")),
        Step::check("nothing is built twice", deps::built_once),
        Step::check("lints", || cargo(&format!("clippy {TARGETS} -- -D warnings"), "")),
        Step::check("the tests build", || all_built().map(drop)),
    ]);
    let Ok(programs) = all_built() else { std::process::exit(i32::from(!tally.end())) };

    // Builds end in one crate on one core: the tests run at the same time.
    let mut steps = vec![Step::check("the Python package builds", python::is_built)];
    // A drive's watchdog runs by the clock: its tests run one program at a time, with nothing else.
    let tests = |program: &Program| Step::program(program.name(), program.command());
    let mut exclusive = Vec::new();
    for program in &programs {
        match program.name().as_str() {
            name if name.starts_with("hapt-drive/") => exclusive.push(tests(program)),
            name @ "hapt/cli" => {
                let (mut rest, mut timed) = (program.command(), program.command());
                rest.args(BY_THE_CLOCK.iter().flat_map(|name| ["--skip", name]));
                timed.args(BY_THE_CLOCK);
                steps.push(Step::program(name, rest));
                exclusive.push(Step::program(format!("{name}, by the clock"), timed));
            }
            _ => steps.push(tests(program)),
        }
    }
    steps.push(Step::tests("examples in the documentation", documented()));
    steps.push(Step::check("documentation", || cargo("doc --workspace --no-deps", "-D warnings")));
    tally.run(steps);
    // Builds next to these tests, even of a lower priority, are too much: a simulated drive then answers too late.
    for step in exclusive {
        tally.run(vec![step]);
    }

    // An emulated machine keeps time too, on one core. The builds and emulations of boards use the other core.
    let guest = Step::by_the_clock("drives on a CAN bus, and a wheel on USB", vm::devices);
    let firmware = Step::by_the_clock("the firmware holds on emulated boards", || {
        let mut firmware = Command::new("nice");
        let output = firmware.args(["-n", "10"]).arg(std::env::current_exe()?).args(["firmware", "holds"]).output()?;
        let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
        ensure!(output.status.success(), "{}, after\n{text}", output.status);
        print!("{text}");
        Ok(())
    });
    let mut steps = vec![
        Step::by_the_clock("the Python package works", python::works),
        Step::by_the_clock("the page works in a browser", page::works),
        Step::check("the Python package's types", python::has_types),
        Step::check("FMUs in the importers of others", fmi::holds),
        Step::check("fuzzing finds nothing in a few seconds", fuzz::is_quiet),
        Step::check("intervals of identified devices cover the truth", identify::holds),
        Step::check("docs/measured.md is current, where the records are at hand", identify::measured_is_current),
        Step::check("the supervisor catches faults, and nothing else", faults::are_caught),
        Step::check("the page's core gives the same bits", page::same_bits),
        Step::check("the page is what its sources build to", page::is_current),
        Step::check("the certificate holds against brute force", truth::holds),
        Step::check("proofs hold before an independent checker", proof::holds),
        Step::check("theorems hold before Coq", proof::is_checked_by_coq),
        Step::check("hapt-core cannot panic", cannot_panic),
        Step::check("memory stays bounded", memory::is_bounded),
        Step::check("licences and sources", deps::licences),
        Step::check("licences of the program", licences::is_current),
        Step::check("the oldest Rust", deps::oldest_rust),
        Step::check("docs/notes.md is current", notes::is_current),
        Step::check("docs/notes.md names tests that exist", notes::names_real_tests),
        Step::check("the pictures are current", figure::is_current),
        Step::check("links of the documents", links::hold),
        Step::check("no circles of modules", modules::are_acyclic),
    ];
    steps.extend(same_bytes([PROFILE, PROFILE])?);
    for page in book::pages()? {
        steps.push(Step::check(page.display().to_string(), move || book::is_current(&page)));
    }
    tally.run_after(Some(guest), Some(firmware), steps);
    std::process::exit(i32::from(!tally.end()))
}

/// The program of `cargo build --release`, which has no assertions and no overflow checks, writes the bytes of the tested program for every
/// world, refuses bad inputs, and works from its archive in an empty root. The README's first command works too.
pub fn released() -> Result<()> {
    let mut tally = Tally::new();
    // Its program has the tested one's file.
    tally.run(vec![Step::check("the README's first command", || cargo("run --quiet", ""))]);
    tally.run(vec![
        Step::check("the optimised program builds", || cargo("build --quiet --release", "")),
        Step::check("the tested program builds", || {
            cargo(&format!("build --quiet --workspace --bin hapt --profile {PROFILE}"), "")
        }),
    ]);
    let mut bad_inputs = built(&["cli"])?.into_iter().next().context("there is no test cli")?.command();
    bad_inputs.arg("bad_inputs").env("HAPT_PROGRAM", std::path::absolute(binary("release").get_program())?);
    let mut steps = vec![
        Step::tests("bad inputs", bad_inputs),
        Step::check("a release's archive works in an empty root", release::rehearsed),
    ];
    steps.extend(same_bytes([PROFILE, "release"])?);
    tally.run(steps);
    std::process::exit(i32::from(!tally.end()))
}

/// The examples of the documentation, all of them even where one fails.
fn documented() -> Command {
    let mut command = Command::new(env!("CARGO"));
    command.args(["test", "--no-fail-fast", "--workspace", "--doc", "--profile", PROFILE]);
    command
}

/// The programs of these two profiles write the same bytes of every scenario and the same verdict: a step for each world and network.
fn same_bytes(profiles: [&'static str; 2]) -> Result<impl Iterator<Item = Step>> {
    let worlds = [worlds(Path::new("worlds"))?, worlds(Path::new("networks"))?].concat();
    Ok(worlds.into_iter().map(move |world| {
        Step::check(world.display().to_string(), move || {
            let [first, second] = [written(&world, profiles[0], 0)?, written(&world, profiles[1], 1)?];
            ensure!(first == second, "two runs, of {} and of {}, differ", profiles[0], profiles[1]);
            Ok(())
        })
    }))
}

/// What the program of a profile writes of a world: the name and the bytes of each scenario's file, and the verdict.
fn written(world: &Path, profile: &str, run: usize) -> Result<Vec<(OsString, Vec<u8>)>> {
    let out = Path::new("target/worlds").join(run.to_string()).join(world.file_stem().context("a name")?);
    if out.exists() {
        fs::remove_dir_all(&out)?;
    }
    let sim = binary(profile).arg("sim").arg(world).arg("--out").arg(&out).output()?;
    ensure!(sim.status.success(), "{}", String::from_utf8_lossy(&sim.stderr));
    let mut files = Vec::new();
    for entry in fs::read_dir(&out)? {
        let path = entry?.path();
        files.push((path.file_name().context("a name")?.to_owned(), fs::read(&path)?));
    }
    files.sort();
    ensure!(!files.is_empty(), "no scenario was run");
    let check = binary(profile).arg("check").arg(world).arg("--json").output()?;
    let code = check.status.code().context("check was ended by a signal")?;
    ensure!(code == 0 || code == 1, "check ends with {code}");
    files.push(("the verdict".into(), check.stdout));
    Ok(files)
}

/// Links only the core and searches the standard panic routines; a control that can panic must show them.
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
