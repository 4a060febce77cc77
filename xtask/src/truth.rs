//! `cargo xtask truth`: the certificate against brute force, on random loops.
//!
//! Every loop is judged by hapt-analysis and then run: the real core on the exact device. A loop that is called stable must not grow, and
//! one that is called unstable must; no hand may draw work from a loop that is called passive; and the campaign measures how many of the
//! refused loops a passive hand breaks.

mod brute;
mod friction;
mod near;
mod networks;
pub mod published;
mod table;
mod uneven;
pub mod worlds;

use std::collections::BTreeMap;
use std::ops::AddAssign;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use anyhow::{Result, ensure};
use brute::{At, Outcome};
use fastrand::Rng;
use hapt_analysis::MARGINAL;
use hapt_analysis::{
    Error, PatternVerdict, Status, breaking_damping, free_growth, held_growth, held_world_growth, passivity,
    quick_check, required_damping, uneven as for_all_times, worst_grip,
};
use hapt_model::{Coupling, EstimatorKind, World};
use rayon::prelude::*;

use crate::campaign::Campaign;

const PAGE: &str = "docs/truth.md";
/// The number of loops at a time; between them a campaign reports its progress, and checks the clock.
const BATCH: u64 = 1000;

/// Samples of a motion; ten times as many where the first do not decide.
const SAMPLES: u64 = 100_000;
/// Samples of a hand's run, and hands a loop.
const HAND_SAMPLES: u64 = 3_000;
const HANDS: u32 = 4;
/// Samples of a motion against counts, levels and samples: where it must draw nothing, and where it may.
const MOTION_SAMPLES: usize = 1_000;
const OPEN_SAMPLES: usize = 10_000;
/// An amplitude that changes by less than this part counts as constant.
const SEEN: f64 = 1e-3;
/// By e to this power an oscillation grows above any other.
const OVERTAKES: f64 = 60.0;
/// Damping beyond the required one, in parts of that.
const JUST: f64 = 1e-9;
/// The worst hand's reach is measured for one of this many refused loops with a finite required damping.
const MEASURED: u8 = 10;
/// Work that counts as rounding, in parts of all the work exchanged.
const ROUNDING: f64 = 1e-9;

/// Loops at even samples, or with bounds of their intervals, delays and lags.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Part {
    Even,
    Uneven,
}

/// How many loops, and how many of them were contradicted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Claim {
    loops: u64,
    /// Of these: loops that ran as claimed.
    confirmed: u64,
    /// Loops that change too slowly to be seen in the run.
    slow: u64,
    contradicted: u64,
}

/// The results of a campaign.
#[derive(Clone, Debug, Default, PartialEq)]
struct Counts {
    loops: u64,
    samples: u64,
    /// Numbers that left double precision, and worlds that the loop refuses.
    unanswered: u64,
    held_stable: Claim,
    held_unstable: Claim,
    free_stable: Claim,
    free_unstable: Claim,
    /// Passive, against random hands and against the worst that was found.
    passive: Claim,
    /// The same beyond the linear loop, where it is called proved.
    proved: Claim,
    /// Hands-off, nonlinear, proved: started from states of several sizes.
    free_nonlinear: Claim,
    /// Passive by the device's friction up to a speed, against hands just below it.
    by_friction: Claim,
    /// Of these: broken by hands at 1.5 times it.
    faster: u64,
    /// Passive, and counts, levels or the like not proved: broken by a motion, or (slow) not by any that was tried.
    unproved: Claim,
    /// Open: broken by a hand or a motion, or (slow) not by any that was tried.
    open: Claim,
    /// Linear loops with a little less than the damping that they require.
    near: near::Near,
    /// Not passive: broken by a passive hand, or (slow) not by any that was tried.
    refused: Claim,
    /// Up to which part of the required damping a hand breaks the loop, for some of the refused.
    reach: Vec<f64>,
    /// Hands-off under patterns: proved, against patterns of every kind; broken by a pattern that the real core runs.
    patterns_proved: Claim,
    patterns_broken: Claim,
    /// Open ones, by the reason of the verdict.
    patterns_open: BTreeMap<String, u64>,
    /// Passive for all times, against hands under patterns.
    uneven_passive: Claim,
    /// Of the bound for all times, of loops without a body and of one.
    sharpness: Vec<uneven::Sharpness>,
    /// Passive together, against hands at all stations: for any clocks, and at fixed times.
    networks: [networks::Judged; 2],
}

impl AddAssign for Claim {
    fn add_assign(&mut self, other: Self) {
        self.loops += other.loops;
        self.confirmed += other.confirmed;
        self.slow += other.slow;
        self.contradicted += other.contradicted;
    }
}

impl Counts {
    /// Whether a loop's reach is measured, which takes as long as everything else.
    fn draws_lots(rng: &mut Rng) -> bool {
        rng.u8(..MEASURED) == 0
    }

    fn claims(&mut self) -> [(&'static str, &mut Claim); 14] {
        [
            ("stable or marginal, held", &mut self.held_stable),
            ("unstable, held", &mut self.held_unstable),
            ("stable or marginal, free", &mut self.free_stable),
            ("unstable, free", &mut self.free_unstable),
            ("passive, linear", &mut self.passive),
            ("passive, nonlinear, proved", &mut self.proved),
            ("free, nonlinear, proved", &mut self.free_nonlinear),
            ("passive by friction, below `speed_max`", &mut self.by_friction),
            ("not passive", &mut self.refused),
            ("not proved", &mut self.unproved),
            ("open", &mut self.open),
            ("hands-off under patterns, proved", &mut self.patterns_proved),
            ("hands-off under patterns, broken", &mut self.patterns_broken),
            ("passive under patterns", &mut self.uneven_passive),
        ]
    }
}

impl AddAssign for Counts {
    fn add_assign(&mut self, mut other: Self) {
        self.loops += other.loops;
        self.samples += other.samples;
        self.unanswered += other.unanswered;
        for ((_, sum), (_, more)) in self.claims().into_iter().zip(other.claims()) {
            *sum += *more;
        }
        self.reach.append(&mut other.reach);
        self.near += other.near;
        self.faster += other.faster;
        for (reason, more) in other.patterns_open {
            *self.patterns_open.entry(reason).or_default() += more;
        }
        self.sharpness.append(&mut other.sharpness);
        for (sum, more) in self.networks.iter_mut().zip(other.networks) {
            *sum += more;
        }
    }
}

/// `[--n N] [--seed S] [--minutes M] [--write]`
pub fn command(words: &[&str]) -> Result<()> {
    let options = Campaign::parse(words, true)?;
    let time = Duration::from_secs((60.0 * options.minutes) as u64);
    let text = table::table(
        &mut campaign(&|i, against| one(Part::Even, options.seed, i, against), options.n, time)?,
        options.seed,
    );
    options.publish("truth", PAGE, &text)
}

/// `cargo xtask patterns`, with the words of [`command`]: the same for uneven time.
pub fn patterns(words: &[&str]) -> Result<()> {
    let options = Campaign::parse(words, true)?;
    let time = Duration::from_secs((60.0 * options.minutes) as u64);
    let text = uneven::table(
        &campaign(&|i, against| one(Part::Uneven, options.seed, i, against), options.n, time)?,
        options.seed,
    );
    options.publish("patterns", PAGE, &text)
}

/// `cargo xtask networks`, with the words of [`command`]: the same for stations joined by links.
pub fn networks(words: &[&str]) -> Result<()> {
    let options = Campaign::parse(words, true)?;
    let time = Duration::from_secs((60.0 * options.minutes) as u64);
    let text = networks::table(
        &campaign(&|i, against| networks::one(options.seed, i, against), options.n, time)?,
        options.seed,
    );
    options.publish("networks", PAGE, &text)
}

/// The part of it that every run of the tests makes.
pub fn holds() -> Result<()> {
    campaign(&|i, against| one(Part::Even, 2, i, against), 120, Duration::MAX)?;
    campaign(&|i, against| one(Part::Uneven, 2, i, against), 20, Duration::MAX)?;
    campaign(&|i, against| networks::one(2, i, against), 24, Duration::MAX).map(drop)
}

/// The contradictions of verdicts.
type Against = Mutex<Vec<String>>;

/// Judges and runs `n` loops by `one`, which takes their numbers, or the first of them, as long as they begin within `time`; an error where
/// one contradicts its verdict.
fn campaign(one: &(dyn Fn(u64, &Against) -> Counts + Sync), n: u64, time: Duration) -> Result<Counts> {
    let started = Instant::now();
    let against = Against::default();
    let mut found = Counts::default();
    while found.loops < n && started.elapsed() < time {
        let batch = found.loops..n.min(found.loops + BATCH);
        found += batch.into_par_iter().map(|i| one(i, &against)).reduce(Counts::default, |mut a, b| {
            a += b;
            a
        });
        // A campaign that is interrupted has printed what it found so far.
        let contradicted = against.lock().map_or(0, |against| against.len());
        if found.loops < n {
            let time = started.elapsed().as_secs_f64();
            eprintln!("{} of {n} loops, {contradicted} contradict their verdict, {time:.0} s", found.loops);
        }
    }
    let against = against.into_inner()?;
    for text in against.iter().take(5) {
        eprintln!("{text}");
    }
    ensure!(against.is_empty(), "{} of {} loops contradict their verdict", against.len(), found.loops);
    Ok(found)
}

/// The random numbers of loop `i`.
fn numbers(seed: u64, i: u64) -> Rng {
    Rng::with_seed(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(i))
}

/// The loop of number `i`, from a seed of its own.
fn one(part: Part, seed: u64, i: u64, against: &Against) -> Counts {
    let mut rng = numbers(seed, i);
    let is_nonlinear = i % 2 == 1;
    let mut world = worlds::random(&mut rng, is_nonlinear);
    // From separate random numbers, so that the loops are otherwise those without handles.
    let mut own = Rng::with_seed(!seed.wrapping_add(i));
    world.device.handle = worlds::handle(&mut own, &world);
    if part == Part::Even {
        world.sampling.bodies_every = worlds::bodies_every(&mut own, &world);
    }
    // A third of them with the required damping, and hardly more: the sharpest claim on passivity.
    if i.is_multiple_of(3)
        && let Ok(Some(required)) = required_damping(&world)
    {
        world.device.damping = required * (1.0 + JUST);
    }
    if part == Part::Even && is_nonlinear {
        friction::spare(&mut own, &mut world);
    }
    let mut found = Counts { loops: 1, ..Counts::default() };
    let mut report = |what: String| {
        if let Ok(mut against) = against.lock() {
            against.push(format!("loop {i}: {what}\n{}", world.to_toml()));
        }
    };
    let judged = match part {
        Part::Even => judge(&mut rng, &world, is_nonlinear, &mut found, &mut report),
        Part::Uneven => uneven::judge(&mut rng, &world, is_nonlinear, &mut found, &mut report),
    };
    if judged.is_err() {
        found.unanswered += 1;
    }
    found
}

fn judge(
    rng: &mut Rng,
    world: &World,
    is_nonlinear: bool,
    found: &mut Counts,
    report: &mut dyn FnMut(String),
) -> Result<(), Error> {
    let sampling = &world.sampling;
    let held = held_growth(&world.bodies, &world.couplings, sampling.method, sampling.step())?;
    let answer = passivity(world)?;
    if held.is_some_and(|growth| growth > MARGINAL) && (answer.passive.holds() || answer.required_damping.is_some()) {
        report(format!("held it grows by {held:?} per second, and a finite damping is called enough"));
        let claim = if is_nonlinear { &mut found.proved } else { &mut found.passive };
        claim.contradicted += 1;
    }
    if !is_nonlinear {
        let free = free_growth(world)?;
        match world.device.handle {
            Some(_) => run(rng, world, At::Held, held_world_growth(world)?, found, report),
            None if !world.bodies.is_empty() => run(rng, world, At::Held, held, found, report),
            None => {}
        }
        run(rng, world, At::Free, free, found, report);
    }
    if is_nonlinear && for_all_times(world)?.free.verdict() == PatternVerdict::Proved {
        let holds = uneven::stays(rng, world, &mut found.samples, report)?;
        found.free_nonlinear +=
            Claim { loops: 1, confirmed: u64::from(holds), slow: 0, contradicted: u64::from(!holds) };
    }
    // A proved claim is tried on the complete loop.
    let mut device = if is_nonlinear { world.clone() } else { brute::as_certified(world) };
    if !answer.passive.holds() {
        // The requirement is about hands at the motor.
        device.device.handle = None;
    }
    let worst = worst_grip(&device)?;
    let grows = worst.as_ref().map_or(f64::NEG_INFINITY, |worst| worst.growth_per_s);
    if !answer.passive.holds() {
        // A nonlinear loop counts with its worst slopes, and bodies that step at every n-th sample have no number for some claims: a
        // refusal is about the loop itself only if it is linear and of one rate.
        if is_nonlinear
            && answer.proved.holds()
            && let Some(speed) = answer.speed_max
        {
            friction::judge(rng, world, speed, found, report);
            return Ok(());
        }
        if is_nonlinear && quick_check(world)?.status == Status::Open {
            let broken = breaks(rng, world, &mut found.samples);
            found.open += Claim { loops: 1, confirmed: u64::from(broken), slow: u64::from(!broken), contradicted: 0 };
        }
        if is_nonlinear || sampling.bodies_every > 1 {
            return Ok(());
        }
        let broken = grows > MARGINAL;
        if let Some(required) = answer.required_damping.filter(|_| Counts::draws_lots(rng)) {
            let breaking = breaking_damping(&device)?.map_or(0.0, |breaking| breaking.damping);
            found.reach.push(breaking / required);
            found.near += near::Near::of(&device, required, breaking, &mut found.samples);
        }
        found.refused += Claim { loops: 1, confirmed: u64::from(broken), slow: u64::from(!broken), contradicted: 0 };
        return Ok(());
    }
    if is_nonlinear && !answer.proved.holds() {
        if rounds(world) && rng.u8(..MEASURED) == 0 {
            let broken = hapt_sweep::worst::best_motion(world, OPEN_SAMPLES).is_ok_and(|found| found.0.is_some());
            found.unproved +=
                Claim { loops: 1, confirmed: u64::from(broken), slow: u64::from(!broken), contradicted: 0 };
        }
        return Ok(());
    }
    let mut drawn = f64::NEG_INFINITY;
    for _ in 0..HANDS {
        let hand = brute::hand(rng, &device);
        let (work, samples) = brute::drawn(&device, hand.clone(), HAND_SAMPLES);
        found.samples += samples;
        if work > ROUNDING {
            report(format!("called passive, and a hand draws {work:e} of the work that goes round: {hand:?}"));
        }
        drawn = drawn.max(work);
    }
    // The hands that break what is not proved.
    if is_nonlinear && let Ok((Some(moved), _)) = hapt_sweep::worst::best_motion(world, MOTION_SAMPLES) {
        report(format!("called proved, and a motion draws {:e} J: {:?}", moved.drawn.gain, moved.motion.trick));
        drawn = f64::INFINITY;
    }
    // A passive loop stays stable in every passive hand.
    let stays = is_nonlinear || grows <= MARGINAL;
    if !stays {
        report(format!("called passive, and grows by {grows:e} per second in {worst:?}"));
    }
    let holds = drawn <= ROUNDING && stays;
    let claim = if is_nonlinear { &mut found.proved } else { &mut found.passive };
    *claim += Claim { loops: 1, confirmed: u64::from(holds), slow: 0, contradicted: u64::from(!holds) };
    Ok(())
}

/// Whether one of some random hands draws energy from a world, or of every tenth a motion that is searched for.
fn breaks(rng: &mut Rng, world: &World, taken: &mut u64) -> bool {
    for _ in 0..HANDS {
        let (work, samples) = brute::drawn(world, brute::hand(rng, world), HAND_SAMPLES);
        *taken += samples;
        if work > ROUNDING {
            return true;
        }
    }
    rng.u8(..MEASURED) == 0 && hapt_sweep::worst::best_motion(world, OPEN_SAMPLES).is_ok_and(|found| found.0.is_some())
}

/// Whether counts, levels, an exact velocity or a constant torque may be the reason why a loop is not proved, so that motions are tried on
/// it.
fn rounds(world: &World) -> bool {
    let device = &world.device;
    let pushes = |c: &Coupling| c.law.constant().is_some();
    device.encoder.is_some()
        || device.levels.is_some()
        || world.sampling.estimator == EstimatorKind::Exact
        || world.couplings.iter().any(pushes)
}

/// One claim on growth against a run.
fn run(rng: &mut Rng, world: &World, at: At, growth: Option<f64>, found: &mut Counts, report: &mut dyn FnMut(String)) {
    let growth = growth.unwrap_or(f64::NEG_INFINITY);
    let unstable = growth > MARGINAL;
    let claim = |confirmed, slow, contradicted| Claim { loops: 1, confirmed, slow, contradicted };
    let seen = |samples: u64| SEEN / (0.5 * samples as f64 * world.sampling.period);
    let mut outcome = claim(1, 0, 0);
    for samples in [SAMPLES, 10 * SAMPLES] {
        let (motion, taken) = brute::motion(rng, world, at, samples);
        found.samples += taken;
        // The rate of an amplitude; an energy's is twice that.
        let rate = match motion {
            Outcome::Gone => f64::NEG_INFINITY,
            Outcome::Grown => f64::INFINITY,
            Outcome::Rate(rate) => 0.5 * rate,
        };
        outcome = match unstable {
            false if rate < seen(samples) => claim(1, 0, 0),
            true if rate > 0.25 * growth => claim(1, 0, 0),
            // A small growing oscillation is seen only when it exceeds the constant ones.
            true if growth * samples as f64 * world.sampling.period < OVERTAKES => claim(0, 1, 0),
            _ => claim(0, 0, 1),
        };
        if outcome.confirmed > 0 {
            break;
        }
        if outcome.contradicted > 0 && samples > SAMPLES {
            report(format!("{at:?}: growth by the analysis {growth:e}, by {samples} samples {rate:e} per second"));
        }
    }
    *match (at, unstable) {
        (At::Held, false) => &mut found.held_stable,
        (At::Held, true) => &mut found.held_unstable,
        (At::Free, false) => &mut found.free_stable,
        (At::Free, true) => &mut found.free_unstable,
    } += outcome;
}
