//! `cargo xtask proof`: the proofs of random certified worlds before an independent checker.
//!
//! Each world is drawn, given about the damping that its theorem requires, and its proof written. `proof/checker.py` has to accept all of them,
//! and to refuse each of them with one digit changed in any of its numbers, and each of them with a changed world.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use fastrand::Rng;
use hapt_core::Waveform;
use hapt_model::{
    Body, Cogging, Compensated, Compensation, Coupling, Damping, Delay, Device, End, EstimatorKind, FrictionByPosition,
    Gravity, Handle, Law, Method, Motion, Output, Sampling, World,
};
use rayon::prelude::*;
use serde_json::Value;

use crate::campaign::Campaign;
use crate::programs;
use crate::random::{as_steep_as, log_uniform, one_of, potentials};

const CHECKER: &str = "proof/checker.py";
const COQ: &str = "proof/passive.v";
/// Worlds that the step of `cargo xtask test` draws; about three of four have a witness.
const WORLDS: u64 = 800;
/// Digits of a number that matter: the checker allows 2^-48 of it.
const DIGITS: usize = 14;
/// Those of a polynomial's coefficients, which are sums that may cancel, and of its damping, which is the least one to 2^-26.
const OF_COEFFICIENTS: usize = 6;
const OF_LEAST: usize = 7;
/// The assumptions that the theorems of the Coq file may use: the axioms of its real numbers.
const AXIOMS: [&str; 4] = [
    "ClassicalDedekindReals.sig_forall_dec",
    "ClassicalDedekindReals.sig_not_dec",
    "Classical_Prop.classic",
    "FunctionalExtensionality.functional_extensionality_dep",
];

/// `[--n N] [--seed S]`.
pub fn command(words: &[&str]) -> Result<()> {
    let campaign = Campaign::parse(words, false)?;
    println!("{}", check(campaign.n, campaign.seed)?);
    is_checked_by_coq()
}

/// The step of the tests.
pub fn holds() -> Result<()> {
    let Some(python) = python() else {
        println!("        (the checker of proofs needs Python 3.11 or newer)");
        return Ok(());
    };
    let tests = python.run(&["-m", "unittest", "discover", "--quiet", "proof"])?;
    ensure!(tests.status.success(), "{}", String::from_utf8_lossy(&tests.stderr));
    check(WORLDS, 1).map(drop)
}

struct Python(&'static str);

fn python() -> Option<Python> {
    let test = |name: &&str| {
        Command::new(name).args(["-c", "import tomllib"]).output().is_ok_and(|output| output.status.success())
    };
    ["python3", "/usr/bin/python3"].into_iter().find(test).map(Python)
}

impl Python {
    fn run(&self, arguments: &[&str]) -> Result<std::process::Output> {
        Command::new(self.0).arg("-B").args(arguments).output().context(self.0)
    }
}

/// Draws `n` worlds and has their proofs checked. The numbers of accepted and refused proofs, or the first wrong answer.
fn check(n: u64, seed: u64) -> Result<String> {
    let python = python().context("the checker of proofs needs Python 3.11 or newer")?;
    let folder = programs::target().join("proofs");
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    fs::create_dir_all(&folder)?;
    let drawn = (1..=n).into_par_iter().map(|number| {
        let mut rng = Rng::with_seed(seed.wrapping_mul(1 << 32).wrapping_add(number));
        written(&mut rng, &folder, number)
    });
    let mut worlds = BTreeMap::<String, u64>::new();
    for theorem in drawn.collect::<Result<Vec<_>>>()?.into_iter().flatten() {
        *worlds.entry(theorem).or_default() += 1;
    }
    let witnessed: u64 = worlds.values().sum();
    let since = Instant::now();
    let output = python.run(&[CHECKER, "--batch", &folder.to_string_lossy()])?;
    let took = since.elapsed().as_secs_f64();
    let (mut accepted, mut refused) = (0u64, 0u64);
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        let mut words = line.splitn(3, ' ');
        let (code, file) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
        // w12.json is a proof; w12.changed-3.json and w12-less.json are not.
        let is_proof = file.strip_suffix(".json").is_some_and(|stem| !stem.contains(['.', '-']));
        match (code, is_proof) {
            ("0", true) => accepted += 1,
            ("1", false) => refused += 1,
            _ => anyhow::bail!("{}: {line}", folder.join(file).display()),
        }
    }
    ensure!(
        accepted == witnessed,
        "{accepted} of {witnessed} proofs were looked at: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    let each: Vec<String> = worlds.iter().map(|(theorem, n)| format!("{n} {theorem}")).collect();
    fs::remove_dir_all(&folder)?;
    Ok(format!(
        "{n} worlds drawn, {witnessed} with a witness ({}); {accepted} proofs accepted, {refused} changed proofs and worlds refused; the checker \
         took {took:.0} s",
        each.join(", ")
    ))
}

/// Draws a world and writes its proof and the files that have to be refused. Returns the theorem; `None` where the world has no witness.
fn written(rng: &mut Rng, folder: &Path, number: u64) -> Result<Option<String>> {
    let mut world = random(rng);
    let Some(required) = required(rng, &world)? else { return Ok(None) };
    world.device.damping = required * if rng.bool() { 1.0 } else { 1.0 + rng.f64() };
    if rng.u8(..8) == 0 {
        world.device.tolerances.damping = 0.25;
        world.device.damping *= (1.0 + 1e-12) / 0.75;
    }
    let proof = proof(&world)?;
    let Some(claim) = proof["claims"].as_array().and_then(|claims| claims.last()) else { return Ok(None) };
    let theorem = claim["theorem"].as_str().context("a theorem")?.to_string();
    let required: f64 = claim["required_damping"].as_str().context("a damping")?.parse()?;
    let write = |name: String, text: String| fs::write(folder.join(format!("w{number}{name}")), text);
    write(".toml".into(), world.to_toml())?;
    write(".json".into(), proof.to_string())?;
    let chosen = rng.usize(..proof["claims"].as_array().map_or(1, Vec::len));
    for (i, path) in numbers(&proof["claims"][chosen], String::new()).into_iter().enumerate() {
        let mut changed = proof.clone();
        let place = changed["claims"][chosen].pointer_mut(&path).context("a number")?;
        *place = with_other_digit(rng, &theorem, &path, place)?;
        write(format!(".changed-{i}.json"), changed.to_string())?;
    }
    for (what, changed) in changed_worlds(&world, required, &theorem) {
        write(format!("-{what}.toml"), changed.to_toml())?;
        write(format!("-{what}.json"), proof.to_string())?;
    }
    Ok(Some(theorem))
}

/// The damping to draw a world's about: what the witness of an overdamped copy requires, or the requirement of the linear loop.
fn required(rng: &mut Rng, world: &World) -> Result<Option<f64>> {
    let damped = |c: &Coupling| matches!(c.law, Law::Damper { .. });
    if rng.u8(..if world.couplings.iter().any(damped) { 2 } else { 8 }) == 0 {
        return Ok(hapt_analysis::required_damping(world)?.map(|b| b * (1.0 + 1e-8)));
    }
    let mut overdamped = world.clone();
    overdamped.device.damping = 1e9;
    let proof = proof(&overdamped)?;
    let passive = proof["claims"].as_array().and_then(|claims| claims.last());
    passive.map(|claim| Ok(claim["required_damping"].as_str().context("a damping")?.parse()?)).transpose()
}

fn proof(world: &World) -> Result<Value> {
    let check = hapt_analysis::quick_check(world)?;
    Ok(serde_json::to_value(hapt_analysis::proof(world, &check)?)?)
}

/// Where the numbers of a claim are.
fn numbers(value: &Value, path: String) -> Vec<String> {
    let inner = |(key, value): (String, &Value)| numbers(value, format!("{path}/{key}"));
    match value {
        Value::Object(table) => table.iter().map(|(key, value)| (key.clone(), value)).flat_map(inner).collect(),
        Value::Array(list) => {
            list.iter().enumerate().map(|(i, value)| (i.to_string(), value)).flat_map(inner).collect()
        }
        Value::String(text) if text.starts_with(|c: char| c == '-' || c.is_ascii_digit()) => vec![path],
        Value::Number(_) => vec![path],
        Value::String(_) | Value::Bool(_) | Value::Null => Vec::new(),
    }
}

/// The number with one of the digits changed that matter.
fn with_other_digit(rng: &mut Rng, theorem: &str, path: &str, number: &Value) -> Result<Value> {
    let Some(text) = number.as_str() else { return Ok(Value::from(number.as_u64().context("a whole number")? + 1)) };
    let matter = match path.rsplit('/').next() {
        _ if path.contains("/witness/coefficients") => OF_COEFFICIENTS,
        // The ends of its intervals are halves of halves: every digit matters.
        _ if path.contains("/witness/intervals") => usize::MAX,
        Some("required_damping") if theorem == "linear" => OF_LEAST,
        _ => DIGITS,
    };
    let mantissa = text.split('e').next().unwrap_or_default();
    let digits: Vec<usize> =
        mantissa.char_indices().filter(|(_, c)| c.is_ascii_digit()).map(|(at, _)| at).take(matter).collect();
    let at = digits[rng.usize(..digits.len())];
    let old = text.as_bytes()[at] - b'0';
    let new = (old + rng.u8(1..10)) % 10;
    Ok(Value::from(format!("{}{new}{}", &text[..at], &text[at + 1..])))
}

/// Worlds near `world` that its proof does not cover.
fn changed_worlds(world: &World, required: f64, theorem: &str) -> Vec<(&'static str, World)> {
    let with = |change: &dyn Fn(&mut World)| {
        let mut changed = world.clone();
        change(&mut changed);
        changed
    };
    let period = world.sampling.period;
    let mut all = vec![
        (
            "late",
            with(&|world| {
                world.sampling.delay = Delay::Seconds(world.sampling.delay_s() + period);
                world.sampling.delay_max =
                    world.sampling.delay_max.map(|delay| Delay::Seconds(delay.seconds(period) + period));
            }),
        ),
        ("lagging", with(&|world| world.device.lag += 1e-3 * period)),
        (
            "uneven",
            with(&|world| {
                world.sampling.interval_max = Some(world.sampling.interval_max.map_or(period, |longest| 1.01 * longest))
            }),
        ),
    ];
    if required > 0.0 {
        // The polynomial's damping is above the least by less than this.
        let less = required * (1.0 - if theorem == "linear" { 1e-8 } else { 1e-9 });
        all.push((
            "less",
            with(&|world| {
                world.device.damping = less;
                world.device.tolerances.damping = 0.0;
            }),
        ));
    }
    if !world.bodies.is_empty() {
        all.push(("start", with(&|world| world.sampling.output = Output::Start)));
        all.push(("explicit", with(&|world| world.sampling.method = Method::SemiImplicitEuler)));
    }
    if world.couplings.iter().any(|c| {
        matches!(c.law, Law::Integral { .. } | Law::Coulomb { .. } | Law::Assist { .. } | Law::Acceleration { .. })
    }) {
        all.push(("slippery", with(&|world| world.device.friction *= 1.0 - 1e-9)));
    }
    let stiff = |c: &Coupling| {
        c.law.spring().is_some_and(|stiffness| stiffness > 0.0) && [c.first, c.second].contains(&End::Puck)
    };
    if let Some(index) = world.couplings.iter().position(stiff) {
        all.push((
            "stiffer",
            with(&|world| {
                if let Law::Spring { stiffness, .. } = &mut world.couplings[index].law {
                    *stiffness *= 1.0 + 1e-9;
                }
            }),
        ));
    }
    all
}

/// A world within the assumptions of a theorem that has a witness: bodies with the torque at once, laws at the puck under any times, or springs
/// and dampers at the puck behind whole samples.
fn random(rng: &mut Rng) -> World {
    let mut world = World::new(Sampling::new(1e-3), Device::new(1e-3));
    let period = log_uniform(rng, -4.0, -2.0);
    let kind = rng.u8(..3);
    world.device.inertia = log_uniform(rng, -5.0, -2.0);
    let sampling = &mut world.sampling;
    sampling.period = period;
    sampling.estimator = one_of(
        rng,
        &[EstimatorKind::Difference, EstimatorKind::Difference, EstimatorKind::Exact, EstimatorKind::LowPass],
    );
    sampling.cutoff = (sampling.estimator == EstimatorKind::LowPass).then(|| log_uniform(rng, -2.0, 0.0) / period);
    sampling.every = if rng.u8(..4) == 0 { rng.u32(2..9) } else { 1 };
    sampling.filter = (kind == 1 && rng.u8(..4) == 0).then(|| log_uniform(rng, -3.0, 0.5) / period);
    sampling.method = match kind {
        0 => one_of(rng, &[Method::Zoh, Method::Trapezoidal, Method::BackwardEuler]),
        _ => one_of(rng, &[Method::Zoh, Method::ForwardEuler, Method::Rk4]),
    };
    let delay = match (kind, rng.u8(..4)) {
        (0, _) | (1, 0) => [0.0; 2],
        (1, 1) => [3.0 * rng.f64(); 2],
        (1, 2) => {
            let most = 2.0 * rng.f64();
            [most * rng.f64(), most]
        }
        _ => [f64::from(rng.u8(..6)); 2],
    };
    sampling.delay = if rng.bool() { Delay::Samples(delay[0]) } else { Delay::Seconds(delay[0] * period) };
    sampling.delay_max = (delay[0] != delay[1]).then(|| Delay::Seconds(delay[1] * period));
    let stretch = if rng.bool() { 1.0 } else { 1.0 + rng.f64() };
    sampling.interval_max = (kind < 2 && rng.u8(..3) == 0).then_some(period * stretch);
    if kind == 0 && rng.u8(..6) == 0 {
        sampling.bodies_every = rng.u32(2..5);
    }
    if kind == 1 && rng.u8(..3) == 0 {
        world.device.lag = period * log_uniform(rng, -2.0, 1.0);
        world.device.tolerances.lag = if rng.bool() { 0.0 } else { 0.2 };
    }
    if rng.u8(..4) == 0 {
        world.motion = Motion::Linear;
    }
    if rng.u8(..8) == 0 {
        world.device.handle =
            Some(Handle { inertia: world.device.inertia, stiffness: log_uniform(rng, 1.0, 3.0), damping: 0.0 });
    }
    if rng.u8(..4) == 0 {
        world.device.limit = Some(1.0);
        world.device.encoder = Some(4000.0);
    }
    if world.motion == Motion::Rotary && rng.u8(..6) == 0 {
        world.device.torque.gravity = Some(Gravity { torque: log_uniform(rng, -4.0, 0.0), phase: rng.f64() });
        world.couplings.extend(world.device.compensation(Compensation {
            of: Compensated::Gravity,
            share: rng.f64(),
            velocity: None,
            cutoff: None,
        }));
    }
    if rng.u8(..6) == 0 {
        let waveform = Waveform { sine: [1.0, 0.0, -0.5, 0.0], cosine: [0.0, 0.25, 0.0, 0.0] };
        world.device.torque.cogging = Some(Cogging {
            torque: log_uniform(rng, -4.0, -1.0),
            pitch: log_uniform(rng, -1.5, 0.0),
            phase: 0.1,
            waveform,
        });
    }
    if kind == 0 {
        world.bodies = (0..rng.usize(1..4))
            .map(|_| Body { inertia: log_uniform(rng, -4.0, 0.0), position: 0.0, velocity: 0.0 })
            .collect();
        world.names = (0..world.bodies.len()).map(|i| format!("b{i}")).collect();
    }
    for _ in 0..rng.usize(..3) {
        let torque = log_uniform(rng, -4.0, -1.0);
        let kind = rng.u8(..4);
        within_friction(rng, &mut world, torque, kind);
    }
    let ends: Vec<End> = [End::Puck, End::Ground].into_iter().chain((0..world.bodies.len()).map(End::Body)).collect();
    for _ in 0..rng.usize(1..6) {
        let first = one_of(rng, &ends);
        let Some(&second) = ends.iter().cycle().skip(rng.usize(..8)).take(8).find(|end| **end != first) else {
            continue;
        };
        let law = law(rng, kind == 2 || sampling_is_linear(&world));
        let limit = (kind < 2 && matches!(law, Law::Spring { .. } | Law::Wall { .. }) && rng.u8(..6) == 0)
            .then(|| log_uniform(rng, -2.0, 1.0));
        world.couplings.push(Coupling { first, second, law, limit });
        if let (Law::Spring { .. }, 0) = (law, rng.u8(..6)) {
            let law = Law::Damper { damping: Damping::Compensating };
            world.couplings.push(Coupling { first: second, second: first, law, limit: None });
        }
    }
    world
}

/// Adds an integral term, friction, an assist or an acceleration at the puck that the device's friction takes, all of it or more.
fn within_friction(rng: &mut Rng, world: &mut World, torque: f64, kind: u8) {
    let (law, limit) = match kind {
        0 => (Law::Assist { torque, velocity: log_uniform(rng, -3.0, 2.0) }, None),
        3 => {
            let (inertia, cutoff) = (log_uniform(rng, -6.0, -2.0), log_uniform(rng, -1.0, 2.0));
            (Law::Acceleration { inertia, cutoff }, Some(torque))
        }
        1 => (Law::Integral { stiffness: log_uniform(rng, -2.0, 2.0), time: 0.1, rest: rng.f64() }, Some(torque)),
        _ => (Law::Coulomb { torque }, None),
    };
    let (first, second) = if rng.bool() { (End::Puck, End::Ground) } else { (End::Ground, End::Puck) };
    world.couplings.push(Coupling { first, second, law, limit });
    let device = &mut world.device;
    let [least, _] = device.friction_range();
    device.tolerances.friction = if rng.bool() { 0.0 } else { 0.2 };
    let waveform = Waveform { sine: [0.0, 0.75, 0.0, 0.0], cosine: [0.5, 0.0, 0.0, -0.25] };
    device.friction_by_position = (rng.u8(..4) == 0).then(|| FrictionByPosition {
        share: 0.6 * rng.f64(),
        pitch: log_uniform(rng, -1.0, 1.0),
        phase: rng.f64(),
        waveform,
    });
    (device.friction, device.friction_backward) = (1.0, None);
    let [part, _] = device.friction_range();
    device.friction = (least + torque) * (1.0 + 1e-12) / part;
    device.friction_backward = rng.bool().then_some(1.5 * device.friction);
}

/// A filtered velocity together with nonlinear laws has no proof.
fn sampling_is_linear(world: &World) -> bool {
    world.sampling.estimator == EstimatorKind::LowPass
}

/// A law that the checker covers: every one about a place, but no texture.
fn law(rng: &mut Rng, is_linear: bool) -> Law {
    let law = match rng.u8(..if is_linear { 5 } else { 9 }) {
        0..3 => Law::Spring { stiffness: 1.0, rest: 0.0 },
        3 | 4 => Law::Damper { damping: Damping::Fixed(1.0) },
        _ => {
            let known: Vec<Law> = potentials().into_iter().filter(|law| law.waveform().is_none()).collect();
            one_of(rng, &known)
        }
    };
    let damping = if law.side().is_some() && rng.bool() { 0.0 } else { log_uniform(rng, -5.0, -1.0) };
    let stiffness = log_uniform(rng, -2.0, 3.0);
    as_steep_as(rng, law, stiffness, damping)
}

/// Compiles the Coq file: no proof in it is left open, and its theorems assume only the axioms of the real numbers.
pub fn is_checked_by_coq() -> Result<()> {
    if !Command::new("coqc").arg("--version").output().is_ok_and(|output| output.status.success()) {
        println!("        (no coqc: {COQ} was not looked at; it is in Debian's package coq)");
        return Ok(());
    }
    // The compiler writes into its source's folder.
    let folder = programs::target().join("proofs-by-coq");
    fs::create_dir_all(&folder)?;
    let text = fs::read_to_string(COQ).context(COQ)?;
    for word in ["Admitted", "admit", "Axiom", "Parameter", "Conjecture", "Abort"] {
        let is_word = |found: &str| found.split(|c: char| !c.is_alphanumeric()).any(|other| other == word);
        ensure!(!is_word(&text), "{COQ} has the word {word}");
    }
    let name = Path::new(COQ).file_name().context("a name")?;
    fs::write(folder.join(name), &text)?;
    let output = Command::new("coqc").arg(name).current_dir(&folder).output()?;
    let out = String::from_utf8_lossy(&output.stdout);
    ensure!(output.status.success(), "{COQ}: {out}{}", String::from_utf8_lossy(&output.stderr));
    // "Axioms:", then each with its type; lines of types are indented.
    let named =
        out.lines().filter(|line| line.starts_with(|c: char| c.is_alphabetic())).filter(|line| *line != "Axioms:");
    let axioms: Vec<&str> = named.map(|line| line.split([' ', ':']).next().unwrap_or_default()).collect();
    ensure!(!axioms.is_empty(), "{COQ} does not print what its theorems rest on");
    for axiom in axioms {
        ensure!(AXIOMS.contains(&axiom), "{COQ} rests on {axiom}");
    }
    Ok(())
}
