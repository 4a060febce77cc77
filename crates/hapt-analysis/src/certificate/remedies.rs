//! What would make a loop certified, one number at a time; of a certified loop, how far each may go.
//!
//! Each is a search over the certificate itself, and the value on the certified side is what is given. A remedy is looked for outwards from
//! the present value, until the answer turns, and then halved to a relative 1e-7: it certifies, whatever lies between. A margin
//! is the end of the interval that begins at the present value and is certified all through: the search follows what the world asks
//! of its device and passes no gap, and where the interval has no end within its reach, it says so.

use std::collections::BTreeMap;

use hapt_model::{Coupling, Damping, Delay, End, Law, Output, World};
use serde::Serialize;

use crate::certificate::{excess, is_certified};
use crate::equations::delay::IN_FLIGHT;
use crate::error::Error;
use crate::numerics::crossing::{Along, Heights, first_rise};
use crate::passivity::required_damping;

/// Each makes the world certified by itself; `None` where none was found. Of a certified world these are margins, and `advance`
/// and `output` are `None`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Remedies {
    /// The least damping of the device, N·m·s/rad (linear: N·s/m).
    pub device_damping: Option<f64>,
    /// The least damper from every body to ground, the same for all, in the same unit.
    pub ground_damping: Option<f64>,
    /// The longest period in s; a delay in samples and compensating dampers follow it, a delay in seconds stays.
    pub period_s: Option<f64>,
    /// The longest delay in s.
    pub delay_s: Option<f64>,
    /// The steps ahead.
    pub advance: Option<u32>,
    /// The output.
    pub output: Option<&'static str>,
    /// The largest factor on every spring, wall, detent and bristle.
    pub stiffness_scale: Option<f64>,
    /// Of a certified world: the margins that have no end, and how far was looked.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub reasons: BTreeMap<&'static str, String>,
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
/// Damping to spare, in parts of the device's, with which a passive loop is taken for stable when it is let go.
const SPARE: f64 = 1e-6;
/// How far a margin is followed, as a ratio.
const REACH: f64 = 1e6;
/// So many samples beyond a whole number a delay still counts as that number; twice what the loop allows.
const WHOLE: f64 = 2e-6;
/// The most steps ahead, and whole samples of delay one after the other, that are tried.
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
    let mut reasons = BTreeMap::new();
    let mut margin = |name: &'static str, end: Result<f64, String>| match end {
        Ok(end) => Some(end),
        Err(reason) => {
            reasons.insert(name, reason);
            None
        }
    };
    let (period_s, delay_s, stiffness_scale) = if certified {
        let scale = has_stiffness(world).then(|| stiffness_margin(world)).transpose()?;
        (
            margin("period_s", period_margin(world)?),
            margin("delay_s", delay_margin(world)?),
            scale.and_then(|scale| margin("stiffness_scale", scale)),
        )
    } else {
        (period(world), delay(world), stiffness_scale(world))
    };
    Ok(Remedies {
        device_damping: device_damping(world)?,
        ground_damping: ground_damping(world, certified),
        period_s,
        delay_s,
        advance: (1..=STEPS)
            .find(|&advance| others(world.sampling.output == Output::End && with_advance(world, advance))),
        output: Output::ALL.into_iter().find(|&output| others(with_output(world, output))).map(Output::name),
        stiffness_scale,
        reasons,
    })
}

/// The end of the interval from `low` on in which `change` leaves the world certified, or why there is none up to `high`.
fn margin(
    world: &World,
    along: Along,
    [low, high]: [f64; 2],
    change: impl Fn(&mut World, f64),
) -> Result<Result<f64, String>, Error> {
    let mut scratch = world.clone();
    let mut follow = |spare: f64| {
        let height = |x: f64| {
            change(&mut scratch, x);
            Ok(Heights::one(excess(&scratch, spare)))
        };
        first_rise(height, along, low, high, WIDTH)
    };
    let mut end = follow(SPARE)?;
    // At the end too the free loop does not grow, but for rounding.
    if end.is_some() && !end.is_some_and(|end| changed(world, |w| change(w, end))) {
        end = follow(0.0)?;
    }
    Ok(end.ok_or_else(|| format!("no end up to {REACH:e} times the present value")))
}

fn period_margin(world: &World) -> Result<Result<f64, String>, Error> {
    let now = world.sampling.period;
    margin(world, Along::period(world.sampling.delay), [now, REACH * now], |w, period| w.sampling.period = period)
}

fn delay_margin(world: &World) -> Result<Result<f64, String>, Error> {
    let (period, most) = (world.sampling.period, IN_FLIGHT as f64);
    let now = world.sampling.delay_s() / period;
    if now >= most {
        return Ok(Ok(world.sampling.delay_s()));
    }
    let end = margin(world, Along::Samples, [now, most], |w, samples| w.sampling.delay = Delay::Samples(samples))?;
    let reason = |_| format!("no end up to {IN_FLIGHT} samples, the most that the analysis carries");
    // So near to what the file has an end is the tolerance by which a whole number of samples is told: there is no margin.
    let end = end.map(|samples| if samples - now < WHOLE { now } else { samples });
    Ok(end.map(|samples| (samples * period).max(world.sampling.delay_s())).map_err(reason))
}

fn stiffness_margin(world: &World) -> Result<Result<f64, String>, Error> {
    let own: Vec<Law> = world.couplings.iter().map(|c| c.law).collect();
    margin(world, Along::Ratio, [1.0, REACH], |w, factor| {
        for (c, law) in w.couplings.iter_mut().zip(&own) {
            c.law = *law;
            c.law.strength().into_iter().for_each(|strength| *strength.value *= factor);
        }
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

/// The first certified value below `now` in steps of [`STRIDE`], down to `down` times it, and up again from there.
fn largest(now: f64, down: f64, certified: &impl Fn(f64) -> bool) -> Option<f64> {
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

/// The first certified value from `good` on outwards in steps of [`STRIDE`], and back again from there to `bad`.
fn least(mut bad: f64, mut good: f64, certified: &impl Fn(f64) -> bool) -> Option<f64> {
    let far = FAR * good;
    while !certified(good) {
        // What is 0, or beyond all numbers, gets no larger.
        if !(STRIDE * good > good && good <= far) {
            return None;
        }
        bad = good;
        good *= STRIDE;
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
    Ok(self::least(least, STRIDE * least, &certified))
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
            let ground = |body| Coupling { first: End::Body(body), second: End::Ground, law, limit: None };
            let dampers: Vec<Coupling> = (0..w.bodies.len()).map(ground).collect();
            w.couplings.extend(dampers);
        })
    };
    // A damper that takes a millionth of a body's motion in a sample.
    let lightest = world.bodies.iter().map(|body| body.inertia).fold(f64::INFINITY, f64::min);
    if certified(0.0) {
        return Some(0.0);
    }
    least(0.0, 1e-6 * lightest / world.sampling.period, &certified)
}

fn period(world: &World) -> Option<f64> {
    let certified = |period: f64| changed(world, |w| w.sampling.period = period);
    let delay = world.sampling.delay_s();
    // A lossless world takes a delay of whole samples only.
    let whole = || (1..=STEPS).map(|n| delay / f64::from(n)).find(|&period| certified(period));
    let stays = matches!(world.sampling.delay, Delay::Seconds(delay) if delay > 0.0);
    largest(world.sampling.period, SHORTEST, &certified).or_else(|| if stays { whole() } else { None })
}

fn delay(world: &World) -> Option<f64> {
    let (period, now) = (world.sampling.period, world.sampling.delay_s());
    let certified = |delay: f64| changed(world, |w| w.sampling.delay = Delay::Seconds(delay));
    // Whole samples first: a lossless world takes no others.
    let whole = |n: f64| n * period;
    let samples = (now / period).floor();
    let near = (0..=STEPS).map(|n| whole(samples - f64::from(n))).take_while(|delay| *delay >= 0.0);
    let best = match near.into_iter().find(|&delay| delay < now && certified(delay)) {
        Some(best) => best,
        // Further down by halves.
        None => {
            let (mut good, mut bad) = (0.0, samples - f64::from(STEPS));
            if bad <= 0.0 || !certified(0.0) {
                return None;
            }
            while bad - good > 1.0 {
                let middle = (0.5 * (good + bad)).floor();
                if certified(whole(middle)) { good = middle } else { bad = middle }
            }
            whole(good)
        }
    };
    // And on within the sample.
    let next = whole((best / period + 1e-9).floor() + 1.0).min(now);
    let step = best + 1e-4 * (next - best);
    Some(if certified(step) { edge(step, next, &certified) } else { best })
}

fn has_stiffness(world: &World) -> bool {
    world.couplings.iter().any(|c| c.law.clone().strength().is_some_and(|strength| *strength.value > 0.0))
}

fn stiffness_scale(world: &World) -> Option<f64> {
    if !has_stiffness(world) {
        return None;
    }
    let certified = |factor: f64| {
        changed(world, |w| {
            w.couplings.iter_mut().filter_map(|c| c.law.strength()).for_each(|strength| *strength.value *= factor);
        })
    };
    largest(1.0, SOFTEST, &certified)
}
