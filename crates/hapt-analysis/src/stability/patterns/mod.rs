//! The hands-off loop under patterns of intervals and delays: one common quadratic form, or a pattern under which it grows.
//!
//! A loop that is stable at every fixed interval may grow under a pattern of them. *Source:* the joint spectral radius, R. Jungers (2009);
//! L. Hetel and others, "Recent developments on the stability of systems with aperiodic sampling: an overview", Automatica 76 (2017).

pub(crate) mod common;
pub(crate) mod family;
mod search;

use std::borrow::Cow;

use hapt_model::{EstimatorKind, Scenario, Timing, World};
use serde::Serialize;

use crate::equations::closed_loop::ClosedLoop;
use crate::equations::continuous::Slopes;
use crate::equations::estimator::Filter;
use crate::equations::laws::is_nonlinear;
use crate::equations::port::Port;
use crate::equations::structure::{inertias_with_puck, linearise_with_puck, parts};
use crate::error::{Error, at_one_rate};
use crate::stability::free::free_growth;
use crate::stability::patterns::common::{Norm, is_proved};
use crate::stability::patterns::family::{Cell, Family, Step};
use crate::stability::{MARGINAL, Verdict};
use crate::text::time;

/// ln of the modulus from which on an eigenvalue of a whole pattern counts as outside the unit circle. A double eigenvalue 1 is split by
/// 1e-8.
const GROWS: f64 = 1e-6;

/// Intervals and delays that repeat.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pattern {
    /// In s.
    pub intervals_s: Vec<f64>,
    /// From each sample to the arrival of its command, s; as many as intervals.
    pub delays_s: Vec<f64>,
    /// The growth of the linear hands-off loop under it, 1/s.
    pub growth_per_s: f64,
}

/// What is known of the hands-off loop under every pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum PatternVerdict {
    /// It grows under none.
    Proved,
    /// It grows under one.
    Broken,
    /// Neither is known.
    Open,
}

/// The hands-off loop under every pattern of intervals and delays.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FreePatterns {
    /// The verdict.
    pub verdict: PatternVerdict,
    /// The shortest and the longest interval that it is about, s; never shorter than the delay before it.
    pub interval_s: [f64; 2],
    /// What proves it: `"passivity"`, `"eigenvalues"` (even samples) or `"common form"`.
    pub proved_by: Option<&'static str>,
    /// The pattern that breaks it.
    pub pattern: Option<Pattern>,
    /// Why it is open.
    pub reason: Option<String>,
}

impl FreePatterns {
    /// Proved by what also covers intervals as short as any.
    pub(crate) fn by_passivity(world: &World) -> FreePatterns {
        FreePatterns {
            verdict: PatternVerdict::Proved,
            interval_s: [0.0, world.sampling.interval_max_s()],
            proved_by: Some(BY_PASSIVITY),
            pattern: None,
            reason: None,
        }
    }
}

impl Pattern {
    /// As a scenario's timing in a loop with this period in s.
    pub fn timing(&self, period: f64) -> Timing {
        let periods = |times: &[f64]| times.iter().map(|time| time / period).collect();
        Timing::Pattern { intervals: periods(&self.intervals_s), delays: periods(&self.delays_s) }
    }

    /// Its intervals in words, equal ones in a row once: "intervals of 3 x 1.8 ms and 2 x 0.2 ms"; beyond four such rows only how many
    /// there are.
    pub fn description(&self) -> String {
        let mut runs: Vec<(usize, f64, f64)> = Vec::new();
        for (interval, delay) in self.intervals_s.iter().zip(&self.delays_s) {
            match runs.last_mut() {
                Some((count, i, d)) if i == interval && d == delay => *count += 1,
                _ => runs.push((1, *interval, *delay)),
            }
        }
        let is_late = self.delays_s.iter().any(|delay| *delay != self.delays_s[0]);
        let late = |delay: f64| if is_late { format!(" ({} late)", time(delay)) } else { String::new() };
        let run = |(count, interval, delay): &(usize, f64, f64)| match count {
            1 => format!("{}{}", time(*interval), late(*delay)),
            _ => format!("{count} x {}{}", time(*interval), late(*delay)),
        };
        match &runs[..] {
            [(_, interval, delay)] => format!("even intervals of {}{}", time(*interval), late(*delay)),
            [rows @ .., last] if runs.len() <= 4 => {
                let rows: Vec<String> = rows.iter().map(run).collect();
                format!("intervals of {} and {}, again and again", rows.join(", "), run(last))
            }
            _ => format!("a pattern of {} intervals, which hapt check --json lists", self.intervals_s.len()),
        }
    }
}

/// As [`FreePatterns::proved_by`] names it.
pub(crate) const BY_PASSIVITY: &str = "passivity";

/// Why a loop has no patterns to search.
const TOO_LATE: &str = "a delay longer than the period is not analysed under patterns";

/// The hands-off loop under every pattern, without a proof by passivity.
///
/// Work: bounded; some ten thousand products of matrices of the loop's order.
///
/// # Errors
/// As [`crate::free`].
pub(crate) fn patterns(world: &World) -> Result<FreePatterns, Error> {
    let sampling = &world.sampling;
    let even_growth = free_growth(world)?;
    let is_even = sampling.interval_max_s() == sampling.period && sampling.delay_s() == sampling.delay_max_s();
    let tolerances = &world.device.tolerances;
    let exact = [tolerances.inertia, tolerances.damping, tolerances.lag] == [0.0; 3];
    let interval_s = [sampling.interval_min_s(), sampling.interval_max_s()];
    let answer = |verdict, proved_by, pattern| FreePatterns { verdict, interval_s, proved_by, pattern, reason: None };
    let open =
        |reason: &str| FreePatterns { reason: Some(reason.to_string()), ..answer(PatternVerdict::Open, None, None) };
    let unstable = Verdict::of(even_growth) == Verdict::Unstable;
    if is_even && exact && !unstable {
        return Ok(answer(PatternVerdict::Proved, Some("eigenvalues"), None));
    }
    if unstable && (is_even || sampling.delay_max_s() > sampling.period) {
        return Ok(answer(PatternVerdict::Broken, None, Some(even(world, even_growth))));
    }
    if sampling.delay_max_s() > sampling.period {
        return Ok(open(TOO_LATE));
    }
    if sampling.bodies_every > 1 {
        return Ok(open("patterns are searched in loops whose bodies step at every sample"));
    }
    if is_even {
        return Ok(open("tolerances of the device are covered by a proof of passivity only"));
    }
    let (found, proved) = with_family(world, |family, all, at, start| {
        let found = search::worst(family, all, at, start.as_ref().unwrap_or(&Norm::balanced(&family.at(at))))?;
        let breaks = unstable || found.as_ref().is_some_and(|found| found.ln_abs > GROWS);
        let proved = !breaks && exact && start.as_ref().is_some_and(|start| is_proved(family, all, at, start));
        Ok((found, proved))
    })?;
    let grown = found.filter(|found| found.ln_abs > GROWS).map(pattern);
    let nominal = unstable.then(|| even(world, even_growth));
    let worse = grown.into_iter().chain(nominal).max_by(|a, b| a.growth_per_s.total_cmp(&b.growth_per_s));
    if let Some(pattern) = worse.filter(|pattern| pattern.growth_per_s > MARGINAL) {
        return Ok(answer(PatternVerdict::Broken, None, Some(pattern)));
    }
    Ok(if world.couplings.iter().any(is_nonlinear) {
        open(
            "nonlinear couplings are covered by a proof of passivity only; no pattern that was tried makes their steepest slopes grow",
        )
    } else if !exact {
        open(
            "tolerances of the device are covered by a proof of passivity only; no pattern that was tried makes the middle of them grow",
        )
    } else if matches!(sampling.estimator, EstimatorKind::Foaw | EstimatorKind::FoawBest) {
        open("FOAW changes its window; no pattern that was tried makes its shortest window grow")
    } else if proved {
        answer(PatternVerdict::Proved, Some("common form"), None)
    } else if Verdict::of(even_growth) == Verdict::Marginal {
        open("a motion of the loop neither grows nor decays at even samples; no pattern that was tried makes it grow")
    } else {
        open("no pattern that was tried makes it grow, and no common quadratic form was found")
    })
}

/// The pattern within the file's intervals and delays that was found to make the linear hands-off loop grow most, or decay least.
/// It is the same each time.
///
/// ```
/// use hapt_analysis::worst_pattern;
/// use hapt_model::{Source, World};
///
/// let file = r#"
/// loop = { period = "1 ms", interval_max = "1.8 ms" }
/// device = { inertia = "6.4e-4 kg m^2", damping = "1.2e-3 N m s/rad" }
/// [[couplings]]
/// kind = "spring"
/// between = ["puck", "ground"]
/// stiffness = "2 N m/rad"
/// "#;
/// let pattern = worst_pattern(&World::read(&Source::from_text("spring.toml", file), &[])?)?;
/// // KT/2 of 1.8 ms is 1.8e-3: the hold supplies more than the device takes when all intervals are long.
/// assert!(pattern.intervals_s == [1.8e-3] && pattern.growth_per_s > 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As [`crate::free`]; [`Error::BodiesEvery`].
pub fn worst_pattern(world: &World) -> Result<Pattern, Error> {
    at_one_rate(&world.sampling, "the search for the worst pattern")?;
    let even = even(world, free_growth(world)?);
    if world.sampling.delay_max_s() > world.sampling.period {
        return Ok(even);
    }
    let found = with_family(world, |family, all, at, start| {
        search::worst(family, all, at, start.as_ref().unwrap_or(&Norm::balanced(&family.at(at))))
    })?;
    Ok(found.map_or(even, pattern))
}

/// The scenario as it runs: with the [`worst_pattern`] of the world where its timing is [`Timing::Worst`].
///
/// # Errors
/// As [`worst_pattern`].
pub fn with_worst_pattern<'a>(world: &World, scenario: &'a Scenario) -> Result<Cow<'a, Scenario>, Error> {
    if scenario.timing != Timing::Worst {
        return Ok(Cow::Borrowed(scenario));
    }
    let timing = worst_pattern(world)?.timing(world.sampling.period);
    Ok(Cow::Owned(Scenario { timing, ..scenario.clone() }))
}

fn pattern(found: search::Found) -> Pattern {
    Pattern {
        intervals_s: found.steps.iter().map(|step| step.interval).collect(),
        delays_s: found.steps.iter().map(|step| step.delay).collect(),
        growth_per_s: found.growth_per_s,
    }
}

/// Even samples, as the file has them.
fn even(world: &World, growth: Option<f64>) -> Pattern {
    Pattern {
        intervals_s: vec![world.sampling.period],
        delays_s: vec![world.sampling.delay_s()],
        growth_per_s: growth.unwrap_or(0.0),
    }
}

/// `work` on the maps of the loop, all its steps, the even one, and a norm that the even one shortens, where there is one. Nonlinear
/// couplings have their steepest slopes, FOAW its shortest window, the device the middle of its tolerances.
fn with_family<T>(
    world: &World,
    work: impl FnOnce(&Family<'_>, Cell, Step, Option<Norm>) -> Result<T, Error>,
) -> Result<T, Error> {
    let (sampling, device) = (&world.sampling, &world.device);
    let inertia = inertias_with_puck(world)?;
    let terms = linearise_with_puck(&world.bodies, &world.couplings, &Slopes::Steep)?;
    let failed = Error::Eigenvalues { order: 0 };
    let all = parts(&inertia, &terms);
    let port = Port::new(all.first().ok_or(failed.clone())?)?.lagging(device.lag).with_handle(device.handle);
    let filters = Filter::of(sampling, sampling.period);
    let filter = filters.first().ok_or(failed)?;
    let late = sampling.delay_max_s() > 0.0;
    let parts = ClosedLoop::new(&port, sampling, filter, sampling.period, usize::from(late))?;
    let family = Family::new(&parts, device.damping, &port, late && !port.is_uncoupled());
    let all = Cell {
        interval: [sampling.interval_min_s(), sampling.interval_max_s()],
        delay: [sampling.delay_s(), sampling.delay_max_s()],
    };
    let even = Step { interval: sampling.period, delay: sampling.delay_s() };
    let d = family.at(even);
    if !d.iter().all(|x| x.is_finite()) {
        return Err(Error::Eigenvalues { order: family.order() });
    }
    let start = if family.order() > 0 { Norm::lyapunov(&d) } else { None };
    work(&family, all, even, start)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_model::Source;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(hapt_testing::cases(128))]

        /// What a proof rests on: within a cell no map is farther from the mean of the corners than the bound.
        #[test]
        fn the_maps_of_a_cell_are_as_near_to_their_corners_as_bounded(
            alpha in 0.05..2.0f64, beta in 0.0..0.9f64, lag in prop_oneof![Just(0.0), 0.02..3.0f64],
            handle in prop::option::of((-1.5..1.5f64, -2.0..2.0f64, prop_oneof![Just(0.0), 0.0..1.0f64])),
            from in 0.2..1.8f64, width in 0.01..0.8f64, late in prop_oneof![Just((0.0, 0.0)), (0.0..0.1f64, 0.0..0.1f64)], (x, y) in (0.0..1.0f64, 0.0..1.0f64),
        ) {
            let unit = 6.4e-4 / 1e-3;
            let shaft = handle.map_or(String::new(), |(mass, stiffness, damping)| format!(
                "handle = {{ inertia = {}, stiffness = {}, damping = {} }}\n",
                6.4e-4 * 10f64.powf(mass), unit / 1e-3 * 10f64.powf(stiffness), unit * damping
            ));
            let text = format!(
                "loop = {{ period = 1e-3, estimator = \"difference\", delay_max = 2e-4, interval_max = 2e-3 }}\n[device]\ninertia = 6.4e-4\ndamping = 1e-2\n\
                 lag = {}\n{shaft}[[couplings]]\nkind = \"spring\"\nbetween = [\"puck\", \"ground\"]\nstiffness = {}\n\
                 [[couplings]]\nkind = \"damper\"\nbetween = [\"puck\", \"ground\"]\ndamping = {}\n",
                lag * 1e-3, alpha * unit / 1e-3, beta * unit
            );
            let world = World::read(&Source::from_text("cell.toml", text), &[]).unwrap();
            let cell = Cell { interval: [from * 1e-3, (from + width) * 1e-3], delay: [late.0 * 1e-3, (late.0 + late.1) * 1e-3] };
            with_family(&world, |family, _, _, start| {
                let norm = start.unwrap_or_else(|| Norm::balanced(&family.at(cell.corners()[0])));
                let [along, across] = family.curvature(&norm.c, &norm.inverse, cell.interval[1]).error(&cell);
                let [[h0, h1], [d0, d1]] = [cell.interval, cell.delay];
                let place = Step { interval: h0 + x * (h1 - h0), delay: d0 + y * (d1 - d0) };
                let weights = [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y];
                let mut apart = family.at(place);
                for (corner, weight) in cell.corners().into_iter().zip(weights) {
                    apart -= family.at(corner) * weight;
                }
                let size = (&norm.c * apart * &norm.inverse).norm();
                // The Frobenius norm is an upper bound of the one that the proof is about, and rounding stays.
                let spectral = (&norm.c * family.at(place) * &norm.inverse).norm();
                let order = (family.order() as f64).sqrt();
                assert!(size <= order * (along + across) + 1e-10 * spectral, "{size} {along} {across}");
                Ok(())
            }).unwrap();
        }
    }
}
