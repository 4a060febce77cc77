//! The page: its core in WebAssembly, held to the bits of every other machine, and its files, built from web/ and tried in a browser.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use fastrand::Rng;
use hapt_core::Method;
use hapt_host::messages::WorldFile;
use hapt_model::{Drive, Hand, Scenario, Shape};
use hapt_sim::DesktopLoop;
use hapt_web::Page;
use serde_json::json;

use crate::deps::{self, PAGE_TARGET};
use crate::tools;
use crate::truth::worlds;

const CORE: &str = "web/core";
const BUILT: &str = "web/core/hapt.wasm";
/// Its sources and its compiler.
const STAMP: &str = "web/core/hapt.wasm.txt";
/// Its sources.
const SOURCES: [&str; 9] = [
    "crates/hapt-analysis",
    "crates/hapt-core",
    "crates/hapt-plant",
    "crates/hapt-model",
    "crates/hapt-sim",
    "crates/hapt-rt",
    "crates/hapt-host",
    "crates/hapt-wire",
    CORE,
];
/// Samples of each method.
const EACH: u32 = 100_000;
/// The most that a page without a server loads in addition to its files, in bytes: much of it reads world files. 65 000 of them are networks:
/// their file, their links, and the verdict on them.
const MAX_BYTES: usize = 1_150_000;

/// Builds the core for the browser: with rustup's target where it is installed, else with the distribution's compiler and sources.
pub fn build() -> Result<()> {
    let folder = "target/page";
    let mut command = if deps::has_target(PAGE_TARGET) {
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
        PAGE_TARGET,
    ]);
    if !deps::has_target(PAGE_TARGET) {
        command.arg("-Zbuild-std=std,panic_abort");
    }
    command.args(["--target-dir", folder]);
    // Paths of this machine's sources would make other bytes on every machine.
    let home = std::env::var("CARGO_HOME").or_else(|_| std::env::var("HOME").map(|home| format!("{home}/.cargo")))?;
    let here = std::env::current_dir()?;
    // A world is compiled on the stack, with capacity for 32 bodies.
    let stack = "-Clink-arg=-zstack-size=4194304";
    let remap = format!("--remap-path-prefix={home}=cargo --remap-path-prefix={}=hapt", here.display());
    command.env("RUSTFLAGS", format!("{stack} {remap}"));
    let status = command.status().context("no compiler for the browser: rustup target add wasm32-unknown-unknown")?;
    ensure!(status.success(), "the page's core does not build: rustup target add {PAGE_TARGET}");
    let bytes = fs::read(format!("{folder}/{PAGE_TARGET}/web/hapt_web.wasm"))?;
    ensure!(bytes.len() <= MAX_BYTES, "the page's core has {} bytes, more than {MAX_BYTES}", bytes.len());
    println!("{BUILT}: {} bytes", bytes.len());
    fs::write(BUILT, &bytes)?;
    let rustc = if deps::has_target(PAGE_TARGET) { "rustc" } else { "/usr/bin/rustc" };
    let output = Command::new(rustc).arg("--version").output()?;
    fs::write(STAMP, format!("{}{}", stamp()?, String::from_utf8_lossy(&output.stdout)))?;
    same_bits()
}

/// Sums of the built core and of all that it is built of. Its bytes are not enough: they depend on the folder that it is built in.
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
        // A diverging world has no bits to compare.
        let case = loop {
            if let Some(case) = case(method, &mut rng)? {
                break case;
            }
        };
        fs::write(file, case)?;
        let output = Command::new("node").args([&format!("{CORE}/check.mjs"), BUILT]).arg(file).output()?;
        ensure!(output.status.success(), "{}: {}", method.name(), String::from_utf8_lossy(&output.stderr));
    }
    println!("        {} worlds, {EACH} samples each: the same bits", Method::ALL.len());
    fs::remove_file(file)?;
    Ok(())
}

/// web/dist and the core are those of the present sources.
pub fn is_current() -> Result<()> {
    if has_npm()? {
        npm(&["run", "--silent", "check"])?;
    }
    let kept = fs::read_to_string(STAMP)?;
    ensure!(kept.starts_with(&stamp()?), "{BUILT} is not built of its present sources: cargo xtask page");
    Ok(())
}

/// The page does what it should, in a real browser.
pub fn works() -> Result<()> {
    if !has_npm()? {
        return Ok(());
    }
    let places = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];
    if std::env::var_os("CHROMIUM").is_none() && !places.iter().any(|path| Path::new(path).exists()) {
        ensure!(std::env::var_os("CI").is_none(), "no Chromium: apt-get install chromium");
        println!("        (skipped: the page needs Chromium, apt-get install chromium)");
        return Ok(());
    }
    npm(&["test", "--silent"])
}

/// Whether npm and the page's build tools are installed; with `CI` set they have to be.
fn has_npm() -> Result<bool> {
    let there =
        || Command::new("npm").arg("--version").stdout(Stdio::null()).status().is_ok_and(|output| output.success());
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
    command.env("WHEEL_PAGE", std::path::absolute(crate::programs::example("wheel_page")?)?);
    if let Some(environment) = tools::environment("hapt") {
        command.env("HAPT_PYTHON", tools::python(&environment)?.get_program());
    }
    let output = command.output()?;
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).join("\n");
    // For either reporter of node: only what follows the first failure is shown.
    let lines = || text.lines().filter(|line| !line.starts_with("✔"));
    let first = lines().position(|line| line.starts_with("not ok")).unwrap_or(0);
    let failed: Vec<&str> = lines().skip(first).take(60).collect();
    ensure!(output.status.success(), "npm {}:\n{}", arguments.join(" "), failed.join("\n"));
    Ok(())
}

fn program() -> PathBuf {
    PathBuf::from(crate::programs::binary(crate::programs::PROFILE).get_program())
}

/// A random world of this method in hands, all its inputs, and every number of its output; `None` where it does not stay finite.
/// Its form is check.mjs's.
fn case(method: Method, rng: &mut Rng) -> Result<Option<Vec<u8>>> {
    let is_nonlinear = rng.bool();
    let mut world = worlds::random(rng, is_nonlinear);
    // Not every random world can be compiled.
    if world.sampling.method != method || world.bodies.is_empty() || DesktopLoop::new(&world.spec()).is_err() {
        return Ok(None);
    }
    let period = world.sampling.period;
    let sine = Drive::Position(Shape::Sine { amplitude: 0.3, frequency: 0.01 / period, phase: 0.0 });
    let hand = Hand { drive: sine, release: None };
    world.scenarios =
        vec![Scenario { name: "sine".into(), hand, duration: 3000.0 * period, timing: Default::default() }];
    let file =
        WorldFile { name: "random.toml".into(), text: world.to_toml(), files: Default::default(), sets: Vec::new() };
    let file = json!(file).to_string();
    // Nor can every one run behind a page.
    let Ok(mut page) = Page::new(&file) else { return Ok(None) };
    let other = Method::ALL.iter().cycle().skip_while(|other| **other != method).nth(1).copied().unwrap_or(method);
    let set = |key: &str, value: String| json!({ "type": "set", "key": key, "value": value }).to_string();
    let body = format!("bodies.{}.inertia", world.names[0]);
    let deeds = [
        (20_000, set("loop.period", format!("{} s", 1.05 * period))),
        (30_000, set(&body, (1.5 * world.bodies[0].inertia).to_string())),
        (40_000, set("device.damping", (1.5 * world.device.damping).to_string())),
        (50_000, json!({ "type": "scenario", "name": "sine" }).to_string()),
        (95_000, set("loop.method", other.name().to_string())),
    ];

    let mut case = Vec::new();
    let text = |case: &mut Vec<u8>, text: &str| {
        case.extend((text.len() as u32).to_le_bytes());
        case.extend(text.as_bytes());
    };
    text(&mut case, &file);
    case.extend(EACH.to_le_bytes());
    let (mut target, mut runs) = (0.0, false);
    for sample in 0..EACH {
        target += 0.02 * (rng.f64() - 0.5) - 1e-4 * target;
        let message = match deeds.iter().find(|(at, _)| *at == sample) {
            Some((_, message)) => message.clone(),
            // The scenario's hand has the puck.
            None if (50_000..54_000).contains(&sample) => String::new(),
            None if sample / 2_000 % 4 == 3 => json!({ "type": "hand", "grip": false }).to_string(),
            None => json!({ "type": "hand", "grip": true, "position": target }).to_string(),
        };
        if !message.is_empty() {
            page.send(&message);
        }
        // Somewhat more than a period, so that some frames have two samples.
        let now = 1e3 * 1.001 * period * f64::from(sample);
        page.poll(Duration::try_from_secs_f64(now / 1e3)?);
        let columns = page.columns().as_flattened();
        // NaNs have different bits on different machines.
        if !columns.iter().all(|x| x.is_finite()) {
            return Ok(None);
        }
        text(&mut case, &message);
        case.extend(now.to_le_bytes());
        case.extend((columns.len() as u32).to_le_bytes());
        case.extend(columns.iter().flat_map(|x| x.to_le_bytes()));
        while let Some(message) = page.next_message() {
            if let hapt_web::Message::Text(text) = message {
                ensure!(!text.contains("\"type\":\"error\""), "{text}");
                if text.contains("\"type\":\"status\"") {
                    runs = text.contains("\"phase\":\"running\"");
                }
            }
        }
    }
    Ok(runs.then_some(case))
}
