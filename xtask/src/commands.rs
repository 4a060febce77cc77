//! Whole commands on random worlds: the programs that users start, with ordinary and extreme numbers, each within a bound on its work.
//!
//! A command may answer or refuse. It may not panic, not run on beyond its processor time, not end with another code than its
//! contract's, and print neither NaN nor infinity: a result that it cannot compute is stated in words, or is null.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use fastrand::Rng;
use serde_json::Value;

use crate::programs;
use crate::random::one_of;

/// As typed.
pub const NAME: &str = "commands";
/// The folder of worlds, results and findings.
const SCRATCH: &str = "target/fuzz/commands";
/// Processor time of one command, s: of the short ones, and of `worst` and `report`, which run worlds. The build has debug assertions.
const SHORT: u32 = 60;
const LONG: u32 = 600;

/// Runs commands on random worlds for this time, one after the other, the same ones in every run from the same seed.
pub fn campaign(time: Duration, seed: u64) -> Result<()> {
    programs::program("hapt")?;
    fs::create_dir_all(SCRATCH)?;
    let (started, mut number, mut runs, mut found) = (Instant::now(), 0, 0, 0);
    while started.elapsed() < time {
        let mut rng = Rng::with_seed(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(number));
        let world = Path::new(SCRATCH).join(format!("world-{seed}.toml"));
        fs::write(&world, file(&mut rng))?;
        for command in commands(&mut rng, number, &world) {
            runs += 1;
            if let Err(why) = judged(&command) {
                found += 1;
                let kept = Path::new(SCRATCH).join(format!("found-{seed}-{number}.toml"));
                fs::copy(&world, &kept)?;
                println!("{NAME}: world {number} of seed {seed}: hapt {}: {why}: {}", command.line(), kept.display());
            }
            if started.elapsed() >= time {
                break;
            }
        }
        number += 1;
    }
    println!("{NAME:<9} {runs} commands on {number} worlds, {found} findings");
    ensure!(found == 0, "commands: {found} findings, the worlds are in {SCRATCH}");
    Ok(())
}

/// A command line, and its bound on processor time.
struct Line {
    words: Vec<String>,
    seconds: u32,
}

impl Line {
    fn line(&self) -> String {
        self.words.join(" ")
    }
}

/// The commands for a world: the quick ones for every world, the slow ones in turn.
fn commands(rng: &mut Rng, number: u64, world: &Path) -> Vec<Line> {
    let world = world.display().to_string();
    let line = |seconds, words: &[&str]| {
        let words = words.iter().map(|word| (*word).to_string()).collect();
        Line { words, seconds }
    };
    let out = |name: &str| PathBuf::from(SCRATCH).join(name).display().to_string();
    let keys = ["loop.period", "device.inertia", "device.damping", "loop.delay"];
    let (one, other) = (keys[rng.usize(..2)], keys[2 + rng.usize(..2)]);
    let (from, to) = (number_of(rng, 1e-3), number_of(rng, 1e-3));
    let one = format!("{one}={:e}..{:e}", f64::min(from, to), f64::max(from, to));
    let other = format!("{other}=0..{:e}", number_of(rng, 1e-3));
    let (five, four) = (format!("{one}:5"), format!("{other}:4"));
    let mut all = vec![line(SHORT, &["check", "--json", &world]), line(SHORT, &["check", &world])];
    all.push(match number % 6 {
        0 => line(LONG, &["worst", "--json", &world]),
        1 => line(SHORT, &["impedance", "--json", &world]),
        2 => line(SHORT, &["impedance", "--z-width", "--points", "6", "--json", &world]),
        3 => line(
            SHORT,
            &[
                "sweep",
                &world,
                "--vary",
                &five,
                "--vary",
                &four,
                "--measure",
                "certified,required_damping",
                "--out",
                &out("t.csv"),
            ],
        ),
        4 => line(SHORT, &["boundary", &world, "--vary", &one, "--vary", &other]),
        _ => line(LONG, &["report", &world, "--out", &out("pages")]),
    });
    all
}

/// A number of this order, most times; else one far off.
fn number_of(rng: &mut Rng, ordinary: f64) -> f64 {
    let decades = match rng.u8(..40) {
        0 => 40.0,
        1..4 => 12.0,
        4..10 => 4.0,
        _ => 1.0,
    };
    ordinary * 10f64.powf(decades * (2.0 * rng.f64() - 1.0))
}

/// Zero or more: often 0, and now and then smaller than anything physical.
fn maybe(rng: &mut Rng, ordinary: f64) -> f64 {
    match rng.u8(..60) {
        0 => 1e-320,
        1 => 1e300,
        2..12 => 0.0,
        _ => number_of(rng, ordinary),
    }
}

/// A world file that is valid but for its numbers now and then.
fn file(rng: &mut Rng) -> String {
    let period = number_of(rng, 1e-3);
    let method = one_of(
        rng,
        &[
            "forward-euler",
            "semi-implicit-euler",
            "backward-euler",
            "trapezoidal",
            "zoh",
            "zoh",
            "rk4",
            "tustin",
            "foh",
        ],
    );
    let output = match method {
        "tustin" | "foh" => "start",
        _ => one_of(rng, &["start", "middle", "end", "end"]),
    };
    let estimator = one_of(rng, &["exact", "difference", "low-pass", "foaw", "foaw-best", "kalman", "levant"]);
    let mut text = format!(
        "[loop]\nperiod = {period:e}\nmethod = \"{method}\"\noutput = \"{output}\"\nestimator = \"{estimator}\"\n"
    );
    if matches!(estimator, "low-pass" | "kalman") {
        text += &format!("cutoff = {:e}\n", number_of(rng, 0.1 / period));
    }
    if estimator == "levant" {
        text += &format!("acceleration = {:e}\n", number_of(rng, 1e3));
    }
    if rng.u8(..4) == 0 {
        text += &format!("filter = {:e}\n", number_of(rng, 0.1 / period));
    }
    if estimator == "difference" && rng.bool() {
        text += &format!("every = {}\n", rng.u32(1..12));
    }
    if estimator.starts_with("foaw") {
        text += &format!("window = {}\n", rng.u32(1..12));
    }
    if output == "end" && rng.u8(..4) == 0 {
        text += &format!("advance = {}\n", rng.u32(1..4));
    }
    match rng.u8(..4) {
        0 => text += &format!("delay = {:e}\n", f64::from(rng.u32(1..5)) * period),
        1 => text += &format!("delay = {:e}\n", maybe(rng, 2.0 * period)),
        _ => {}
    }
    let inertia = number_of(rng, 1e-3);
    text += &format!(
        "[device]\ninertia = {inertia:e}\ndamping = {:e}\nfriction = {:e}\n",
        maybe(rng, 1e-3),
        maybe(rng, 1e-3)
    );
    if rng.u8(..4) == 0 {
        text += &format!("friction_backward = {:e}\n", maybe(rng, 1e-3));
    }
    let limited = rng.bool();
    if limited {
        text += &format!("limit = {:e}\n", number_of(rng, 1.0));
    }
    if rng.bool() {
        text += &format!("encoder = {:e}\n", number_of(rng, 4000.0).round().max(1.0));
    }
    if limited && rng.bool() {
        text += "levels = 2048\n";
    }
    let bodies = [0, 1, 1, 1, 2, 3, 7][rng.usize(..7)];
    if rng.u8(..4) == 0 {
        text += &format!(
            "[device.friction_by_position]\nshare = {:e}\npitch = {:e}\nsine = [1, {:e}]\n",
            maybe(rng, 0.3),
            number_of(rng, 1.0),
            number_of(rng, 1.0)
        );
    }
    if rng.u8(..4) == 0 {
        text += &format!("[device.stribeck]\ntorque = {:e}\nvelocity = {:e}\n", maybe(rng, 1e-3), number_of(rng, 1.0));
    }
    if rng.u8(..4) == 0 {
        text += &format!("[device.stops]\nhigh = {:e}\nstiffness = {:e}\n", maybe(rng, 0.1), number_of(rng, 10.0));
    }
    for body in 0..bodies {
        let place = if rng.u8(..8) == 0 { number_of(rng, 1.0) } else { 0.0 };
        let inertia = if rng.u8(..30) == 0 { 1e-320 } else { number_of(rng, 1e-2) };
        text += &format!("[bodies.b{body}]\ninertia = {inertia:e}\nposition = {place:e}\n");
    }
    for _ in 0..rng.usize(..2 * bodies + 3) {
        text += &coupling(rng, bodies);
    }
    let hand = match rng.u8(..5) {
        0 => format!("{{ kind = \"step\", to = {:e} }}", number_of(rng, 0.5)),
        1 => format!(
            "{{ kind = \"sine\", amplitude = {:e}, frequency = {:e} }}",
            number_of(rng, 0.5),
            number_of(rng, 1.0)
        ),
        2 => format!(
            "{{ kind = \"torque\", moves = {{ kind = \"ramp\", to = {:e}, over = {:e} }} }}",
            number_of(rng, 0.1),
            number_of(rng, 0.1)
        ),
        _ => format!(
            "{{ kind = \"grip\", inertia = {:e}, damping = {:e}, stiffness = {:e}, moves = {{ kind = \"step\", to = {:e} }} }}",
            maybe(rng, 1e-3),
            maybe(rng, 1e-2),
            maybe(rng, 1.0),
            number_of(rng, 0.5)
        ),
    };
    text + &format!("[scenarios.one]\nduration = {:e}\nhand = {hand}\n", 500.0 * period)
}

fn coupling(rng: &mut Rng, bodies: usize) -> String {
    let end = |rng: &mut Rng| match rng.usize(..bodies + 3) {
        0 | 1 => "puck".to_string(),
        2 => "ground".to_string(),
        body => format!("b{}", body - 3),
    };
    let first = end(rng);
    let second = loop {
        let second = end(rng);
        if second != first {
            break second;
        }
    };
    let law = match rng.u8(..9) {
        0..4 => format!("kind = \"spring\"\nstiffness = {:e}\nrest = {:e}", maybe(rng, 1.0), maybe(rng, 0.1)),
        4 => format!("kind = \"damper\"\ndamping = {:e}", maybe(rng, 1e-3)),
        5 => format!(
            "kind = \"wall\"\nside = \"above\"\nat = {:e}\nstiffness = {:e}\ndamping = {:e}",
            maybe(rng, 0.2),
            maybe(rng, 1.0),
            maybe(rng, 1e-4)
        ),
        6 => format!("kind = \"detent\"\npitch = {:e}\ntorque = {:e}", number_of(rng, 0.2), maybe(rng, 0.02)),
        7 => format!("kind = \"constant\"\ntorque = {:e}", maybe(rng, 0.01)),
        _ if rng.bool() => format!("kind = \"friction\"\ntorque = {:e}", maybe(rng, 0.01)),
        _ => format!(
            "kind = \"friction\"\ncoulomb = {:e}\nstribeck = {:e}\nstribeck_velocity = {:e}\nbristle_stiffness = {:e}\n\
             bristle_damping = {:e}\nviscous = {:e}",
            number_of(rng, 0.01),
            number_of(rng, 0.02),
            number_of(rng, 0.1),
            number_of(rng, 10.0),
            maybe(rng, 0.01),
            maybe(rng, 0.001)
        ),
    };
    format!("[[couplings]]\nbetween = [\"{first}\", \"{second}\"]\n{law}\n")
}

/// Runs a command within its processor time; `Err`: the violation.
fn judged(line: &Line) -> Result<()> {
    let output = bounded(line)?;
    let texts = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    let message = texts[1].lines().next().unwrap_or_default().to_string();
    let code = output.status.code().with_context(|| format!("{}: {message}", output.status))?;
    // A run that diverges keeps its file, with a message.
    let ran_away = code == 3 && texts[1].contains("stops being finite");
    ensure!((0..=2).contains(&code) || ran_away, "it ends with {code}: {message}");
    ensure!(code != 2 || !message.is_empty(), "it refuses without a message");
    let wrong = |text: &str| {
        text.split(|c: char| !c.is_ascii_alphanumeric()).any(|word| matches!(word, "NaN" | "inf" | "panicked"))
    };
    if let Some(text) = texts.iter().find(|text| wrong(text)) {
        let line = text.lines().find(|line| wrong(line)).unwrap_or_default();
        anyhow::bail!("it prints {line:?}");
    }
    if line.words.starts_with(&["check".into(), "--json".into()]) && code < 2 {
        consistent(&serde_json::from_str(&texts[0])?, code)?;
    }
    Ok(())
}

/// The consistency of the numbers of a check.
fn consistent(check: &Value, code: i32) -> Result<()> {
    let certified = check["certified"] == true;
    ensure!(certified == (code == 0), "certified is {certified} and the exit code {code}");
    let remedies = &check["remedies"];
    let number = |value: &Value| value.as_f64();
    let dampings = [&check["passivity"]["required_damping"], &remedies["device_damping"], &remedies["ground_damping"]];
    for value in dampings.into_iter().filter_map(number) {
        ensure!(value >= 0.0, "a damping of {value}");
    }
    for half in ["held", "free"] {
        let critical = &check[half]["critical_period_s"];
        ensure!(critical.is_null() != check[half]["critical_period_reason"].is_null(), "{half}: {}", check[half]);
        let unstable = check[half]["verdict"] == "unstable";
        ensure!(!(certified && unstable), "certified, and {half} is unstable");
        ensure!(number(critical).is_none_or(|period| period > 0.0), "{half}: {critical}");
    }
    if certified && let (Some(margin), Some(period)) = (number(&remedies["period_s"]), number(&check["period_s"])) {
        ensure!(margin >= period * (1.0 - 1e-9), "a margin of {margin} s below the period");
    }
    if certified && let Some(scale) = number(&remedies["stiffness_scale"]) {
        ensure!(scale >= 1.0 - 1e-9, "a margin of {scale} on the stiffness");
    }
    Ok(())
}

/// By the shell's limit on processor time: a busy machine takes longer, which is no failure.
fn bounded(line: &Line) -> Result<Output> {
    let shell = format!("ulimit -t {}; exec \"$0\" \"$@\"", line.seconds);
    let mut command = Command::new("sh");
    command.args(["-c", &shell]).arg(programs::binary(programs::PROFILE).get_program()).args(&line.words);
    command.env("NO_COLOR", "1").stdin(Stdio::null());
    command.output().context("sh")
}
