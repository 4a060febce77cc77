//! Uneven time against brute force: loops with random bounds of their intervals, delays and lags, run under patterns of every kind.

use fastrand::Rng;
use hapt_analysis::{Error, PatternVerdict, uneven, uneven_damping, worst_pattern};
use hapt_model::{Delay, Drive, Hand, Law, Scenario, Shape, Timing, World};
use hapt_sim::Simulation;
use hapt_sweep::worst::work_motion;

use super::{Claim, Counts, JUST, ROUNDING, brute};

/// Samples of a hands-off run that may not grow, and the most of one that must.
const SAMPLES: f64 = 1_000.0;
/// The part of these samples, and of a hand's, with a handle or a lag: each new interval then takes a matrix exponential.
const FEWER: f64 = 0.3;
const MOST_SAMPLES: f64 = 20_000.0;
/// A run that must grow lasts until e to this power.
const FOLDS: f64 = 20.0;
/// ln of the part by which an energy may rise from the middle of a run to its end where a quadratic form of the state falls.
const TURNS: f64 = 5.0;
/// The part of a bound at which a hand is tried.
const NEAR: f64 = 0.95;
/// Samples of a hand's run.
const HAND_SAMPLES: u64 = 1_000;

/// Samples of the worst motion, without and with a body.
const MOTION: [usize; 2] = [300, 3_000];

/// How sharp the bound of one loop for all times is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sharpness {
    /// Its row of [`ROWS`], and its column of [`TIMES`].
    class: (usize, usize),
    /// The damping that the worst motion found requires, as a part of it.
    reach: f64,
    /// Whether the real core gives energy to that motion at 0.95 of it.
    broken: bool,
}

const ROWS: [&str; 3] = ["bare springs", "springs with dampers", "one body"];
const TIMES: [&str; 4] = ["at once", "delay", "lag", "delay and lag"];

/// Gives the loop bounds of its times, the lag among them.
pub fn stretch(rng: &mut Rng, world: &mut World) {
    let sampling = &mut world.sampling;
    let period = sampling.period;
    sampling.delay = Delay::Seconds(if sampling.delay_s() > period { 0.0 } else { sampling.delay_s() });
    let least = sampling.delay_s();
    sampling.interval_max = Some(period * (1.0 + 1.2 * rng.f64()));
    sampling.delay_max = rng.bool().then(|| Delay::Seconds(least + (period - least) * rng.f64()));
    if rng.u8(..4) == 0 {
        world.device.lag = period * 10f64.powf(-2.0 + 2.0 * rng.f64());
    }
}

/// Patterns of every kind within the loop's bounds: the worst that was found, random, periodic, and recorded ones with a late sample now
/// and then.
fn timings(rng: &mut Rng, world: &World, duration: f64) -> Result<Vec<Timing>, Error> {
    let sampling = &world.sampling;
    let (period, longest) = (sampling.period, sampling.interval_max_s());
    let [soon, late] = [sampling.delay_s(), sampling.delay_max_s()];
    let shortest = sampling.interval_min_s();
    let step = |rng: &mut Rng| {
        let delay = soon + (late - soon) * rng.f64();
        let interval = shortest.max(delay) + (longest - shortest.max(delay)) * rng.f64();
        (interval / period, delay / period)
    };
    let (intervals, delays) = (0..rng.usize(1..9)).map(|_| step(rng)).unzip();
    let mut samples = Vec::new();
    let mut time = 0.0;
    while time <= duration * 1.001 + longest {
        let (interval, delay) = if rng.u8(..20) == 0 { step(rng) } else { (1.0, late.min(period) / period) };
        samples.push((time, Some(delay * period)));
        time += interval * period;
    }
    Ok(vec![
        worst_pattern(world)?.timing(period),
        Timing::Random { seed: rng.u32(..), shortest: None },
        Timing::Pattern { intervals, delays },
        Timing::Recorded { file: String::new(), samples },
    ])
}

/// How much ln of the energy rises from the middle of a hands-off run to its end: infinite where it leaves double precision. It begins with
/// speeds in parts `size` of 0.01 rad a sample.
fn rise(rng: &mut Rng, world: &World, size: f64, timing: Timing, duration: f64, samples: &mut u64) -> f64 {
    let mut world = world.clone();
    let period = world.sampling.period;
    for body in &mut world.bodies {
        (body.position, body.velocity) = (size * (rng.f64() - 0.5), size * (rng.f64() - 0.5) / (100.0 * period));
    }
    let push = size * world.device.inertia / (100.0 * period) / period;
    let hand = Hand { drive: Drive::Torque(Shape::Step { to: push, at: 0.0 }), release: Some(period) };
    let scenario = Scenario { name: "free".into(), duration, hand, timing };
    let Ok(mut run) = Simulation::without_works(&world, &scenario) else { return f64::NEG_INFINITY };
    let (mut middle, mut end, mut largest) = (0.0f64, 0.0f64, 0.0f64);
    while let Some(row) = run.next() {
        let Ok(row) = row else { return f64::INFINITY };
        let energy = brute::energy(&world, row);
        if !energy.is_finite() {
            return f64::INFINITY;
        }
        largest = largest.max(energy);
        *samples += 1;
        let part = row.time / duration;
        if (0.4..0.5).contains(&part) {
            middle = middle.max(energy);
        } else if part >= 0.9 {
            end = end.max(energy);
        }
    }
    // A motion that has died out is rounding.
    if end <= 1e-20 * largest { f64::NEG_INFINITY } else { (end / middle).ln() }
}

/// Sizes of the initial states of a nonlinear loop: from within a wall or a dead band to far beyond.
const SIZES: [f64; 3] = [0.01, 1.0, 30.0];

/// The world on a device without counts, levels, limit and friction, which hands-off verdicts leave out.
fn linear_device(world: &World) -> World {
    let mut world = world.clone();
    let device = &mut world.device;
    (device.encoder, device.levels, device.limit) = (None, None, None);
    device.set_friction(0.0);
    (device.stribeck, device.stops) = (None, None);
    world
}

/// Whether a nonlinear loop that is proved hands-off does not grow, from states of several sizes and under patterns of every kind. The
/// proof leaves out counts, levels, the motor's limit and friction.
///
/// # Errors
/// Numbers out of range.
pub fn stays(rng: &mut Rng, world: &World, taken: &mut u64, report: &mut dyn FnMut(String)) -> Result<bool, Error> {
    let world = linear_device(world);
    let slow = world.device.handle.is_some() || world.device.lag > 0.0;
    let duration = SAMPLES * if slow { FEWER } else { 1.0 } * world.sampling.period;
    let sampling = &world.sampling;
    let is_even = sampling.interval_max_s() == sampling.period && sampling.delay_s() == sampling.delay_max_s();
    let timings = if is_even { vec![Timing::Even] } else { timings(rng, &world, duration)? };
    let mut holds = true;
    for (timing, size) in timings.iter().flat_map(|timing| SIZES.map(|size| (timing, size))) {
        let risen = rise(rng, &world, size, timing.clone(), duration, taken);
        if risen > TURNS {
            holds = false;
            let kind = timing.kind();
            report(format!(
                "proved hands-off, and from size {size} ln of the energy rises by {risen:e} under {kind:?}"
            ));
        }
    }
    Ok(holds)
}

/// One loop under uneven time, linear or `is_nonlinear`.
///
/// # Errors
/// Numbers out of range.
pub fn judge(
    rng: &mut Rng,
    world: &World,
    is_nonlinear: bool,
    found: &mut Counts,
    report: &mut dyn FnMut(String),
) -> Result<(), Error> {
    let mut world = brute::as_certified(world);
    stretch(rng, &mut world);
    // Half of them at the damping that is called enough.
    let bound = uneven_damping(&world)?;
    if let Some(bound) = bound.filter(|_| rng.bool()) {
        world.device.damping = bound * (1.0 + super::JUST);
    }
    let answer = uneven(&world)?;
    let period = world.sampling.period;
    let part = if world.device.handle.is_some() || world.device.lag > 0.0 { FEWER } else { 1.0 };
    let claim = |holds: bool| Claim { loops: 1, confirmed: u64::from(holds), slow: 0, contradicted: u64::from(!holds) };
    match answer.free.verdict() {
        PatternVerdict::Open => {
            // Of a reason with numbers, only the text before them.
            let reason = answer.free.reason().unwrap_or_default();
            let reason = reason.split(" from ").next().unwrap_or(reason).to_string();
            *found.patterns_open.entry(reason).or_default() += 1;
        }
        PatternVerdict::Proved if is_nonlinear => {
            let holds = stays(rng, &world, &mut found.samples, report)?;
            found.free_nonlinear += claim(holds);
        }
        PatternVerdict::Proved => {
            let duration = SAMPLES * part * period;
            let mut holds = true;
            for timing in timings(rng, &world, duration)? {
                let risen = rise(rng, &world, 1.0, timing.clone(), duration, &mut found.samples);
                if risen > TURNS {
                    holds = false;
                    report(format!(
                        "proved under patterns, and ln of the energy rises by {risen:e} under {:?}",
                        timing.kind()
                    ));
                }
            }
            found.patterns_proved += claim(holds);
        }
        PatternVerdict::Broken => {
            let Some(pattern) = answer.free.pattern() else { return Err(Error::Eigenvalues { order: 0 }) };
            let growth = pattern.growth_per_s;
            let duration = FOLDS / growth;
            if !(growth > 0.0 && duration < MOST_SAMPLES * period) {
                found.patterns_broken += Claim { loops: 1, slow: 1, ..Claim::default() };
            } else {
                let duration = duration.max(100.0 * period);
                let risen =
                    rise(rng, &linear_device(&world), 1.0, pattern.timing(period), duration, &mut found.samples);
                let holds = risen > 0.25 * growth * duration;
                if !holds {
                    report(format!(
                        "broken by a pattern at {growth:e} per second, and ln of the energy rises by {risen:e} in {duration:e} s"
                    ));
                }
                found.patterns_broken += claim(holds);
            }
        }
    }
    // Commands in flight lend energy: hands act where there are none.
    if answer.passive.holds() && answer.proved.holds() && world.sampling.delay_max_s() == 0.0 && world.device.lag == 0.0
    {
        let hand_samples = (HAND_SAMPLES as f64 * part) as u64;
        let duration = hand_samples as f64 * period;
        let mut holds = true;
        for timing in timings(rng, &world, duration)? {
            let hand = brute::hand(rng, &world);
            let (work, samples) = brute::drawn_under(&world, hand.clone(), hand_samples, timing.clone());
            found.samples += samples;
            if work > ROUNDING {
                holds = false;
                report(format!(
                    "called passive under patterns, and a hand draws {work:e} of the work that goes round: {hand:?} {:?}",
                    timing.kind()
                ));
            }
        }
        if is_nonlinear { found.proved += claim(holds) } else { found.uneven_passive += claim(holds) }
    }
    if let Some(bound) =
        bound.filter(|bound| !is_nonlinear && *bound > 0.0 && world.bodies.len() < 2 && Counts::draws_lots(rng))
    {
        let sharp = sharpness(&world, bound, &mut found.samples);
        if let Some(sharp) = sharp.filter(|sharp| sharp.reach > 1.0 + JUST) {
            report(format!("a damping of {bound:e} is called enough, and a motion requires {:e} of it", sharp.reach));
            found.uneven_passive.contradicted += 1;
        }
        found.sharpness.extend(sharp);
    }
    Ok(())
}

/// How sharp `bound` is, by the worst motion and pattern.
fn sharpness(world: &World, bound: f64, samples: &mut u64) -> Option<Sharpness> {
    let mut world = world.clone();
    // The bound is about hands at the motor.
    world.device.handle = None;
    let damped = world.couplings.iter().any(|c| matches!(c.law, Law::Damper { .. }));
    let row = if world.bodies.is_empty() { usize::from(damped) } else { 2 };
    let column = usize::from(world.sampling.delay_max_s() > 0.0) + 2 * usize::from(world.device.lag > 0.0);
    let found = work_motion(&world, MOTION[world.bodies.len()])?;
    let reach = found.demand / bound;
    let broken = reach > NEAR && found.draws(&world, NEAR * bound, samples);
    Some(Sharpness { class: (row, column), reach, broken })
}

/// The counts in Markdown.
pub fn table(found: &Counts, seed: u64) -> String {
    let mut text = format!(
        "{} random loops with bounds of their times (seed {seed}), {} samples of the real core on the exact device; {} without an answer.\n\n\
         | called | loops | ran as called | too slow to see | contradicted |\n| --- | --- | --- | --- | --- |\n",
        found.loops, found.samples, found.unanswered
    );
    let claims = [
        ("hands-off under patterns, proved", found.patterns_proved),
        ("hands-off under patterns, broken", found.patterns_broken),
        ("passive under patterns", found.uneven_passive),
        ("nonlinear, hands-off under patterns, proved", found.free_nonlinear),
        ("nonlinear, passive under patterns, proved", found.proved),
    ];
    for (name, Claim { loops, confirmed, slow, contradicted }) in claims {
        text += &format!("| {name} | {loops} | {confirmed} | {slow} | {contradicted} |\n");
    }
    text += &format!("\nHands-off {} loops are open:\n\n", found.patterns_open.values().sum::<u64>());
    for (reason, loops) in &found.patterns_open {
        text += &format!("- {loops}: {reason}\n");
    }
    text.push('\n');
    text += "| bound for all times | torque | loops | break at 0.95 of it | reach of the motion: a tenth below | half below |\n\
             | --- | --- | --- | --- | --- | --- |\n";
    let share = |broken: usize, of: usize| format!("{broken} ({:.1} %)", 100.0 * broken as f64 / of.max(1) as f64);
    for (row, name) in ROWS.iter().enumerate() {
        let of_row = |column: usize| {
            let fits = |s: &&Sharpness| s.class.0 == row && s.class.1 == column;
            let mut reach: Vec<f64> = found.sharpness.iter().filter(fits).map(|s| s.reach).collect();
            reach.sort_by(f64::total_cmp);
            let broken = found.sharpness.iter().filter(fits).filter(|s| s.broken).count();
            let at = |part: usize| reach.get(reach.len() / part).copied().unwrap_or(0.0);
            format!("{} | {} | {:.3} | {:.3} |\n", reach.len(), share(broken, reach.len()), at(10), at(2))
        };
        for (column, time) in TIMES.iter().enumerate() {
            if found.sharpness.iter().any(|s| s.class.0 == row && s.class.1 == column) {
                text += &format!("| {name} | {time} | {}", of_row(column));
            }
        }
    }
    text
}
