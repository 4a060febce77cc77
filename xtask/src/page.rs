//! The page: its core in WebAssembly, held to the bits of every other machine, and its files, built from web/ and tried in a browser.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, ensure};
use fastrand::Rng;
use hapt_core::Method;
use hapt_sim::DesktopLoop;

use crate::truth::worlds;

const CORE: &str = "web/core";
const BUILT: &str = "web/core/hapt.wasm";
const TARGET: &str = "wasm32-unknown-unknown";
const EACH: u32 = 100_000;

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
    command.args(["build", "--quiet", "--release", "--locked", "--target", TARGET]);
    if !has_target() {
        command.arg("-Zbuild-std=core");
    }
    command.args(["--manifest-path", &format!("{CORE}/Cargo.toml"), "--target-dir", folder]);
    // Where this machine keeps its sources is nobody's business, and would make other bytes on every machine.
    let home = std::env::var("CARGO_HOME").or_else(|_| std::env::var("HOME").map(|home| format!("{home}/.cargo")))?;
    let here = std::env::current_dir()?;
    command.env("RUSTFLAGS", format!("--remap-path-prefix={home}=cargo --remap-path-prefix={}=hapt", here.display()));
    let status = command.status().context("no compiler for the browser: rustup target add wasm32-unknown-unknown")?;
    ensure!(status.success(), "the page's core does not build: rustup target add {TARGET}");
    fs::copy(format!("{folder}/{TARGET}/release/hapt_page.wasm"), BUILT)?;
    println!("{BUILT}: {} bytes", fs::metadata(BUILT)?.len());
    same_bits()
}

/// Whether this compiler has the target's standard library.
fn has_target() -> bool {
    let said = Command::new("rustc").args(["--print", "target-libdir", "--target", TARGET]).output();
    said.is_ok_and(|said| Path::new(String::from_utf8_lossy(&said.stdout).trim()).exists())
}

/// The built core gives the bits of this machine's, for every method over 10^5 samples of a random world.
pub fn same_bits() -> Result<()> {
    if !Command::new("node").arg("--version").stdout(Stdio::null()).status().is_ok_and(|status| status.success()) {
        ensure!(std::env::var_os("CI").is_none(), "node is missing");
        println!("        (skipped: the page's core wants node)");
        return Ok(());
    }
    let cases = Path::new("target/page-cases");
    let mut file = std::io::BufWriter::new(fs::File::create(cases)?);
    let mut rng = Rng::with_seed(6);
    for method in Method::ALL {
        // A world that runs away has no bits to compare.
        let case = loop {
            if let Some(case) = case(method, &mut rng)? {
                break case;
            }
        };
        file.write_all(&case)?;
    }
    file.flush()?;
    let said = Command::new("node").args([&format!("{CORE}/check.mjs"), BUILT]).arg(cases).output()?;
    ensure!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
    print!("        {}", String::from_utf8_lossy(&said.stdout));
    fs::remove_file(cases)?;
    Ok(())
}

/// web/dist is what the sources build to.
pub fn is_current() -> Result<()> {
    if has_npm()? {
        npm(&["run", "--silent", "check"])?;
    }
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
        println!("        (skipped: the page wants Chromium, apt-get install chromium)");
        return Ok(());
    }
    npm(&["test", "--silent"])
}

/// Whether there is npm, and what the page is built with; with `CI` set what is missing is installed.
fn has_npm() -> Result<bool> {
    let there = || Command::new("npm").arg("--version").stdout(Stdio::null()).status().is_ok_and(|said| said.success());
    let ci = std::env::var_os("CI").is_some();
    if ci && !there() {
        Command::new("apt-get").args(["install", "-y", "nodejs", "npm", "chromium"]).output()?;
    }
    let built = Path::new("web/node_modules").exists();
    if there() && (built || ci) {
        if !built {
            npm(&["ci", "--silent", "--no-audit", "--no-fund"])?;
        }
        return Ok(true);
    }
    ensure!(!ci, "npm is missing");
    println!("        (skipped: npm ci in web/ first, which wants nodejs and npm)");
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

/// A random world of this method, with a puck that swings through all of it; `None` where it does not stay finite.
fn case(method: Method, rng: &mut Rng) -> Result<Option<Vec<u8>>> {
    let bent = rng.bool();
    let world = worlds::random(rng, bent);
    if world.sampling.method != method || world.bodies.is_empty() {
        return Ok(None);
    }
    // Not every random world can be compiled.
    let Ok(compiled) = DesktopLoop::new(&world.spec()) else { return Ok(None) };
    let mut room = [0; 8192];
    let bytes = hapt_wire::write(&world.spec(), &mut room)?;
    let mut case = Vec::new();
    case.extend((bytes.len() as u32).to_le_bytes());
    case.extend(bytes);
    case.extend(EACH.to_le_bytes());
    let mut state = compiled.start();
    let period = world.sampling.period;
    let omega = 0.3 / period * rng.f64();
    let (mut position, mut velocity) = (0.0, 0.0);
    for _ in 0..EACH {
        // A swing that is pushed about, so that counts, walls and limits are met.
        velocity += period * (-omega * omega * position + omega * (rng.f64() - 0.5) * 30.0);
        velocity *= 0.999;
        position += period * velocity;
        let sample = compiled.step(&mut state, position, velocity);
        let row = [position, velocity, sample.puck.position, sample.puck.velocity, sample.torque, sample.command];
        if !row.iter().all(|x| x.is_finite()) {
            return Ok(None);
        }
        case.extend(row.iter().flat_map(|x| x.to_le_bytes()));
    }
    case.extend((compiled.bodies() as u32).to_le_bytes());
    for (w, v) in state.now.position.iter().zip(&state.now.velocity).take(compiled.bodies()) {
        case.extend([*w, *v].iter().flat_map(|x| x.to_le_bytes()));
    }
    Ok(Some(case))
}
