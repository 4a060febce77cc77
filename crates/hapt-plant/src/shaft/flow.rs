//! The linear motion of a puck, its shaft and the handle on it, with its works; [`super::Shaft`] advances with it from event to event.

use super::Shaft;
use crate::exponential::{GAUSS, Square, applied, congruent, doubled, folded, halved, series, widened};
use crate::push::{Grasp, Inertia, Sine};
use crate::root::root;
use crate::spec::Handle;

/// How many states there are.
pub const STATES: usize = 10;
/// v, w, s, x, f, d, g, ramp, σ, κ.
pub type State = [f64; STATES];
pub const V: usize = 0;
pub const W: usize = 1;
pub const S: usize = 2;
pub const X: usize = 3;
pub const MOTOR: usize = 4;
pub const GAP: usize = 5;
pub const HAND: usize = 6;
pub const RAMP: usize = 7;
pub const SIN: usize = 8;
pub const COS: usize = 9;
pub type Matrix = Square<STATES>;

/// A linear motion ẏ = N y, and its maps over the recurring time steps.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Flow {
    pub n: Matrix,
    /// Powers, each a product of two linear outputs: of the motor's torque beyond the held one, lost in the puck's damping and in the
    /// shaft's, and of the hand without its spring and inertia.
    pub powers: [[State; 2]; 4],
    /// The fastest rate in it and the highest frequency of oscillation, in 1/s; then both once the motor has settled.
    pub rate: f64,
    pub settled_rate: f64,
    pub swing: f64,
    pub recurring: [(f64, Propagator); 2],
    /// The time in which the fastest goes a quarter radian, and exp(N t) - I over it.
    quarter: (f64, Matrix),
}

/// The map over a time step.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Propagator {
    /// exp(N dt) - I
    pub change: Matrix,
    /// The integrals of the powers as quadratic forms of the state at the start; the upper triangles hold all of them.
    pub works: [Matrix; 4],
}

impl Flow {
    /// No motion.
    pub fn zero() -> Self {
        Flow {
            n: [[0.0; STATES]; STATES],
            powers: [[[0.0; STATES]; 2]; 4],
            rate: 0.0,
            settled_rate: 0.0,
            swing: 0.0,
            recurring: core::array::from_fn(|_| (0.0, Propagator::NONE)),
            quarter: (0.0, [[0.0; STATES]; STATES]),
        }
    }

    pub fn new(shaft: &Shaft, grasp: Grasp, sine: Sine, stuck: bool) -> Self {
        let Handle { inertia, stiffness, damping } = shaft.handle;
        let (own, decay) = (shaft.device, shaft.decay);
        let mut n = [[0.0; STATES]; STATES];
        // The shaft's torque on the puck, and what drives the handle.
        let (mut torque, mut drive) = ([0.0; STATES], [0.0; STATES]);
        (torque[S], torque[W], torque[V]) = (stiffness, damping, -damping);
        (drive[HAND], drive[SIN], drive[COS]) = (1.0, sine.0, sine.1);
        let grip = if let Grasp::Grip(grip) = grasp { grip } else { Inertia::default() };
        let mass = inertia + grip.inertia;
        n[W] = match grasp {
            Grasp::Prescribed => drive,
            Grasp::Free | Grasp::Grip(_) => {
                let mut w: State = core::array::from_fn(|i| (drive[i] - torque[i]) / mass);
                w[W] -= grip.damping / mass;
                w[S] -= grip.stiffness / mass;
                w[X] -= grip.stiffness / mass;
                w
            }
        };
        (n[S][W], n[X][V]) = (1.0, 1.0);
        n[S][V] = -1.0;
        if !stuck {
            n[V] = torque.map(|x| x / own.inertia);
            n[V][V] -= own.damping / own.inertia;
            (n[V][MOTOR], n[V][GAP]) = (1.0 / own.inertia, 1.0 / own.inertia);
        }
        n[GAP][GAP] = -decay;
        n[HAND][RAMP] = 1.0;
        (n[SIN][COS], n[COS][SIN]) = (sine.2, -sine.2);

        let unit = |i: usize, x: f64| {
            let mut row = [0.0; STATES];
            row[i] = x;
            row
        };
        let mut slip = unit(W, damping);
        slip[V] = -damping;
        let hand = match grasp {
            Grasp::Prescribed => torque,
            Grasp::Free | Grasp::Grip(_) => {
                drive[W] -= grip.damping;
                drive
            }
        };
        let mut turn = unit(W, 1.0);
        turn[V] = -1.0;
        let powers =
            [[unit(GAP, 1.0), unit(V, 1.0)], [unit(V, own.damping), unit(V, 1.0)], [slip, turn], [hand, unit(W, 1.0)]];

        let masses = 1.0 / own.inertia + 1.0 / mass;
        let swing = libm::sqrt(stiffness * masses + grip.stiffness / mass).max(sine.2);
        let settled_rate = (damping * masses + own.damping / own.inertia + grip.damping / mass).max(swing);
        let rate = settled_rate.max(decay);
        let quarter = (0.25 / rate, series(&n, 0.25 / rate));
        let mut flow = Flow {
            n,
            powers,
            rate,
            settled_rate,
            swing,
            recurring: core::array::from_fn(|_| (0.0, Propagator::NONE)),
            quarter,
        };
        let [first, second] = shaft.lengths;
        let long = flow.propagator(first);
        let short = if second == first { long.clone() } else { flow.propagator(second) };
        flow.recurring = [(first, long), (second, short)];
        flow
    }

    pub fn propagator(&self, dt: f64) -> Propagator {
        self.propagator_of::<STATES>(dt)
    }

    /// A propagator of the states that the motion from `y` on needs, bit-identical to the one of all states: the others are 0.
    pub fn propagator_for(&self, y: &State, dt: f64) -> Propagator {
        match y.iter().rposition(|y| *y != 0.0) {
            None | Some(..=MOTOR) => self.propagator_of::<{ MOTOR + 1 }>(dt),
            Some(GAP) => self.propagator_of::<{ GAP + 1 }>(dt),
            Some(HAND | RAMP) => self.propagator_of::<{ RAMP + 1 }>(dt),
            Some(_) => self.propagator_of::<STATES>(dt),
        }
    }

    /// Of the first K states; the rows and columns of the others are 0.
    fn propagator_of<const K: usize>(&self, dt: f64) -> Propagator {
        let (h, halvings) = halved(self.rate, dt);
        let n: Square<K> = core::array::from_fn(|i| core::array::from_fn(|j| self.n[i][j]));
        let mut works = [[[0.0; K]; K]; 4];
        for (node, weight) in GAUSS {
            let change = series(&n, node * h);
            for (work, [p, q]) in works.iter_mut().zip(&self.powers) {
                let (p, q) = (output(p, &change), output(q, &change));
                for (row, p) in work.iter_mut().zip(p) {
                    for (x, q) in row.iter_mut().zip(q) {
                        *x += weight * h * p * q;
                    }
                }
            }
        }
        let mut change = series(&n, h);
        for _ in 0..halvings {
            // The second half starts at the end of the first.
            for work in &mut works {
                let later = congruent(&change, work);
                for (x, later) in work.as_flattened_mut().iter_mut().zip(later.as_flattened()) {
                    *x += later;
                }
            }
            change = doubled(&change);
        }
        let states = core::array::from_fn(|i| i);
        Propagator { change: widened(states, &change), works: works.map(|work| widened(states, &folded(&work))) }
    }

    /// exp(N dt) - I
    fn change(&self, dt: f64) -> Matrix {
        if let Some((_, propagator)) = self.recurring.iter().find(|(length, _)| *length == dt) {
            return propagator.change;
        }
        let (h, halvings) = halved(self.rate, dt);
        let mut change = series(&self.n, h);
        for _ in 0..halvings {
            change = doubled(&change);
        }
        change
    }

    /// The first t in (0, dt] at which g, negative or zero at the start, becomes positive. `g` gives value and derivative.
    ///
    /// The time is cut into slices in which nothing swings more than a quarter radian: a derivative changes sign at most once. What
    /// decays is cut into slices that grow with the time since, as the decay slows.
    pub fn first_crossing(&self, y: &State, dt: f64, g: impl Fn(&State) -> (f64, f64)) -> Option<f64> {
        let (mut y, mut t, mut slope) = (*y, 0.0, g(y).1);
        let mut length = self.quarter.0.min(dt);
        let mut change = if length == self.quarter.0 { self.quarter.1 } else { self.change(length) };
        for slice in 1.. {
            let left = dt - t;
            let step = length.min(left);
            let course = || Course::new(self, &y, step);
            let next = if step == length { applied(&change, &y) } else { course().after(step) };
            let (value, next_slope) = g(&next);
            let turns = slope > 0.0 && next_slope < 0.0;
            if value > 0.0 || turns {
                let course = course();
                let positive = if value > 0.0 {
                    Some(step)
                } else {
                    let summit = root(0.0, step, |t| -g(&course.after(t)).1);
                    (g(&course.after(summit)).0 > 0.0).then_some(summit)
                };
                if let Some(positive) = positive {
                    return Some((t + root(0.0, positive, |t| g(&course.after(t)).0)).min(dt));
                }
            }
            // Negated, so that a NaN also ends the search.
            if !(step < left && t + step > t) {
                return None;
            }
            (y, slope, t) = (next, next_slope, t + step);
            if slice % 2 == 0 && 8.0 * length * self.swing <= 1.0 {
                length *= 2.0;
                change = doubled(&change);
            }
        }
        None
    }
}

/// The course of a motion from a state over up to a time step.
struct Course<'a> {
    flow: &'a Flow,
    start: State,
    dt: f64,
    /// (N dt)ʲ y / j!, exact to rounding over a quarter radian; `None` for a longer time step.
    terms: Option<[State; TERMS]>,
}

/// A quarter radian needs 16 terms beyond the first, as in [`series`].
const TERMS: usize = 17;

impl<'a> Course<'a> {
    fn new(flow: &'a Flow, y: &State, dt: f64) -> Self {
        let terms = (flow.rate * dt <= 0.25).then(|| {
            let mut terms = [*y; TERMS];
            for j in 1..TERMS {
                let before = terms[j - 1];
                for (x, row) in terms[j].iter_mut().zip(&flow.n) {
                    *x = row.iter().zip(&before).map(|(n, y)| n * y).sum::<f64>() * (dt / j as f64);
                }
            }
            terms
        });
        Course { flow, start: *y, dt, terms }
    }

    /// The state after `t`.
    fn after(&self, t: f64) -> State {
        let Some(terms) = &self.terms else { return applied(&self.flow.change(t), &self.start) };
        let part = t / self.dt;
        terms.iter().rev().fold([0.0; STATES], |y, term| core::array::from_fn(|i| y[i] * part + term[i]))
    }
}

impl Propagator {
    const NONE: Propagator = Propagator { change: [[0.0; STATES]; STATES], works: [[[0.0; STATES]; STATES]; 4] };
}

/// A linear output as one of the first K states at the start.
fn output<const K: usize>(row: &State, change: &Square<K>) -> [f64; K] {
    let mut out = core::array::from_fn(|i| row[i]);
    for (gain, change) in row.iter().zip(change).filter(|(gain, _)| **gain != 0.0) {
        for (out, x) in out.iter_mut().zip(change) {
            *out += gain * x;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    fn or_zero(of: core::ops::Range<f64>) -> impl Strategy<Value = f64> {
        prop_oneof![Just(0.0), of]
    }

    proptest! {
        #![proptest_config(hapt_testing::cases(400))]

        /// The result of the states that a motion needs is bit-identical to that of all states; a short motion's series equals its exponential.
        #[test]
        fn states_that_are_0_may_be_left_out(
            (inertia, stiffness, damping) in (1e-5_f64..1e-2, 0.3_f64..1e4, or_zero(1e-6..1.0)),
            (motor, friction, lag) in (1e-5_f64..1e-2, or_zero(1e-4..0.1), or_zero(1e-4..5e-3)),
            grip in prop::option::of((1e-5_f64..1e-2, 0.0_f64..0.1, 0.0_f64..10.0)), stuck in any::<bool>(),
            y in prop::array::uniform8(or_zero(-1.0..1.0)), sine in or_zero(0.1..1.0), dt in 1e-5_f64..1e-2,
        ) {
            let device = Inertia { inertia: motor, damping: 1e-3, stiffness: 0.0 };
            let handle = Handle { inertia, stiffness, damping };
            let mut shaft = Shaft::boxed(handle, device, crate::own::Own::of(crate::friction::Levels { forward: friction, backward: friction }), lag, [1e-3; 2]);
            let grasp = grip.map_or(Grasp::Free, |(inertia, damping, stiffness)| Grasp::Grip(Inertia { inertia, damping, stiffness }));
            shaft.take(grasp, (sine, 0.0, 30.0), false);
            let flow = if stuck { &shaft.now.stuck } else { &shaft.now.sliding };
            let mut all = [0.0; STATES];
            all[..8].copy_from_slice(&y);
            if sine != 0.0 {
                (all[SIN], all[COS]) = (0.6, 0.8);
            }
            let (few, whole) = (flow.propagator_for(&all, dt), flow.propagator(dt));
            prop_assert_eq!(applied(&few.change, &all), applied(&whole.change, &all));
            for (few, whole) in few.works.iter().zip(&whole.works) {
                let work = |form: &Matrix| -> f64 { (0..STATES).map(|i| all[i] * (i..STATES).map(|j| form[i][j] * all[j]).sum::<f64>()).sum() };
                prop_assert_eq!(work(few), work(whole));
            }
            let short = dt.min(0.2 / flow.rate);
            let (by_series, by_exponential) = (Course::new(flow, &all, short).after(0.7 * short), applied(&flow.change(0.7 * short), &all));
            for (a, b) in by_series.iter().zip(by_exponential) {
                prop_assert!((a - b).abs() <= 1e-12 * (1.0 + b.abs()) * (1.0 + flow.rate), "{a} {b}");
            }
        }
    }
}
