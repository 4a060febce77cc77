//! What would make a loop certified, one number at a time; of a certified loop, how far each may go.
//!
//! Each is a search over the certificate itself: outwards from the present value by a constant ratio until the answer turns,
//! then halved to a relative 1e-7, and the value on the certified side is what is given. Beyond it, at 1.01 times the value,
//! the certificate has to fail; where it does not, the search has met an island and goes on from there.

use hapt_model::{Clampable, Coupling, Damping, End, Law, Output, World};
use serde::Serialize;

use crate::certificate::is_certified;
use crate::error::Error;
use crate::passivity::required_damping;

/// Each makes the world certified by itself; `None` where none was found. Of a certified world these are margins, and `advance`
/// and `output` are `None`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Remedies {
    /// The least damping of the device, N·m·s/rad (linear: N·s/m).
    pub device_damping: Option<f64>,
    /// The least damper from every body to ground, the same for all, in the same unit.
    pub ground_damping: Option<f64>,
    /// The longest period in s, the delay staying in seconds and compensating dampers following.
    pub period_s: Option<f64>,
    /// The longest delay in s.
    pub delay_s: Option<f64>,
    /// The steps ahead.
    pub advance: Option<u32>,
    /// The output.
    pub output: Option<&'static str>,
    /// The largest factor on every spring, wall, detent and bristle.
    pub stiffness_scale: Option<f64>,
}

/// From one try outwards to the next.
const STRIDE: f64 = 2.0;
/// How far outwards, as a ratio.
const FAR: f64 = 1e9;
/// How far down a period is looked for, and a stiffness. Below, what a verdict cannot see is taken for nothing: any growth falls
/// under its threshold, and any mode comes into step with the hand.
const SHORTEST: f64 = 1e-3;
const SOFTEST: f64 = 1e-6;
/// The relative width at which a search ends.
const WIDTH: f64 = 1e-7;
/// How far beyond a value the certificate has to fail.
const BEYOND: f64 = 1.01;
/// So often an island is left behind.
const ISLANDS: usize = 4;
/// The most steps ahead, and whole samples of delay, that are tried.
const STEPS: u32 = 32;

/// All remedies of a world.
///
/// Work: some hundred certificates.
///
/// # Errors
/// As [`crate::passivity()`].
pub fn remedies(world: &World) -> Result<Remedies, Error> {
    let certified = is_certified(world);
    let others = |found: bool| !certified && found;
    Ok(Remedies {
        device_damping: device_damping(world)?,
        ground_damping: ground_damping(world, certified),
        period_s: period(world, certified),
        delay_s: delay(world, certified),
        advance: (1..=STEPS)
            .find(|&advance| others(world.sampling.output == Output::End && with_advance(world, advance))),
        output: Output::ALL.into_iter().find(|&output| others(with_output(world, output))).map(Output::name),
        stiffness_scale: stiffness_scale(world, certified),
    })
}

fn changed(world: &World, change: impl FnOnce(&mut World)) -> bool {
    let mut world = world.clone();
    change(&mut world);
    is_certified(&world)
}

fn with_advance(world: &World, advance: u32) -> bool {
    advance != world.sampling.advance && changed(world, |w| w.sampling.advance = advance)
}

fn with_output(world: &World, output: Output) -> bool {
    let sampling = &world.sampling;
    output != sampling.output
        && !sampling.method.takes_new_sample_first()
        && sampling.advance == 0
        && changed(world, |w| w.sampling.output = output)
}

/// Between a certified and a refused value: the certified end, to [`WIDTH`].
fn edge(mut good: f64, mut bad: f64, certified: &impl Fn(f64) -> bool) -> f64 {
    while (bad - good).abs() > WIDTH * good.abs().max(bad.abs()) {
        let middle = if good > 0.0 && bad > 0.0 && (bad / good > 4.0 || good / bad > 4.0) {
            (good * bad).sqrt()
        } else {
            0.5 * (good + bad)
        };
        if middle == good || middle == bad {
            break;
        }
        if certified(middle) { good = middle } else { bad = middle }
    }
    good
}

/// The largest value that is certified, from a certified one on; `None` where there is no largest within [`FAR`].
fn largest_from(mut good: f64, certified: &impl Fn(f64) -> bool) -> Option<f64> {
    let far = FAR * good;
    for _ in 0..ISLANDS {
        let mut bad = STRIDE * good;
        while certified(bad) {
            good = bad;
            bad *= STRIDE;
            if bad > far {
                return None;
            }
        }
        good = edge(good, bad, certified);
        if !certified(BEYOND * good) {
            break;
        }
        good *= BEYOND;
    }
    Some(good)
}

/// The largest certified value: on from `now`, or the first below it, down to `down` times it.
fn largest(now: f64, down: f64, is_good: bool, certified: &impl Fn(f64) -> bool) -> Option<f64> {
    if is_good {
        return largest_from(now, certified);
    }
    let mut bad = now;
    while bad > now * down {
        let good = (bad / STRIDE).max(now * down);
        if certified(good) {
            return Some(edge(good, bad, certified));
        }
        bad = good;
    }
    None
}

/// The least certified value of 0 and above, outwards from `small`.
fn least(small: f64, certified: &impl Fn(f64) -> bool) -> Option<f64> {
    if certified(0.0) {
        return Some(0.0);
    }
    let (mut bad, mut good) = (0.0, small);
    while !certified(good) {
        bad = good;
        good *= STRIDE;
        if good > FAR * small {
            return None;
        }
    }
    Some(edge(good, bad, certified))
}

/// Passivity asks for one number, and that it is enough is looked at.
fn device_damping(world: &World) -> Result<Option<f64>, Error> {
    let certified = |damping: f64| changed(world, |w| w.device.damping = damping);
    let Some(required) = required_damping(world)? else { return Ok(None) };
    if certified(required) {
        return Ok(Some(required));
    }
    // Rounding, or a free loop that wants more.
    let least = required.max(1e-12 * world.device.inertia / world.sampling.period);
    if certified(least * (1.0 + WIDTH)) {
        return Ok(Some(least * (1.0 + WIDTH)));
    }
    let mut good = STRIDE * least;
    while !certified(good) {
        good *= STRIDE;
        if good > FAR * least {
            return Ok(None);
        }
    }
    Ok(Some(edge(good, good / STRIDE, &certified)))
}

fn ground_damping(world: &World, is_certified: bool) -> Option<f64> {
    if world.bodies.is_empty() {
        return None;
    }
    if is_certified {
        return Some(0.0);
    }
    let certified = |damping: f64| {
        changed(world, |w| {
            let law = Law::Damper { damping: Damping::Fixed(damping) };
            let ground = |body| Coupling { first: End::Body(body), second: End::Ground, law };
            let dampers: Vec<Coupling> = (0..w.bodies.len()).map(ground).collect();
            w.couplings.extend(dampers);
        })
    };
    // A damper that takes a millionth of a body's motion in a sample.
    let lightest = world.bodies.iter().map(|body| body.inertia).fold(f64::INFINITY, f64::min);
    least(1e-6 * lightest / world.sampling.period, &certified)
}

fn period(world: &World, is_certified: bool) -> Option<f64> {
    let certified = |period: f64| changed(world, |w| w.sampling.period = period);
    let delay = world.sampling.delay;
    let found = largest(world.sampling.period, SHORTEST, is_certified, &certified);
    // A lossless world takes a delay of whole samples only.
    let whole = || (1..=STEPS).map(|n| delay / f64::from(n)).find(|&period| certified(period));
    found.or_else(|| if delay > 0.0 { whole() } else { None })
}

fn delay(world: &World, is_certified: bool) -> Option<f64> {
    let period = world.sampling.period;
    let certified = |delay: f64| changed(world, |w| w.sampling.delay = delay);
    let now = world.sampling.delay;
    let samples = (now / period).floor();
    // Whole samples first: a lossless world takes no others.
    let whole = |n: f64| n * period;
    let best = if is_certified {
        let mut best = samples;
        while best < samples + f64::from(STEPS) && certified(whole(best + 1.0)) {
            best += 1.0;
        }
        if best == samples + f64::from(STEPS) && certified(whole(FAR.sqrt().min(400.0))) {
            return None;
        }
        if best == samples { now } else { whole(best) }
    } else {
        let below = (0..=STEPS).map(|n| whole(samples - f64::from(n))).take_while(|delay| *delay >= 0.0);
        below.into_iter().find(|&delay| delay < now && certified(delay))?
    };
    // And on within the sample.
    let next = whole((best / period + 1e-9).floor() + 1.0).min(if is_certified { f64::INFINITY } else { now });
    let step = best + 1e-4 * (next - best);
    Some(if certified(step) { edge(step, next, &certified) } else { best })
}

fn stiffness_scale(world: &World, is_certified: bool) -> Option<f64> {
    let stiff = |c: &Coupling| stiffness(&mut c.law.clone()).is_some_and(|stiffness| *stiffness > 0.0);
    if !world.couplings.iter().any(stiff) {
        return None;
    }
    let certified = |factor: f64| {
        changed(world, |w| {
            w.couplings.iter_mut().filter_map(|c| stiffness(&mut c.law)).for_each(|stiffness| *stiffness *= factor);
        })
    };
    largest(1.0, SOFTEST, is_certified, &certified)
}

/// The number in which a law's stiffness is.
fn stiffness(law: &mut Law) -> Option<&mut f64> {
    match law {
        Law::Spring { stiffness, .. } | Law::Wall { stiffness, .. } => Some(stiffness),
        Law::Clamped { law: Clampable::Spring { stiffness, .. } | Clampable::Wall { stiffness, .. }, .. } => {
            Some(stiffness)
        }
        Law::Detent { torque, .. } => Some(torque),
        Law::Lugre { bristle_stiffness, .. } => Some(bristle_stiffness),
        _ => None,
    }
}
