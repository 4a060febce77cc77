//! The C of `hapt export c` on a Cortex-M: size, stack and instructions a sample by each compiler, compared with the core's in Rust, over
//! the same trace and with the same bits.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use hapt_core::{Controller, Estimator, Phase, Reading, Request};
use hapt_export_c::{About, Float, Prefix, export};
use hapt_model::{Source, World};

use super::bits::bytes;
use super::trace::{BODIES, COUNTS, COUPLINGS, LIMITS, Trace};
use super::{ARM, BUILT, counts, has_tools, qemu};

/// The largest ratio of the C's instructions to the core's.
const GOAL: f64 = 1.3;
const WORLDS: [&str; 5] = [
    "worlds/notes/default.toml",
    "firmware/worlds/two.toml",
    "firmware/worlds/four.toml",
    "worlds/knob/coarse-strong.toml",
    "worlds/knob/flywheel.toml",
];
/// gcc's options for other processors, whose code is only sized.
const SIZED: [(&str, &[&str]); 3] = [
    ("Cortex-M0+", &["-mcpu=cortex-m0plus", "-mthumb"]),
    ("Cortex-M4F", &ARM),
    ("Cortex-M33", &["-mcpu=cortex-m33", "-mthumb", "-mfpu=fpv5-sp-d16", "-mfloat-abi=hard"]),
];

/// The result of one compiler for one world.
struct Counted {
    bare: f64,
    supervised: f64,
    stack: u64,
    controller: u64,
}

/// The tables, or nothing where the tools are missing.
pub fn table() -> Result<String> {
    if !has_tools()? {
        return Ok(String::new());
    }
    let folder = std::env::current_dir()?.join(BUILT).join("exported");
    fs::create_dir_all(&folder)?;
    let worlds: Vec<(String, World)> = WORLDS.into_iter().map(opened).collect::<Result<_>>()?;
    let core = counts::of_the_core(&worlds.iter().map(|(_, world)| bytes(world)).collect::<Result<Vec<_>>>()?)?;
    let mut table = String::from(
        "| world | compiler | code and constants | controller | stack | bare | core, bare | C / core | supervised | core, supervised | C / core |\n\
         | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n",
    );
    let mut sizes =
        format!("| world | {} |\n| --- |{}\n", SIZED.map(|(name, _)| name).join(" | "), " --- |".repeat(SIZED.len()));
    for ((name, world), [bare, supervised]) in worlds.iter().zip(core) {
        write_c(world, &folder)?;
        let wanted = sum(world)?;
        for (compiler, label, level) in compilers() {
            let object = folder.join("w.o");
            compile(&compiler, level, &object, &folder)?;
            let size = size(&object)?;
            let counted = count(world, &object, &folder, wanted).with_context(|| format!("{name}, {label} {level}"))?;
            let of = |c: f64, core: f64| {
                let missed = if c > GOAL * core { " **missed**" } else { "" };
                format!("{c:.0} | {core:.0} | {:.2}{missed}", c / core)
            };
            let Counted { controller, stack, .. } = counted;
            ensure!(
                counted.supervised <= GOAL * supervised,
                "{name}, {label} {level}: {} instructions, where the core takes {supervised}",
                counted.supervised
            );
            let (bare, supervised) = (of(counted.bare, bare), of(counted.supervised, supervised));
            writeln!(table, "| {name} | {label} {level} | {size} | {controller} | {stack} | {bare} | {supervised} |")?;
        }
        let row: Vec<String> = SIZED
            .into_iter()
            .map(|(_, flags)| {
                let object = folder.join("sized.o");
                compile(&gcc(flags), "-Os", &object, &folder)?;
                Ok(size(&object)?.to_string())
            })
            .collect::<Result<_>>()?;
        writeln!(sizes, "| {name} | {} |", row.join(" | "))?;
    }
    Ok(format!("{table}\nCode and constants by gcc -Os, without the compiler's own routines for numbers:\n\n{sizes}"))
}

fn opened(path: &str) -> Result<(String, World)> {
    let world = World::read(&Source::open(path)?, &[])?;
    let name = Path::new(path).file_stem().context("a name")?.to_string_lossy().into_owned();
    Ok((name, world))
}

fn gcc(flags: &[&str]) -> Vec<String> {
    ["arm-none-eabi-gcc"].iter().chain(flags).map(ToString::to_string).collect()
}

/// The installed compilers, with their versions and levels of optimisation.
fn compilers() -> Vec<(Vec<String>, String, &'static str)> {
    let clang: Vec<String> =
        ["clang", "--target=arm-none-eabi", "-fshort-enums"].iter().chain(&ARM).map(ToString::to_string).collect();
    let mut all = Vec::new();
    for (command, name) in [(gcc(&ARM), "gcc"), (clang, "clang")] {
        let version = || {
            let printed = Command::new(&command[0]).arg("--version").output().ok()?;
            let text = String::from_utf8(printed.stdout).ok()?;
            let is_number =
                |word: &&str| word.split('.').count() == 3 && word.starts_with(|c: char| c.is_ascii_digit());
            Some(text.lines().next()?.split([' ', '-']).find(is_number)?.to_owned())
        };
        match version() {
            Some(version) => {
                let levels = ["-Os", "-O2", "-O3"];
                all.extend(levels.map(|level| (command.clone(), format!("{name} {version}"), level)));
            }
            None => println!("        (without {name}, which is not here)"),
        }
    }
    all
}

/// Writes w.c and w.h: with the limits and the trace of the core's count.
fn write_c(world: &World, folder: &Path) -> Result<()> {
    let about = About { title: world.title.clone().unwrap_or_default(), is_certified: true, ..About::default() };
    let prefix = Prefix::new("w").map_err(anyhow::Error::msg)?;
    let written = export(&world.spec(), &LIMITS, &about, &prefix, "w.h", Float::F32)?;
    fs::write(folder.join("w.c"), written.source)?;
    Ok(fs::write(folder.join("w.h"), written.header)?)
}

fn compile(compiler: &[String], level: &str, object: &Path, folder: &Path) -> Result<()> {
    let mut command = Command::new(&compiler[0]);
    command.args(&compiler[1..]).args(["-std=c99", "-ffreestanding", level, "-c", "w.c", "-o"]);
    let printed = command.arg(object).current_dir(folder).output()?;
    ensure!(printed.status.success(), "{command:?}: {}", String::from_utf8_lossy(&printed.stderr));
    Ok(())
}

/// Bytes of code and constants.
fn size(object: &Path) -> Result<u64> {
    let printed = Command::new("arm-none-eabi-size").arg(object).output().context("arm-none-eabi-size")?;
    let text = String::from_utf8_lossy(&printed.stdout).into_owned();
    let row: Vec<&str> = text.lines().nth(1).context("a size")?.split_whitespace().collect();
    ensure!(row.len() > 2, "not a size: {text}");
    Ok(row[0].parse::<u64>()? + row[1].parse::<u64>()?)
}

fn count(world: &World, object: &Path, folder: &Path, wanted: u64) -> Result<Counted> {
    let program = folder.join("exported");
    let source = PathBuf::from("firmware/bench/exported.c").canonicalize()?;
    let mut command = Command::new("arm-none-eabi-gcc");
    command.args(ARM).args(["-std=gnu99", "-O2", "-ffp-contract=off", "-ffreestanding", "-nostdlib", "-I."]);
    command.args(["-Wl,--section-start=.vectors=0,-Ttext=0x100,-Tdata=0x20000000,-e,reset"]);
    command.args(if world.spec().estimator == Estimator::Exact { &["-DEXACT"][..] } else { &[] });
    let printed = command.arg(source).arg(object).args(["-lgcc", "-o"]).arg(&program).current_dir(folder).output()?;
    ensure!(printed.status.success(), "{command:?}: {}", String::from_utf8_lossy(&printed.stderr));
    let printed = qemu("mps2-an386", &program, &[], &["-icount", "shift=5,sleep=off"])?;
    let numbers: Vec<u64> = printed.split_whitespace().map(str::parse).collect::<Result<_, _>>()?;
    let [nothing, bare, supervised, rounds, stack, controller, phase, high, low] = numbers[..] else {
        anyhow::bail!("not a count: {printed}")
    };
    ensure!(phase == Phase::Running as u64, "the loop is in phase {phase}: a faulted one would be cheap");
    ensure!(high << 32 | low == wanted, "the C has other bits than the core");
    let instructions = |ticks: u64| (ticks as f64 - nothing as f64) / (rounds as f64 / 20_000.0) / SAMPLES as f64;
    Ok(Counted { bare: instructions(bare), supervised: instructions(supervised), stack, controller })
}

/// The samples of the counts in `exported.c`.
const SAMPLES: u64 = 1000;

/// The sum of the bits of `exported.c`'s last run, by the core.
fn sum(world: &World) -> Result<u64> {
    let controller = Controller::<f32, BODIES, COUPLINGS, COUNTS>::new(&world.spec(), &LIMITS)?;
    let (mut state, mut sum) = (controller.start(), 0);
    let runs = [101, SAMPLES, 2 * SAMPLES, 200, SAMPLES];
    for (i, samples) in runs.into_iter().enumerate() {
        let mut trace = Trace::new(1e-3);
        sum = 0xcbf2_9ce4_8422_2325_u64;
        for k in 0..samples {
            let (position, velocity) = trace.next();
            let velocity = if world.spec().estimator == Estimator::Exact { velocity } else { 0.0 };
            let reading = Reading { position, velocity, announced: false, late: 0.0, missed: 0, silent: 0.0 };
            let request = (i == 0 && k == 0).then_some(Request::Arm);
            let output = controller.step(&mut state, &reading, request).output;
            sum = (sum ^ u64::from(output.to_bits())).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
    Ok(sum)
}
