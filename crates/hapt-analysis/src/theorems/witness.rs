//! What makes claims checkable without hapt: slopes, and a polynomial with the intervals on which it is positive.
//!
//! A witness belongs to a theorem that proves the claim by itself, from numbers that the world file has or that follow by a few sums
//! and products. That may be another theorem than the one that requires the least damping. Its assumptions are checked here once more,
//! within the scope of `proof/checker.py`.

use hapt_model::{Coupling, EstimatorKind, Method, Output, World};
use serde::Serialize;

use crate::equations::continuous::{Slopes, linearise};
use crate::equations::delay::Delay;
use crate::equations::laws::{self, is_nonlinear};
use crate::error::Error;
use crate::passivity::required::linear_requirement_wanted;
use crate::passivity::supremum::Wanted;
use crate::passivity::timing::Timing;
use crate::passivity::within::beyond_friction;
use crate::theorems::assumptions::behind_filter;
use crate::theorems::claim::least;
use crate::theorems::{ENERGY, LAWS, LINEAR, TWO_RATES, Theorem};

/// The largest whole delay of a polynomial, in samples.
const SAMPLES: usize = 32;
/// How often an interval is halved, and how many there may be.
const LEVELS: u32 = 40;
const INTERVALS: usize = 4000;
/// By this part a polynomial's damping is above the least, so that few intervals show that it is positive.
const SPARE: f64 = 1.0 / (1u64 << 30) as f64;
/// By this part less is not enough.
const LEAST: f64 = 1.0 / (1u64 << 26) as f64;

/// A theorem that proves what a world claims of its hands, with what shows it.
#[derive(Clone, Debug)]
pub(crate) struct Witnessed {
    pub theorem: &'static Theorem,
    /// A device damping that is enough.
    pub required: f64,
    pub witness: Witness,
}

/// What a checker needs in addition to the world file. Numbers are exact decimals.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub(crate) enum Witness {
    /// The steepest rise and the damping of every coupling at the puck.
    Slopes { laws: Vec<Slope> },
    /// b (1 + filter s) - Σ coefficients\[i\] sⁱ, s = sin²(ωT/2), has no negative Bernstein coefficient between two of `intervals`.
    Polynomial { coefficients: Vec<String>, filter: String, intervals: Vec<String> },
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Slope {
    coupling: usize,
    stiffness: String,
    damping: String,
}

/// The witness that the held world does not grow (`is_held`), or that the loop is passive, and so does not grow hands-off; `None` where no
/// theorem that has a witness covers the world, or where the damping is too small.
pub(crate) fn witness(world: &World, is_held: bool) -> Result<Option<Witnessed>, Error> {
    let timing = Timing::of(world);
    // Torques that friction takes require no damping, (T76).
    let least = beyond_friction(&least(world)).into_owned();
    let world = &least;
    let at_puck = at_puck(&least)?;
    let [stiffness, damping] =
        at_puck.iter().fold([0.0, 0.0], |[k, b], (_, [stiffness, damping])| [k + stiffness, b + damping]);
    if !world.couplings.iter().all(|c| laws::is_known(&c.law))
        || !has_mean_velocity(world, damping)
        || (world.sampling.filter.is_some() && !world.bodies.is_empty())
        || world.sampling.advance > 0
        || world.sampling.recentre.is_some()
    {
        return Ok(None);
    }
    let slopes = |theorem, required: f64| {
        let slope = |&(coupling, [stiffness, damping]): &(usize, [f64; 2])| Slope {
            coupling,
            stiffness: exact(stiffness),
            damping: exact(damping),
        };
        let found =
            || Witnessed { theorem, required, witness: Witness::Slopes { laws: at_puck.iter().map(slope).collect() } };
        // The device's damping has no effect on a held world, except on a puck behind a shaft.
        (is_held && least.device.handle.is_none() || least.device.damping >= required).then(found)
    };
    if !world.bodies.is_empty() {
        let Some(theorem) = energy(world, timing) else { return Ok(None) };
        return Ok(slopes(theorem, timing.longest * (0.5 * stiffness + damping / timing.period)));
    }
    match slopes(&LAWS, timing.of_laws(behind_filter(world, [stiffness, damping]))?) {
        Some(found) => Ok(Some(found)),
        None if world.sampling.filter.is_some() || world.sampling.takes_several_samples() => Ok(None),
        None => polynomial(&least, timing, [stiffness, damping]),
    }
}

/// Whether a damping at the puck takes the mean velocity of the last interval or of several, which the checker covers.
fn has_mean_velocity(world: &World, damping: f64) -> bool {
    match world.sampling.estimator {
        _ if damping == 0.0 => true,
        // With bodies, the energy theorem does not cover a difference over several samples.
        EstimatorKind::Difference => world.sampling.every == 1 || world.bodies.is_empty(),
        EstimatorKind::LowPass => !world.couplings.iter().any(is_nonlinear),
        EstimatorKind::Exact
        | EstimatorKind::Foaw
        | EstimatorKind::FoawBest
        | EstimatorKind::Kalman
        | EstimatorKind::Levant => false,
    }
}

/// The stiffness and damping of each coupling at the puck, with its index.
fn at_puck(world: &World) -> Result<Vec<(usize, [f64; 2])>, Error> {
    let terms = linearise(&world.bodies, &world.couplings, &Slopes::Steep)?;
    let over = |at_body: bool| if at_body { world.sampling.step() } else { world.sampling.period };
    let indexed = world.couplings.iter().zip(terms).enumerate().filter(|(_, (c, _))| laws::at_puck(c));
    Ok(indexed.map(|(i, (c, t))| (i, [t.stiffness, t.fixed + over(c.is_at_body()) * t.per_period])).collect())
}

/// The energy theorem that covers a world with bodies.
fn energy(world: &World, timing: Timing) -> Option<&'static Theorem> {
    let sampling = &world.sampling;
    let keeps = matches!(sampling.method, Method::Zoh | Method::Trapezoidal | Method::BackwardEuler);
    if !keeps || sampling.output != Output::End || !timing.is_at_once() {
        return None;
    }
    let bodies = || world.couplings.iter().filter(|c| laws::at_body(c));
    if bodies().any(|c| laws::is_damped_wall(&c.law) && (laws::at_puck(c) || c.limit.is_some())) {
        return None;
    }
    // Damped walls are out already.
    let is_clamped_damper = |c: &Coupling| laws::at_puck(c) && laws::takes_velocity(&c.law) && c.limit.is_some();
    if bodies().any(is_clamped_damper) && bodies().any(|c| laws::may_not_settle(&c.law)) {
        return None;
    }
    match sampling.bodies_every {
        1 => Some(&ENERGY),
        _ if bodies().any(|c| laws::at_puck(c) && laws::takes_velocity(&c.law)) => None,
        _ => Some(&TWO_RATES),
    }
}

/// (T29) of springs and dampers at the puck as a polynomial in s = sin²(ωT/2), `world` with one delay.
fn polynomial(world: &World, timing: Timing, [stiffness, damping]: [f64; 2]) -> Result<Option<Witnessed>, Error> {
    let Delay { samples, fraction } = Delay::of_loop(&world.sampling)?;
    let covered = timing.is_even() && timing.lag[1] == 0.0 && fraction == 0.0 && samples <= SAMPLES;
    if !covered || world.couplings.iter().any(is_nonlinear) {
        return Ok(None);
    }
    let Ok(required) = linear_requirement_wanted(Wanted::Value, world)?.damping else { return Ok(None) };
    let required = required * (1.0 + SPARE);
    if world.device.damping < required {
        return Ok(None);
    }
    let period = timing.period;
    let tau = match world.sampling.estimator {
        EstimatorKind::LowPass => world.sampling.cutoff.map_or(0.0, |cutoff| 1.0 / (std::f64::consts::TAU * cutoff)),
        EstimatorKind::Exact
        | EstimatorKind::Difference
        | EstimatorKind::Foaw
        | EstimatorKind::FoawBest
        | EstimatorKind::Kalman
        | EstimatorKind::Levant => 0.0,
    };
    let filter = 4.0 * tau * (tau + period) / (period * period);
    let parts = Parts {
        samples,
        spring: stiffness * period,
        sooner: damping * tau / period,
        later: damping * (tau + period) / period,
        filter,
    };
    let Some(intervals) = parts.intervals(required) else { return Ok(None) };
    let witness = Witness::Polynomial {
        coefficients: parts.coefficients().into_iter().map(exact).collect(),
        filter: exact(filter),
        intervals: intervals.into_iter().map(exact).collect(),
    };
    Ok(Some(Witnessed { theorem: &LINEAR, required, witness }))
}

/// R(s) = spring (1/2 + Σ cos iθ)(1 + filter s) + sooner cos dθ - later cos (d + 1)θ, i = 1 ... d.
struct Parts {
    samples: usize,
    spring: f64,
    sooner: f64,
    later: f64,
    filter: f64,
}

impl Parts {
    /// The coefficients of R in powers of s.
    fn coefficients(&self) -> Vec<f64> {
        let mut total = vec![0.0; self.samples + 2];
        let mut add = |of: &[f64], factor: f64, shift: usize| {
            for (i, c) in of.iter().enumerate() {
                total[i + shift] += factor * c;
            }
        };
        let mut kernel = vec![0.0; self.samples + 1];
        kernel[0] = 0.5;
        for i in 1..=self.samples {
            for (sum, c) in kernel.iter_mut().zip(chebyshev(i)) {
                *sum += c;
            }
        }
        add(&kernel, self.spring, 0);
        if self.filter > 0.0 {
            add(&kernel, self.spring * self.filter, 1);
        }
        add(&chebyshev(self.samples), self.sooner, 0);
        add(&chebyshev(self.samples + 1), -self.later, 0);
        total
    }

    /// The Bernstein coefficients of R on 0 to 1. Those of cos nθ are (-1)ⁱ C(2n, 2i)/C(n, i).
    fn bernstein(&self) -> Vec<f64> {
        let d = self.samples;
        let mut kernel = vec![0.5; d + 1];
        for n in 1..=d {
            for (sum, c) in kernel.iter_mut().zip(raised(cosine(n), d)) {
                *sum += c;
            }
        }
        let (sooner, later) = (raised(cosine(d), d + 1), cosine(d + 1));
        let over = (d + 1) as f64;
        let spring = |i: usize| {
            let below = if i > 0 { kernel[i - 1] * i as f64 / over * (1.0 + self.filter) } else { 0.0 };
            below + kernel.get(i).map_or(0.0, |c| c * (over - i as f64) / over)
        };
        (0..=d + 1).map(|i| self.spring * spring(i) + self.sooner * sooner[i] - self.later * later[i]).collect()
    }

    /// The ends of the intervals on each of which b (1 + filter s) - R has no negative Bernstein coefficient, with a b that is the least one
    /// within [`LEAST`]. `None` where doubles do not show that.
    fn intervals(&self, b: f64) -> Option<Vec<f64>> {
        let total = self.bernstein();
        let size = (self.spring + self.sooner + self.later) * (1.0 + self.filter) * (self.samples + 1) as f64;
        let room = 1e-14 * size;
        let degree = (total.len() - 1) as f64;
        let norm = |i: usize| 1.0 + self.filter * i as f64 / degree;
        let whole: Vec<f64> = total.iter().enumerate().map(|(i, c)| b * norm(i) - c).collect();
        let mut ends = vec![0.0];
        let mut is_least = b == 0.0;
        let mut waiting = vec![(0.0, 0u32, whole)];
        while let Some((low, level, of)) = waiting.pop() {
            let width = 0.5f64.powi(level as i32);
            if of.iter().all(|c| *c >= room) {
                for (s, value) in [(low, of.first()), (low + width, of.last())] {
                    is_least |= value.is_some_and(|value| value + room < b * LEAST * (1.0 + self.filter * s));
                }
                ends.push(low + width);
                continue;
            }
            if level == LEVELS || ends.len() + waiting.len() > INTERVALS {
                return None;
            }
            let (left, right) = halved(of);
            waiting.push((low + 0.5 * width, level + 1, right));
            waiting.push((low, level + 1, left));
        }
        is_least.then_some(ends)
    }
}

/// cos nθ in powers of sin²(θ/2).
fn chebyshev(n: usize) -> Vec<f64> {
    let (mut before, mut now) = (vec![1.0], vec![1.0, -2.0]);
    if n == 0 {
        return before;
    }
    for _ in 1..n {
        let mut next = vec![0.0; now.len() + 1];
        for (i, c) in now.iter().enumerate() {
            next[i] += 2.0 * c;
            next[i + 1] -= 4.0 * c;
        }
        for (sum, c) in next.iter_mut().zip(&before) {
            *sum -= c;
        }
        (before, now) = (now, next);
    }
    now
}

/// The Bernstein coefficients of cos nθ in sin²(θ/2) from 0 to 1.
fn cosine(n: usize) -> Vec<f64> {
    let mut coefficients = vec![1.0; n + 1];
    for i in 0..n {
        // C(2n, 2i + 2)/C(2n, 2i) over C(n, i + 1)/C(n, i).
        let (two, one) = (2.0 * (n - i) as f64, (n - i) as f64);
        let ratio = two * (two - 1.0) / ((2.0 * i as f64 + 2.0) * (2.0 * i as f64 + 1.0)) / (one / (i as f64 + 1.0));
        coefficients[i + 1] = -coefficients[i] * ratio;
    }
    coefficients
}

/// The Bernstein coefficients of the same polynomial at a higher degree.
fn raised(mut of: Vec<f64>, degree: usize) -> Vec<f64> {
    while of.len() <= degree {
        let n = of.len() as f64;
        let at = |i: usize| of.get(i).copied().unwrap_or(0.0);
        of = (0..=of.len())
            .map(|i| if i > 0 { at(i - 1) * i as f64 / n } else { 0.0 } + at(i) * (n - i as f64) / n)
            .collect();
    }
    of
}

/// The Bernstein coefficients on both halves, by de Casteljau.
fn halved(mut of: Vec<f64>) -> (Vec<f64>, Vec<f64>) {
    let (mut left, mut right) = (Vec::new(), Vec::new());
    while let (Some(first), Some(last)) = (of.first(), of.last()) {
        left.push(*first);
        right.push(*last);
        of = of.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
    }
    right.reverse();
    (left, right)
}

/// A double as a decimal number, exactly.
pub(crate) fn exact(x: f64) -> String {
    // No double has more digits.
    let digits = format!("{x:.770e}");
    let (mantissa, exponent) = digits.split_once('e').unwrap_or((&digits, "0"));
    let mantissa = mantissa.trim_end_matches('0').trim_end_matches('.');
    match (mantissa, exponent) {
        ("0" | "-0", _) => "0".to_string(),
        (mantissa, "0") => mantissa.to_string(),
        (mantissa, exponent) => format!("{mantissa}e{exponent}"),
    }
}
