//! Many worlds side by side, one in each lane of a number.
//!
//! What needs a branch, the torques that a method finds at bodies, and couplings whose kinds differ between lanes are computed by each lane's
//! own loop, one lane after the other.

use core::array::from_fn;

use crate::actuate::Actuator;
use crate::gradient::Contacts;
use crate::lanes::each;
use crate::matrix::{Response, Vector};
use crate::nonlinear::Nonlinear;
use crate::sense::{Kalman, Levant, Memory, Puck, Sensor, Velocity, longest_windows};
use crate::step::{Branches, Loop, Port, Sample, State};
use crate::{Lanes, Number};

/// N worlds side by side, a world in each lane. They may differ in their numbers and in their nonlinear couplings. With S = 0 there are no
/// nonlinear couplings, and the state needs no memory for them; else S is C.
///
/// ```
/// use hapt_core::{Batch, Coupling, End, Estimator, Lanes, Law, Loop, Method, Output, Spec};
///
/// let worlds = [1.0, 2.0].map(|stiffness| {
///     let law = Law::Spring { stiffness, rest: 0.0 };
///     let couplings = [Coupling { first: End::Puck, second: End::Ground, law, limit: None }];
///     let spec = Spec { estimator: Estimator::Difference, couplings: &couplings, ..Spec::new(1e-3) };
///     Loop::<f64, 1, 8, 1>::new(&spec).unwrap()
/// });
/// let batch = Batch::<2, 1, 8, 1, 0>::new(&worlds).unwrap();
/// let mut state = batch.start();
/// assert_eq!(batch.step(&mut state, Lanes([0.1, 0.1]), Lanes([0.0, 0.0])).torque, Lanes([-0.1, -0.2]));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Batch<'w, const N: usize, const B: usize, const C: usize, const W: usize, const S: usize> {
    /// The part of the loop that all lanes share.
    common: Loop<Lanes<N>, B, S, W>,
    worlds: &'w [Loop<f64, B, C, W>; N],
    /// Whether it contains the nonlinear couplings. Else they differ in more than their numbers, and each lane has its own.
    alike: bool,
    /// Whether nonlinear couplings have bristles or torques that are found.
    remembers: bool,
    /// Whether bodies have nonlinear torques.
    forces: bool,
}

/// The vector of lane i.
#[inline(always)]
fn lane<const N: usize, const B: usize>(of: &Vector<Lanes<N>, B>, i: usize) -> Vector<f64, B> {
    Vector { position: from_fn(|j| of.position[j].0[i]), velocity: from_fn(|j| of.velocity[j].0[i]) }
}

/// The same for each of a world's couplings.
#[inline(always)]
fn own<const N: usize, const S: usize, const C: usize>(of: &[Lanes<N>; S], i: usize) -> [f64; C] {
    from_fn(|j| of.get(j).map_or(0.0, |number| number.0[i]))
}

#[inline(always)]
fn puck_of<const N: usize>(of: Puck<Lanes<N>>, i: usize) -> Puck<f64> {
    Puck { position: of.position.0[i], velocity: of.velocity.0[i] }
}

impl<const N: usize, const B: usize, const C: usize, const W: usize, const S: usize> Batch<'_, N, B, C, W, S> {
    /// A lane's bristles and found torques.
    #[inline(always)]
    fn memory_of(
        &self,
        bristles: &[Lanes<N>; S],
        contacts: &Contacts<Lanes<N>, S>,
        i: usize,
    ) -> ([f64; C], Contacts<f64, C>) {
        if !self.remembers {
            return ([0.0; C], Contacts::NONE);
        }
        (own(bristles, i), Contacts { torques: own(&contacts.torques, i), unsettled: contacts.unsettled })
    }
}

impl<const N: usize, const B: usize, const C: usize, const W: usize, const S: usize> Branches<Lanes<N>, B, S, W>
    for Batch<'_, N, B, C, W, S>
{
    #[inline(always)]
    fn estimate(&self, memory: &mut Memory<Lanes<N>, W>, position: Lanes<N>) -> Lanes<N> {
        if let Some(velocity) = self.common.sensor.by_difference(memory, position) {
            return velocity;
        }
        // FOAW remembers counts.
        if W == 1 {
            return Lanes::ZERO;
        }
        let newest = memory.then(0);
        let windows = from_fn(|i| self.worlds[i].sensor.window(memory.older));
        let windows = longest_windows(windows, |age| (memory.then(age) - newest).0);
        Lanes(from_fn(|i| self.worlds[i].sensor.fit(windows[i], |age| memory.then(age).0[i] - newest.0[i])))
    }

    #[inline(always)]
    fn bend(&self, bristles: &mut [Lanes<N>; S], puck: Puck<Lanes<N>>, bodies: &Vector<Lanes<N>, B>) {
        if S == 0 || !self.remembers {
            return;
        }
        if self.alike {
            return self.common.bend_each(bristles, puck, bodies);
        }
        for (i, world) in self.worlds.iter().enumerate() {
            let mut after = own(bristles, i);
            world.bend_all(&mut after, puck_of(puck, i), &lane(bodies, i));
            for (bristle, after) in bristles.iter_mut().zip(after) {
                bristle.0[i] = after;
            }
        }
    }

    #[inline(always)]
    fn change(
        &self,
        n: usize,
        change: &mut Vector<Lanes<N>, B>,
        x: &Vector<Lanes<N>, B>,
        old: Option<Puck<Lanes<N>>>,
        new: Puck<Lanes<N>>,
        bristles: &[Lanes<N>; S],
        contacts: &mut Contacts<Lanes<N>, S>,
    ) {
        self.common.linear(n, change, x, old, new);
        if S == 0 || !self.forces {
            return;
        }
        for (i, world) in self.worlds.iter().enumerate() {
            let Some(force) = &world.force else { continue };
            let mut moved = lane(change, i);
            let (bristles, mut found) = self.memory_of(bristles, contacts, i);
            let (old, new) = (old.map(|old| puck_of(old, i)), puck_of(new, i));
            world.force_on(&mut moved, force, &lane(x, i), old, new, &bristles, &mut found);
            for j in 0..n.min(B) {
                (change.position[j].0[i], change.velocity[j].0[i]) = (moved.position[j], moved.velocity[j]);
            }
            if self.remembers {
                for (torques, torque) in contacts.torques.iter_mut().zip(found.torques) {
                    torques.0[i] = torque;
                }
            }
        }
    }

    #[inline(always)]
    fn with_nonlinear_torque<const L: usize>(
        &self,
        torque: Lanes<N>,
        bodies: &Vector<Lanes<N>, L>,
        puck: Puck<Lanes<N>>,
        bristles: &[Lanes<N>; S],
        contacts: &Contacts<Lanes<N>, S>,
    ) -> Lanes<N> {
        if S == 0 {
            return torque;
        }
        if self.alike {
            return torque + self.common.sum_at_puck(bodies, puck, bristles, contacts);
        }
        let mut torque = torque;
        for (i, world) in self.worlds.iter().enumerate().filter(|(_, world)| world.nonlinear_count > 0) {
            let (bristles, found) = self.memory_of(bristles, contacts, i);
            torque.0[i] += world.nonlinear_torque(&lane(bodies, i), puck_of(puck, i), &bristles, &found);
        }
        torque
    }

    #[inline(always)]
    fn command(&self, torque: Lanes<N>) -> Lanes<N> {
        self.common.actuator.command(torque)
    }
}

impl<'w, const N: usize, const B: usize, const C: usize, const W: usize, const S: usize> Batch<'w, N, B, C, W, S> {
    /// `None` where the worlds differ in more than their numbers and nonlinear couplings: number of bodies, kind of method, output, advance,
    /// the samples between steps of the bodies, estimator, parts of the device; and with S = 0 where one has nonlinear couplings.
    pub fn new(worlds: &'w [Loop<f64, B, C, W>; N]) -> Option<Self> {
        let first = worlds.first()?;
        let alike = |world: &Loop<f64, B, C, W>| {
            (world.bodies, world.new_sample_first, world.skips) == (first.bodies, first.new_sample_first, first.skips)
                && world.moment == first.moment
        };
        let bends = worlds.iter().any(|world| world.nonlinear_count > 0);
        if !worlds.iter().all(alike) || (S == 0 && bends) {
            return None;
        }
        let nonlinear = nonlinear(worlds).filter(|_| bends);
        let common = Loop {
            bodies: first.bodies,
            period: each(worlds, &|w| w.period),
            rate: each(worlds, &|w| w.rate),
            new_sample_first: first.new_sample_first,
            skips: first.skips,
            has_fast_path: false,
            staged: false,
            moment: first.moment,
            start: vector(worlds, &|w| &w.start),
            state: from_fn(|j| response(worlds, &|w| &w.state[j])),
            input_new: response(worlds, &|w| &w.input_new),
            input_old: response(worlds, &|w| &w.input_old),
            drift: vector(worlds, &|w| &w.drift),
            force: None,
            gradient: None,
            port: Port {
                puck: from_fn(|i| each(worlds, &|w| w.port.puck[i])),
                bodies: vector(worlds, &|w| &w.port.bodies),
                offset: each(worlds, &|w| w.port.offset),
            },
            nonlinear: nonlinear.unwrap_or([None; S]),
            nonlinear_count: if nonlinear.is_some() { first.nonlinear_count } else { 0 },
            sensor: Sensor {
                count: each_or_none(worlds, &|w| w.sensor.count)?,
                rate: each(worlds, &|w| w.sensor.rate),
                filter: each_or_none(worlds, &|w| w.sensor.filter)?,
                velocity: velocity(worlds)?,
            },
            actuator: Actuator {
                // No limit is an infinite one.
                limit: Some(each(worlds, &|w| w.actuator.limit.unwrap_or(f64::INFINITY))),
                step: each_or_none(worlds, &|w| w.actuator.step)?,
                passes: Lanes::ZERO,
                beyond: Lanes::ZERO,
            },
        };
        let remembers =
            S > 0 && worlds.iter().flat_map(|world| world.nonlinear.iter().flatten()).any(Nonlinear::remembers);
        let forces = worlds.iter().any(|world| world.force.is_some());
        Some(Batch { common, worlds, alike: nonlinear.is_some(), remembers, forces })
    }

    /// The state before sample 0.
    pub fn start(&self) -> State<Lanes<N>, B, S, W> {
        State { now: self.common.start, ..State::EMPTY }
    }

    /// How many bodies each world has.
    pub fn bodies(&self) -> usize {
        self.common.bodies
    }

    /// Sample k of every world, as in a loop of one world: see [`Loop::step`].
    #[inline(always)]
    pub fn step(
        &self,
        state: &mut State<Lanes<N>, B, S, W>,
        position: Lanes<N>,
        velocity: Lanes<N>,
    ) -> Sample<Lanes<N>> {
        self.common.sample(self, state, position, velocity)
    }
}

/// The nonlinear couplings in the first S places of all worlds; `None` where they differ in more than their numbers.
fn nonlinear<const N: usize, const B: usize, const C: usize, const W: usize, const S: usize>(
    worlds: &[Loop<f64, B, C, W>; N],
) -> Option<[Option<Nonlinear<Lanes<N>>>; S]> {
    let mut all = [None; S];
    for (j, place) in all.iter_mut().enumerate() {
        let of = |world: &Loop<f64, B, C, W>| world.nonlinear.get(j).copied().flatten();
        let Some(first) = of(worlds.first()?) else {
            if worlds.iter().any(|world| of(world).is_some()) {
                return None;
            }
            continue;
        };
        if worlds.iter().any(|world| of(world).is_none()) {
            return None;
        }
        *place = Some(Nonlinear::side_by_side(from_fn(|i| of(&worlds[i]).unwrap_or(first)))?);
    }
    Some(all)
}

/// A part that all worlds have, or none has; `None` where only some have it.
fn each_or_none<T, const N: usize>(worlds: &[T; N], of: &dyn Fn(&T) -> Option<f64>) -> Option<Option<Lanes<N>>> {
    let how_many = worlds.iter().filter(|world| of(world).is_some()).count();
    match how_many {
        0 => Some(None),
        all if all == N => Some(Some(each(worlds, &|world| of(world).unwrap_or(0.0)))),
        _ => None,
    }
}

fn vector<T, const N: usize, const B: usize>(
    worlds: &[T; N],
    of: &dyn Fn(&T) -> &Vector<f64, B>,
) -> Vector<Lanes<N>, B> {
    Vector {
        position: from_fn(|i| each(worlds, &|world| of(world).position[i])),
        velocity: from_fn(|i| each(worlds, &|world| of(world).velocity[i])),
    }
}

fn response<T, const N: usize, const B: usize>(
    worlds: &[T; N],
    of: &dyn Fn(&T) -> &Response<f64, B>,
) -> Response<Lanes<N>, B> {
    Response {
        position: vector(worlds, &|world| &of(world).position),
        velocity: vector(worlds, &|world| &of(world).velocity),
    }
}

/// The estimator of all worlds; `None` where they have different ones, or differences over different numbers of samples. FOAW has the
/// longest of all windows, and each lane uses its own.
fn velocity<const N: usize, const B: usize, const C: usize, const W: usize>(
    worlds: &[Loop<f64, B, C, W>; N],
) -> Option<Option<Velocity<Lanes<N>>>> {
    let of = |world: &Loop<f64, B, C, W>| world.sensor.velocity;
    let all = |is: fn(Option<Velocity<f64>>) -> bool| worlds.iter().all(|world| is(of(world)));
    if all(|velocity| velocity.is_none()) {
        Some(None)
    } else if all(|velocity| matches!(velocity, Some(Velocity::Difference))) {
        Some(Some(Velocity::Difference))
    } else if all(|velocity| matches!(velocity, Some(Velocity::Foaw { .. }))) {
        Some(Some(Velocity::Foaw { window: W, best: false }))
    } else if let Some(Velocity::DifferenceOver { every, .. }) = worlds.first().and_then(of) {
        let rate = |world: &Loop<f64, B, C, W>| match of(world) {
            Some(Velocity::DifferenceOver { every: other, rate }) if other == every => Some(rate),
            None | Some(_) => None,
        };
        Some(Some(Velocity::DifferenceOver { every, rate: each_or_none(worlds, &rate)?? }))
    } else {
        // The kind of the first, and each world's numbers where it has the same.
        let numbers = |velocity: Option<Velocity<f64>>| match velocity? {
            Velocity::LowPass { keep, gain } => Some((0, [keep, gain, 0.0, 0.0, 0.0])),
            Velocity::Kalman(k) => Some((1, [k.period, k.half, k.position, k.velocity, k.acceleration])),
            Velocity::Levant(l) => Some((2, [l.period, l.rate, l.change, l.reach, l.pull])),
            Velocity::Difference | Velocity::Foaw { .. } | Velocity::DifferenceOver { .. } => None,
        };
        let (kind, _) = numbers(of(worlds.first()?))?;
        let same = |velocity| numbers(velocity).filter(|(own, _)| *own == kind);
        let part = |i: usize| each_or_none(worlds, &|world| same(of(world)).map(|(_, numbers)| numbers[i])).flatten();
        Some(Some(match kind {
            0 => Velocity::LowPass { keep: part(0)?, gain: part(1)? },
            1 => Velocity::Kalman(Kalman {
                period: part(0)?,
                half: part(1)?,
                position: part(2)?,
                velocity: part(3)?,
                acceleration: part(4)?,
            }),
            _ => Velocity::Levant(Levant {
                period: part(0)?,
                rate: part(1)?,
                change: part(2)?,
                reach: part(3)?,
                pull: part(4)?,
            }),
        }))
    }
}
