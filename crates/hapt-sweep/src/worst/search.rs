//! The search: by eigenvalues first, then by simulation.

use std::ops::ControlFlow;

use hapt_analysis::continuous::linearise;
use hapt_analysis::nelder_mead::maximise;
use hapt_analysis::{
    BreakingGrip, Grip, MARGINAL, Slopes, Status, WorstGrip, breaking_damping, free_growth, gripped_growth,
    quick_check, worst_grip,
};
use hapt_model::{End, Scenario, World};
use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

use super::drawn::{Drawn, drawn};
use super::hand::{Hand, targets};
use super::motion::HandMotion;
use super::moved::{best_motion_watched, grain, moved, work};

/// The largest and the smallest number of rows of a run, and its nominal duration in s.
const MAX_ROWS: f64 = 4_000.0;
const MIN_ROWS: f64 = 2_000.0;
const DURATION_S: f64 = 2.0;
/// The largest number of rows of the run that shows a hand, for fast runs, and for runs that friction or nonlinear laws slow down; the multiple of
/// the growth's time constant that shows a slow hand.
const SHOWN: [f64; 2] = [3e6, 2e5];
const GROWN: f64 = 12.0;

/// Masses over the device's inertia, and ωT, of the hands that are always tried.
const MASSES: [f64; 3] = [0.3, 3.0, 30.0];
const ANGLES: [f64; 4] = [0.01, 0.06, 0.35, 2.0];
/// The damping ratio of a hand's own oscillation.
const DAMPED: f64 = 0.01;
/// The closed and open times of a switching hand, over the period of its own oscillation.
const SWITCHED: [(f64, f64); 3] = [(0.25, 0.05), (0.25, 0.25), (0.5, 0.1)];
/// The range of a local search, as a logarithm.
const FAR: f64 = 5.0;
/// Springs of a hand to be kicked, over those at the puck.
const STIFFER: [f64; 4] = [1.0, 0.3, 0.1, 0.03];
/// The largest number of runs of one local search.
const MAX_CLIMB_RUNS: usize = 30;

/// Receives the number of hands tried by simulation so far, at most [`super::most_runs`]; `Break` ends the search.
pub type Watch<'a> = dyn Fn(usize) -> ControlFlow<()> + 'a;

/// The reason that the search has no result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The linear loop cannot be analysed.
    #[error("{0}")]
    Linear(#[from] hapt_analysis::Error),
    /// The world cannot be compiled.
    #[error("{0}")]
    Run(#[from] hapt_sim::Error),
    /// The watch ended it.
    #[error("the search was interrupted")]
    Interrupted,
}

/// The distance between the certificate and the worst hand, as device dampings in N·m·s/rad (linear: N·s/m).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gap {
    /// The damping that the certificate requires; `None`: no finite damping suffices.
    pub required_damping: Option<f64>,
    /// The largest damping at which a hand still makes the linear loop grow; `None`: none.
    pub breaking_damping: Option<f64>,
    /// The device's damping.
    pub device_damping: f64,
}

/// The worst hand found of a world.
#[derive(Clone, Debug, PartialEq)]
pub struct WorstOfWorld {
    /// Whether the world is certified, open or refuted.
    pub status: Status,
    /// The linear loop's worst hand, or one with nearly the same growth and a stronger initial kick, and the growth in 1/s; `None` where no tried
    /// hand makes the loop grow.
    pub linear: Option<WorstGrip>,
    /// The grip that drew most energy from the whole loop.
    pub hand: Hand,
    /// Where no grip drew energy in its run: the prescribed motion that did.
    pub motion: Option<HandMotion>,
    /// The energy that it drew.
    pub drawn: Drawn,
    /// Whether that exceeds rounding and a count of the encoder.
    pub drew: bool,
    /// The run that shows it, under the name `worst`.
    pub scenario: Scenario,
    /// Whether a hand draws energy: from the whole loop in a run, or by the growth of the linear loop, where the whole loop grows at large motions as
    /// the linear one does.
    pub broken: bool,
    /// The gap between the linear loop and the certificate.
    pub gap: Gap,
    /// The number of hands tried by simulation.
    pub runs: usize,
}

/// The form of `hapt worst --json`, in SI.
impl Serialize for WorstOfWorld {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Summary {
            trick: super::motion::Exploit,
            points: usize,
        }
        let motion = self.motion.as_ref().map(|motion| Summary { trick: motion.trick, points: motion.points.len() });
        let mut fields = to.serialize_struct("WorstOfWorld", 11)?;
        fields.serialize_field("broken", &self.broken)?;
        fields.serialize_field("certified", &self.is_certified())?;
        fields.serialize_field("status", &self.status)?;
        fields.serialize_field("linear", &self.linear)?;
        fields.serialize_field("hand", &self.hand)?;
        fields.serialize_field("motion", &motion)?;
        fields.serialize_field("drew", &self.drew)?;
        fields.serialize_field("drawn", &self.drawn)?;
        fields.serialize_field("duration_s", &self.scenario.duration)?;
        fields.serialize_field("gap", &self.gap)?;
        fields.serialize_field("runs", &self.runs)?;
        fields.end()
    }
}

impl WorstOfWorld {
    /// Whether the world is certified.
    pub fn is_certified(&self) -> bool {
        self.status == Status::Certified
    }
}

/// A hand tried.
#[derive(Clone, Copy, Debug)]
struct Tried {
    hand: Hand,
    target: f64,
    drawn: Drawn,
}

impl Tried {
    /// A gain ranks above any loss: by its energy, and by the time until the loop diverged. A loss ranks by its share of the exchanged
    /// energy, so that a run without motion does not rank best.
    fn height(&self, duration: f64, grain: f64) -> f64 {
        let Drawn { gain, end, until_s, moved, .. } = self.drawn;
        if self.drawn.is_gain(grain) {
            let early = (duration / until_s).max(1.0);
            1e3 + (gain.ln() + 60.0).max(0.0) * early
        } else {
            (end / moved.max(1e-6 * self.hand.energy())).clamp(-1.0, 0.0)
        }
    }
}

/// The runs of one world.
struct Trials<'w> {
    world: &'w World,
    duration: f64,
    grain: f64,
    runs: usize,
    best: Option<Tried>,
    watch: &'w Watch<'w>,
}

pub(super) fn go_on(watch: &Watch<'_>, runs: usize) -> Result<(), Error> {
    match watch(runs) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Error::Interrupted),
    }
}

impl Trials<'_> {
    fn run(&mut self, grip: Grip, target: f64, hold_and_open: Option<(f64, f64)>) -> Result<Tried, Error> {
        let hand = Hand::toward(self.world, grip, target, hold_and_open);
        let drawn = drawn(self.world, &hand.scenario("worst", self.duration, 0.0), hand.energy())?;
        self.runs += 1;
        go_on(self.watch, self.runs)?;
        let tried = Tried { hand, target, drawn };
        if self.best.is_none_or(|best| self.height(&tried) > self.height(&best)) {
            self.best = Some(tried);
        }
        Ok(tried)
    }

    fn height(&self, tried: &Tried) -> f64 {
        tried.height(self.duration, self.grain)
    }

    /// Climbs from a tried hand, over the logarithms of its numbers.
    fn maximise(&mut self, from: Tried) -> Result<(), Error> {
        let Grip { inertia, damping, stiffness } = from.hand.grip;
        let mut failed = None;
        let mut height =
            |trials: &mut Self, grip: Grip, switched: Option<(f64, f64)>| match trials.run(grip, from.target, switched)
            {
                Ok(tried) => trials.height(&tried),
                Err(error) => {
                    failed = Some(error);
                    f64::NEG_INFINITY
                }
            };
        // The damper relative to critical damping.
        let stops = 2.0 * (stiffness * (inertia + self.world.device.inertia)).sqrt();
        let grip = |x: &[f64]| Grip {
            inertia: inertia * x[0].clamp(-FAR, FAR).exp(),
            damping: damping + stops * x[1].clamp(0.0, 1.0),
            stiffness: stiffness * x[2].clamp(-FAR, FAR).exp(),
        };
        match from.hand.hold_and_open {
            None => {
                maximise([0.0; 3], [0.4, 0.02, 0.4], MAX_CLIMB_RUNS, |x| height(self, grip(x), None));
            }
            Some((hold, open)) => {
                let period = self.world.sampling.period;
                maximise([0.0; 5], [0.4, 0.02, 0.4, 0.2, 0.2], 2 * MAX_CLIMB_RUNS, |x| {
                    let of = |t: f64, x: f64| whole(t * x.clamp(-FAR, FAR).exp(), period);
                    height(self, grip(x), Some((of(hold, x[3]), of(open, x[4]))))
                });
            }
        }
        failed.map_or(Ok(()), Err)
    }
}

/// The time in whole samples, at least one: hands that switch at samples suffice, and their runs are fast.
fn whole(t: f64, period: f64) -> f64 {
    (t / period).round().max(1.0) * period
}

/// The stiffness at the puck, nonlinear couplings on their steepest rise.
pub(super) fn stiffness(world: &World) -> Result<f64, Error> {
    let ties = linearise(&world.bodies, &world.couplings, &Slopes::Steep)?;
    // An empty sum is -0, and a division by it would give -∞.
    Ok(ties.iter().filter(|t| t.first == End::Puck || t.second == End::Puck).fold(0.0, |sum, t| sum + t.stiffness))
}

/// Whether nothing makes a run slow: couplings are linear, without friction, counts and levels.
fn is_smooth(world: &World) -> bool {
    let device = &world.device;
    world.couplings.iter().all(|c| c.linear().is_some())
        && device.largest_friction() == 0.0
        && device.encoder.is_none()
        && device.levels.is_none()
}

/// Whether couplings and estimator are linear, so that the loop grows as the linear loop does: from any motion up to the motor's limit, or
/// with friction and counts from a large one.
fn grows_as_linear(world: &World) -> bool {
    let is_unlimited = world.device.limit.is_none() && world.safety.overspeed.is_none();
    world.couplings.iter().all(|c| c.linear().is_some())
        && world.sampling.has_linear_estimator()
        && (is_smooth(world) || is_unlimited)
}

/// The hand of the linear loop with the largest growth; a hand that releases, where that is the free loop.
fn growing(world: &World) -> Result<Option<WorstGrip>, Error> {
    let free = free_growth(world)?.filter(|growth| *growth > MARGINAL);
    let nothing = Grip { inertia: 0.0, damping: 0.0, stiffness: 0.0 };
    let free = free.map(|growth_per_s| WorstGrip { grip: nothing, growth_per_s });
    let found = worst_grip(world)?.into_iter().chain(free);
    Ok(found.max_by(|a, b| a.growth_per_s.total_cmp(&b.growth_per_s)))
}

/// The same hand with a stiffer spring, where that keeps half of the growth: a soft one excites mainly a slow oscillation of the whole
/// loop, and little the growing mode.
fn with_a_kick(world: &World, worst: WorstGrip, stiffness: f64) -> Result<WorstGrip, hapt_analysis::Error> {
    for part in STIFFER {
        let grip = Grip { stiffness: worst.grip.stiffness.max(part * stiffness), ..worst.grip };
        if let Some(growth) = gripped_growth(world, &grip)?.filter(|growth| *growth >= 0.5 * worst.growth_per_s) {
            return Ok(WorstGrip { grip, growth_per_s: growth });
        }
    }
    Ok(worst)
}

/// The largest number of hands that [`search_world`] tries by simulation: two of the linear loop and those of the grid at each target, a switching
/// one for each of the grid, and both local searches, each with the round that ends it.
///
/// # Errors
/// As [`search_world`].
pub fn most_runs_of_world(world: &World) -> Result<usize, Error> {
    let (targets, grid) = (targets(world, stiffness(world)?).len(), MASSES.len() * ANGLES.len());
    let climbs = 3 * MAX_CLIMB_RUNS + (3 + 1) + (5 + 1);
    Ok((2 + grid) * targets + grid + climbs)
}

/// Searches for the passive hand that draws most energy from a world's loop.
///
/// The linear loop's worst hand comes first; then hands of three masses on four springs, closed and switching, each kicked toward a few
/// places, on the exact simulation of the whole device; then a climb from the best of either kind. Where none of them draws energy, the
/// motion for which the motor's work on the linear loop is largest ([`super::work_motion`]), then motions against counts, levels, samples and
/// constant torques ([`HandMotion`]). Deterministic.
///
/// Work: about 250 runs of up to 12 000 samples, and the eigenvalues of [`breaking_damping`].
///
/// A spring held over each sample lags by half a period and so gives energy away, as a damper of -KT/2 would: some passive hand draws it
/// from a device with less damping.
///
/// ```
/// use hapt_model::{Source, World};
/// use hapt_sweep::worst::search_world;
///
/// let file = r#"
/// loop = { period = "1 ms", estimator = "difference" }
/// device = { inertia = "6.4e-4 kg m^2", damping = "1e-4 N m s/rad" }
/// [[couplings]]
/// kind = "spring"
/// between = ["puck", "ground"]
/// stiffness = "1 N m/rad"
/// "#;
/// let world = World::read(&Source::from_text("spring.toml", file), &[])?;
/// let worst = search_world(&world, &|_| std::ops::ControlFlow::Continue(()))?;
/// assert!(worst.status == hapt_analysis::Status::Refuted && worst.broken, "0.1 mN m s/rad, and KT/2 is 0.5");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`Error`].
pub fn search_world(world: &World, watch: &Watch<'_>) -> Result<WorstOfWorld, Error> {
    hapt_sim::check(world)?;
    let (linear, breaking) = (growing(world)?, breaking_damping(world)?);
    let check = quick_check(world)?;
    let period = world.sampling.period;
    let stiffness = stiffness(world)?;
    let targets = targets(world, stiffness);
    let duration = DURATION_S.clamp(MIN_ROWS * period, MAX_ROWS * period);
    let grain = grain(world, stiffness);
    let mut trials = Trials { world, duration, grain, runs: 0, best: None, watch };

    let mut held = Vec::new();
    let mut switched = Vec::new();
    let linear = linear.map(|worst| with_a_kick(world, worst, stiffness)).transpose()?;
    let named = [linear.map(|w| w.grip), breaking.map(|b: BreakingGrip| b.grip)];
    for grip in named.into_iter().flatten() {
        let grip = Grip { inertia: grip.inertia.max(1e-3 * world.device.inertia), ..grip };
        for &target in &targets {
            held.push(trials.run(grip, target, None)?);
        }
    }
    for mass in MASSES {
        for angle in ANGLES {
            let inertia = mass * world.device.inertia;
            let (total, omega) = (inertia + world.device.inertia, angle / period);
            let stiffness = total * omega * omega;
            let grip = Grip { inertia, damping: 2.0 * DAMPED * total * omega, stiffness };
            let swing = std::f64::consts::TAU / omega;
            for &target in &targets {
                held.push(trials.run(grip, target, None)?);
            }
            // One number after the other.
            let ((hold, open), target) =
                (SWITCHED[switched.len() % SWITCHED.len()], targets[switched.len() % targets.len()]);
            let times = (whole(hold * swing, period), whole(open * swing, period));
            switched.push(trials.run(grip, target, Some(times))?);
        }
    }
    for tried in [&held, &switched] {
        let best = tried.iter().copied().max_by(|a, b| trials.height(a).total_cmp(&trials.height(b)));
        if let Some(best) = best {
            trials.maximise(best)?;
        }
    }

    let Trials { mut runs, best, .. } = trials;
    let gains = |tried: &Tried| tried.drawn.is_gain(grain);
    let mut shown = Vec::new();
    let longest = period * SHOWN[usize::from(!is_smooth(world))];
    // The linear loop's hand, in a run long enough to show its growth; where none grows, the one nearest to growth.
    if let Some(first) = held.first() {
        let length = linear.map_or(duration, |w| (GROWN / w.growth_per_s).clamp(duration, longest.max(duration)));
        shown.push(show(world, first.hand, (length / period).round() * period)?);
    }
    if let Some(best) = best.filter(gains) {
        shown.push(show(world, best.hand, 8.0 * duration)?);
    }
    let more = |a: &ShownHand, b: &ShownHand| a.drawn.gain.total_cmp(&b.drawn.gain);
    // Three masses are always tried.
    let Some(ShownHand { hand, scenario, drawn }) = shown.into_iter().max_by(more) else {
        return Err(Error::Linear(hapt_analysis::Error::Eigenvalues { order: 0 }));
    };
    let (mut scenario, mut drawn, mut motion) = (scenario, drawn, None);
    let mut drew = drawn.is_gain(grain);
    if !drew && let Some(found) = work(world, watch, &mut runs)? {
        (scenario, drawn, motion, drew) = (found.scenario, found.drawn, Some(found.motion), true);
    }
    if !drew {
        let (found, tried) = best_motion_watched(world, moved(world, stiffness), &|tried| watch(runs + tried))?;
        runs += tried;
        if let Some(found) = found {
            (scenario, drawn, motion, drew) = (found.scenario, found.drawn, Some(found.motion), true);
        }
    }
    let broken = drew || (linear.is_some() && grows_as_linear(world));
    Ok(WorstOfWorld {
        status: check.status,
        linear,
        hand,
        motion,
        drawn,
        drew,
        scenario,
        broken,
        gap: Gap {
            required_damping: check.passivity.required_damping,
            breaking_damping: breaking.map(|b| b.damping),
            device_damping: world.device.damping,
        },
        runs,
    })
}

/// A hand, and the run that shows it.
struct ShownHand {
    hand: Hand,
    scenario: Scenario,
    drawn: Drawn,
}

/// A run of `length`, or until the loop diverges.
fn show(world: &World, hand: Hand, length: f64) -> Result<ShownHand, Error> {
    let drawn = drawn(world, &hand.scenario("worst", length, 0.0), hand.energy())?;
    let scenario = hand.scenario("worst", drawn.shown_s(length, world.sampling.period), 0.0);
    Ok(ShownHand { hand, scenario, drawn })
}
