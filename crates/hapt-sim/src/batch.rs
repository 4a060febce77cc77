//! Batches of runs, for a few numbers of many runs: one world a lane, all lanes at the same sample.
//!
//! The loop is hapt-core's own on [`Lanes`], and the puck moves by the same products and sums as in a single run, so that each lane
//! has the bits of [`crate::Simulation`]. Code that branches on its numbers cannot run in lanes. [`run_batch`] returns `None` for it:
//! nonlinear couplings, FOAW, Coulomb friction or a lag on a puck that is not held, handles on a shaft, grips, torques that change between their steps, uneven samples, delays that
//! are not whole samples or differ between the worlds, and events of the hand between two samples.

use std::array::from_fn;

use hapt_core::{Lanes, Loop, Number};
use hapt_model::{Scenario, Timing, World};
use pulp::{Simd, WithSimd};

use crate::energy::world_energy;
use crate::run::rows;
use hapt_plant::{Hand, Motor, Push, under_held_torque};

/// The number of worlds in a batch: two of today's widest vectors, so that one computes while the other waits.
pub const LANES: usize = 16;
/// The most couplings of a world in a lane.
const COUPLINGS: usize = 8;
/// The longest delay in samples; its commands are kept for all lanes.
const LONGEST_DELAY: usize = 4096;

type Batch = Lanes<LANES>;

/// The results of a run in a lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// As [`crate::Summary::peak_torque`].
    pub peak_torque: f64,
    /// As [`crate::Summary::final_energy`].
    pub final_energy: f64,
}

/// Runs scenario number `scenario` of each world, all in one batch. An outcome is `None` where the run stops being finite. Returns `None`
/// where these worlds cannot run as a batch and must be run one by one.
pub fn run_batch(worlds: &[World; LANES], scenario: usize) -> Option<[Option<Outcome>; LANES]> {
    match worlds[0].bodies.len() {
        0 | 1 => with_capacity::<1>(worlds, scenario),
        2..=4 => with_capacity::<4>(worlds, scenario),
        _ => None,
    }
}

fn with_capacity<const B: usize>(worlds: &[World; LANES], scenario: usize) -> Option<[Option<Outcome>; LANES]> {
    let run = Run::<B>::new(worlds, scenario)?;
    pulp::Arch::new().dispatch(run)
}

/// The hand and the clock of one lane.
struct Lane<'w> {
    world: &'w World,
    hand: Hand,
    period: f64,
    rows: u64,
    /// The sample of the hand's next event; `u64::MAX`: none.
    next: u64,
    /// Whether the hand still holds the puck.
    held: bool,
}

/// How the pucks move until the next event of a hand.
#[derive(Clone, Copy)]
struct Motion {
    /// 1 where a torque moves the puck, 0 where its hand prescribes the position.
    pushed: Batch,
    /// The torque beside the motor's.
    push: Batch,
    any_pushed: bool,
    /// Whether some hand prescribes a motion.
    any_prescribed: bool,
}

struct Run<'w, const B: usize> {
    lanes: Vec<Lane<'w>>,
    compiled: Loop<Batch, B, 0, 1>,
    /// The change of position and velocity over a period, by velocity and by torque.
    plant: [[Batch; 2]; 2],
    motor: Motor<Batch>,
}

impl<'w> Lane<'w> {
    fn new(world: &'w World, scenario: &Scenario) -> Option<Self> {
        let period = world.sampling.period;
        let hand = Hand::new(&scenario.hand, period);
        let rows = rows(scenario.duration, period);
        let lane = Lane { world, hand, period, rows, next: 0, held: true };
        let device = &world.device;
        let plain = device.friction == 0.0 && device.lag == 0.0;
        let stiff = device.handle.is_none();
        let fits = stiff && scenario.timing == Timing::Even && !lane.hand.grips() && (plain || !lane.moves());
        fits.then_some(lane)
    }

    /// Whether the puck ever moves by its own dynamics.
    fn moves(&self) -> bool {
        self.hand.prescribed().is_none() || self.hand.is_gone((self.rows - 1) as f64 * self.period)
    }

    /// The hand's event at sample k. Returns the puck, moved where the hand prescribes it; `None` if the next event is not at a sample.
    fn act(&mut self, k: u64, puck: (f64, f64)) -> Option<(f64, f64)> {
        let t = k as f64 * self.period;
        self.next = u64::MAX;
        if self.hand.is_gone(t) {
            self.held = false;
            return Some(puck);
        }
        if let Some(next) = self.hand.act(t, puck.0).0.filter(|next| *next <= (self.rows - 1) as f64 * self.period) {
            let sample = (next / self.period).round();
            if sample * self.period != next {
                return None;
            }
            self.next = sample as u64;
        }
        Some(self.hand.prescribed().map_or(puck, |piece| piece.at(t)))
    }

    /// The torque on the puck from sample k on; `None` where the hand prescribes its position.
    fn push(&self, k: u64) -> Option<Push> {
        match self.hand.prescribed() {
            _ if !self.held => Some(Default::default()),
            None => Some(self.hand.push(k as f64 * self.period)),
            Some(_) => None,
        }
    }
}

impl<'w, const B: usize> Run<'w, B> {
    fn new(worlds: &'w [World; LANES], scenario: usize) -> Option<Self> {
        let mut lanes = Vec::with_capacity(LANES);
        for world in worlds {
            lanes.push(Lane::new(world, world.scenarios.get(scenario)?)?);
        }
        let motors: Vec<Motor<Batch>> =
            lanes.iter().map(|lane| Motor::new(lane.world.sampling.delay_s(), lane.period)).collect();
        let motor = motors.first()?.clone();
        if motor.samples > LONGEST_DELAY || motors.iter().any(|m| m.rest != 0.0 || m.samples != motor.samples) {
            return None;
        }
        let mut loops = Vec::with_capacity(LANES);
        for lane in &lanes {
            loops.push(Loop::<f64, B, COUPLINGS, 1>::new(&lane.world.spec()).ok()?);
        }
        let compiled = Loop::batch(loops.as_slice().try_into().ok()?)?;
        let mut plant = [[Batch::ZERO; 2]; 2];
        for (i, lane) in lanes.iter().enumerate().filter(|(_, lane)| lane.moves()) {
            let device = &lane.world.device;
            let change = under_held_torque(device.inertia, device.damping, lane.period);
            for (plant, change) in plant.as_flattened_mut().iter_mut().zip(change.as_flattened()) {
                plant.0[i] = *change;
            }
        }
        Some(Run { lanes, compiled, plant, motor })
    }

    /// The hands' events at sample k. Returns the pucks, and how they move from there.
    #[inline(never)]
    fn act(&mut self, k: u64, mut puck: [Batch; 2]) -> Option<([Batch; 2], Motion)> {
        let mut motion = Motion { pushed: Batch::ZERO, push: Batch::ZERO, any_pushed: false, any_prescribed: false };
        for (i, lane) in self.lanes.iter_mut().enumerate() {
            if lane.next == k {
                (puck[0].0[i], puck[1].0[i]) = lane.act(k, (puck[0].0[i], puck[1].0[i]))?;
            }
            match lane.push(k) {
                Some(push) if push.slope == 0.0 && push.sin == 0.0 && push.cos == 0.0 => {
                    motion.any_pushed = true;
                    (motion.pushed.0[i], motion.push.0[i]) = (1.0, push.value);
                }
                Some(_) => return None,
                None => motion.any_prescribed |= lane.hand.prescribed().is_some_and(|piece| !piece.is_flat()),
            }
        }
        Some((puck, motion))
    }

    /// Sets the pucks whose motion a hand prescribes to their positions at sample k.
    #[inline(never)]
    fn prescribe(&self, k: u64, mut puck: [Batch; 2]) -> [Batch; 2] {
        for (i, lane) in self.lanes.iter().enumerate().filter(|(_, lane)| lane.held) {
            if let Some(piece) = lane.hand.prescribed().filter(|piece| !piece.is_flat()) {
                (puck[0].0[i], puck[1].0[i]) = piece.at(k as f64 * lane.period);
            }
        }
        puck
    }
}

impl<const B: usize> WithSimd for Run<'_, B> {
    type Output = Option<[Option<Outcome>; LANES]>;

    /// The whole run, compiled once for each width of vectors.
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) -> Self::Output {
        let compiled = self.compiled;
        let mut state = compiled.start();
        let mut outcomes = [None; LANES];
        let mut puck = [Batch::ZERO; 2];
        for (i, lane) in self.lanes.iter().enumerate() {
            if let Some(piece) = lane.hand.prescribed() {
                (puck[0].0[i], puck[1].0[i]) = piece.at(0.0);
            }
        }
        let mut motion = Motion { pushed: Batch::ZERO, push: Batch::ZERO, any_pushed: false, any_prescribed: false };
        let (mut applied, mut peak, mut finite_sum) = (Batch::ZERO, Batch::ZERO, Batch::ZERO);
        let end = self.lanes.iter().map(|lane| lane.rows).max()?;
        let mut k = 0;
        while k < end {
            // Up to the next event of any hand, or the end of any run.
            let first = k;
            let mut last = end;
            while k < last {
                if k > 0 {
                    if motion.any_pushed {
                        puck = moved(&self.plant, puck, applied + motion.push, motion.pushed);
                    }
                    if motion.any_prescribed {
                        puck = self.prescribe(k, puck);
                        finite_sum += Batch::ZERO * puck[1];
                    }
                }
                if k == first {
                    (puck, motion) = self.act(k, puck)?;
                    let stops = self.lanes.iter().flat_map(|lane| [lane.next, lane.rows]);
                    last = stops.filter(|stop| *stop > k).fold(end, u64::min);
                }
                let sample = compiled.step(&mut state, puck[0], puck[1]);
                applied = if self.motor.samples == 0 {
                    sample.command
                } else {
                    self.motor.command(sample.command);
                    self.motor.applied
                };
                peak = peak.larger(sample.torque.abs());
                // 0 · x is 0 or NaN, and a NaN stays in a sum. Bodies and puck, once not finite, stay so.
                finite_sum += Batch::ZERO * sample.torque;
                k += 1;
            }
            for (i, lane) in self.lanes.iter().enumerate().filter(|(_, lane)| lane.rows == k) {
                let bodies: [(f64, f64); B] = from_fn(|j| (state.now.position[j].0[i], state.now.velocity[j].0[i]));
                let bodies = &bodies[..compiled.bodies()];
                let own = [(puck[0].0[i], puck[1].0[i]), (finite_sum.0[i], 0.0)];
                let finite = own.iter().chain(bodies).all(|(x, v)| x.is_finite() && v.is_finite());
                outcomes[i] = finite.then(|| Outcome {
                    peak_torque: peak.0[i],
                    final_energy: world_energy(lane.world, puck[0].0[i], bodies, &[]),
                });
            }
        }
        Some(outcomes)
    }
}

/// The puck a period later, where it is pushed.
#[inline(always)]
fn moved(plant: &[[Batch; 2]; 2], [position, velocity]: [Batch; 2], torque: Batch, pushed: Batch) -> [Batch; 2] {
    let [by_position, by_velocity] = plant;
    let travel = by_position[0] * velocity + by_position[1] * torque;
    let gain = by_velocity[0] * velocity + by_velocity[1] * torque;
    [pushed.choose(position + travel, position), pushed.choose(velocity + gain, velocity)]
}
