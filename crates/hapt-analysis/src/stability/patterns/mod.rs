//! The hands-off loop under patterns of intervals and delays: one common quadratic form, or a pattern under which it grows.
//!
//! A loop that is stable at every fixed interval may grow under a pattern of them. *Source:* the joint spectral radius, R. Jungers (2009);
//! L. Hetel and others, "Recent developments on the stability of systems with aperiodic sampling: an overview", Automatica 76 (2017).

pub(crate) mod common;
pub(crate) mod family;
mod search;

use std::borrow::Cow;

use hapt_model::{Sampling, Scenario, System, Timing, World};
use serde::Serialize;

use nalgebra::DMatrix;

use crate::equations::closed_loop::{ClosedLoop, closed_loop};
use crate::equations::continuous::Slopes;
use crate::equations::estimator::Filter;
use crate::equations::port::Port;
use crate::equations::structure::{inertias_with_puck, linearise_with_puck, parts};
use crate::error::{Error, at_one_rate};
use crate::stability::MARGINAL;
use crate::stability::free::free_growth;
use crate::stability::patterns::common::{Norm, shrinking, shrinks_under_all};
use crate::stability::patterns::family::{Cell, Family, Step};
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

/// Part of the period below which an interval is short: there the form has to shrink in proportion to time.
const NEAR_ZERO: f64 = 1e-3;

/// The result of the search for a pattern, and for a quadratic form that no pattern makes grow.
pub(crate) struct Searched {
    /// The worst pattern, if it makes the loop grow.
    pub grows: Option<Pattern>,
    /// One quadratic form shrinks under all delays and all of these intervals, s.
    pub form_s: Option<[f64; 2]>,
}

/// The linear hands-off loop under patterns of its intervals and delays. The form is looked for where `wants_form`.
///
/// Work: bounded; some ten thousand products of matrices of the loop's order.
///
/// # Errors
/// As [`crate::free`].
pub(crate) fn search(world: &World, wants_form: bool) -> Result<Searched, Error> {
    let sampling = &world.sampling;
    let least = if sampling.interval_max.is_none() { sampling.period } else { sampling.interval_min_s() };
    let (found, form_s) = with_family(world, |family, all, at, start| {
        let found = search::worst(family, all, at, start.as_ref().unwrap_or(&Norm::balanced(&family.at(at))))?;
        let grows = found.as_ref().is_some_and(|found| found.ln_abs > GROWS);
        let Some(start) = start.filter(|_| wants_form && !grows) else { return Ok((found, None)) };
        let longest = all.interval[1];
        // Down to 0 where that can be, else as far below the period as the longest interval is above.
        let short = NEAR_ZERO * sampling.period;
        let from_zero = family.stands_at_zero()
            && sampling.interval_max.is_some()
            && shrinking(family, Cell { interval: [short, longest], ..all }, at, &start)
                .is_some_and(|norm| norm.covers_from_zero(family, short));
        let form_s = match from_zero {
            true => Some([0.0, longest]),
            false => {
                shrinking(family, Cell { interval: [least, longest], ..all }, at, &start).map(|_| [least, longest])
            }
        };
        Ok((found, form_s))
    })?;
    let grows = found.filter(|found| found.ln_abs > GROWS).map(pattern);
    Ok(Searched { grows: grows.filter(|pattern| pattern.growth_per_s > MARGINAL), form_s })
}

/// Whether one quadratic form shrinks at every sample of each of these linear loops, at even samples with one delay, and therefore under
/// any switching between the loops. They differ only in their couplings.
///
/// # Errors
/// As [`crate::free`].
pub(crate) fn have_common_form(worlds: &[World]) -> Result<bool, Error> {
    let mut maps: Vec<DMatrix<f64>> = Vec::new();
    for world in worlds {
        let sampling = &world.sampling;
        let filters = Filter::of(sampling, sampling.period);
        let filter = filters.first().ok_or(Error::Eigenvalues { order: 0 })?;
        let map = closed_loop(&port(world)?, sampling, world.device.damping, filter, sampling.period)?;
        if maps.first().is_some_and(|first| first.nrows() != map.nrows()) {
            return Ok(false);
        }
        maps.push(map);
    }
    Ok(shrinks_under_all(&maps))
}

/// The puck of a world and what is tied to it.
fn port(world: &World) -> Result<Port, Error> {
    let inertia = inertias_with_puck(world)?;
    let terms = linearise_with_puck(&world.bodies, &world.couplings, &Slopes::Steep)?;
    let all = parts(&inertia, &terms);
    let part = all.first().ok_or(Error::Eigenvalues { order: 0 })?;
    Ok(Port::new(part)?.lagging(world.device.lag).with_handle(world.device.handle))
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

/// The system as its scenario `name` runs: at each station [`with_worst_pattern`].
///
/// # Errors
/// As [`worst_pattern`].
pub fn played<'a>(system: &'a System, name: &str) -> Result<Cow<'a, System>, Error> {
    let mut played = Cow::Borrowed(system);
    for (at, station) in system.stations.iter().enumerate() {
        let scenarios = &station.world.scenarios;
        let Some(index) = scenarios.iter().position(|scenario| scenario.name == name) else { continue };
        if let Cow::Owned(scenario) = with_worst_pattern(&station.world, &scenarios[index])? {
            played.to_mut().stations[at].world.scenarios[index] = scenario;
        }
    }
    Ok(played)
}

fn pattern(found: search::WorstPattern) -> Pattern {
    Pattern {
        intervals_s: found.steps.iter().map(|step| step.interval).collect(),
        delays_s: found.steps.iter().map(|step| step.delay).collect(),
        growth_per_s: found.growth_per_s,
    }
}

/// Even samples, as the file has them.
pub(crate) fn even(world: &World, growth: Option<f64>) -> Pattern {
    Pattern {
        intervals_s: vec![world.sampling.period],
        delays_s: vec![world.sampling.delay_s()],
        growth_per_s: growth.unwrap_or(0.0),
    }
}

/// The shortest interval of a search: a hundredth of the period where intervals are uneven, but none before the command has arrived.
fn shortest(sampling: &Sampling) -> f64 {
    if sampling.interval_max.is_none() { sampling.period } else { (0.01 * sampling.period).max(sampling.delay_s()) }
}

/// `work` on the maps of the loop, all its steps, the even one, and a norm that the even one shortens, where there is one. Nonlinear
/// couplings have their steepest slopes, FOAW its shortest window, the device the middle of its tolerances.
fn with_family<T>(
    world: &World,
    work: impl FnOnce(&Family<'_>, Cell, Step, Option<Norm>) -> Result<T, Error>,
) -> Result<T, Error> {
    let (sampling, device) = (&world.sampling, &world.device);
    let port = port(world)?;
    let filters = Filter::of(sampling, sampling.period);
    let filter = filters.first().ok_or(Error::Eigenvalues { order: 0 })?;
    let late = sampling.delay_max_s() > 0.0;
    let parts = ClosedLoop::new(&port, sampling, filter, sampling.period, usize::from(late))?;
    let family = Family::new(&parts, device.damping, &port, late && !port.is_uncoupled());
    let all = Cell {
        interval: [shortest(sampling), sampling.interval_max_s()],
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
    use hapt_testing::prelude::*;

    proptest! {
        #![proptest_config(hapt_testing::cases(128))]

        /// The basis of a proof: within a cell no map is farther from the mean of the corners than the bound.
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
