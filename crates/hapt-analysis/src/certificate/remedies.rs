//! Remedies: single changes that make a loop certified. For a certified loop: the margin of each number.
//!
//! Each is a search over the certificate itself. A remedy is searched outwards from the
//! present value until the verdict changes, then between the last two values to a relative 1e-7. The result is the number of fewest
//! digits within 1e-6 of the edge that the certificate itself confirms (`certificate::rounding`). A margin is the end of the interval that begins at
//! the present value and is certified throughout: the search tracks the excess of the required damping and passes no gap. If the
//! interval has no end within the range of the search, a reason is given.

use std::collections::BTreeMap;

use hapt_model::keys::PHYSICAL;
use hapt_model::{Coupling, Damping, Delay, End, EstimatorKind, Law, Output, Sampling, World};
use serde::Serialize;

use crate::certificate::change::{Change, SPARE, STRIDE, WIDTH, changed};
use crate::certificate::rounding::{Certified, candidates, roundest};
use crate::certificate::{excess_below, is_certified};
use crate::equations::delay::MAX_IN_FLIGHT;
use crate::error::Error;
use crate::numerics::crossing::{Ranked, Spacing, first_crossing};
use crate::theorems::passivity::{passivity, required_damping};
use crate::theorems::uneven::{is_stated, uneven, uneven_damping};

/// Each value makes the world certified by itself; `None` where none was found. For a certified world these are margins, and
/// `advance` and `output` are `None`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Remedies {
    /// The least damping of the device, N·m·s/rad (linear: N·s/m).
    pub device_damping: Option<f64>,
    /// The least damper from every body to ground, the same for all, in the same unit.
    pub ground_damping: Option<f64>,
    /// The longest period in s; a delay in samples and compensating dampers change with it, a delay in seconds does not.
    pub period_s: Option<f64>,
    /// The longest delay in s.
    pub delay_s: Option<f64>,
    /// The smallest advance, in steps.
    pub advance: Option<u32>,
    /// The output.
    pub output: Option<&'static str>,
    /// An estimator that theorems cover, where that is all that is missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub estimator: Option<&'static str>,
    /// The largest `safety.overspeed` with which the device's friction makes up for missing damping, rad/s (linear: m/s).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub overspeed: Option<f64>,
    /// The largest factor on the share of every `[[compensation]]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compensation_scale: Option<f64>,
    /// The largest factor on every spring, wall, detent and bristle.
    pub stiffness_scale: Option<f64>,
    /// Where the file states times or tolerances, the longest interval between samples, s; the period does not follow it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interval_max_s: Option<f64>,
    /// Where the file states times or tolerances, the longest delay of a delay that varies from `loop.delay` on, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_max_s: Option<f64>,
    /// For a certified world: the margins without an end, and the range of the search.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub reasons: BTreeMap<&'static str, String>,
}

/// Least ratio of a period, and of a stiffness. Below, any growth falls under the threshold of the verdict.
const MIN_PERIOD: f64 = 1e-3;
const MIN_STIFFNESS: f64 = 1e-6;
/// First step of the margin of a bound, in periods.
const FIRST_STEP: f64 = 0.25;
/// Range of a margin, as a ratio.
const MAX_MARGIN: f64 = 1e6;
/// Tolerance, in samples, within which a delay counts as a whole number; twice that of the loop.
const WHOLE: f64 = 2e-6;
/// Largest advance, and largest number of whole delays, that are tried.
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
    let stated = is_stated(world);
    let mut bound = |name, bound: &Bound| -> Option<f64> {
        if !stated {
            None
        } else if certified {
            margin(name, bound.margin(world))
        } else {
            bound.remedy(world)
        }
    };
    // What a file would take.
    let taken = |x: &f64| *x == 0.0 || PHYSICAL.contains(x);
    Ok(Remedies {
        interval_max_s: bound("interval_max_s", &INTERVAL).filter(taken),
        delay_max_s: bound("delay_max_s", &DELAY).filter(taken),
        device_damping: device_damping(world)?.filter(taken),
        ground_damping: ground_damping(world, certified).filter(taken),
        period_s: period_s.filter(taken),
        delay_s: delay_s.filter(taken),
        advance: (1..=STEPS)
            .find(|&advance| others(world.sampling.output == Output::End && with_advance(world, advance))),
        output: Output::ALL.into_iter().find(|&output| others(with_output(world, output))).map(Output::name),
        estimator: Some(EstimatorKind::Difference)
            .filter(|kind| {
                others(world.sampling.estimator != *kind && changed(world, |w| w.sampling.estimator = *kind))
            })
            .map(EstimatorKind::name),
        overspeed: if certified { None } else { overspeed(world)?.filter(taken) },
        compensation_scale: if certified { None } else { compensation_scale(world) },
        stiffness_scale,
        reasons,
    })
}

/// The speed below which friction makes up for missing damping, on the certified side.
fn overspeed(world: &World) -> Result<Option<f64>, Error> {
    let set = |w: &mut World, speed: f64| {
        w.safety.overspeed = Some(speed);
        w.safety.velocity = w.safety.velocity.map(|velocity| velocity.min(speed));
    };
    let change = Change { world, set };
    let even = passivity(world)?.speed_max;
    let all = if is_stated(world) { uneven(world)?.speed_max } else { None };
    let Some(speed) = even.into_iter().chain(all).reduce(f64::min) else { return Ok(None) };
    let found = roundest(speed, Certified::Below, |x| change.is_certified(*x));
    Ok(Some(found).filter(|found| change.is_certified(*found)))
}

/// The end of the interval from `low` on in which the world remains certified under `change`, or the reason for none up to `high`.
fn margin(
    world: &World,
    spacing: Spacing,
    [low, high]: [f64; 2],
    change: impl Fn(&mut World, f64) + Copy,
) -> Result<Result<f64, String>, Error> {
    let mut scratch = world.clone();
    let mut follow = |spare: f64| {
        let value = |x: f64| {
            change(&mut scratch, x);
            Ok(Ranked::one(excess_below(&scratch, spare)))
        };
        first_crossing(value, spacing, low, high, WIDTH)
    };
    let mut end = follow(SPARE)?;
    // The end itself must be certified too.
    if end.is_some() && !end.is_some_and(|end| changed(world, |w| change(w, end))) {
        end = follow(0.0)?;
    }
    Ok(end.ok_or_else(|| format!("no end up to {MAX_MARGIN:e} times the present value")))
}

fn set_period(world: &mut World, period: f64) {
    world.sampling.period = period;
}

/// Whether a file may have this period, with all else as it is.
fn takes_period(world: &World, period: f64) -> bool {
    let sampling = Sampling { period, ..world.sampling.clone() };
    sampling.fault().is_none() && world.device.fault(period).is_none()
}

/// The longest period that a file may have with all else as it is, at most [`MAX_MARGIN`] times the present one.
fn longest_period(world: &World) -> f64 {
    let now = world.sampling.period;
    let (mut good, mut bad) = (now, MAX_MARGIN * now);
    if takes_period(world, bad) {
        return bad;
    }
    while bad > good * (1.0 + WIDTH) {
        let middle = (good * bad).sqrt();
        if takes_period(world, middle) { good = middle } else { bad = middle }
    }
    // A bound of the file is a round number more often than not.
    candidates(bad, Certified::Below, WIDTH).find(|x| *x >= good && takes_period(world, *x)).unwrap_or(good)
}

fn period_margin(world: &World) -> Result<Result<f64, String>, Error> {
    let now = world.sampling.period;
    let longest = longest_period(world);
    if longest <= now {
        return Ok(Ok(now));
    }
    let end = margin(world, Spacing::period(world.sampling.delay), [now, longest], set_period)?;
    let change = Change { world, set: set_period };
    let holds = |x: f64| x >= now && takes_period(world, x) && change.is_certified(x);
    let end = end.map(|end| roundest(end, Certified::Below, |x| holds(*x)));
    Ok(end.or_else(|reason| if longest < MAX_MARGIN * now { Ok(longest) } else { Err(reason) }))
}

fn delay_margin(world: &World) -> Result<Result<f64, String>, Error> {
    let period = world.sampling.period;
    // The file takes no delay above loop.delay_max.
    let latest = world.sampling.delay_max.map(|delay| delay.seconds(period));
    let most = latest.map_or(MAX_IN_FLIGHT as f64, |latest| latest / period).min(MAX_IN_FLIGHT as f64);
    let now = world.sampling.delay_s() / period;
    if now >= most {
        return Ok(Ok(world.sampling.delay_s()));
    }
    let end = margin(world, Spacing::Samples, [now, most], |w, samples| w.sampling.delay = Delay::Samples(samples))?;
    let reason = |_| format!("no end up to {MAX_IN_FLIGHT} samples, the most that the analysis carries");
    let (present, change) = (world.sampling.delay_s(), Change { world, set: set_delay });
    // An end within the tolerance of a whole number of samples is no margin.
    let in_seconds = |samples: f64| match samples - now < WHOLE {
        true => present,
        false => change.largest_from(present, samples * period),
    };
    let end = end.map(in_seconds).map(|end| latest.map_or(end, |latest| end.min(latest)));
    Ok(match latest {
        Some(latest) if most < MAX_IN_FLIGHT as f64 => Ok(end.unwrap_or(latest)),
        _ => end.map_err(reason),
    })
}

fn set_delay(world: &mut World, delay: f64) {
    world.sampling.delay = Delay::Seconds(delay);
}

/// A bound of a time in the file. A larger one allows more patterns, so that the certificate holds up to one value and for none above.
struct Bound {
    /// The value that allows least, the present one, and a change of it.
    least: fn(&World) -> f64,
    now: fn(&World) -> f64,
    set: fn(&mut World, f64),
}

const INTERVAL: Bound = Bound {
    least: |w| w.sampling.period,
    now: |w| w.sampling.interval_max_s(),
    set: |w, longest| w.sampling.interval_max = Some(longest),
};

const DELAY: Bound = Bound {
    least: |w| w.sampling.delay_s(),
    now: |w| w.sampling.delay_max_s(),
    set: |w, longest| w.sampling.delay_max = Some(Delay::Seconds(longest)),
};

impl Bound {
    fn change<'w>(&self, world: &'w World) -> Change<'w, fn(&mut World, f64)> {
        Change { world, set: self.set }
    }

    /// The largest value of a certified world, or the reason for none.
    fn margin(&self, world: &World) -> Result<f64, String> {
        let change = self.change(world);
        let (mut good, period) = ((self.now)(world), world.sampling.period);
        // A file without the key requires less than one that states the present value, with which every pattern up to it counts.
        if !change.is_certified(good) {
            return Err("stated at all, it is not proved".into());
        }
        let end = good + MAX_IN_FLIGHT as f64 * period;
        let mut step = FIRST_STEP * period;
        while good + step < end {
            if !change.is_certified(good + step) {
                return Ok(change.last(good, good + step));
            }
            good += step;
            step *= STRIDE;
        }
        Err(format!("no end up to {MAX_IN_FLIGHT} periods more than the present value"))
    }

    /// The largest value that makes the world certified, if one below the present does.
    fn remedy(&self, world: &World) -> Option<f64> {
        let change = self.change(world);
        let (least, now) = ((self.least)(world), (self.now)(world));
        (now > least && change.is_certified(least)).then(|| change.last(least, now))
    }
}

fn stiffness_margin(world: &World) -> Result<Result<f64, String>, Error> {
    let own: Vec<Law> = world.couplings.iter().map(|c| c.law).collect();
    let set = |w: &mut World, factor: f64| {
        for (c, law) in w.couplings.iter_mut().zip(&own) {
            c.law = *law;
            c.law.strength().into_iter().for_each(|strength| *strength.value *= factor);
        }
    };
    let end = margin(world, Spacing::Ratio, [1.0, MAX_MARGIN], set)?;
    Ok(end.map(|end| Change { world, set }.largest_from(1.0, end)))
}

/// The interval of values of one number around its present one, `now`, in which a certified world remains certified with all else as it is, at
/// most `ratio` times more or less than `now`; `None` where the world is not certified, `now` is not positive or `ratio` is less than 1.
///
/// Both ends are margins, and certified themselves: [`Remedies`]. Two numbers at once are not covered by the intervals of each.
///
/// # Errors
/// As [`crate::passivity()`].
pub fn certified_interval(
    world: &World,
    now: f64,
    ratio: f64,
    set: impl Fn(&mut World, f64) + Copy,
) -> Result<Option<[f64; 2]>, Error> {
    let is_positive = now > 0.0 && now.is_finite() && ratio >= 1.0 && ratio.is_finite();
    if !is_positive || !is_certified(world) {
        return Ok(None);
    }
    let (least, most) = (now / ratio, now * ratio);
    let change = Change { world, set };
    let high = match margin(world, Spacing::Ratio, [now, most], set)? {
        Ok(end) => change.largest_from(now, end),
        Err(_) => most,
    };
    // The search runs upwards, over the divisor of `now`.
    let low = match margin(world, Spacing::Ratio, [1.0, ratio], |w: &mut World, by: f64| set(w, now / by))? {
        Ok(by) => roundest(now / by, Certified::Above, |x| *x <= now && change.is_certified(*x)),
        Err(_) => least,
    };
    let holds = |x: f64| x > 0.0 && x.is_finite() && change.is_certified(x);
    Ok(Some([if holds(low) && low <= now { low } else { now }, if holds(high) && high >= now { high } else { now }]))
}

fn with_advance(world: &World, advance: u32) -> bool {
    let is_open = !world.couplings.iter().any(|c| c.law.is_at_puck());
    is_open && advance != world.sampling.advance && changed(world, |w| w.sampling.advance = advance)
}

fn with_output(world: &World, output: Output) -> bool {
    let sampling = &world.sampling;
    output != sampling.output
        && !sampling.method.takes_new_sample_first()
        && sampling.advance == 0
        && changed(world, |w| w.sampling.output = output)
}

/// The required damping, verified by the certificate.
fn device_damping(world: &World) -> Result<Option<f64>, Error> {
    let change = Change { world, set: |w: &mut World, damping| w.device.damping = damping };
    let Some(required) = required_damping(world)? else { return Ok(None) };
    let rounded = |least: f64| Some(roundest(least, Certified::Above, |x| change.is_certified(*x)));
    if change.is_certified(required) {
        return Ok(rounded(required));
    }
    // The least damping of the tolerance has to meet the requirement of uneven time.
    let spread = world.device.damping_range()[0] / world.device.damping;
    if is_stated(world)
        && let Some(all) = uneven_damping(world)?
        && change.is_certified(required.max(all) / spread)
    {
        return Ok(rounded(required.max(all) / spread));
    }
    // Rounding, or a free loop that requires more.
    let least = required.max(1e-12 * world.device.inertia / world.sampling.period);
    if change.is_certified(least * (1.0 + WIDTH)) {
        return Ok(rounded(least * (1.0 + WIDTH)));
    }
    Ok(change.least(least, STRIDE * least))
}

fn ground_damping(world: &World, is_certified: bool) -> Option<f64> {
    if world.bodies.is_empty() {
        return None;
    }
    if is_certified {
        return Some(0.0);
    }
    let set = |w: &mut World, damping: f64| {
        let law = Law::Damper { damping: Damping::Fixed(damping) };
        let ground = |body| Coupling { first: End::Body(body), second: End::Ground, law, limit: None };
        let dampers: Vec<Coupling> = (0..w.bodies.len()).map(ground).collect();
        w.couplings.extend(dampers);
    };
    let change = Change { world, set };
    // Start with a damper that reduces a velocity by a millionth in a sample.
    let lightest = world.bodies.iter().map(|body| body.inertia).fold(f64::INFINITY, f64::min);
    if change.is_certified(0.0) {
        return Some(0.0);
    }
    change.least(0.0, 1e-6 * lightest / world.sampling.period)
}

fn period(world: &World) -> Option<f64> {
    let change = Change { world, set: set_period };
    let delay = world.sampling.delay_s();
    // A lossless world is passive only with a delay of whole samples.
    let whole = || {
        let mut all = (1..=STEPS).map(|n| delay / f64::from(n));
        let found = all.find(|&period| change.is_certified(period))?;
        Some(roundest(found, Certified::Below, |x| change.is_certified(*x)))
    };
    let stays = matches!(world.sampling.delay, Delay::Seconds(delay) if delay > 0.0);
    let found = change.largest_below(world.sampling.period, MIN_PERIOD).or_else(|| if stays { whole() } else { None });
    found.filter(|period| takes_period(world, *period))
}

fn delay(world: &World) -> Option<f64> {
    let (period, now) = (world.sampling.period, world.sampling.delay_s());
    let change = Change { world, set: set_delay };
    let certified = |delay: f64| change.is_certified(delay);
    // Whole samples first, for lossless worlds.
    let whole = |n: f64| n * period;
    let samples = (now / period).floor();
    let near = (0..=STEPS).map(|n| whole(samples - f64::from(n))).take_while(|delay| *delay >= 0.0);
    let best = match near.into_iter().find(|&delay| delay < now && certified(delay)) {
        Some(best) => best,
        // Then bisection.
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
    // Then within the sample.
    let next = whole((best / period + 1e-9).floor() + 1.0).min(now);
    let step = best + 1e-4 * (next - best);
    Some(if certified(step) { change.last(step, next) } else { roundest(best, Certified::Below, |x| certified(*x)) })
}

fn has_stiffness(world: &World) -> bool {
    world.couplings.iter().any(|c| c.law.clone().strength().is_some_and(|strength| *strength.value > 0.0))
}

fn stiffness_scale(world: &World) -> Option<f64> {
    if !has_stiffness(world) {
        return None;
    }
    let set = |w: &mut World, factor: f64| {
        w.couplings.iter_mut().filter_map(|c| c.law.strength()).for_each(|strength| *strength.value *= factor);
    };
    Change { world, set }.largest_below(1.0, MIN_STIFFNESS)
}

fn compensation_scale(world: &World) -> Option<f64> {
    let is_one = |c: &Coupling| world.device.compensated_by(c).is_some();
    if !world.couplings.iter().any(is_one) {
        return None;
    }
    let set = |w: &mut World, factor: f64| {
        for c in w.couplings.iter_mut().filter(|c| is_one(c)) {
            if let Some(limit) = &mut c.limit {
                *limit *= factor;
                continue;
            }
            if let Law::Detent { torque, .. } | Law::Texture { torque, .. } | Law::Assist { torque, .. } = &mut c.law {
                *torque *= factor;
            } else if let Law::Acceleration { inertia, .. } = &mut c.law {
                *inertia *= factor;
            }
        }
    };
    Change { world, set }.largest_below(1.0, MIN_STIFFNESS)
}
