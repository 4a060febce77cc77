//! Instructions a sample, counted by the emulator: hapt's loop bare and supervised, and the same loop in C.

use std::fmt::Write;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context, Result, ensure};
use hapt_model::{Source, World};

use super::bits::bytes;
use super::{ARM, BUILT, has_tools, program, qemu};
use crate::notes::world;

/// The largest count for the notes' world under the supervisor.
const GOAL: f64 = 400.0;
/// The largest ratio to C's count.
const RATIO: f64 = 1.2;

/// The instructions of one world.
#[derive(Clone, Copy)]
struct Row {
    bodies: u32,
    /// With capacity for 4 bodies, and with its own: bare, supervised, and supervised on the slow path.
    hapt: [[f64; 3]; 2],
    /// For the world's number of bodies, and for a number fixed at compile time.
    c: [f64; 2],
}

/// Instructions a sample of these worlds by hapt-core, with the smaller capacity: bare, and supervised.
pub fn of_the_core(worlds: &[Vec<u8>]) -> Result<Vec<[f64; 2]>> {
    let mut file = Vec::new();
    for bytes in worlds {
        file.extend((bytes.len() as u32).to_le_bytes());
        file.extend(bytes);
    }
    let program = program("mps2", "count", Some(&c_step("-O2")?))?;
    let rows = rows(&qemu("mps2-an386", &program, &file, &["-icount", "shift=5,sleep=off"])?)?;
    let least = |row: Row, kind: usize| row.hapt.into_iter().map(|counts| counts[kind]).fold(f64::INFINITY, f64::min);
    Ok(rows.into_iter().map(|row| [least(row, 0), least(row, 1)]).collect())
}

/// The table, or nothing where the tools are missing.
pub fn table() -> Result<String> {
    if !has_tools()? {
        return Ok(String::new());
    }
    let mut file = Vec::new();
    let chain =
        |name| Ok::<_, anyhow::Error>(World::read(&Source::open(format!("firmware/worlds/{name}.toml"))?, &[])?);
    for world in [world("default")?, chain("two")?, chain("four")?] {
        let bytes = bytes(&world)?;
        file.extend((bytes.len() as u32).to_le_bytes());
        file.extend(bytes);
    }
    let mut levels = Vec::new();
    for level in ["-O2", "-O3"] {
        let program = program("mps2", "count", Some(&c_step(level)?))?;
        levels.push(rows(&qemu("mps2-an386", &program, &file, &["-icount", "shift=5,sleep=off"])?)?);
    }
    let [two, three] = &levels[..] else { unreachable!("two levels") };
    let mut table = String::from(
        "| bodies | hapt, bare | in its own room | C, any world: -O2 | -O3 | C, this number of bodies: -O2 | -O3 | hapt / C | hapt, supervised | in its own room | in full | in its own room |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    for (o2, o3) in two.iter().zip(three) {
        let [[bare, supervised, full], [own_bare, own_supervised, own_full]] = o3.hapt;
        let ratio = bare.min(own_bare) / o3.c[0].min(o2.c[0]);
        let missed = if ratio > RATIO { " **missed**" } else { "" };
        let over = if o3.bodies == 1 && supervised.min(own_supervised) > GOAL { " **missed**" } else { "" };
        let [any2, typed2, any3, typed3] = [o2.c[0], o2.c[1], o3.c[0], o3.c[1]];
        writeln!(
            table,
            "| {} | {bare:.0} | {own_bare:.0} | {any2:.0} | {any3:.0} | {typed2:.0} | {typed3:.0} | {ratio:.2}{missed} | {supervised:.0} | {own_supervised:.0}{over} | {full:.0} | {own_full:.0} |",
            o3.bodies
        )?;
    }
    Ok(table)
}

/// The output of `count` for each world.
fn rows(printed: &str) -> Result<Vec<Row>> {
    let lines = printed.lines().filter(|line| !line.starts_with("stack"));
    let row = |line: &str| {
        let numbers: Vec<f64> = line.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
        let [bodies, a, b, c, d, e, f, any, typed] = numbers[..] else { anyhow::bail!("not a count: {line}") };
        Ok(Row { bodies: bodies as u32, hapt: [[a, b, c], [d, e, f]], c: [any, typed] })
    };
    lines.map(row).collect::<Result<_>>().context("counts")
}

/// The same loop in C.
fn c_step(level: &str) -> Result<PathBuf> {
    let folder = std::env::current_dir()?.join(BUILT);
    std::fs::create_dir_all(&folder)?;
    let object = folder.join(format!("step{level}.o"));
    let mut command = Command::new("arm-none-eabi-gcc");
    command.args(ARM).args(["-ffp-contract=off", "-Wall", level, "-c", "firmware/bench/step.c", "-o"]).arg(&object);
    ensure!(command.status()?.success(), "arm-none-eabi-gcc");
    Ok(object)
}
