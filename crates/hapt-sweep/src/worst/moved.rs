//! Prescribed motions that draw energy: the one for which the motor's work is largest, and those against counts, levels and samples.

use std::ops::ControlFlow;

use hapt_model::{Scenario, World};

use super::drawn::{Drawn, drawn};
use super::form::work_motion;
use super::hand::{reach, targets};
use super::motion::{Exploit, HandMotion, motions};
use super::search::{Error, Watch, go_on, stiffness};

/// Samples of a prescribed motion: the smallest and the largest number, and the number of half periods of the slowest body coupled to the puck.
const MOVED: [f64; 3] = [2e4, 2e5, 80.0];
/// The file of a motion, in the scenario that shows it.
pub const FILE: &str = "worst.csv";

/// The numbers of samples of the motion with the largest work of the motor, without bodies and with bodies, whose oscillations last longer.
const WORKED: [&[usize]; 2] = [&[100, 300, 1_000], &[300, 3_000]];
/// The numbers of repetitions, and the largest number of all samples: each repetition draws more, and the first supplies the puck's kinetic energy.
const REPETITIONS: [usize; 3] = [4, 16, 64];
const MAX_WORKED_SAMPLES: usize = 200_000;
/// The sizes of the motion: friction dissipates a smaller part of the work of a larger motion.
const SIZES: [f64; 2] = [1.0, 30.0];

/// The number of samples of a prescribed motion.
pub(super) fn moved(world: &World, stiffness: f64) -> usize {
    let heaviest = world.bodies.iter().map(|body| body.inertia).fold(0.0, f64::max);
    let swing = std::f64::consts::PI * (heaviest / stiffness.max(f64::MIN_POSITIVE)).sqrt() / world.sampling.period;
    let [fewest, most, swings] = MOVED;
    (swings * swing).clamp(fewest, most) as usize
}

/// A prescribed motion that draws energy.
#[derive(Clone, Debug, PartialEq)]
pub struct Moved {
    /// The motion.
    pub motion: HandMotion,
    /// The run that shows it, under the name `worst`, its path the file [`FILE`].
    pub scenario: Scenario,
    /// The energy that it drew.
    pub drawn: Drawn,
}

/// The prescribed motion of at most `samples` samples that draws most energy, if any does; and the number of tried ones.
///
/// # Errors
/// [`Error`].
pub fn best_motion(world: &World, samples: usize) -> Result<(Option<Moved>, usize), Error> {
    best_motion_watched(world, samples, &|_| ControlFlow::Continue(()))
}

/// As [`best_motion`]; `watch` receives the number of tried motions.
pub(super) fn best_motion_watched(
    world: &World,
    samples: usize,
    watch: &Watch<'_>,
) -> Result<(Option<Moved>, usize), Error> {
    let stiffness = stiffness(world)?;
    let period = world.sampling.period;
    let length = samples as f64 * period;
    let all = motions(world, &targets(world, stiffness), samples)?;
    let tried = all.len();
    let mut best: Option<Moved> = None;
    for (i, motion) in all.into_iter().enumerate() {
        go_on(watch, i)?;
        let scenario = motion.scenario("worst", FILE, length);
        // The energy of the motion's amplitude, of which a million times ends the run.
        let had = (stiffness + world.device.damping / period) * motion.reach().powi(2);
        let drawn = drawn(world, &scenario, had)?;
        let gains = drawn.is_gain(4.0 * grain(world, stiffness));
        if gains && best.as_ref().is_none_or(|best| drawn.gain > best.drawn.gain) {
            let scenario = motion.scenario("worst", FILE, drawn.shown_s(length, period));
            best = Some(Moved { motion, scenario, drawn });
        }
    }
    Ok((best, tried))
}

/// The motion for which the motor's work on the linear loop is largest, repeated until a run shows that it draws energy; `None` where the
/// device has the damping that it requires, or no run shows it.
///
/// # Errors
/// [`Error`].
pub(super) fn work(world: &World, watch: &Watch<'_>, runs: &mut usize) -> Result<Option<Moved>, Error> {
    let stiffness = stiffness(world)?;
    let lengths = WORKED[usize::from(!world.bodies.is_empty())].iter();
    let found = lengths.filter_map(|samples| work_motion(world, *samples).map(|motion| (*samples, motion)));
    let mut found: Vec<_> = found.filter(|(_, motion)| motion.demand > world.device.damping).collect();
    // In the order of the required damping, the largest first.
    found.sort_by(|a, b| b.1.demand.total_cmp(&a.1.demand));
    for (samples, motion) in found {
        let whole = reach(world, stiffness) / motion.reach();
        let is_rough = world.device.largest_friction() > 0.0 || world.device.encoder.is_some();
        let sizes = if is_rough && world.device.limit.is_none() { &SIZES[..] } else { &SIZES[..1] };
        for (repetitions, size) in REPETITIONS.iter().flat_map(|n| sizes.iter().map(move |size| (*n, size * whole))) {
            if repetitions * samples > MAX_WORKED_SAMPLES || !size.is_finite() {
                continue;
            }
            let points = motion.points(repetitions, size);
            let moves = HandMotion { trick: Exploit::Work, points, timing: motion.timing(world) };
            let length = repetitions as f64 * motion.duration();
            let scenario =
                moves.scenario("worst", FILE, (length / world.sampling.period).round() * world.sampling.period);
            let had = (stiffness + world.device.damping / world.sampling.period) * moves.reach().powi(2);
            let drawn = drawn(world, &scenario, had)?;
            *runs += 1;
            go_on(watch, *runs)?;
            if drawn.is_gain(4.0 * grain(world, stiffness)) {
                return Ok(Some(Moved { motion: moves, scenario, drawn }));
            }
        }
    }
    Ok(None)
}

/// The energy of a count, J.
pub(super) fn grain(world: &World, stiffness: f64) -> f64 {
    world.count().map_or(0.0, |count| 0.5 * stiffness * count * count)
}
