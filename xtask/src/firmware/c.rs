//! hapt for firmware in C: the library, its header, and an example that makes the same bits on a PC and on a board.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use hapt_core::{Controller, Reading, Request, SafetyProfile};
use hapt_model::World;

use super::trace::{BODIES, COUNTS, COUPLINGS, Trace};
use crate::deps::BOARD_TARGET;

use super::{ARM, BUILT, chip, compiler, control, qemu};
use crate::notes::world;

const HOST: [&str; 6] = ["-O2", "-Wall", "-Wextra", "-Werror", "-std=c11", "-ffp-contract=off"];

/// The example gives this machine's bits, compiled for this machine and for a board; there it cannot panic.
pub fn same_bits() -> Result<()> {
    let folder = std::env::current_dir()?.join(BUILT).join("example");
    fs::create_dir_all(&folder)?;
    let wheel = world("default")?;
    fs::write(folder.join("world.h"), array(&wheel)?)?;
    let wanted = format!("{:016x}\n", sum(&wheel)?);
    let sources = ["wheel.c"].map(|name| format!("firmware/c/example/{name}"));

    let library = library(None)?;
    let pc = folder.join("pc");
    let mut gcc = Command::new("gcc");
    gcc.args(HOST).arg("-I").arg(&folder).args(&sources).arg("firmware/c/example/pc.c").arg(library).arg("-o").arg(&pc);
    run(&mut gcc)?;
    let printed = String::from_utf8(Command::new(&pc).output()?.stdout)?;
    ensure!(printed == wanted, "the example in C on this machine: {printed}, not {wanted}");

    let library = self::library(Some(BOARD_TARGET))?;
    let board = folder.join("mps2");
    let mut gcc = Command::new("arm-none-eabi-gcc");
    gcc.args(ARM)
        .args(HOST)
        .args(["-nostdlib", "-ffreestanding", "-Wl,--gc-sections", "-T", "firmware/c/example/mps2.ld", "-I"])
        .arg(&folder);
    gcc.args(&sources).arg("firmware/c/example/mps2.c").arg(library).arg("-lgcc").arg("-o").arg(&board);
    run(&mut gcc)?;
    let printed = qemu("mps2-an386", &board, &[], &[])?;
    ensure!(printed == wanted, "the example in C on the board: {printed}, not {wanted}");
    chip::cannot_panic(&board, &control()?)?;
    let cpp = ["-x", "c++", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "firmware/c/hapt.h"];
    run(Command::new("gcc").args(cpp))
}

/// The world and its limits as a C array, as a board takes them.
pub fn array(world: &World) -> Result<String> {
    let mut room = [0; 1024];
    let bytes = hapt_wire::pack(&world.spec(), &world.board_limits(SafetyProfile::Simulated), &mut room)?;
    let lines: Vec<String> =
        bytes.chunks(16).map(|line| line.iter().map(|byte| format!(" 0x{byte:02x},")).collect::<String>()).collect();
    let title = world.title.as_deref().unwrap_or("A world");
    Ok(format!(
        "/* {title}, for hapt_load. */\nstatic const unsigned char world[] = {{\n   {}\n}};\n",
        lines.join("\n   ")
    ))
}

/// The sum of the example, by the core itself.
fn sum(world: &World) -> Result<u64> {
    let limits = world.board_limits(SafetyProfile::Simulated);
    let controller = Controller::<f32, BODIES, COUPLINGS, COUNTS>::new(&world.spec(), &limits)?;
    let (mut state, mut trace) = (controller.start(), Trace::new(1e-3));
    let mut sum = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |bits: u32| sum = (sum ^ u64::from(bits)).wrapping_mul(0x0000_0100_0000_01b3);
    for k in 0..10_000 {
        let (position, velocity) = trace.next();
        let reading = Reading { position, velocity, announced: false, late: 0.0, missed: 0, silent: 0.0 };
        let request = (k == 0).then_some(Request::Arm);
        let guarded = controller.step(&mut state, &reading, request);
        let now = &state.world.now;
        for x in [guarded.output, guarded.sample.torque, now.position[0], now.velocity[0]] {
            add(x.to_bits());
        }
        add(guarded.phase as u32);
    }
    Ok(sum)
}

/// The static library, for this machine or for a processor.
fn library(target: Option<&str>) -> Result<PathBuf> {
    let folder = std::env::current_dir()?.join(BUILT);
    let mut command = match target {
        Some(_) => compiler(BOARD_TARGET),
        None => Command::new(env!("CARGO")),
    };
    command.current_dir("firmware").env_remove("RUSTFLAGS").arg("build").arg("--target-dir").arg(&folder);
    command.args(["--quiet", "--release", "--locked", "--package", "hapt-c"]);
    if target.is_some() {
        command.args(super::target_arguments(BOARD_TARGET));
    }
    ensure!(command.status()?.success(), "the library for C does not build");
    Ok(folder.join(target.unwrap_or_default()).join("release/libhapt.a"))
}

fn run(command: &mut Command) -> Result<()> {
    let printed = command.output().with_context(|| format!("{command:?}"))?;
    ensure!(printed.status.success(), "{command:?}: {}", String::from_utf8_lossy(&printed.stderr));
    Ok(())
}

/// Prints a world as C.
pub fn print(file: &Path) -> Result<()> {
    let source = hapt_model::Source::open(file)?;
    print!("{}", array(&World::read(&source, &[])?)?);
    Ok(())
}
