//! Hands that prescribe the puck's motion and exploit quantisation and sampling: dithering across a count or a level, pumping a body
//! by counts, reversing within a sample, moving with a constant torque.
//!
//! A loop is passive when no motion of the puck draws unbounded energy from it, so that such a hand's gain is a counterexample like
//! a grip's. Each motion is found by running the loop along with it, and is then an ordinary path.

use std::collections::VecDeque;

use hapt_analysis::Slopes;
use hapt_analysis::continuous::linearise;
use hapt_model::{Coupling, Drive, End, EstimatorKind, Hand as Model, Scenario, Shape, Timing, World};
use hapt_sim::DesktopLoop;
use serde::Serialize;

use super::search::Error;

/// The kind of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Exploit {
    /// It repeats the motion with the largest ratio of the motor's work on a linear loop to the damping's ([`super::work_motion`]).
    Work,
    /// It moves with the quantisation error of the held torque, sample by sample.
    Dither,
    /// It crosses a count in both directions in phase with a body's oscillation, and yields at the end of the oscillation.
    Pump,
    /// At each sample it moves in one direction, and between samples in the other.
    Reverse,
    /// It moves with a constant torque at constant velocity.
    Follow,
}

/// A motion that the hand prescribes.
#[derive(Clone, Debug, PartialEq)]
pub struct HandMotion {
    /// Its kind.
    pub trick: Exploit,
    /// Times in s and positions in rad (linear: m), straight in between.
    pub points: Vec<(f64, f64)>,
    /// The pattern of intervals and delays of the motion.
    pub timing: Timing,
}

impl HandMotion {
    /// The scenario that shows it; its path is the file `file`.
    pub fn scenario(&self, name: &str, file: &str, duration: f64) -> Scenario {
        let shape = Shape::Path { file: file.into(), points: self.points.clone() };
        Scenario {
            name: name.into(),
            duration,
            hand: Model { drive: Drive::Position(shape), release: None },
            timing: self.timing.clone(),
        }
    }

    /// Its largest distance from its start.
    pub fn reach(&self) -> f64 {
        let first = self.points.first().map_or(0.0, |point| point.1);
        self.points.iter().map(|point| (point.1 - first).abs()).fold(0.0, f64::max)
    }

    /// The text of its file.
    pub fn csv(&self, motion: hapt_model::Motion) -> String {
        let unit = match motion {
            hapt_model::Motion::Rotary => "rad",
            hapt_model::Motion::Linear => "m",
        };
        let lines: String = self.points.iter().map(|(time, position)| format!("{time},{position}\n")).collect();
        format!("time_s,puck_{unit}\n{lines}")
    }
}

/// The data of a world for these hands.
struct Bench<'w> {
    world: &'w World,
    period: f64,
    samples: usize,
    /// Stiffness and damping of all couplings at the puck, at their steepest slopes.
    stiffness: f64,
    damping: f64,
    /// A body and its coupling to the puck.
    pulls: Vec<(usize, f64)>,
    /// The delay of the first command, in whole samples and the rest.
    late: (usize, f64),
}

/// A running loop.
struct Running {
    compiled: Box<DesktopLoop>,
    state: Box<hapt_sim::DesktopState>,
}

impl Running {
    fn new(world: &World) -> Result<Running, Error> {
        let compiled = Box::new(DesktopLoop::new(&world.spec()).map_err(hapt_sim::Error::from)?);
        let state = Box::new(compiled.start());
        Ok(Running { compiled, state })
    }

    fn step(&mut self, position: f64, velocity: f64) -> f64 {
        self.compiled.step(&mut self.state, position, velocity).command
    }
}

/// All candidate motions, for this number of samples.
pub(crate) fn motions(world: &World, targets: &[f64], samples: usize) -> Result<Vec<HandMotion>, Error> {
    let (mut stiffness, mut damping, mut pulls) = (0.0, 0.0, Vec::new());
    let period = world.sampling.period;
    for tie in linearise(&world.bodies, &world.couplings, &Slopes::Steep).map_err(Error::Linear)? {
        let own = match (tie.first, tie.second) {
            (End::Puck, other) | (other, End::Puck) => other,
            (End::Ground | End::Body(_), End::Ground | End::Body(_)) => continue,
        };
        stiffness += tie.stiffness;
        damping += tie.fixed + period * tie.per_period;
        if let End::Body(body) = own {
            pulls.push((body, tie.stiffness));
        }
    }
    let lag = world.sampling.delay_s() / period;
    let whole = (lag + 1e-6).floor();
    let late = (whole as usize, (lag - whole).max(0.0));
    let bench = Bench { world, period, samples, stiffness, damping, pulls, late };
    let mut all = Vec::new();
    let places = places(world, targets);
    if world.device.encoder.is_some() || world.device.levels.is_some() {
        for &place in &places {
            for part in DITHERS {
                all.extend(bench.dither(place, part)?);
            }
        }
    }
    if world.device.encoder.is_some() && !bench.pulls.is_empty() {
        for &place in places.iter().take(2) {
            for swings in SWINGS {
                for yielding in YIELDING {
                    all.extend(bench.pump(place, swings, yielding)?);
                }
            }
        }
    }
    if world.sampling.estimator == EstimatorKind::Exact && bench.damping > 0.0 {
        for &place in &places {
            for back in BACKS {
                all.extend(bench.reverse(place, back));
            }
        }
    }
    all.extend(bench.follow());
    Ok(all)
}

/// Starting places: where springs are slack, so that little energy is stored, then the targets of grips.
fn places(world: &World, targets: &[f64]) -> Vec<f64> {
    let rest = |c: &Coupling| {
        let sign = match (c.first, c.second) {
            (End::Puck, _) => 1.0,
            (_, End::Puck) => -1.0,
            (End::Ground | End::Body(_), End::Ground | End::Body(_)) => return None,
        };
        c.law.center().map(|center| sign * center)
    };
    let mut all = vec![0.0];
    for place in world.couplings.iter().filter_map(rest).chain(targets.iter().copied()) {
        if !all.contains(&place) {
            all.push(place);
        }
    }
    all.truncate(MAX_PLACES);
    all
}

/// The largest number of starting places.
const MAX_PLACES: usize = 6;
/// The dither per sample, in counts, or in steps of the levels over the stiffness.
const DITHERS: [f64; 6] = [0.5, 0.15, 0.04, 0.01, 0.002, 4e-4];
/// The number of half periods for which a body is pumped, and the part of the final amplitude that a hand takes per sample.
const SWINGS: [u32; 5] = [3, 6, 12, 30, 80];
const YIELDING: [f64; 2] = [0.1, 0.3];
/// The backward motion of a reversal within a sample, relative to the displacement at the sampled velocity.
const BACKS: [f64; 6] = [0.4, 0.2, 0.1, 0.04, 0.015, 0.005];
/// The part of a sample for which it moves backward.
const FORTH: f64 = 2e-5;
/// A reversal moves this number of samples in one direction and then as many in the other.
const BLOCK: usize = 32;

impl Bench<'_> {
    /// The unit of a dither; `None` where no position is quantised.
    fn grain(&self) -> Option<f64> {
        let device = &self.world.device;
        self.world.count().or_else(|| {
            let step = 2.0 * device.limit? / f64::from(device.levels?);
            let slope = self.stiffness.max(self.damping / self.period);
            (slope > 0.0).then(|| step / slope)
        })
    }

    /// Positions at the samples as a path that stands still until the command arrives, and moves then.
    fn path(&self, trick: Exploit, positions: &[f64]) -> HandMotion {
        let mut points = Vec::with_capacity(2 * positions.len());
        let mut last = None;
        for (k, &position) in positions.iter().enumerate() {
            if let Some(last) = last.filter(|last| *last != position && self.late.1 > 0.0) {
                points.push(((k as f64 - 1.0 + self.late.1) * self.period, last));
            }
            points.push((k as f64 * self.period, position));
            last = Some(position);
        }
        HandMotion { trick, points, timing: Timing::Even }
    }

    /// With the error of the held torque, from the comparison with a loop without counts and levels. [`Bench::pump`] exploits the errors at
    /// bodies.
    fn dither(&self, place: f64, part: f64) -> Result<Option<HandMotion>, Error> {
        let Some(step) = self.grain().map(|grain| part * grain) else { return Ok(None) };
        let mut ideal = self.world.clone();
        (ideal.device.encoder, ideal.device.levels) = (None, None);
        // With bodies the loop without counts would drift from the one with them: only the couplings at the puck are compared.
        let mut world = self.world.clone();
        if world.device.encoder.is_some() && !world.bodies.is_empty() {
            let held = |world: &mut World| {
                for body in &mut world.bodies {
                    body.inertia *= 1e12;
                }
            };
            held(&mut ideal);
            held(&mut world);
        }
        let (mut real, mut ideal) = (Running::new(&world)?, Running::new(&ideal)?);
        let mut errors: VecDeque<f64> = VecDeque::from(vec![0.0; self.late.0]);
        let mut positions = Vec::with_capacity(self.samples + 1);
        // At the edge of a count, where there are any.
        let mut z =
            self.world.count().map_or(place, |count| ((place / count - 0.5).round() + 0.5) * count - 0.5 * step);
        let mut before = z;
        for _ in 0..=self.samples {
            positions.push(z);
            let velocity = (z - before) / self.period;
            errors.push_back(real.step(z, velocity) - ideal.step(z, velocity));
            before = z;
            // Without an error yet, move on until there is one.
            z += if errors.pop_front().unwrap_or(0.0) < 0.0 { -step } else { step };
        }
        Ok(Some(self.path(Exploit::Dither, &positions)))
    }

    /// Crosses a count so that the bodies' oscillation grows, and after `swings` half periods yields at its end, by `yielding` of the
    /// torque's demand per sample.
    fn pump(&self, place: f64, swings: u32, yielding: f64) -> Result<Option<HandMotion>, Error> {
        let (Some(count), true) = (self.world.count(), self.stiffness > 0.0) else { return Ok(None) };
        let friction = self.world.device.largest_friction();
        let mut running = Running::new(self.world)?;
        let step = 0.01 * count;
        let edge = |z: f64| ((z / count - 0.5).round() + 0.5) * count;
        let mut center = edge(place);
        let mut z = center - step;
        let mut before = z;
        let (mut rising, mut turned, mut giving) = (true, 0, false);
        let mut held: VecDeque<f64> = VecDeque::from(vec![0.0; self.late.0]);
        let mut positions = Vec::with_capacity(self.samples + 1);
        for _ in 0..=self.samples {
            positions.push(z);
            held.push_back(running.step(z, (z - before) / self.period));
            before = z;
            let torque = held.pop_front().unwrap_or(0.0);
            if !torque.is_finite() {
                return Ok(None);
            }
            let velocity = |body: usize| running.state.now.velocity.get(body).copied().unwrap_or(0.0);
            let pace: f64 = self.pulls.iter().map(|&(body, stiffness)| stiffness * velocity(body)).sum();
            if giving {
                let left = torque.abs() - 1.02 * friction;
                if left > 0.0 {
                    z += yielding * left / self.stiffness * torque.signum();
                    continue;
                }
                (giving, turned) = (false, 0);
                center = edge(z);
            }
            if (pace > 0.0) != rising && pace != 0.0 {
                rising = pace > 0.0;
                turned += 1;
                // Only where energy is available.
                giving = turned >= swings && torque.abs() > 1.1 * friction;
            }
            if !giving {
                z = center + if rising { step } else { -step };
            }
        }
        Ok(Some(self.path(Exploit::Pump, &positions)))
    }

    /// The velocity at each sample is opposite to that in between.
    fn reverse(&self, place: f64, back: f64) -> Option<HandMotion> {
        let device = &self.world.device;
        // The damper's torque is well above friction, and within the motor's limit.
        let torque = device
            .limit
            .map_or(f64::INFINITY, |limit| 0.45 * limit)
            .min((50.0 * device.largest_friction()).max(0.1 * self.damping));
        let velocity = torque / self.damping;
        if !velocity.is_finite() || velocity <= 0.0 {
            return None;
        }
        let forth = FORTH * self.period;
        let mut points = Vec::with_capacity(2 * self.samples + 2);
        let mut z = place;
        for k in 0..=self.samples {
            let start = k as f64 * self.period;
            let rate = |k: usize| if (k / BLOCK).is_multiple_of(2) { velocity } else { -velocity };
            points.extend([(start, z), (start + forth, z + rate(k) * forth)]);
            // Against the held torque: that of one delay ago.
            z -= back * rate(k.saturating_sub(self.late.0)) * self.period;
        }
        Some(HandMotion { trick: Exploit::Reverse, points, timing: Timing::Even })
    }

    /// With the constant torques at bodies, at the velocity of least dissipation at the puck.
    fn follow(&self) -> Option<HandMotion> {
        let torque: f64 = self.world.couplings.iter().filter_map(constant).sum();
        let device = &self.world.device;
        if torque == 0.0 {
            return None;
        }
        let left = torque.abs() - device.largest_friction();
        let pace = left.max(0.1 * torque.abs()) / (2.0 * (device.damping + self.damping).max(1e-9 * torque.abs()));
        let time = self.samples as f64 * self.period;
        let slow = pace.min(1e3 / time.max(1.0));
        let points = vec![(0.0, 0.0), (time, slow * time * torque.signum())];
        Some(HandMotion { trick: Exploit::Follow, points, timing: Timing::Even })
    }
}

/// The torque toward larger positions of a constant with a body at an end, with which the hand can move.
pub(crate) fn constant(coupling: &Coupling) -> Option<f64> {
    let torque = coupling.law.constant()?;
    match (coupling.first, coupling.second) {
        (End::Body(_), End::Ground) => Some(torque),
        (End::Ground, End::Body(_)) => Some(-torque),
        (End::Puck, End::Body(_)) => Some(torque),
        (End::Body(_), End::Puck) => Some(-torque),
        // Between two bodies no common motion does work: they separate.
        (End::Body(_), End::Body(_)) => None,
        (End::Puck | End::Ground, End::Puck | End::Ground) => None,
    }
}
