//! `cargo xtask faults`: the supervisor against faults of every kind, and in runs without a fault.
//!
//! Random certified worlds on the exact device, a rough hand, a virtual clock. A fault begins at a random sample; the measurement is on the
//! true device: when the torque was off, how large it was, and the energy that the hand received.

mod bench;
mod kinds;
mod test_bench;

use std::collections::BTreeMap;
use std::fs;
use std::time::Instant;

use anyhow::{Result, bail, ensure};
use fastrand::Rng;
use hapt_core::{Phase, Reason, SafetyProfile};
use rayon::prelude::*;

use crate::{marked, text};
use bench::Hand;
use kinds::Kind;
use test_bench::TestBench;

const PAGE: &str = "docs/safety.md";
/// A fault counts as caught within this time, s.
const WINDOW: f64 = 3.0;
/// Bounds of that time in samples.
const MIN_SAMPLES: u32 = 2000;
const MAX_SAMPLES: u32 = 10_000;
/// A frozen encoder is found after a second of sufficient torque, which a slowly oscillating body supplies for a part of the time, s.
const FROZEN_WINDOW: f64 = 15.0;
/// Samples after a fault for which the torque has to stay off.
const AFTER: u32 = 50;
/// Samples of one clean run.
const CLEAN: u64 = 100_000;

/// The outcome of one fault.
struct Trial {
    kind: Kind,
    /// From its onset to the first sample without torque, in samples and in s; `None`: not caught.
    caught: Option<(Reason, u32, f64)>,
    /// The largest commanded torque after the onset, in parts of the motor's limit.
    peak: f64,
    /// The most energy that the hand received after the onset, J.
    given: f64,
}

/// `[--n N] [--clean SAMPLES] [--seed S] [--write]`
pub fn command(words: &[&str]) -> Result<()> {
    let (mut n, mut clean, mut seed) = (1e4, 1e8, 1.0);
    let write = text::numbers(words, &mut [("--n", &mut n), ("--clean", &mut clean), ("--seed", &mut seed)])?;
    let (n, seed) = (n as u64, seed as u64);
    let started = Instant::now();
    let trials = campaign(n, seed)?;
    let runs = (clean / CLEAN as f64).ceil() as u64;
    let Clean { samples, overspeeds } = clean_runs(runs, seed)?;
    let ended = match overspeeds {
        0 => String::new(),
        n => format!(
            " In {n} of these the world, or a body that the hand had swung up, threw the puck faster than `overspeed`: they ended there, as they \
             should."
        ),
    };
    let text = format!(
        "{n} faults (seed {seed}) in as many random certified worlds, and {samples} samples without any in {runs}: no false trip.{ended}\n\n{}",
        table(&trials)
    );
    if write {
        let page = fs::read_to_string(PAGE)?;
        fs::write(PAGE, marked::replaced(&page, "cargo xtask faults", &text)?)?;
    } else {
        println!("{text}");
    }
    eprintln!("{:.0} s", started.elapsed().as_secs_f64());
    Ok(())
}

/// A small campaign, for every test run.
pub fn are_caught() -> Result<()> {
    campaign(220, 1)?;
    clean_runs(10, 1)?;
    Ok(())
}

/// The outcome of runs without a fault.
#[derive(Default)]
struct Clean {
    samples: u64,
    /// Runs that ended because the puck truly was too fast.
    overspeeds: u64,
}

fn campaign(n: u64, seed: u64) -> Result<Vec<Trial>> {
    let trials: Vec<(u64, Result<Option<Trial>>)> = (0..n).into_par_iter().map(|i| (i, trial(seed, i))).collect();
    let wrong: Vec<String> = trials
        .iter()
        .filter_map(|(i, trial)| trial.as_ref().err().map(|error| format!("fault {i}: {error:#}")))
        .collect();
    for text in wrong.iter().take(20) {
        eprintln!("{text}");
    }
    ensure!(wrong.is_empty(), "{} of {n} faults ended wrongly", wrong.len());
    Ok(trials.into_iter().filter_map(|(_, trial)| trial.ok().flatten()).collect())
}

fn clean_runs(runs: u64, seed: u64) -> Result<Clean> {
    let ran: Vec<(u64, Result<Clean>)> = (0..runs).into_par_iter().map(|i| (i, clean_run(seed, i))).collect();
    let (mut all, mut trips) = (Clean::default(), Vec::new());
    for (i, run) in ran {
        match run {
            Ok(Clean { samples, overspeeds }) => {
                (all.samples, all.overspeeds) = (all.samples + samples, all.overspeeds + overspeeds);
            }
            Err(error) => trips.push(format!("clean run {i}: {error:#}")),
        }
    }
    for text in trips.iter().take(20) {
        eprintln!("{text}");
    }
    ensure!(trips.is_empty(), "{} of {runs} clean runs tripped", trips.len());
    Ok(all)
}

/// A generator of its own for each run, so that any of them can be repeated without the others.
fn generator(seed: u64, i: u64) -> Rng {
    Rng::with_seed(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ i)
}

fn clean_run(seed: u64, i: u64) -> Result<Clean> {
    let mut rng = generator(seed, i);
    // Every fourth world oscillates, in the same hands.
    let world = if i % 4 == 3 { bench::swinging(&mut rng) } else { bench::world(&mut rng) };
    let mut test_bench = TestBench::new(&world, SafetyProfile::Certified)?;
    let armed = test_bench.arm();
    if test_bench.is_too_fast() {
        return Ok(Clean { samples: 0, overspeeds: 1 });
    }
    ensure!(armed.phase == Phase::Running, "did not arm: {:?}\n{}", armed.reason, world.to_toml());
    let mut hand = Hand::new();
    for k in 0..CLEAN {
        hand.act(&mut rng, &world, &mut test_bench.device);
        let guarded = test_bench.sample(None);
        if test_bench.is_too_fast() {
            return Ok(Clean { samples: k, overspeeds: 1 });
        }
        if guarded.phase != Phase::Running {
            let supervisor = test_bench.supervisor();
            let (account, made, speed) = (supervisor.account(), supervisor.made(), test_bench.device.puck().1);
            let (reason, limits) = (guarded.reason, world.limits(SafetyProfile::Certified));
            bail!(
                "sample {k}: {reason:?} at {speed:.1} rad/s, account {account:.2e} J, made {made:.2e} J\n{limits:?}\n{}",
                world.to_toml()
            );
        }
    }
    Ok(Clean { samples: CLEAN, overspeeds: 0 })
}

/// `None`: it ended before the fault, for a valid reason.
fn trial(seed: u64, i: u64) -> Result<Option<Trial>> {
    let mut rng = generator(!seed, i);
    let kind = Kind::ALL[i as usize % Kind::ALL.len()];
    // A fault for the sign test is tried where there is one.
    let swings = kind == Kind::FrozenSwinging;
    let world = if swings { bench::swinging(&mut rng) } else { bench::world(&mut rng) };
    let mut test_bench = TestBench::new(&world, SafetyProfile::Certified)?;
    let mut hand = Hand::new();
    let mut request = None;
    if kind.before_arming() {
        test_bench.rest();
        request = Some(hapt_core::Request::Arm);
    } else {
        let armed = test_bench.arm();
        if test_bench.is_too_fast() {
            return Ok(None);
        }
        ensure!(armed.phase == Phase::Running, "did not arm: {:?}\n{}", armed.reason, world.to_toml());
        // A hand damps an oscillation until its torque is too small: where the fault has to be caught, the encoder freezes at once.
        let honest = if swings { 0 } else { rng.u32(200..3000) };
        for _ in 0..honest {
            hand.act(&mut rng, &world, &mut test_bench.device);
            if test_bench.sample(None).phase != Phase::Running {
                break;
            }
        }
        if test_bench.is_too_fast() {
            return Ok(None);
        }
        ensure!(
            test_bench.supervisor().phase == Phase::Running,
            "tripped without a fault: {:?}\n{}",
            test_bench.supervisor().reason,
            world.to_toml()
        );
    }
    let limit = world.device.limit.unwrap_or(f64::INFINITY);
    let (period, begin) = (world.sampling.period, test_bench.device.ledger().hand);
    let window = if swings {
        (FROZEN_WINDOW / period) as u32
    } else {
        ((WINDOW / period) as u32).clamp(MIN_SAMPLES, MAX_SAMPLES)
    };
    let mut trial = Trial { kind, caught: None, peak: 0.0, given: 0.0 };
    let (mut ended, mut samples) = (None, 0);
    for age in 0..window {
        if !kind.before_arming() && kind != Kind::Hit {
            hand.act(&mut rng, &world, &mut test_bench.device);
        }
        let request_of_act = kind.act(&mut rng, &mut test_bench, age).or(request.take());
        let missed = test_bench.wires.missed;
        let guarded = test_bench.sample(request_of_act);
        samples += 1 + missed;
        trial.peak = trial.peak.max(guarded.output.abs() / limit);
        trial.given = trial.given.max(begin - test_bench.device.ledger().hand);
        let over = matches!(guarded.phase, Phase::Faulted | Phase::Disarmed);
        if let (None, true, Some(reason)) = (ended, over, guarded.reason) {
            ensure!(kind.right().contains(&reason), "{}: {}\n{}", kind.name(), reason.name(), world.to_toml());
            ensure!(guarded.output == 0.0, "{}: a torque after {}", kind.name(), reason.name());
            trial.caught = Some((reason, samples, f64::from(samples) * period));
            ended = Some(age);
        }
        if let Some(at) = ended {
            ensure!(guarded.output == 0.0 && over, "{}: the torque came back", kind.name());
            if age > at + AFTER {
                break;
            }
        }
    }
    ensure!(trial.peak <= 1.0 + 1e-9, "{}: {} times the limit", kind.name(), trial.peak);
    ensure!(trial.caught.is_some() || !kind.must_trip(), "{}: not caught\n{}", kind.name(), world.to_toml());
    Ok(Some(trial))
}

/// The counts in Markdown.
fn table(trials: &[Trial]) -> String {
    let mut text = String::from(
        "| fault | caught, by | not caught | median, ms | longest, ms | to the hand, J |\n| --- | --- | --- | --- | --- | --- |\n",
    );
    for kind in Kind::ALL {
        let (caught, missed): (Vec<&Trial>, Vec<&Trial>) =
            trials.iter().filter(|trial| trial.kind == kind).partition(|trial| trial.caught.is_some());
        let mut reasons = BTreeMap::<&str, usize>::new();
        for (reason, ..) in caught.iter().filter_map(|trial| trial.caught) {
            *reasons.entry(reason.name()).or_default() += 1;
        }
        let mut by: Vec<_> = reasons.into_iter().collect();
        by.sort_by_key(|(_, count)| usize::MAX - count);
        let by: Vec<String> = by.into_iter().map(|(name, count)| format!("{name} {count}")).collect();
        let mut times: Vec<f64> =
            caught.iter().filter_map(|trial| trial.caught).map(|(_, _, seconds)| 1e3 * seconds).collect();
        times.sort_by(f64::total_cmp);
        let given = caught.iter().chain(&missed).map(|trial| trial.given).fold(0.0, f64::max);
        let show = |number: Option<&f64>| number.map_or("-".into(), |number| format!("{number:.3}"));
        text += &format!(
            "| {} | {} | {} | {} | {} | {given:.3} |\n",
            kind.name(),
            if by.is_empty() { "-".into() } else { by.join(", ") },
            missed.len(),
            show(times.get(times.len() / 2)),
            show(times.last()),
        );
    }
    let peak = trials.iter().map(|trial| trial.peak).fold(0.0, f64::max);
    text += &format!("\nThe largest torque that a motor was asked for is {:.1} % of its limit.\n", 100.0 * peak);
    text
}
