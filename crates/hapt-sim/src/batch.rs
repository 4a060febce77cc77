//! Batches of runs, for a few results of many runs: one world a lane, all lanes at the same sample.
//!
//! The loop is hapt-core's own on [`Lanes`], and the puck moves by the same products and sums as in a single run, so that each lane
//! is bit-identical to [`crate::Simulation`]. The lanes advance together all pucks that are free, that a torque or a grip moves, or whose
//! hand prescribes the position, with Coulomb friction too where the torque is held: the direction of sliding and sticking are selected
//! without a branch. A puck that stops within the period is advanced separately, in closed form.
//!
//! A lane advances separately, on the same exact device as a single run, with a lag, a handle on a shaft, a hand that opens and closes,
//! friction together with a grip or a torque that changes, a delay of another number of samples than in the first lane, and uneven samples.
//! An event of the hand between two samples separates its lane for that period only.
//!
//! Nonlinear couplings are evaluated on all lanes at once where all have the same kinds at the same ends; otherwise, and where a method
//! solves for the torques at bodies, lane after lane. [`run_batch`] returns `None` for loops that differ in more than their numbers and nonlinear
//! couplings, and for more bodies or couplings, or a longer window, than fit.

use std::array::from_fn;

use hapt_core::{Batch, Lanes, Loop, Number};
use hapt_model::vectors::{has_vectors, with_vectors};
use hapt_model::{EstimatorKind, Scenario, Timing, World};
use hapt_plant::spec::{DeviceSpec, Drive};
use hapt_plant::{Hand, Motor, Push, VirtualDevice, change_under, slide_under, sliding_direction};

use crate::energy::world_energy;
use crate::run::{Machine, rows, script};

/// The number of worlds in a batch: two vectors of eight numbers, so that the latencies of their operations overlap.
pub const LANES: usize = 16;
/// The most couplings of a world in a lane, and its longest FOAW window.
const COUPLINGS: usize = 8;
const WINDOW: usize = 32;
/// A sliding puck that keeps more than this part of its velocity over a period does not stop in it.
const SLIDES: f64 = 1e-9;
/// The longest delay in samples; the commands of this many samples are kept for all lanes.
const MAX_DELAY_SAMPLES: usize = 4096;

type Numbers = Lanes<LANES>;

/// The results of a run in a lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// As [`crate::Summary::peak_torque`].
    pub peak_torque: f64,
    /// As [`crate::Summary::final_energy`].
    pub final_energy: f64,
}

/// Samples between two checks of the stop.
const STRETCH: u64 = 4096;

/// Whether the work is to be cancelled; called every [`STRETCH`] samples.
type Stop<'s> = dyn Fn() -> bool + 's;

/// Runs scenario number `scenario` of each world, all in one batch. An outcome is `None` where the run stops being finite, or is stopped:
/// `stop` is called every 4096 samples. Returns `None` where these worlds cannot run as a batch and must be run one by one, and on a processor
/// without vectors of four numbers (x86 before AVX2), where that is as fast.
pub fn run_batch(worlds: &[&World; LANES], scenario: usize, stop: &Stop<'_>) -> Option<[Option<Outcome>; LANES]> {
    // Not run there, so not compiled for it: written out lane by lane, these instructions would be most of the crate's code.
    if !has_vectors() {
        return None;
    }
    match worlds[0].bodies.len() {
        0 | 1 => with_bodies::<1>(worlds, scenario, stop),
        2..=4 => with_bodies::<4>(worlds, scenario, stop),
        _ => None,
    }
}

/// For up to `B` bodies.
fn with_bodies<const B: usize>(
    worlds: &[&World; LANES],
    scenario: usize,
    stop: &Stop<'_>,
) -> Option<[Option<Outcome>; LANES]> {
    // Linear worlds whose estimator keeps no window of samples have a loop of their own, in which every lane computes at once. Batches are passed by
    // reference: with room for couplings in every lane they are large to move.
    let sampling = &worlds[0].sampling;
    let is_windowed = matches!(sampling.estimator, EstimatorKind::Foaw | EstimatorKind::FoawBest);
    if !is_windowed && !sampling.takes_several_samples() {
        let loops: Loops<B, 1> = loops(worlds)?;
        if let Some(linear) = Batch::<LANES, B, COUPLINGS, 1, 0>::new(&loops) {
            let run = Run::new(worlds, &linear, scenario, stop)?;
            return with_vectors(
                #[inline(always)]
                || run.whole(),
            )?;
        }
    }
    let loops: Loops<B, { WINDOW + 1 }> = loops(worlds)?;
    let any = Batch::<LANES, B, COUPLINGS, { WINDOW + 1 }, COUPLINGS>::new(&loops)?;
    let run = Run::new(worlds, &any, scenario, stop)?;
    with_vectors(
        #[inline(always)]
        || run.whole(),
    )?
}

/// For up to `B` bodies and a window of `W` - 1.
type Loops<const B: usize, const W: usize> = Box<[Loop<f64, B, COUPLINGS, W>; LANES]>;

fn loops<const B: usize, const W: usize>(worlds: &[&World; LANES]) -> Option<Loops<B, W>> {
    let loops: Option<Vec<_>> = worlds.iter().map(|world| Loop::new(&world.spec()).ok()).collect();
    loops?.into_boxed_slice().try_into().ok()
}

/// The hand and the clock of one lane.
struct Lane<'w> {
    world: &'w World,
    scenario: &'w Scenario,
    hand: Hand,
    period: f64,
    /// The fraction of the delay, in s.
    rest: f64,
    rows: u64,
    /// The sample of the hand's next event, or at which a period with an event begins; `u64::MAX`: none.
    next: u64,
    /// Whether the hand still holds the puck.
    held: bool,
    apart: Apart,
    /// Whether the puck's or the handle's state is no longer finite.
    broken: bool,
}

/// The device that advances the puck of a lane instead of the products of all lanes.
enum Apart {
    /// Its own device in this period (`now`) or in a later one; the lane sets the torque that its motor holds. `None`: not needed yet.
    Sometimes { device: Option<Box<VirtualDevice>>, now: bool },
    /// Its own device, always.
    Always(Box<Machine>),
}

impl Apart {
    const SELDOM: Apart = Apart::Sometimes { device: None, now: false };
}

/// v, torque, x, the torque's slope, σ and κ: the puck and its drive. A free puck under a held torque needs only the first two.
type States = [Numbers; 6];

/// The held torque of each lane's motor in a period: up to the end of the delay's fraction, and from there on.
type Applied = [Numbers; 2];

/// The drives of the pucks until the next event of a hand.
#[derive(Clone, Copy)]
struct Drives {
    /// 1 where a torque moves the puck, 0 where its hand prescribes the position.
    pushed: Numbers,
    /// The hand's torque: its value, its slope, σ and κ of a sine.
    drive: [Numbers; 4],
    any_pushed: bool,
    /// Whether some hand pushes with something other than a held torque.
    any_driven: bool,
    /// Whether some hand's push changes from sample to sample.
    any_varying: bool,
    /// Whether some hand prescribes a motion.
    any_prescribed: bool,
    /// Whether some lane advances its puck on its own device.
    any_apart: bool,
}

impl Drives {
    const NONE: Drives = Drives {
        pushed: Numbers::ZERO,
        drive: [Numbers::ZERO; 4],
        any_pushed: false,
        any_driven: false,
        any_varying: false,
        any_prescribed: false,
        any_apart: false,
    };

    fn set_drive(&mut self, i: usize, push: Push) {
        for (drive, part) in self.drive.iter_mut().zip([push.value, push.slope, push.sin, push.cos]) {
            drive.0[i] = part;
        }
    }
}

struct Run<'w, const B: usize, const W: usize, const S: usize> {
    lanes: Vec<Lane<'w>>,
    compiled: &'w Batch<'w, LANES, B, COUPLINGS, W, S>,
    stop: &'w Stop<'w>,
    /// The change of position and velocity over a period, by [`States`]; over the two parts of it where the delay has a fraction.
    plants: [[States; 2]; 2],
    /// Toward larger positions, and toward smaller ones.
    friction: [Numbers; 2],
    slides: bool,
    motor: Motor<Numbers>,
}

impl<'w> Lane<'w> {
    fn new(world: &'w World, scenario: &'w Scenario) -> Self {
        let period = world.sampling.period;
        let hand = Hand::new(&scenario.hand, period);
        let rows = rows(scenario.duration, period);
        let rest = Motor::<f64>::new(world.sampling.delay_s(), period).rest;
        Lane { world, scenario, hand, period, rest, rows, next: 0, held: true, apart: Apart::SELDOM, broken: false }
    }

    /// Whether the puck ever moves by its own dynamics.
    fn moves(&self) -> bool {
        self.hand.prescribed().is_none() || self.hand.is_gone((self.rows - 1) as f64 * self.period)
    }

    /// Whether the puck can be advanced together with those of other lanes.
    fn is_plain(&self) -> bool {
        let device = &self.world.device;
        // Under friction a puck that is driven by more than a held torque may stop and start within a period that begins and ends in motion.
        let pushed = match self.scenario.hand.drive {
            Drive::Position(_) => true,
            Drive::Torque(_) => device.largest_friction() == 0.0 || self.hand.is_steady(),
            Drive::Grip { switching, .. } => device.largest_friction() == 0.0 && switching.is_none(),
        };
        device.handle.is_none()
            && device.is_plain()
            && self.scenario.timing == Timing::Even
            && pushed
            && (device.lag == 0.0 || !self.moves())
    }

    /// The parts of a period, in s: after the fraction of the delay, and before its end.
    fn parts(&self) -> [f64; 2] {
        [self.period - self.rest, self.rest]
    }

    /// Whether the hand pushes with something other than a held torque.
    fn is_driven(&self) -> bool {
        self.held && (self.hand.grips() || !self.hand.is_steady())
    }

    /// Whether the hand's push changes from sample to sample.
    fn varies(&self) -> bool {
        self.held && self.hand.prescribed().is_none() && !self.hand.rests() && !self.is_apart()
    }

    fn is_apart(&self) -> bool {
        matches!(self.apart, Apart::Sometimes { now: true, .. } | Apart::Always(_))
    }

    /// Advances on its own device from the first sample on. `None`: the scenario's timing does not suit the loop.
    fn set_apart(&mut self) -> Option<()> {
        let (machine, rows) = Machine::new(self.world, self.scenario, true).ok()?;
        (self.apart, self.rows, self.next) = (Apart::Always(Box::new(machine)), rows, u64::MAX);
        Some(())
    }

    /// The hand's event at sample k. Returns the puck, at the prescribed position and velocity where the hand prescribes them.
    fn act(&mut self, k: u64, puck: (f64, f64)) -> (f64, f64) {
        let t = k as f64 * self.period;
        self.next = u64::MAX;
        self.set_apart_now(false);
        if self.hand.is_gone(t) {
            self.held = false;
            return puck;
        }
        if let Some(next) = self.hand.act(t, puck.0).0.filter(|next| *next <= (self.rows - 1) as f64 * self.period) {
            let sample = (next / self.period).round();
            let before = if sample * self.period > next { sample - 1.0 } else { sample } as u64;
            self.next = before;
            if sample * self.period != next && before <= k {
                self.set_apart_now(true);
                self.next = k + 1;
            }
        }
        self.hand.prescribed().map_or(puck, |piece| piece.at(t))
    }

    /// The hand's push from sample k on; `None` where the hand prescribes the puck's position, or the lane has its own device.
    fn push(&self, k: u64) -> Option<Push> {
        match self.hand.prescribed() {
            _ if self.is_apart() => None,
            _ if !self.held => Some(Push::default()),
            None => Some(self.hand.push(k as f64 * self.period)),
            Some(_) => None,
        }
    }

    fn set_apart_now(&mut self, is: bool) {
        if let Apart::Sometimes { now, .. } = &mut self.apart {
            *now = is;
        }
    }

    /// Advances the puck on the lane's own device from sample k - 1, at which the loop's command was `command`, to sample k. The motor holds
    /// `applied` meanwhile.
    fn travel(&mut self, k: u64, puck: (f64, f64), command: f64, applied: [f64; 2]) -> (f64, f64) {
        let device = match &mut self.apart {
            Apart::Always(machine) if k < self.rows && !self.broken => {
                machine.command(command);
                machine.travel(k, command);
                &machine.device
            }
            Apart::Always(_) => return puck,
            Apart::Sometimes { device, .. } => {
                let device = device.get_or_insert_with(|| {
                    // No delay line: `command` below sets the held torque.
                    let mut device =
                        VirtualDevice::without_works(&DeviceSpec { delay: 0.0, ..self.world.device_spec() });
                    device.begin(&mut script(self.scenario, self.period));
                    Box::new(device)
                });
                device.skip_to(k - 1, puck);
                device.command(applied[0]);
                device.travel_uneven(self.period, k as f64 * self.period, self.rest, applied[1]);
                &**device
            }
        };
        let (puck, handle) = (device.puck(), device.handle().unwrap_or_default());
        self.broken |= ![puck.0, puck.1, handle.0, handle.1].iter().all(|x| x.is_finite());
        puck
    }
}

impl<'w, const B: usize, const W: usize, const S: usize> Run<'w, B, W, S> {
    fn new(
        worlds: &'w [&'w World; LANES],
        compiled: &'w Batch<'w, LANES, B, COUPLINGS, W, S>,
        scenario: usize,
        stop: &'w Stop<'w>,
    ) -> Option<Self> {
        let mut lanes = Vec::with_capacity(LANES);
        for world in worlds {
            lanes.push(Lane::new(world, world.scenarios.get(scenario)?));
        }
        // One delay line for all lanes: that of the first one. A fraction may differ from lane to lane.
        let motor_of = |lane: &Lane<'_>| Motor::<Numbers>::new(lane.world.sampling.delay_s(), lane.period);
        let mut motors = lanes.iter().filter(|lane| lane.is_plain()).map(motor_of);
        let motor = motors.find(|motor| motor.samples <= MAX_DELAY_SAMPLES).unwrap_or_else(|| Motor::new(0.0, 1.0));
        let mut friction = [Numbers::ZERO; 2];
        for (i, lane) in lanes.iter_mut().enumerate() {
            let own = motor_of(lane);
            if !lane.is_plain() || (own.samples, own.rest == 0.0) != (motor.samples, motor.rest == 0.0) {
                lane.set_apart()?;
            } else if lane.moves() {
                let [forward, backward] = lane.world.device.frictions();
                (friction[0].0[i], friction[1].0[i]) = (forward, backward);
            }
        }
        let slides = friction.iter().flat_map(|toward| toward.0).any(|friction| friction > 0.0);
        let plants = [[[Numbers::ZERO; 6]; 2]; 2];
        let mut run = Run { lanes, compiled, stop, plants, friction, slides, motor };
        (0..LANES).for_each(|i| run.set_plant(i));
        Some(run)
    }

    /// Computes the change of lane i's puck over a period, with or without its hand.
    fn set_plant(&mut self, i: usize) {
        let lane = &self.lanes[i];
        if matches!(lane.apart, Apart::Always(_)) || !lane.moves() {
            return;
        }
        let (device, hand) = (&lane.world.device, Some(&lane.hand).filter(|_| lane.held));
        for (plant, part) in self.plants.iter_mut().zip(lane.parts()).filter(|(_, part)| *part > 0.0) {
            let change = change_under(device.inertia, device.damping, hand, part);
            for (plant, change) in plant.as_flattened_mut().iter_mut().zip(change.as_flattened()) {
                plant.0[i] = *change;
            }
        }
    }

    /// The hands' events at sample k. Returns the pucks and their drives from there on.
    #[inline(never)]
    fn act(&mut self, k: u64, mut puck: [Numbers; 2]) -> ([Numbers; 2], Drives) {
        let mut drives = Drives::NONE;
        for i in 0..LANES {
            let lane = &mut self.lanes[i];
            if lane.next == k {
                let was_driven = lane.is_driven();
                (puck[0].0[i], puck[1].0[i]) = lane.act(k, (puck[0].0[i], puck[1].0[i]));
                if was_driven && !lane.held {
                    self.set_plant(i);
                }
            }
            let lane = &self.lanes[i];
            if let Some(push) = lane.push(k) {
                drives.any_pushed = true;
                drives.pushed.0[i] = 1.0;
                drives.set_drive(i, push);
                drives.any_driven |= lane.is_driven();
                drives.any_varying |= lane.varies();
            }
            let moves = lane.hand.prescribed().is_some_and(|piece| !piece.is_flat());
            drives.any_prescribed |= moves && !lane.is_apart();
            drives.any_apart |= lane.is_apart();
        }
        (puck, drives)
    }

    /// Updates the pushes that change from sample to sample, at sample k or at the end of its delay's fraction.
    #[inline(never)]
    fn vary(&self, k: u64, after_rest: bool, drives: &mut Drives) {
        for (i, lane) in self.lanes.iter().enumerate().filter(|(_, lane)| lane.varies()) {
            let t = k as f64 * lane.period;
            drives.set_drive(i, lane.hand.push(if after_rest { t + lane.rest } else { t }));
        }
    }

    /// Advances the pucks of lanes that have their own device.
    #[inline(never)]
    fn travel(&mut self, k: u64, mut puck: [Numbers; 2], command: Numbers, applied: Applied) -> [Numbers; 2] {
        for (i, lane) in self.lanes.iter_mut().enumerate().filter(|(_, lane)| lane.is_apart()) {
            let at = (puck[0].0[i], puck[1].0[i]);
            (puck[0].0[i], puck[1].0[i]) = lane.travel(k, at, command.0[i], applied.map(|applied| applied.0[i]));
        }
        puck
    }

    /// The pucks under Coulomb friction, at the end of this part of a period.
    #[inline(always)]
    fn slid(&self, part: usize, states: States, driven: bool, pushed: Numbers) -> [Numbers; 2] {
        let ([velocity, torque, position, ..], [forward, backward]) = (states, self.friction);
        let direction = sliding_direction(velocity, torque, self.friction, torque.abs());
        let mut sliding = states;
        sliding[1] = torque - direction.if_above(Numbers::ZERO, forward, backward) * direction;
        let friction = forward + backward;
        let end = moved(&self.plants[part], &sliding, driven, pushed);
        // A stuck puck keeps position and velocity.
        let held = Numbers::ONE - direction * direction;
        let held = friction.if_above(Numbers::ZERO, held, Numbers::ZERO);
        let end = [held.choose(position, end[0]), held.choose(velocity, end[1])];
        // A NaN compares false, and so passes unchanged.
        let slows =
            (Lanes([SLIDES; LANES]) * velocity.abs()).if_above(direction * end[1], velocity.abs(), Numbers::ZERO);
        let stops = (pushed * friction).if_above(Numbers::ZERO, slows, Numbers::ZERO);
        if stops == Numbers::ZERO { end } else { self.stopped(part, states, stops, end) }
    }

    /// Recomputes the lanes whose `stops` is not 0, where the puck may come to rest within this part of the period.
    #[inline(never)]
    fn stopped(&self, part: usize, states: States, stops: Numbers, mut end: [Numbers; 2]) -> [Numbers; 2] {
        let [velocity, torque, position, ..] = states;
        for (i, lane) in self.lanes.iter().enumerate().filter(|(i, _)| stops.0[*i] != 0.0) {
            let device = &lane.world.device;
            let device = (device.inertia, device.damping, device.frictions());
            let puck = (position.0[i], velocity.0[i]);
            (end[0].0[i], end[1].0[i]) = slide_under(device, puck, torque.0[i], lane.parts()[part]);
        }
        end
    }

    /// Sets the pucks whose motion a hand prescribes to their positions at sample k.
    #[inline(never)]
    fn prescribe(&self, k: u64, mut puck: [Numbers; 2]) -> [Numbers; 2] {
        for (i, lane) in self.lanes.iter().enumerate().filter(|(_, lane)| lane.held && !lane.is_apart()) {
            if let Some(piece) = lane.hand.prescribed().filter(|piece| !piece.is_flat()) {
                (puck[0].0[i], puck[1].0[i]) = piece.at(k as f64 * lane.period);
            }
        }
        puck
    }
}

impl<const B: usize, const W: usize, const S: usize> Run<'_, B, W, S> {
    /// The whole run, compiled once for each width of vectors.
    #[inline(always)]
    fn whole(mut self) -> Option<[Option<Outcome>; LANES]> {
        let compiled = self.compiled;
        let mut state = compiled.start();
        let mut outcomes = [None; LANES];
        let mut puck = [Numbers::ZERO; 2];
        for (i, lane) in self.lanes.iter_mut().enumerate() {
            if let Apart::Always(machine) = &mut lane.apart {
                machine.travel(0, 0.0);
                (puck[0].0[i], puck[1].0[i]) = machine.device.puck();
            } else if let Some(piece) = lane.hand.prescribed() {
                (puck[0].0[i], puck[1].0[i]) = piece.at(0.0);
            }
        }
        let mut drives = Drives::NONE;
        let (mut command, mut applied) = (Numbers::ZERO, [Numbers::ZERO; 2]);
        let late = self.motor.rest != 0.0;
        let (mut peak, mut finite_sum) = (Numbers::ZERO, Numbers::ZERO);
        let end = self.lanes.iter().map(|lane| lane.rows).max()?;
        let mut k = 0;
        while k < end {
            // Up to the next event of any hand, the end of any run, or the next check of the stop.
            let first = k;
            if k.is_multiple_of(STRETCH) && (self.stop)() {
                break;
            }
            let mut last = end;
            while k < last {
                if k > 0 {
                    if late {
                        self.motor.change();
                        applied = [applied[1], self.motor.applied];
                    }
                    if drives.any_pushed {
                        for part in if late { 0..2 } else { 1..2 } {
                            if drives.any_varying {
                                self.vary(k - 1, late && part == 1, &mut drives);
                            }
                            let [value, slope, sin, cos] = drives.drive;
                            let states = [puck[1], applied[part] + value, puck[0], slope, sin, cos];
                            puck = if self.slides {
                                self.slid(1 - part, states, drives.any_driven, drives.pushed)
                            } else {
                                moved(&self.plants[1 - part], &states, drives.any_driven, drives.pushed)
                            };
                        }
                    }
                    if drives.any_prescribed {
                        puck = self.prescribe(k, puck);
                        finite_sum += Numbers::ZERO * puck[1];
                    }
                    if drives.any_apart {
                        puck = self.travel(k, puck, command, applied);
                    }
                }
                if k == first {
                    (puck, drives) = self.act(k, puck);
                    let stops = self.lanes.iter().flat_map(|lane| [lane.next, lane.rows]);
                    last = stops.filter(|stop| *stop > k).fold((k / STRETCH + 1) * STRETCH, u64::min).min(end);
                }
                let sample = compiled.step(&mut state, puck[0], puck[1]);
                command = sample.command;
                if self.motor.samples == 0 && !late {
                    applied = [command; 2];
                } else {
                    self.motor.command(command);
                    applied[1] = self.motor.applied;
                    if !late {
                        applied[0] = applied[1];
                    }
                }
                peak = peak.larger(sample.torque.abs());
                // 0 · x is 0 or NaN, and a NaN stays in a sum. Bodies and puck that are not finite never become finite again.
                finite_sum += Numbers::ZERO * sample.torque;
                k += 1;
            }
            for (i, lane) in self.lanes.iter().enumerate().filter(|(_, lane)| lane.rows == k) {
                let bodies: [(f64, f64); B] = from_fn(|j| (state.now.position[j].0[i], state.now.velocity[j].0[i]));
                let (bodies, bristles) = (&bodies[..compiled.bodies()], state.bristles.map(|bristle| bristle.0[i]));
                let own = [(puck[0].0[i], puck[1].0[i]), (finite_sum.0[i], 0.0)];
                let finite = !lane.broken && own.iter().chain(bodies).all(|(x, v)| x.is_finite() && v.is_finite());
                outcomes[i] = finite.then(|| Outcome {
                    peak_torque: peak.0[i],
                    final_energy: world_energy(lane.world, puck[0].0[i], bodies, &bristles),
                });
            }
        }
        Some(outcomes)
    }
}

/// The puck a period later, where it is pushed: by a held torque, or also `driven` by a grip, a ramp or a sine.
#[inline(always)]
fn moved(plant: &[States; 2], states: &States, driven: bool, pushed: Numbers) -> [Numbers; 2] {
    let &[velocity, torque, position, slope, sin, cos] = states;
    let [by_position, by_velocity] = plant;
    let mut travel = by_position[0] * velocity + by_position[1] * torque;
    let mut gain = by_velocity[0] * velocity + by_velocity[1] * torque;
    if driven {
        travel = travel + by_position[2] * position + by_position[3] * slope;
        travel = travel + by_position[4] * sin + by_position[5] * cos;
        gain = gain + by_velocity[2] * position + by_velocity[3] * slope;
        gain = gain + by_velocity[4] * sin + by_velocity[5] * cos;
    }
    [pushed.choose(position + travel, position), pushed.choose(velocity + gain, velocity)]
}
