//! The motion of the puck that draws most energy from a linear loop, and the pattern of intervals and delays that lets it.
//!
//! The puck moves uniformly over each part of an interval, by x. The motor's work is a quadratic form of x, the device takes Σ b x²/part. So
//! the damping that a pattern requires is the largest eigenvalue of the one form in the other (Lanczos). The world's torques are those of the
//! real core, and since a loop at rest is the same whenever it begins, the transposed form runs the core backwards. For the motion that was
//! found each delay then takes the length that lets it draw most, and so on in turn.
//!
//! What is claimed of it is tested by the real core on the exact device: the motion returns to its start and is repeated. A loop that gives
//! energy in each repetition is not passive.

use hapt_model::{Drive, Hand, Scenario, Shape, Timing, World};
use hapt_sim::{DesktopLoop, Simulation};

/// Parts of an interval before and after the command arrives, of a motor that lags.
const PARTS: usize = 4;
/// Dimensions of the space that is searched for an eigenvector.
const LANCZOS: usize = 40;
/// Turns between motion and pattern.
const TURNS: usize = 6;
/// A turn that raises the demand by less than this part is the last.
const SETTLED: f64 = 1e-4;
/// Repetitions of a motion; the first pays for the puck's speed, and is not counted.
const REPEATED: usize = 4;

/// What follows on a sample, s.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Step {
    interval: f64,
    delay: f64,
}

/// A motion over some samples, and the pattern under which it is made.
#[derive(Clone, Debug)]
pub struct Motion {
    /// The damping of the device up to which it draws energy, N·m·s/rad.
    pub demand: f64,
    steps: Vec<Step>,
    /// Length in s and way in rad, one after the other.
    parts: Vec<(f64, f64)>,
}

/// The loop as a linear map from the ways of the parts to the mean torques of the motor over them.
struct Form<'a> {
    core: &'a DesktopLoop,
    lag: f64,
    steps: Vec<Step>,
    /// Of each part: its sample, its length in s, and whether the command of the sample has arrived.
    parts: Vec<(usize, f64, bool)>,
}

impl<'a> Form<'a> {
    fn new(core: &'a DesktopLoop, lag: f64, steps: Vec<Step>) -> Self {
        let mut parts = Vec::new();
        for (k, step) in steps.iter().enumerate() {
            for (length, arrived) in [(step.delay, false), (step.interval - step.delay, true)] {
                let count = if lag > 0.0 { PARTS } else { 1 };
                // Finer where the lagged torque bends most.
                let at = |i: usize| length * (i as f64 / count as f64).powi(2);
                parts.extend((0..count).map(|i| (k, at(i + 1) - at(i), arrived)).filter(|part| part.1 > 0.0));
            }
        }
        Form { core, lag, steps, parts }
    }

    /// The torques of the real core at the samples, from rest.
    fn torques(&self, positions: impl Iterator<Item = f64>) -> Vec<f64> {
        let mut state = self.core.start();
        // The first sample is where the estimators begin.
        self.core.step(&mut state, 0.0, 0.0);
        positions.map(|z| self.core.step(&mut state, z, 0.0).torque).collect()
    }

    /// The positions at the samples.
    fn positions(&self, ways: &[f64]) -> Vec<f64> {
        let mut positions = vec![0.0; self.steps.len() + 1];
        for ((k, ..), way) in self.parts.iter().zip(ways) {
            positions[k + 1] += way;
        }
        for k in 1..positions.len() {
            positions[k] += positions[k - 1];
        }
        positions.pop();
        positions
    }

    /// What of a torque at its start a part has as mean, and at its end.
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
            let target = if arrived { commands[k] } else { k.checked_sub(1).map_or(0.0, |k| commands[k]) };
            let [mean, end] = self.kept(length);
            let found = target + (motor - target) * mean;
            motor = target + (motor - target) * end;
            found
        };
        self.parts.iter().map(mean).collect()
    }

    /// The symmetric part of the form, times `ways`.
    fn times(&self, ways: &[f64]) -> Vec<f64> {
        let mut forces = self.means(&self.torques(self.positions(ways).into_iter()));
        // The transposed: from ways to what each torque's command does with them, and back through the core.
        let mut commands = vec![0.0; self.steps.len()];
        let mut motor = 0.0;
        for (&(k, length, arrived), way) in self.parts.iter().zip(ways).rev() {
            let [mean, end] = self.kept(length);
            let share = way * (1.0 - mean) + motor * (1.0 - end);
            motor = way * mean + motor * end;
            if let Some(k) = if arrived { Some(k) } else { k.checked_sub(1) } {
                commands[k] += share;
            }
        }
        let mut back = self.torques(commands.into_iter().rev());
        back.reverse();
        // What each way adds to all later positions.
        let mut later = vec![0.0; back.len() + 1];
        for k in (0..back.len()).rev() {
            later[k] = later[k + 1] + back[k];
        }
        for ((k, ..), force) in self.parts.iter().zip(&mut forces) {
            *force = 0.5 * (*force + later[k + 1]);
        }
        forces
    }

    /// The motion that returns to its start and requires most damping.
    fn worst(&self, from: Option<&[f64]>) -> Motion {
        let root: Vec<f64> = self.parts.iter().map(|part| part.1.sqrt()).collect();
        let total: f64 = self.parts.iter().map(|part| part.1).sum();
        let returning = |y: &mut [f64]| {
            let over = dot(y, &root) / total;
            y.iter_mut().zip(&root).for_each(|(y, root)| *y -= over * root);
        };
        let mut start: Vec<f64> = match from {
            Some(ways) => ways.iter().zip(&root).map(|(way, root)| way / root).collect(),
            // Slow and fast motions alike, the same each time.
            None => {
                let mut rng = fastrand::Rng::with_seed(1);
                root.iter().map(|root| root * (rng.f64() - 0.2)).collect()
            }
        };
        returning(&mut start);
        let mut basis: Vec<Vec<f64>> = vec![scaled(&start, 1.0 / dot(&start, &start).sqrt())];
        let (mut diagonal, mut beside) = (Vec::new(), Vec::new());
        for i in 0..LANCZOS {
            let ways: Vec<f64> = basis[i].iter().zip(&root).map(|(y, root)| y * root).collect();
            let mut next: Vec<f64> = self.times(&ways).iter().zip(&root).map(|(force, root)| force * root).collect();
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
            beside.push(size);
            basis.push(scaled(&next, 1.0 / size));
        }
        let small = nalgebra::DMatrix::from_fn(diagonal.len(), diagonal.len(), |i, j| match i.abs_diff(j) {
            0 => diagonal[i],
            1 => beside[i.min(j)],
            _ => 0.0,
        });
        let eigen = small.symmetric_eigen();
        let most = eigen.eigenvalues.imax();
        let mut motion = vec![0.0; root.len()];
        for (vector, weight) in basis.iter().zip(eigen.eigenvectors.column(most).iter()) {
            motion.iter_mut().zip(vector).for_each(|(sum, y)| *sum += weight * y);
        }
        let ways: Vec<f64> = root.iter().zip(&motion).map(|(root, y)| y * root).collect();
        // The work itself and not the eigenvalue, which rounding may raise.
        let work = dot(&self.means(&self.torques(self.positions(&ways).into_iter())), &ways);
        let parts: Vec<(f64, f64)> = self.parts.iter().zip(ways).map(|(part, way)| (part.1, way)).collect();
        let lost: f64 = parts.iter().map(|(length, way)| way * way / length).sum();
        Motion { demand: work / lost, steps: self.steps.clone(), parts }
    }

    /// The delays that let this motion draw most: -u d δ/L + u² d (L - d)/(4 b L), u the change of the command and δ the way of the interval.
    fn delays(&self, motion: &Motion, [least, largest]: [f64; 2]) -> Vec<Step> {
        let ways: Vec<f64> = motion.parts.iter().map(|part| part.1).collect();
        let mut positions = self.positions(&ways);
        let commands = self.torques(positions.clone().into_iter());
        positions.push(0.0);
        let step = |(k, step): (usize, &Step)| {
            let change = commands[k] - k.checked_sub(1).map_or(0.0, |k| commands[k]);
            let way = positions[k + 1] - positions[k];
            let best = 0.5 * step.interval - 2.0 * motion.demand * way / change;
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

/// The worst motion that was found over `samples` samples, of a linear world without a handle; `None` where the core refuses it.
pub fn worst(world: &World, samples: usize) -> Option<Motion> {
    let core = DesktopLoop::new(&world.spec()).ok()?;
    let (sampling, lag) = (&world.sampling, world.device.lag);
    let (longest, shortest) = (sampling.interval_max_s(), sampling.interval_min_s());
    let bounds = [sampling.delay_s(), sampling.delay_max_s()];
    let [least, largest] = bounds;
    let long = |delay: f64| Step { interval: longest, delay };
    let mut patterns = vec![vec![long(largest)]];
    if least < largest {
        patterns.extend([vec![long(least)], vec![long(largest), long(least)]]);
    }
    if lag > 0.0 {
        patterns.push(vec![long(largest), Step { interval: shortest.max(largest), delay: largest }]);
    }
    let form = |pattern: &[Step]| Form::new(&core, lag, pattern.iter().copied().cycle().take(samples).collect());
    let all = patterns.iter().map(|pattern| form(pattern).worst(None));
    let mut best = all.max_by(|a, b| a.demand.total_cmp(&b.demand))?;
    for _ in 0..TURNS {
        let ways: Vec<f64> = best.parts.iter().map(|part| part.1).collect();
        let same = Form::new(&core, lag, best.steps.clone());
        let found = if lag == 0.0 && least < largest {
            Form::new(&core, lag, same.delays(&best, bounds)).worst(None)
        } else {
            same.worst(Some(&ways))
        };
        let settled = found.demand <= best.demand * (1.0 + SETTLED);
        if found.demand > best.demand {
            best = found;
        }
        if settled {
            break;
        }
    }
    Some(best)
}

impl Motion {
    /// Whether the real core on the exact device gives energy to this motion in each repetition, with `damping` of the device.
    pub fn draws(&self, world: &World, damping: f64, samples: &mut u64) -> bool {
        let mut world = world.clone();
        world.device.damping = damping;
        let period = world.sampling.period;
        let (mut time, mut position, mut points) = (0.0, 0.0, vec![(0.0, 0.0)]);
        for _ in 0..REPEATED {
            for (length, way) in &self.parts {
                time += length;
                position += way;
                points.push((time, position));
            }
        }
        let periods = |of: fn(&Step) -> f64| self.steps.iter().map(|step| of(step) / period).collect();
        let timing = Timing::Pattern { intervals: periods(|step| step.interval), delays: periods(|step| step.delay) };
        let drive = Drive::Position(Shape::Path { file: String::new(), points });
        // The last sample is at the end, up to rounding.
        let duration = time + 0.5 * self.parts.first().map_or(0.0, |part| part.0);
        let scenario = Scenario { name: "motion".into(), duration, hand: Hand { drive, release: None }, timing };
        let Ok(mut run) = Simulation::new(&world, &scenario) else { return false };
        let (mut taken, mut drawn, mut lost, mut repetitions) = (0, 0.0, 0.0, 0);
        while let Some(Ok(row)) = run.next() {
            *samples += 1;
            taken += 1;
            if taken % self.steps.len() == 1 && taken > 1 {
                // The puck's speed is the same at the end of each.
                let [now, then] = [-row.ledger.hand, row.ledger.damping];
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
