//! The motion of the puck that draws most energy from a linear loop, with the pattern of intervals and delays for it.
//!
//! The puck moves uniformly over each part of an interval, by x. The motor's work is a quadratic form of x, the device dissipates Σ b x²/part. So
//! the damping that a pattern requires is the largest eigenvalue of the first form relative to the second (Lanczos). The world's torques are
//! those of the real core, and since a loop at rest is time-invariant, the transposed form is evaluated with the core in reversed time. For the
//! motion found each delay then takes the length that maximises the energy drawn, and both steps alternate.
//!
//! The real core on the exact device tests the result: the motion returns to its start and is repeated. A loop that gives energy in each
//! repetition is not passive.

use hapt_core::spec::Range;
use hapt_model::{Drive, EstimatorKind, Hand, Scenario, Shape, Timing, World};
use hapt_sim::{DesktopLoop, Simulation};
use nalgebra::DMatrix;

/// Parts of an interval before and after the command arrives, of a motor that lags.
const PARTS: usize = 4;
/// Dimensions of the space that is searched for an eigenvector.
const LANCZOS: usize = 40;
/// The number of alternations between motion and pattern.
const TURNS: usize = 6;
/// An alternation that raises the required damping by less than this part is the last.
const SETTLED: f64 = 1e-4;
/// Repetitions of a motion; the first supplies the puck's kinetic energy, and is not counted.
const REPEATED: usize = 4;
/// A delay is a whole number of samples up to this part of one.
const WHOLE: f64 = 1e-6;

/// The delay and the interval after a sample, s.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Step {
    interval: f64,
    delay: f64,
}

/// A motion over some samples, with its pattern.
#[derive(Clone, Debug)]
pub struct WorkMotion {
    /// The damping of the device up to which it draws energy, N·m·s/rad.
    pub demand: f64,
    steps: Vec<Step>,
    /// The lengths in s and the displacements in rad of the parts, in their order.
    parts: Vec<(f64, f64)>,
}

/// The loop as a linear map from the displacements of the parts to the motor's mean torques over them.
struct Form<'a> {
    core: &'a DesktopLoop,
    lag: f64,
    /// The number of whole samples by which every command is delayed, in addition to the delays of the steps.
    whole: usize,
    steps: Vec<Step>,
    /// Of each part: its sample, its length in s, and whether the command of the sample has arrived.
    parts: Vec<(usize, f64, bool)>,
}

impl<'a> Form<'a> {
    fn new(core: &'a DesktopLoop, lag: f64, whole: usize, steps: Vec<Step>) -> Self {
        let mut parts = Vec::new();
        for (k, step) in steps.iter().enumerate() {
            for (length, arrived) in [(step.delay, false), (step.interval - step.delay, true)] {
                let count = if lag > 0.0 { PARTS } else { 1 };
                // Finer where the curvature of the lagged torque is largest.
                let at = |i: usize| length * (i as f64 / count as f64).powi(2);
                parts.extend((0..count).map(|i| (k, at(i + 1) - at(i), arrived)).filter(|part| part.1 > 0.0));
            }
        }
        Form { core, lag, whole, steps, parts }
    }

    /// The torques of the real core at the samples, from rest.
    fn torques(&self, positions: impl Iterator<Item = f64>) -> Vec<f64> {
        let mut state = self.core.start();
        // The first sample initialises the estimators.
        self.core.step(&mut state, 0.0, 0.0);
        positions.map(|z| self.core.step(&mut state, z, 0.0).torque).collect()
    }

    /// The positions at the samples.
    fn positions(&self, travels: &[f64]) -> Vec<f64> {
        let mut positions = vec![0.0; self.steps.len() + 1];
        for ((k, ..), travel) in self.parts.iter().zip(travels) {
            positions[k + 1] += travel;
        }
        for k in 1..positions.len() {
            positions[k] += positions[k - 1];
        }
        positions.pop();
        positions
    }

    /// The sample whose command acts on a part; `None`: one before the first.
    fn acting(&self, k: usize, arrived: bool) -> Option<usize> {
        k.checked_sub(self.whole + usize::from(!arrived))
    }

    /// The parts of a torque at the start of a part that remain in its mean and at its end.
    fn kept(&self, length: f64) -> [f64; 2] {
        if self.lag > 0.0 {
            let x = length / self.lag;
            [-(-x).exp_m1() / x, (-x).exp()]
        } else {
            [0.0, 0.0]
        }
    }

    /// The mean torques over the parts.
    fn means(&self, commands: &[f64]) -> Vec<f64> {
        let mut motor = 0.0;
        let mean = |&(k, length, arrived): &(usize, f64, bool)| {
            let target = self.acting(k, arrived).map_or(0.0, |k| commands[k]);
            let [mean, end] = self.kept(length);
            let found = target + (motor - target) * mean;
            motor = target + (motor - target) * end;
            found
        };
        self.parts.iter().map(mean).collect()
    }

    /// The symmetric part of the form, times `travels`.
    fn times(&self, travels: &[f64]) -> Vec<f64> {
        let mut forces = self.means(&self.torques(self.positions(travels).into_iter()));
        // The transposed map: from displacements to the work of each command, and back through the core.
        let mut commands = vec![0.0; self.steps.len()];
        let mut motor = 0.0;
        for (&(k, length, arrived), travel) in self.parts.iter().zip(travels).rev() {
            let [mean, end] = self.kept(length);
            let share = travel * (1.0 - mean) + motor * (1.0 - end);
            motor = travel * mean + motor * end;
            if let Some(k) = self.acting(k, arrived) {
                commands[k] += share;
            }
        }
        let mut back = self.torques(commands.into_iter().rev());
        back.reverse();
        // The contribution of each displacement to all later positions.
        let mut later = vec![0.0; back.len() + 1];
        for k in (0..back.len()).rev() {
            later[k] = later[k + 1] + back[k];
        }
        for ((k, ..), force) in self.parts.iter().zip(&mut forces) {
            *force = 0.5 * (*force + later[k + 1]);
        }
        forces
    }

    /// The motion that returns to its start and requires the largest damping.
    fn worst(&self, from: Option<&[f64]>) -> WorkMotion {
        let root: Vec<f64> = self.parts.iter().map(|part| part.1.sqrt()).collect();
        let total: f64 = self.parts.iter().map(|part| part.1).sum();
        let returning = |y: &mut [f64]| {
            let over = dot(y, &root) / total;
            y.iter_mut().zip(&root).for_each(|(y, root)| *y -= over * root);
        };
        let mut start: Vec<f64> = match from {
            Some(travels) => travels.iter().zip(&root).map(|(travel, root)| travel / root).collect(),
            // A fixed start with slow and fast components: Knuth's linear congruential numbers, from -0.2 to 0.8.
            None => {
                let mut state = 1u64;
                let mut next = || {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    (state >> 11) as f64 / (1u64 << 53) as f64
                };
                root.iter().map(|root| root * (next() - 0.2)).collect()
            }
        };
        returning(&mut start);
        let mut basis: Vec<Vec<f64>> = vec![scaled(&start, 1.0 / dot(&start, &start).sqrt())];
        let (mut diagonal, mut off_diagonal) = (Vec::new(), Vec::new());
        for i in 0..LANCZOS {
            let travels: Vec<f64> = basis[i].iter().zip(&root).map(|(y, root)| y * root).collect();
            let mut next: Vec<f64> = self.times(&travels).iter().zip(&root).map(|(force, root)| force * root).collect();
            returning(&mut next);
            diagonal.push(dot(&next, &basis[i]));
            for _ in 0..2 {
                for old in &basis {
                    let along = dot(&next, old);
                    next.iter_mut().zip(old).for_each(|(next, old)| *next -= along * old);
                }
                returning(&mut next);
            }
            let size = dot(&next, &next).sqrt();
            if i + 1 == LANCZOS || size <= 1e-9 * dot(&diagonal, &diagonal).sqrt() || !size.is_finite() {
                break;
            }
            off_diagonal.push(size);
            basis.push(scaled(&next, 1.0 / size));
        }
        let small = DMatrix::from_fn(diagonal.len(), diagonal.len(), |i, j| match i.abs_diff(j) {
            0 => diagonal[i],
            1 => off_diagonal[i.min(j)],
            _ => 0.0,
        });
        let eigen = small.symmetric_eigen();
        let most = eigen.eigenvalues.imax();
        let mut motion = vec![0.0; root.len()];
        for (vector, weight) in basis.iter().zip(eigen.eigenvectors.column(most).iter()) {
            motion.iter_mut().zip(vector).for_each(|(sum, y)| *sum += weight * y);
        }
        let travels: Vec<f64> = root.iter().zip(&motion).map(|(root, y)| y * root).collect();
        // The computed work in place of the eigenvalue, which rounding may increase.
        let work = dot(&self.means(&self.torques(self.positions(&travels).into_iter())), &travels);
        let parts: Vec<(f64, f64)> = self.parts.iter().zip(travels).map(|(part, travel)| (part.1, travel)).collect();
        let lost: f64 = parts.iter().map(|(length, travel)| travel * travel / length).sum();
        WorkMotion { demand: work / lost, steps: self.steps.clone(), parts }
    }

    /// The delays that maximise the energy of this motion: -u d δ/L + u² d (L - d)/(4 b L), u the change of the command and δ the displacement of the interval.
    fn delays(&self, motion: &WorkMotion, [least, largest]: [f64; 2]) -> Vec<Step> {
        let travels: Vec<f64> = motion.parts.iter().map(|part| part.1).collect();
        let mut positions = self.positions(&travels);
        let commands = self.torques(positions.clone().into_iter());
        positions.push(0.0);
        let step = |(k, step): (usize, &Step)| {
            let change = commands[k] - k.checked_sub(1).map_or(0.0, |k| commands[k]);
            let travel = positions[k + 1] - positions[k];
            let best = 0.5 * step.interval - 2.0 * motion.demand * travel / change;
            Step { delay: if best.is_finite() { best.clamp(least, largest) } else { step.delay }, ..*step }
        };
        self.steps.iter().enumerate().map(step).collect()
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn scaled(a: &[f64], factor: f64) -> Vec<f64> {
    a.iter().map(|a| a * factor).collect()
}

/// The loop whose work is a quadratic form: it moves about 0, where nothing is stored. `None` where it is not linear, where bodies step at
/// every n-th sample, or where the hand is at a handle and not at the motor.
fn about_rest(world: &World) -> Option<World> {
    let sampling = &world.sampling;
    let is_linear = world.couplings.iter().all(|c| c.linear().is_some());
    if !is_linear || !sampling.has_linear_estimator() || sampling.bodies_every > 1 || world.device.handle.is_some() {
        return None;
    }
    let mut rest = world.clone();
    // The velocity by difference: the effects of an exact velocity are found by motions of another kind.
    if sampling.estimator == EstimatorKind::Exact {
        (rest.sampling.estimator, rest.sampling.every) = (EstimatorKind::Difference, 1);
    }
    (rest.device.encoder, rest.device.levels, rest.device.limit) = (None, None, None);
    for body in &mut rest.bodies {
        (body.position, body.velocity) = (0.0, 0.0);
    }
    // Of the laws of a linear world a number of any sign is where one is slack, or a constant torque.
    for quantity in rest.couplings.iter_mut().flat_map(|c| c.law.quantities()) {
        if quantity.range == Range::Any {
            *quantity.value = 0.0;
        }
    }
    Some(rest)
}

/// The motion over `samples` samples that draws most, found for a linear world without a handle; `None` for other worlds, or where the core
/// refuses the world.
pub fn work_motion(world: &World, samples: usize) -> Option<WorkMotion> {
    let rest = about_rest(world)?;
    let core = DesktopLoop::new(&rest.spec()).ok()?;
    let (sampling, lag) = (&world.sampling, world.device.lag);
    let (longest, shortest) = (sampling.interval_max_s(), sampling.interval_min_s());
    let bounds = [sampling.delay_s(), sampling.delay_max_s()];
    let [least, largest] = bounds;
    // Whole samples of delay are separate; with varying intervals or delays only a delay within the sample is analysed.
    let is_even = longest == shortest && least == largest;
    let whole = if is_even { (least / longest + WHOLE).floor() } else { 0.0 };
    if largest > sampling.period && !is_even {
        return None;
    }
    let long = |delay: f64| Step { interval: longest, delay: (delay - whole * longest).max(0.0) };
    let whole = whole as usize;
    let mut patterns = vec![vec![long(largest)]];
    if least < largest {
        patterns.extend([vec![long(least)], vec![long(largest), long(least)]]);
    }
    if lag > 0.0 {
        patterns.push(vec![long(largest), Step { interval: shortest.max(largest), delay: largest }]);
    }
    let form = |pattern: &[Step]| Form::new(&core, lag, whole, pattern.iter().copied().cycle().take(samples).collect());
    let all = patterns.iter().map(|pattern| form(pattern).worst(None));
    let mut best = all.max_by(|a, b| a.demand.total_cmp(&b.demand))?;
    for _ in 0..TURNS {
        let travels: Vec<f64> = best.parts.iter().map(|part| part.1).collect();
        let same = Form::new(&core, lag, whole, best.steps.clone());
        let found = if lag == 0.0 && least < largest {
            Form::new(&core, lag, whole, same.delays(&best, bounds)).worst(None)
        } else {
            same.worst(Some(&travels))
        };
        let settled = found.demand <= best.demand * (1.0 + SETTLED);
        if found.demand > best.demand {
            best = found;
        }
        if settled {
            break;
        }
    }
    best.demand.is_finite().then_some(best)
}

impl WorkMotion {
    /// Its duration, s.
    pub fn duration(&self) -> f64 {
        self.parts.iter().map(|part| part.0).sum()
    }

    /// Its largest distance from its start, rad (linear: m).
    pub fn reach(&self) -> f64 {
        self.points(1, 1.0).iter().map(|point| point.1.abs()).fold(0.0, f64::max)
    }

    /// The points of the motion, repeated, and scaled by `size`.
    pub(super) fn points(&self, repeated: usize, size: f64) -> Vec<(f64, f64)> {
        let mut points = Vec::with_capacity(repeated * self.parts.len() + 1);
        points.push((0.0, 0.0));
        let mut before = 0.0;
        for _ in 0..repeated {
            let (mut time, mut position) = (0.0, 0.0);
            for (length, travel) in &self.parts {
                time += length;
                position += size * travel;
                points.push((before + time, position));
            }
            before += time;
        }
        points
    }

    /// The points of the motion, repeated, scaled to the largest speed `speed` in rad/s (linear: m/s): times in s, and positions.
    pub fn at_speed(&self, repeated: usize, speed: f64) -> Vec<(f64, f64)> {
        let fastest = self.parts.iter().map(|(length, travel)| travel.abs() / length).fold(0.0, f64::max);
        self.points(repeated, speed / fastest)
    }

    /// The pattern of the motion.
    pub(super) fn timing(&self, world: &World) -> Timing {
        let (sampling, first) = (&world.sampling, self.steps.first());
        let period = sampling.period;
        let is_even =
            sampling.delay_s() == sampling.delay_max_s() || self.steps.iter().all(|s| s.delay == sampling.delay_s());
        // A command that arrives after the next sample is simulated at even samples only.
        if sampling.delay_max_s() > period {
            return Timing::Even;
        }
        if is_even && self.steps.iter().all(|step| step.interval == period && Some(step) == first) {
            return Timing::Even;
        }
        let periods = |of: fn(&Step) -> f64| self.steps.iter().map(|step| of(step) / period).collect();
        Timing::Pattern { intervals: periods(|step| step.interval), delays: periods(|step| step.delay) }
    }

    /// Whether the real core on the exact device gives energy to this motion in each repetition, with `damping` of the device. `samples`
    /// grows by those of the run.
    pub fn draws(&self, world: &World, damping: f64, samples: &mut u64) -> bool {
        let mut world = world.clone();
        world.device.damping = damping;
        let drive = Drive::Position(Shape::Path { file: String::new(), points: self.points(REPEATED, 1.0) });
        // The last sample is at the end, up to rounding.
        let duration = REPEATED as f64 * self.duration() + 0.5 * self.parts.first().map_or(0.0, |part| part.0);
        let hand = Hand { drive, release: None };
        let scenario = Scenario { name: "motion".into(), duration, hand, timing: self.timing(&world) };
        let Ok(mut run) = Simulation::new(&world, &scenario) else { return false };
        let (mut taken, mut drawn, mut lost, mut repetitions) = (0, 0.0, 0.0, 0);
        while let Some(Ok(row)) = run.next() {
            *samples += 1;
            taken += 1;
            if taken % self.steps.len() == 1 && taken > 1 {
                // The puck's speed is the same at the end of each.
                let [now, then] = [-(row.ledger.hand + row.ledger.field), row.ledger.damping];
                if repetitions > 0 && now - drawn <= 1e-6 * (then - lost) {
                    return false;
                }
                (drawn, lost) = (now, then);
                repetitions += 1;
            }
        }
        repetitions == REPEATED
    }
}
