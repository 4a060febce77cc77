//! The passive hand with the largest growth of the loop: a mass on a spring.
//!
//! Where the loop is not passive at some frequency, a passive hand that oscillates there extracts energy (Colgate and Schenkel,
//! J. Robotic Systems 14(1), 1997). The simplest is a mass on a spring. With it on the puck the loop is again one linear map,
//! whose eigenvalues decide exactly, without simulation.
//!
//! A heavy hand shows how close the family comes to the certificate. It moves the puck along a sine of frequency ω, so that only the
//! fundamental of the held torque does work. Without delay the motion grows where the device damping is below
//!
//! ```text
//! (sin(ωT/2)/(ωT/2))² m(ω),    m the required damping at ω
//! ```
//!
//! A virtual spring requires the same damping at every frequency, so a heavy slow hand destabilises it almost up to the certificate.
//! Where the requirement is largest at Nyquist, the worst hand oscillates exactly there, with a sample at each peak. Its sine
//! dissipates b A² π²/2T per sample, uniform motion 4 b A²/T: such a hand reaches 8/π² of the certificate, and no hand of one mode is
//! known to reach more. A damper of the hand acts as device damping, so the search omits it.

use std::f64::consts::{PI, TAU};

use hapt_model::World;
use serde::Serialize;

use crate::equations::continuous::{Slopes, of_step};
use crate::equations::estimator::Filter;
use crate::equations::grip::Grip;
use crate::equations::port::Port;
use crate::equations::slopes::at_puck;
use crate::equations::structure::{Part, inertias_with_puck, linearise_with_puck, parts};
use crate::error::{Error, positive};
use crate::numerics::nelder_mead::maximise;
use crate::passivity::required::{Cause, requirement};
use crate::stability::MARGINAL;
use crate::stability::free::{multipliers, without_shifts};

/// The worst hand and its growth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WorstGrip {
    /// The hand.
    pub grip: Grip,
    /// Of the loop with the hand on the puck, in 1/s.
    pub growth_per_s: f64,
}

/// Masses of the grid, over the device inertia. Heavy hands come closest to the certificate and grow slowest.
const MASSES: [f64; 7] = [0.0, 0.5, 2.0, 10.0, 60.0, 500.0, 5000.0];
/// Largest mass of the search, over the device inertia.
const MAX_MASS: f64 = 2e4;
/// Least stiffness of the hand, over that of the springs at the puck.
const MIN_STIFFNESS: f64 = 0.01;
/// Number of frequencies of the grid, ωT from [`MIN_ANGLE`] to beyond Nyquist.
const FREQUENCIES: usize = 16;
const MIN_ANGLE: f64 = 2e-3;
const MAX_ANGLE: f64 = 1.5 * PI;
/// Factors on the frequency of the largest required damping.
const NEAR_PEAK: [f64; 9] = [0.9, 0.97, 0.99, 0.999, 1.0, 1.001, 1.01, 1.03, 1.1];
/// Upper end of the search for a breaking damping where the required damping is infinite, over the device damping.
pub const MAX_RATIO: f64 = 1e6;
/// Largest number of rounds of the search for a breaking damping, and its relative step.
const ROUNDS: usize = 8;
const STEP: f64 = 1e-4;
/// Evaluations of one maximisation.
const EVALUATIONS: usize = 50;

/// The ports of a world, with all nonlinear couplings steep and with all flat.
struct GripSearch {
    world: World,
    ports: Vec<Port>,
    filters: Vec<Filter>,
    /// All springs at the puck.
    stiffness: f64,
}

/// A hand with its growth.
#[derive(Clone, Copy, Debug)]
struct Trial {
    grip: Grip,
    growth: f64,
    /// The device damping that would just suppress the growth, less the present one, N·m·s/rad: below 0 for a hand that decays.
    excess: f64,
}

impl Trial {
    /// The objective of the search: growing hands rank above decaying ones.
    fn score(&self) -> f64 {
        if self.growth >= MARGINAL { 1.0 + self.growth.ln_1p() } else { self.excess.min(0.0) }
    }
}

impl GripSearch {
    fn new(world: &World) -> Result<GripSearch, Error> {
        let inertia = inertias_with_puck(world)?;
        positive("the period", world.sampling.period)?;
        let couplings = of_step(&world.couplings, &world.sampling);
        let mut known: Vec<Part> = Vec::new();
        for slopes in [Slopes::Steep, Slopes::Flat] {
            let parts = parts(&inertia, &linearise_with_puck(&world.bodies, &couplings, &slopes)?);
            if let Some(part) = parts.into_iter().next().filter(|part| !known.contains(part)) {
                known.push(part);
            }
        }
        let ports: Vec<Port> = known
            .iter()
            .map(|part| Ok(Port::new(part)?.lagging(world.device.lag).with_handle(world.device.handle)))
            .collect::<Result<_, Error>>()?;
        // A port without couplings gives no energy.
        let ports = ports.into_iter().filter(|port| !port.is_uncoupled()).collect();
        let [stiffness, _] = at_puck(world, &world.couplings)?;
        Ok(GripSearch {
            world: world.clone(),
            filters: Filter::of(&world.sampling, world.sampling.period),
            ports,
            stiffness,
        })
    }

    /// The growth in 1/s of the modes at the puck. Shifts and uniform motions are neutral and are omitted, because they would hide
    /// decaying modes.
    fn growth(&self, device: f64, grip: &Grip) -> Result<f64, Error> {
        let sampling = &self.world.sampling;
        let period = sampling.step();
        let mut most = f64::NEG_INFINITY;
        for port in &self.ports {
            let (port, damping) = port.clone().gripped(device, grip);
            for filter in &self.filters {
                let found = multipliers(&port, sampling, damping, filter, sampling.period)?;
                let found = without_shifts(found.into_iter().map(|(m, _)| m).collect(), port.shifts, period, MARGINAL);
                let moves = |g: f64, arg: f64| g >= MARGINAL || arg.abs() > 1e-7;
                let growths = found.iter().map(|m| (m.growth(period), m.arg())).filter(|&(g, arg)| moves(g, arg));
                most = growths.map(|(g, _)| g).fold(most, f64::max);
                if !port.takes_velocity() {
                    break;
                }
            }
        }
        Ok(most)
    }

    fn trial(&self, grip: Grip) -> Trial {
        let device = &self.world.device;
        let growth = self.growth(device.damping, &grip).unwrap_or(f64::NEG_INFINITY);
        let excess = if growth >= MARGINAL || growth == f64::NEG_INFINITY {
            growth
        } else {
            // One Newton step with a numerical derivative.
            let step = 1e-3 * (device.damping + 1e-3 * device.inertia / self.world.sampling.period);
            let more = self.growth(device.damping + step, &grip).unwrap_or(growth);
            growth * step / ((growth - more).abs() + 1e-12)
        };
        Trial { grip, growth, excess }
    }

    /// A hand of `mass` over the device inertia that oscillates at ωT by itself, or slightly faster.
    fn hand(&self, mass: f64, angle: f64) -> Grip {
        let inertia = self.world.device.inertia;
        let omega = angle / self.world.sampling.period;
        let swings = (1.0 + mass) * inertia * omega * omega;
        Grip { inertia: mass * inertia, damping: 0.0, stiffness: swings.max(MIN_STIFFNESS * self.stiffness) }
    }

    /// The frequencies of the grid, as ωT.
    fn angles(&self) -> Result<Vec<f64>, Error> {
        let ratio = MAX_ANGLE / MIN_ANGLE;
        let mut angles: Vec<f64> =
            (0..FREQUENCIES).map(|i| MIN_ANGLE * ratio.powf(i as f64 / (FREQUENCIES - 1) as f64)).collect();
        let requirement = requirement(&self.world, &self.world.couplings)?;
        let hz = match requirement.damping {
            Err(Cause::Grows { hz }) => Some(hz),
            _ => requirement.at_hz,
        };
        if let Some(hz) = hz.filter(|hz| *hz > 0.0) {
            angles.extend(NEAR_PEAK.map(|ratio| ratio * hz * TAU * self.world.sampling.period));
        }
        Ok(angles)
    }

    /// The local maximum from a hand, over mass and frequency.
    fn maximise(&self, from: &Grip) -> Trial {
        let inertia = self.world.device.inertia;
        let total = inertia + from.inertia;
        let rate = (from.stiffness / total).sqrt() * self.world.sampling.period;
        // The search is in logarithms: a hand without mass starts with a small one.
        let start = [(from.inertia / inertia).max(1e-2).ln(), rate.max(0.1 * MIN_ANGLE).ln()];
        let mut best = self.trial(*from);
        maximise(start, [0.6, 0.25], EVALUATIONS, |&[mass, angle]| {
            let trial = self.trial(self.hand(mass.exp().clamp(1e-3, MAX_MASS), angle.exp().min(TAU)));
            if trial.score() > best.score() {
                best = trial;
            }
            trial.score()
        });
        best
    }

    /// The hand with the largest score.
    fn worst(&self) -> Result<Option<Trial>, Error> {
        if self.ports.is_empty() {
            return Ok(None);
        }
        let mut all: Vec<Trial> = Vec::new();
        for angle in self.angles()? {
            all.extend(MASSES.map(|mass| self.trial(self.hand(mass, angle))));
        }
        all.sort_by(|a, b| b.score().total_cmp(&a.score()));
        // Start from the best, and from the best at another frequency.
        let angle = |trial: &Trial| trial.grip.stiffness / (self.world.device.inertia + trial.grip.inertia);
        let Some(first) = all.first().copied() else { return Ok(None) };
        let apart = |trial: &&Trial| !(0.5..2.0).contains(&(angle(trial) / angle(&first)));
        let starts = [Some(first), all.iter().find(apart).copied()];
        let best = starts.iter().flatten().map(|trial| self.maximise(&trial.grip)).chain([first]);
        Ok(best.max_by(|a, b| a.score().total_cmp(&b.score())))
    }
}

/// The passive hand of mass and spring with the largest growth; `None` when no hand of the search grows by [`MARGINAL`] or more.
///
/// Nonlinear couplings are all at their steepest slope or all flat; limit, levels, encoder and Coulomb friction are omitted. Masses up
/// to 2e4 times the device inertia, frequencies up to twice Nyquist: a grid, then a local maximisation. Deterministic.
///
/// Work: some 300 eigenvalue problems of the puck's own modes, memory and commands in flight.
///
/// # Errors
/// As [`crate::passivity()`].
pub fn worst_grip(world: &World) -> Result<Option<WorstGrip>, Error> {
    let worst = GripSearch::new(world)?.worst()?;
    Ok(worst.filter(|w| w.growth >= MARGINAL).map(|w| WorstGrip { grip: w.grip, growth_per_s: w.growth }))
}

/// A hand, and the largest device damping at which the loop grows with it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BreakingGrip {
    /// The hand.
    pub grip: Grip,
    /// N·m·s/rad (linear: N·s/m).
    pub damping: f64,
}

/// The largest device damping at which the loop still grows with a hand of the family of [`worst_grip`], as found by the search;
/// `None` if it grows with none. Where the required damping is infinite, the search ends at [`MAX_RATIO`] times the device's.
///
/// Each round finds the damping at which the growth of the present hand ends, and there searches for a worse hand.
///
/// Work: some five of [`worst_grip`].
///
/// # Errors
/// As [`worst_grip`].
pub fn breaking_damping(world: &World) -> Result<Option<BreakingGrip>, Error> {
    let mut search = GripSearch::new(world)?;
    let mut at = |damping: f64| -> Result<Option<Grip>, Error> {
        search.world.device.damping = damping;
        Ok(search.worst()?.filter(|w| w.growth >= MARGINAL).map(|w| w.grip))
    };
    let own = world.device.damping;
    let scale = own.max(1e-6 * world.device.inertia / world.sampling.period);
    let most = requirement(world, &world.couplings)?.damping.unwrap_or(MAX_RATIO * scale).max(own);
    // If no hand grows at the device damping, start from 0.
    let (mut damping, mut found) = (own, at(own)?);
    if found.is_none() {
        (damping, found) = (0.0, at(0.0)?);
    }
    let mut breaking = None;
    for _ in 0..ROUNDS {
        let Some(grip) = found else { break };
        damping = last_growth(world, &grip, damping, most)?;
        breaking = Some(BreakingGrip { grip, damping });
        if damping >= most {
            break;
        }
        damping = (damping * (1.0 + STEP)).max(1e-9 * scale);
        found = at(damping)?;
    }
    Ok(breaking)
}

/// The largest damping between `low`, where the loop grows with the hand, and `high` at which it still grows.
fn last_growth(world: &World, grip: &Grip, mut low: f64, mut high: f64) -> Result<f64, Error> {
    let search = GripSearch::new(world)?;
    let grows = |damping: f64| Ok::<bool, Error>(search.growth(damping, grip)? >= MARGINAL);
    if grows(high)? {
        return Ok(high);
    }
    while high - low > 0.1 * STEP * high {
        // Geometric means while the bounds are far apart.
        let middle = match low {
            _ if low > 0.0 && high > 4.0 * low => (low * high).sqrt(),
            _ => 0.5 * (low + high),
        };
        if grows(middle)? {
            low = middle
        } else {
            high = middle
        }
        if high < 1e-12 * world.device.inertia / world.sampling.period {
            break;
        }
    }
    Ok(low)
}
