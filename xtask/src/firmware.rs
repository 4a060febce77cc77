//! The firmware on emulated boards: the same bits as here, hardware in the loop, the instructions a sample takes, and its use of a chip's
//! memory. docs/firmware.md shows the results.

mod bits;
mod boot;
mod c;
mod chip;
mod counts;
mod exported;
mod game_wheel;
mod line;
mod lockstep;
mod port;
mod timer;
#[path = "../../firmware/src/trace.rs"]
mod trace;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail, ensure};

use crate::deps::{self, BOARD_TARGET, M33_TARGET};
use crate::marked;

const FOLDER: &str = "firmware";
const BUILT: &str = "target/firmware";
const PAGE: &str = "docs/firmware.md";
/// The same target for gcc.
const ARM: [&str; 4] = ["-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard"];

/// QEMU's machine, the feature that builds for it, and its processor.
const BOARDS: [(&str, &str, &str); 4] = [
    ("mps2-an386", "mps2", "Cortex-M4F"),
    ("mps2-an500", "mps2", "Cortex-M7"),
    ("mps2-an505", "mps2-an505", "Cortex-M33"),
    ("netduinoplus2", "netduinoplus2", "STM32F405, Cortex-M4F"),
];

/// The chips that the firmware fits: the feature, its program, flash and memory in KiB.
const CHIPS: [(&str, &str, u32, u32); 4] = [
    ("netduinoplus2", "wheel", 1024, 128),
    ("b-g431b-esc1", "wheel", 128, 32),
    (boot::BOARD, "wheel", 4096, 512),
    (game_wheel::BOARD, "game-wheel", 1024, 128),
];

/// How long the emulated boards run. An emulator takes ten to a hundred times a processor's time for the same samples.
#[derive(Clone, Copy, PartialEq)]
enum Extent {
    /// In every run of the tests.
    Short,
    /// By the commands of docs/firmware.md.
    Full,
}

/// `cargo xtask firmware`
pub fn command(words: &[&str]) -> Result<()> {
    match words {
        [] => {
            all(Extent::Full)?;
            println!("{}\n{}\n{}", counts::table()?, game_wheel::counts()?, sizes()?);
            Ok(())
        }
        ["bits"] => bits::same(Extent::Full),
        ["lockstep"] => lockstep::holds(Extent::Full),
        ["timer"] => timer::holds(Extent::Full).and_then(|()| timer::counts_and_watches()),
        ["port"] => port::holds(),
        ["c"] => c::same_bits(),
        ["panics"] => cannot_panic(),
        ["uf2", file] => boot::write(Path::new(file)),
        ["counts"] => {
            println!("{}", counts::table()?);
            Ok(())
        }
        ["export"] => {
            println!("{}", exported::table()?);
            Ok(())
        }
        ["sizes"] => {
            println!("{}", sizes()?);
            Ok(())
        }
        ["world", file] => c::print(Path::new(file)),
        ["game-wheel"] => game_wheel::holds(),
        ["effects"] => {
            println!("{}", game_wheel::counts()?);
            Ok(())
        }
        ["game-wheel", file] => game_wheel::write(Path::new(file)),
        ["--write"] => {
            let page = fs::read_to_string(PAGE).context(PAGE)?;
            let page = marked::replaced(&page, "cargo xtask firmware counts", &counts::table()?)?;
            let page = marked::replaced(&page, "cargo xtask firmware effects", &game_wheel::counts()?)?;
            let page = marked::replaced(&page, "cargo xtask firmware export", &exported::table()?)?;
            fs::write(PAGE, marked::replaced(&page, "cargo xtask firmware sizes", &sizes()?)?).context(PAGE)
        }
        _ => bail!(
            "cargo xtask firmware [--write], or one of bits, lockstep, timer, port, c, panics, counts, export, sizes, effects, game-wheel; world FILE prints a world as C, game-wheel FILE puts one into the wheel's program, uf2 FILE writes pico2's wheel as UF2"
        ),
    }
}

/// All that must hold, in every run of the tests; the tables are made by [`command`].
pub fn holds() -> Result<()> {
    all(Extent::Short)
}

fn all(extent: Extent) -> Result<()> {
    if !has_tools()? {
        return Ok(());
    }
    bits::same(extent)?;
    lockstep::holds(extent)?;
    timer::holds(extent)?;
    timer::counts_and_watches()?;
    port::holds()?;
    c::same_bits()?;
    cannot_panic()?;
    boot::holds()?;
    game_wheel::holds()?;
    exported::table()?;
    sizes().map(drop)
}

/// No program of any board can panic, the template's too.
fn cannot_panic() -> Result<()> {
    let control = control()?;
    for board in ["mps2", "mps2-an505", "netduinoplus2", "b-g431b-esc1", "my-board"] {
        for name in ["wheel", "fed"] {
            chip::cannot_panic(&program(board, name, None)?, &control)?;
        }
    }
    // The parts in which the board's `fed` differs are in its `wheel` too.
    chip::cannot_panic(&program(boot::BOARD, "wheel", None)?, &control)?;
    println!("        no panic code in wheel and fed, on any board");
    Ok(())
}

/// A program that can panic.
fn control() -> Result<PathBuf> {
    program("mps2", "control", None)
}

/// The table of sizes: everything fits.
fn sizes() -> Result<String> {
    let mut table = String::from(
        "| board | program | code and constants | data | zeros | main loop's stack | interrupts' | flash | memory |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for (board, name, flash, memory) in CHIPS {
        let program = program(board, name, None)?;
        table += &chip::row(&format!("{board} | {name}"), &program, flash, memory)?;
        table.push('\n');
    }
    Ok(table)
}

/// The target of a board's processor.
fn target(board: &str) -> &'static str {
    if ["mps2-an505", boot::BOARD].contains(&board) { M33_TARGET } else { BOARD_TARGET }
}

/// cargo for the target: with rustup's where it is installed, else with the distribution's compiler and sources.
fn compiler(target: &str) -> Command {
    if deps::has_target(target) {
        return Command::new(env!("CARGO"));
    }
    // Debian: apt-get install rustc-web cargo-web rust-web-src lld. There is no standard library for the target, so it is built.
    let mut command = Command::new("/usr/bin/cargo");
    command.env("RUSTC", "/usr/bin/rustc").env("RUSTC_BOOTSTRAP", "1").env_remove("RUSTUP_TOOLCHAIN");
    command.env(format!("CARGO_TARGET_{}_LINKER", target.to_uppercase().replace(['-', '.'], "_")), "ld.lld");
    command
}

fn target_arguments(target: &'static str) -> Vec<&'static str> {
    let mut arguments = vec!["--target", target];
    if !deps::has_target(target) {
        arguments.extend(["-Zbuild-std=core", "-Zbuild-std-features=compiler-builtins-mem"]);
    }
    arguments
}

/// Builds one of the firmware's programs for a board.
fn program(board: &str, name: &str, c_step: Option<&Path>) -> Result<PathBuf> {
    // The programs that test have a console.
    let (binary, feature) = match name {
        "bits" | "count" | "usb" => (name, ",semihosting"),
        "wheel-that-stops" => ("wheel", ",stall"),
        _ => (name, ""),
    };
    let features = format!("{board}{feature}");
    let target = target(board);
    let mut command = compiler(target);
    let folder = std::env::current_dir()?.join(BUILT);
    fs::create_dir_all(&folder)?;
    // Without the user's settings, which change sizes.
    command.current_dir(FOLDER).env_remove("RUSTFLAGS").env_remove("CARGO_INCREMENTAL");
    let profile = if ["b-g431b-esc1", "my-board"].contains(&board) { "small" } else { "release" };
    command
        .args(["build", "--quiet", "--profile", profile, "--locked", "--bin", binary])
        .args(target_arguments(target));
    command.args(["--features", &features]).arg("--target-dir").arg(&folder);
    if let Some(object) = c_step {
        command.env("HAPT_C_STEP", object);
    }
    let status = command.status().with_context(|| format!("no compiler: rustup target add {target}"))?;
    ensure!(status.success(), "the firmware's {name} does not build: rustup target add {target}");
    // The next board's program has the same name.
    let kept = folder.join(format!("{board}-{name}"));
    fs::copy(folder.join(target).join(profile).join(binary), &kept)?;
    Ok(kept)
}

/// Builds a program for every board, then has `run` run it on each, side by side.
fn on_all_boards<R: Send>(name: &str, run: impl Fn(&str, &Path) -> Result<R> + Sync) -> Result<Vec<R>> {
    let programs = BOARDS.map(|(machine, board, _)| program(board, name, None).map(|program| (machine, program)));
    let programs: Vec<_> = programs.into_iter().collect::<Result<_>>()?;
    let run = |(machine, program): &(&str, PathBuf)| run(machine, program).with_context(|| machine.to_string());
    std::thread::scope(|scope| {
        let runs: Vec<_> = programs.iter().map(|board| scope.spawn(|| run(board))).collect();
        runs.into_iter().map(|run| run.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
    })
}

/// The output of a program on the emulated board, given a file of cases.
fn qemu(machine: &str, program: &Path, cases: &[u8], more: &[&str]) -> Result<String> {
    let folder = Path::new(BUILT).join(machine);
    fs::create_dir_all(&folder)?;
    fs::write(folder.join("cases"), cases)?;
    let mut command = Command::new("qemu-system-arm");
    command.args(["-machine", machine, "-display", "none", "-serial", "none", "-monitor", "none"]);
    command.args(["-chardev", "stdio,id=console", "-semihosting-config", "enable=on,target=native,chardev=console"]);
    command.args(more).arg("-kernel").arg(program).current_dir(folder).stdin(Stdio::null());
    let output = command.output()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    ensure!(output.status.success(), "{machine}: {}: {text}{}", output.status, String::from_utf8_lossy(&output.stderr));
    Ok(text)
}

/// Whether the tools are installed that build and run the firmware; with `CI` set they have to be.
fn has_tools() -> Result<bool> {
    let there = |program| {
        let output = Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        output.is_ok_and(|status| status.success())
    };
    let all = || {
        let compiler = [BOARD_TARGET, M33_TARGET].into_iter().all(deps::has_target)
            || (there("/usr/bin/rustc") && Path::new("/usr/lib/rustlib/src").exists() && there("ld.lld"));
        compiler && there("qemu-system-arm") && there("arm-none-eabi-gcc")
    };
    const PACKAGES: [&str; 6] =
        ["qemu-system-arm", "gcc-arm-none-eabi", "rustc-web", "cargo-web", "rust-web-src", "lld"];
    let ci = std::env::var_os("CI").is_some();
    if all() {
        return Ok(true);
    }
    ensure!(!ci, "missing: apt-get install {}", PACKAGES.join(" "));
    println!("SKIPPED: the firmware's tests, apt-get install {}", PACKAGES.join(" "));
    Ok(false)
}
