//! The page: its core in WebAssembly, held to the bits of every other machine, and its files, built from web/ and tried in a browser.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail, ensure};
use fastrand::Rng;
use hapt_core::{Method, Phase, Request, SafetyProfile};
use hapt_model::{Drive, Hand, Shape};
use hapt_sim::{DesktopLoop, Grip};
use hapt_web::{OWN, Page, Setup, Slot};

use crate::truth::worlds;

const CORE: &str = "web/core";
const BUILT: &str = "web/core/hapt.wasm";
/// What it was built of, and with which compiler.
const STAMP: &str = "web/core/hapt.wasm.txt";
/// Whatever goes into it.
const SOURCES: [&str; 4] = ["crates/hapt-core", "crates/hapt-plant", "crates/hapt-wire", CORE];
const TARGET: &str = "wasm32-unknown-unknown";
/// Samples of each method.
const EACH: u32 = 100_000;
/// What is loaded with a page, and what a page without a server loads beside it, stays small.
const LARGEST: usize = 200_000;

/// Builds the core for the browser: with rustup's target where it is installed, else with the distribution's compiler and sources.
pub fn build() -> Result<()> {
    let folder = "target/page";
    let mut command = if has_target() {
        Command::new(env!("CARGO"))
    } else {
        // Debian: apt-get install rustc-web cargo-web rust-web-src lld. There is no standard library for the target, so it is built.
        let mut command = Command::new("/usr/bin/cargo");
        command.env("RUSTC", "/usr/bin/rustc").env("RUSTC_BOOTSTRAP", "1").env_remove("RUSTUP_TOOLCHAIN");
        command.env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER", "wasm-ld");
        command
    };
    command.args([
        "build",
        "--quiet",
        "--profile",
        "web",
        "--locked",
        "--package",
        "hapt-web",
        "--lib",
        "--target",
        TARGET,
    ]);
    if !has_target() {
        command.arg("-Zbuild-std=core,alloc");
    }
    command.args(["--target-dir", folder]);
    // Where this machine keeps its sources is nobody's business, and would make other bytes on every machine.
    let home = std::env::var("CARGO_HOME").or_else(|_| std::env::var("HOME").map(|home| format!("{home}/.cargo")))?;
    let here = std::env::current_dir()?;
    // A world is compiled on the stack, in the room of 32 bodies.
    let stack = "-Clink-arg=-zstack-size=4194304";
    let remap = format!("--remap-path-prefix={home}=cargo --remap-path-prefix={}=hapt", here.display());
    command.env("RUSTFLAGS", format!("{stack} {remap}"));
    let status = command.status().context("no compiler for the browser: rustup target add wasm32-unknown-unknown")?;
    ensure!(status.success(), "the page's core does not build: rustup target add {TARGET}");
    let bytes = fs::read(format!("{folder}/{TARGET}/web/hapt_web.wasm"))?;
    ensure!(bytes.len() <= LARGEST, "the page's core has {} bytes, more than {LARGEST}", bytes.len());
    println!("{BUILT}: {} bytes", bytes.len());
    fs::write(BUILT, &bytes)?;
    let rustc = if has_target() { "rustc" } else { "/usr/bin/rustc" };
    let said = Command::new(rustc).arg("--version").output()?;
    fs::write(STAMP, format!("{}{}", stamp()?, String::from_utf8_lossy(&said.stdout)))?;
    same_bits()
}

/// Sums of the built core and of all that it is built of. Its bytes alone would not do: they depend on the folder that it is built in.
fn stamp() -> Result<String> {
    let mut files = Vec::new();
    for folder in SOURCES {
        list(Path::new(folder), &mut files)?;
    }
    files.sort();
    let mut sources = Vec::new();
    for file in files {
        sources.extend(file.to_string_lossy().bytes());
        sources.extend(fs::read(file)?);
    }
    // FNV-1a
    let sum = |bytes: &[u8]| {
        bytes
            .iter()
            .fold(0xcbf2_9ce4_8422_2325_u64, |sum, byte| (sum ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
    };
    Ok(format!("core {:016x}\nsources {:016x}\n", sum(&fs::read(BUILT)?), sum(&sources)))
}

/// The manifests, and what is under `src`.
fn list(folder: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let is_source = path.components().any(|part| part.as_os_str() == "src");
        if path.is_dir() && (is_source || path.ends_with("src")) {
            list(&path, files)?;
        } else if path.is_file() && (is_source || path.ends_with("Cargo.toml")) {
            files.push(path);
        }
    }
    Ok(())
}

/// Whether this compiler has the target's standard library.
/// Whether rustup's compiler builds for the browser.
pub fn has_target() -> bool {
    crate::deps::has_target(TARGET)
}

/// The built page gives the bits of this machine's, for every method over 10^5 samples of a random world: loop, supervisor, device, the
/// hands on it, and numbers that are changed while it runs.
pub fn same_bits() -> Result<()> {
    if !Command::new("node").arg("--version").stdout(Stdio::null()).status().is_ok_and(|status| status.success()) {
        ensure!(std::env::var_os("CI").is_none(), "node is missing");
        println!("        (skipped: the page's core needs node)");
        return Ok(());
    }
    let file = Path::new("target/page-case");
    let mut rng = Rng::with_seed(6);
    for method in Method::ALL {
        // A world that runs away has no bits to compare.
        let case = loop {
            if let Some(case) = case(method, &mut rng)? {
                break case;
            }
        };
        fs::write(file, case)?;
        let said = Command::new("node").args([&format!("{CORE}/check.mjs"), BUILT]).arg(file).output()?;
        ensure!(said.status.success(), "{}: {}", method.name(), String::from_utf8_lossy(&said.stderr));
    }
    println!("        {} worlds, {EACH} samples each: the same bits", Method::ALL.len());
    fs::remove_file(file)?;
    Ok(())
}

/// web/dist and the core are what the sources build to.
pub fn is_current() -> Result<()> {
    if has_npm()? {
        npm(&["run", "--silent", "check"])?;
    }
    let kept = fs::read_to_string(STAMP)?;
    ensure!(kept.starts_with(&stamp()?), "{BUILT} is not built of its present sources: cargo xtask page");
    Ok(())
}

/// The page does what it should, in a real browser on the released program.
pub fn works() -> Result<()> {
    if !has_npm()? {
        return Ok(());
    }
    let usual = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];
    if std::env::var_os("CHROMIUM").is_none() && !usual.iter().any(|path| Path::new(path).exists()) {
        ensure!(std::env::var_os("CI").is_none(), "no Chromium: apt-get install chromium");
        println!("        (skipped: the page needs Chromium, apt-get install chromium)");
        return Ok(());
    }
    npm(&["test", "--silent"])
}

/// Whether there is npm, and what the page is built with; with `CI` set they have to be.
fn has_npm() -> Result<bool> {
    let there = || Command::new("npm").arg("--version").stdout(Stdio::null()).status().is_ok_and(|said| said.success());
    let ci = std::env::var_os("CI").is_some();
    if there() && Path::new("web/node_modules").exists() {
        return Ok(true);
    }
    ensure!(!ci, "npm is missing");
    println!("        (skipped: npm ci in web/ first, which needs nodejs and npm)");
    Ok(false)
}

fn npm(arguments: &[&str]) -> Result<()> {
    let mut command = Command::new("npm");
    command.args(arguments).current_dir("web").env("HAPT", fs::canonicalize(program())?);
    let said = command.output()?;
    let text = [said.stdout, said.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).join("\n");
    let failed: Vec<&str> = text.lines().filter(|line| !line.starts_with("✔")).take(60).collect();
    ensure!(said.status.success(), "npm {}:\n{}", arguments.join(" "), failed.join("\n"));
    Ok(())
}

fn program() -> PathBuf {
    PathBuf::from(crate::test::binary("release").get_program())
}

/// What is done to a page between two samples, beside its hand.
struct Deed {
    sample: u32,
    /// A [`Slot`], or [`BEGIN`].
    slot: u32,
    index: u32,
    value: f64,
}

/// A scenario begins.
const BEGIN: u32 = u32::MAX;
/// Where the hand means to be: nowhere, it lets go.
const LETS_GO: f64 = f64::NEG_INFINITY;
/// Nowhere: a scenario's hand has the puck.
const LEAVES: f64 = f64::INFINITY;

/// A random world of this method in hands, all that is done to it, and every number that it gives; `None` where it does not stay finite.
/// Its form is check.mjs's.
fn case(method: Method, rng: &mut Rng) -> Result<Option<Vec<u8>>> {
    let bent = rng.bool();
    let world = worlds::random(rng, bent);
    // Not every random world can be compiled.
    if world.sampling.method != method || world.bodies.is_empty() || DesktopLoop::new(&world.spec()).is_err() {
        return Ok(None);
    }
    let period = world.sampling.period;
    let sine = Drive::Position(Shape::Sine { amplitude: 0.3, frequency: 0.01 / period, phase: 0.0 });
    let setup = Setup {
        device: world.device_spec(),
        limits: world.limits(SafetyProfile::Simulated),
        output: world.sampling.output,
        scenarios: vec![(Hand { drive: sine, release: None }, 3000.0 * period)],
    };
    let mut room = [0; 8192];
    let bytes = hapt_wire::write(&world.spec(), &mut room)?;
    let setup = postcard::to_allocvec(&setup)?;
    let Some(mut page) = Page::new(bytes, &setup) else { bail!("a page refuses its own world") };
    let deed = |sample, slot, index, value| Deed { sample, slot, index, value };
    let other =
        Method::ALL.iter().position(|other| *other == method).map_or(0, |place| (place + 1) % Method::ALL.len());
    let deeds = [
        deed(20_000, Slot::Period as u32, 0, 1.05 * period),
        deed(30_000, Slot::Inertia as u32, 0, 1.5 * world.bodies[0].inertia),
        deed(40_000, Slot::PuckDamping as u32, 0, 1.5 * world.device.damping),
        deed(50_000, BEGIN, 0, 0.0),
        deed(95_000, Slot::Method as u32, 0, other as f64),
    ];

    let mut case = Vec::new();
    let count = |case: &mut Vec<u8>, number: usize| case.extend((number as u32).to_le_bytes());
    for part in [bytes, setup.as_slice()] {
        count(&mut case, part.len());
        case.extend(part);
    }
    let inertia = 2.0 * world.device.inertia;
    let swing = (0.1 / period).min(60.0);
    let grip = Grip { inertia, damping: 3.0 * inertia * swing, stiffness: 1.5 * inertia * swing * swing };
    case.extend([grip.inertia, grip.damping, grip.stiffness].iter().flat_map(|x| x.to_le_bytes()));
    let columns = OWN + 2 * world.bodies.len();
    for number in [deeds.len(), EACH as usize, columns] {
        count(&mut case, number);
    }
    let at = case.len();
    for Deed { sample, slot, index, value } in &deeds {
        [*sample, *slot, *index].iter().for_each(|number| case.extend(number.to_le_bytes()));
        case.extend(value.to_le_bytes());
        // Whether it was done, once that is known.
        count(&mut case, 0);
    }
    page.ask(Request::Arm);
    let (mut target, mut holds) = (0.0, false);
    for sample in 0..EACH {
        for (place, deed) in deeds.iter().enumerate().filter(|(_, deed)| deed.sample == sample) {
            let index = deed.index as usize;
            let done = match Slot::ALL.get(deed.slot as usize) {
                Some(slot) => page.set(*slot, index, deed.value),
                None => page.begin(index),
            };
            case[at + 24 * place + 20] = done.into();
        }
        target += 0.02 * (rng.f64() - 0.5) - 1e-4 * target;
        let intended = match sample {
            50_000..54_000 => LEAVES,
            _ if sample / 2_000 % 4 == 3 => LETS_GO,
            _ => target,
        };
        if intended.is_finite() {
            if !holds {
                page.hold(Some(grip));
            }
            page.intend(intended);
        } else if intended == LETS_GO && holds {
            page.hold(None);
        }
        holds = intended.is_finite();
        page.run(1);
        let [row, ..] = page.frame();
        let row = &row[..columns];
        // What is no number has no bits that machines agree on.
        if !row.iter().all(|x| x.is_finite()) {
            return Ok(None);
        }
        case.extend(std::iter::once(&intended).chain(row).flat_map(|x| x.to_le_bytes()));
    }
    Ok((page.phase().0 == Phase::Running).then_some(case))
}
