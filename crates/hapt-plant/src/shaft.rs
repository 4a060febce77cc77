//! A handle on a flexible shaft, exactly: the motor turns the puck, the hand holds the handle.
//!
//! ```text
//! J v̇ = f + d - b v - friction + τ,   τ = k s + c (w - v),   s = h - x
//! M ẇ = g + ramp t + sine σ + cosine κ - τ - (the grip's damping) w - (the grip's stiffness) h
//! ```
//!
//! with the puck's x and v, the handle's h and w; M is its inertia and the grip's. A hand that prescribes the handle's motion gives ẇ itself.
//! As with a puck alone, the torques are states too, and one matrix exponential gives motion and works. While friction holds the puck, the
//! handle swings on: that is another such equation, with v = 0.

use alloc::boxed::Box;

use crate::exponential::{GAUSS, Square, applied, congruent, doubled, folded, halved, series, widened};
use crate::field::{Field, Fielded};
use crate::friction::{MOST_EVENTS, ROUNDING};
use crate::ledger::Ledger;
use crate::puck::{Inertia, Lengths, NO_SINE, Push, Sine, decay};
use crate::root::root;
use crate::spec::Handle;

/// How many states there are.
const STATES: usize = 10;
/// v, w, s, x, f, d, g, ramp, σ, κ.
type State = [f64; STATES];
const V: usize = 0;
const W: usize = 1;
const S: usize = 2;
const X: usize = 3;
const MOTOR: usize = 4;
const GAP: usize = 5;
const HAND: usize = 6;
const RAMP: usize = 7;
const SIN: usize = 8;
const COS: usize = 9;
type Matrix = Square<STATES>;

/// The hand's hold on the handle.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Grasp {
    /// None, or a torque.
    Free,
    /// Its inertia, damping and stiffness.
    Grip(Inertia),
    /// It prescribes the handle's motion.
    Prescribed,
}

/// The handle with its shaft, and the hand on it. Position and velocity of the puck are its own.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Shaft {
    /// The handle's position less the puck's, in rad (linear: m).
    pub deflection: f64,
    /// The handle's velocity, in rad/s (linear: m/s).
    pub velocity: f64,
    pub handle: Handle,
    device: Inertia,
    friction: f64,
    /// Gravity and cogging on the puck, where there are any.
    field: Option<Field>,
    /// The rate in 1/s at which the motor approaches its command; 0: at once.
    decay: f64,
    lengths: Lengths,
    now: Held,
    /// Of a hand that alternately opens and closes: whether it is open.
    other: Option<Held>,
}

/// Puck, shaft and handle in a hand: while the puck slides, and while friction holds it.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Held {
    grasp: Grasp,
    sine: Sine,
    sliding: Flow,
    stuck: Flow,
}

/// A linear motion ẏ = N y, and its maps over the recurring time steps.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Flow {
    n: Matrix,
    /// Powers, each a product of two linear outputs: of the motor's torque beyond the held one, lost in the puck's damping and in the
    /// shaft's, and of the hand without its spring and inertia.
    powers: [[State; 2]; 4],
    /// The fastest rate in it and the highest frequency of oscillation, in 1/s; the same once the motor has settled.
    rate: f64,
    settled_rate: f64,
    swing: f64,
    usual: [(f64, Propagator); 2],
    /// The time in which the fastest goes a quarter radian, and exp(N t) - I over it.
    quarter: (f64, Matrix),
}

/// The map over a time step.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Propagator {
    /// exp(N dt) - I
    change: Matrix,
    /// The integrals of the powers as quadratic forms of the state at the start; the upper triangles hold all of them.
    works: [Matrix; 4],
}

impl Flow {
    fn new(shaft: &Shaft, grasp: Grasp, sine: Sine, stuck: bool) -> Self {
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
            usual: core::array::from_fn(|_| (0.0, Propagator::NONE)),
            quarter,
        };
        let [first, second] = shaft.lengths;
        let long = flow.propagator(first);
        let short = if second == first { long.clone() } else { flow.propagator(second) };
        flow.usual = [(first, long), (second, short)];
        flow
    }

    fn propagator(&self, dt: f64) -> Propagator {
        self.propagator_of::<STATES>(dt)
    }

    /// One that suffices for the motion from `y` on, with the bits of one of all states: the others are 0, and change nothing.
    fn propagator_for(&self, y: &State, dt: f64) -> Propagator {
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
            // The second half starts where the first has ended.
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
        if let Some((_, propagator)) = self.usual.iter().find(|(length, _)| *length == dt) {
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
    fn first_crossing(&self, y: &State, dt: f64, g: impl Fn(&State) -> (f64, f64)) -> Option<f64> {
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
            // The negation ends the search at a number that is none, too.
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

/// How a motion goes on from a state, for up to a time step.
struct Course<'a> {
    flow: &'a Flow,
    start: State,
    dt: f64,
    /// (N dt)ʲ y / j!, to rounding over a quarter radian; `None`: it goes further.
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

impl Shaft {
    /// A free handle at rest on an unloaded shaft. Not inlined, so that a device without one does not use its stack.
    #[inline(never)]
    pub fn boxed(
        handle: Handle,
        device: Inertia,
        (friction, field): (f64, Option<Field>),
        lag: f64,
        lengths: Lengths,
    ) -> Box<Self> {
        let none = || Flow {
            n: [[0.0; STATES]; STATES],
            powers: [[[0.0; STATES]; 2]; 4],
            rate: 0.0,
            settled_rate: 0.0,
            swing: 0.0,
            usual: core::array::from_fn(|_| (0.0, Propagator::NONE)),
            quarter: (0.0, [[0.0; STATES]; STATES]),
        };
        let now = Held { grasp: Grasp::Free, sine: NO_SINE, sliding: none(), stuck: none() };
        let decay = decay(lag);
        let mut shaft =
            Shaft { deflection: 0.0, velocity: 0.0, handle, device, friction, field, decay, lengths, now, other: None };
        shaft.take(Grasp::Free, NO_SINE, false);
        Box::new(shaft)
    }

    fn held(&self, grasp: Grasp, sine: Sine) -> Held {
        Held { grasp, sine, sliding: Flow::new(self, grasp, sine, false), stuck: Flow::new(self, grasp, sine, true) }
    }

    /// A hand holds the handle so, with this `sine`: torques, or of a prescribed motion accelerations. One that `switches` alternately opens
    /// and closes: open, only its inertia stays. Allocates nothing.
    pub fn take(&mut self, grasp: Grasp, sine: Sine, switches: bool) {
        self.now = self.held(grasp, sine);
        self.other = match grasp {
            Grasp::Grip(grip) if switches => {
                Some(self.held(Grasp::Grip(Inertia { damping: 0.0, stiffness: 0.0, ..grip }), NO_SINE))
            }
            Grasp::Free | Grasp::Grip(_) | Grasp::Prescribed => None,
        };
    }

    /// The same hand on another device. Allocates nothing.
    pub fn refit(&mut self, device: Inertia, (friction, field): (f64, Option<Field>), lag: f64, lengths: Lengths) {
        (self.device, self.friction, self.field) = (device, friction, field);
        (self.decay, self.lengths) = (decay(lag), lengths);
        self.now = self.held(self.now.grasp, self.now.sine);
        self.other = self.other.as_ref().map(|other| self.held(other.grasp, other.sine));
    }

    /// Gravity and cogging where the puck's 0 has moved.
    pub fn place(&mut self, field: Option<Field>) {
        self.field = field;
    }

    /// Opens or closes a switching hand.
    pub fn switch(&mut self) {
        if let Some(other) = &mut self.other {
            core::mem::swap(&mut self.now, other);
        }
    }

    /// Moves for `dt` under the motor's torque, which is `motor` and `gap` beyond it, and the hand's push; the works go to the ledger. Takes
    /// the puck's position and velocity, and gives those at the end.
    #[inline(never)]
    pub fn advance(
        &mut self,
        [x, v]: [f64; 2],
        dt: f64,
        (motor, gap): (f64, f64),
        push: Push,
        ledger: &mut Ledger,
    ) -> [f64; 2] {
        let mut y = [v, self.velocity, self.deflection, x, motor, gap, push.value, push.slope, push.sin, push.cos];
        let mut left = dt;
        let field = self.field;
        // Where a slip starts, its direction is known. The net torque there is friction's, and rounding could call it either.
        let mut slips = None;
        // Each pass ends in a stop or a start.
        for _ in 0..MOST_EVENTS {
            if left <= 0.0 {
                break;
            }
            // What friction holds stays where the torque of the field is this.
            let mut held = y;
            held[MOTOR] += field.map_or(0.0, |field| field.torque(y[X]));
            let direction = slips.take().or_else(|| self.direction(&held));
            if let (Some(field), Some(direction)) = (&field, direction) {
                left = self.slide_in(field, &mut y, left, direction, ledger);
                continue;
            }
            let event = match direction {
                Some(0.0) => None,
                Some(direction) => self.first_stop(&y, left, direction),
                None => self.first_slip(&held, left).map(|(start, side)| {
                    slips = Some(side);
                    start
                }),
            };
            let taken = event.unwrap_or(left);
            self.pass(&mut y, taken, direction, ledger);
            if direction.is_some() && event.is_some() {
                y[V] = 0.0;
            }
            left -= taken;
        }
        if left > 0.0 {
            // More events than that in one period: the puck rests, and the handle swings on.
            y[V] = 0.0;
            self.pass(&mut y, left, None, ledger);
        }
        (self.deflection, self.velocity) = (y[S], y[W]);
        [y[X], y[V]]
    }

    /// The direction in which the puck slides, ±1, or 0 without friction; `None` while friction holds it: at rest and |net torque| ≤
    /// friction, up to rounding.
    fn direction(&self, y: &State) -> Option<f64> {
        let net = self.net(y);
        if self.friction == 0.0 {
            Some(0.0)
        } else if y[V] != 0.0 {
            Some(y[V].signum())
        } else if net.abs() > self.hold(y) {
            Some(net.signum())
        } else {
            None
        }
    }

    /// The torque on a puck at rest, friction aside: motor and shaft.
    fn net(&self, y: &State) -> f64 {
        y[MOTOR] + y[GAP] + self.handle.stiffness * y[S] + self.handle.damping * y[W]
    }

    /// Its derivative at rest.
    fn net_slope(&self, y: &State) -> f64 {
        let ends: f64 = self.now.stuck.n[W].iter().zip(y).map(|(n, y)| n * y).sum();
        self.handle.stiffness * y[W] + self.handle.damping * ends - self.decay * y[GAP]
    }

    /// The most net torque that holds the puck at rest: friction, and what rounding can leave of the torques that balance there.
    fn hold(&self, y: &State) -> f64 {
        let shaft = (self.handle.stiffness * y[S]).abs() + (self.handle.damping * y[W]).abs();
        self.friction + ROUNDING * (self.friction + y[MOTOR].abs() + y[GAP].abs() + shaft)
    }

    /// The first instant in (0, dt] at which a slide in `direction` comes to rest.
    fn first_stop(&self, y: &State, dt: f64, direction: f64) -> Option<f64> {
        let mut sliding = *y;
        sliding[MOTOR] -= self.friction * direction;
        let flow = &self.now.sliding;
        flow.first_crossing(&sliding, dt, |y| {
            let acceleration: f64 = flow.n[V].iter().zip(y).map(|(n, y)| n * y).sum();
            (-direction * y[V], -direction * acceleration)
        })
    }

    /// The first instant in (0, dt] at which the net torque on the puck at rest exceeds friction, and its sign, ±1.
    fn first_slip(&self, y: &State, dt: f64) -> Option<(f64, f64)> {
        let over = |side: f64| {
            let start =
                self.now.stuck.first_crossing(y, dt, |y| (side * self.net(y) - self.hold(y), side * self.net_slope(y)));
            start.map(|start| (start, side))
        };
        match (over(1.0), over(-1.0)) {
            (Some(up), Some(down)) => Some(if up.0 <= down.0 { up } else { down }),
            (up, down) => up.or(down),
        }
    }

    /// The puck slides in `direction` (0: without friction) under gravity and cogging for `left` s, or to its stop; what is left of the time then.
    fn slide_in(&self, field: &Field, y: &mut State, mut left: f64, direction: f64, ledger: &mut Ledger) -> f64 {
        let flow = &self.now.sliding;
        let (motor, held, lags) = (y[MOTOR], self.friction * direction, y[GAP].abs());
        while left > 0.0 {
            // What is rounding of the lag that was there no longer makes steps short.
            if y[GAP].abs() <= 1e-3 * f64::EPSILON * lags {
                y[GAP] = 0.0;
            }
            let rate = if y[GAP] != 0.0 { flow.rate } else { flow.settled_rate };
            let field = &field.felt(y[V], left);
            let fielded = Fielded { field, n: &flow.n, rate, mass: self.device.inertia, v: V, x: X };
            y[MOTOR] -= held;
            let series = fielded.series(y, left);
            let stop = if direction == 0.0 { None } else { fielded.first_stop(&series, direction) };
            let taken = stop.unwrap_or(series.length);
            let mut end = series.after(taken);
            let works = series.works(taken, |y| {
                let along = |row: &State| row.iter().zip(y).map(|(gain, y)| gain * y).sum::<f64>();
                flow.powers.each_ref().map(|[p, q]| along(p) * along(q))
            });
            let (travel, way) = (end[X] - y[X], end[X] - y[X] + (end[S] - y[S]));
            self.account(y, &end, (motor, held), [travel, way], works, ledger);
            ledger.field += field.work(y[X], end[X]);
            end[MOTOR] = motor;
            if stop.is_some() {
                end[V] = 0.0;
            }
            *y = end;
            left = if taken < left { left - taken } else { 0.0 };
            if stop.is_some() || !y[X].is_finite() {
                break;
            }
        }
        left
    }

    /// The works of a stretch from `y` to `end`, in which the puck and the handle go these ways.
    fn account(
        &self,
        y: &State,
        end: &State,
        (motor, held): (f64, f64),
        [travel, way]: [f64; 2],
        [lagging, damping, shaft, hand]: [f64; 4],
        ledger: &mut Ledger,
    ) {
        ledger.motor += motor * travel + lagging;
        ledger.friction += held * travel;
        ledger.damping += damping;
        ledger.shaft += shaft;
        ledger.hand += hand + self.kept(y, end, way);
    }

    /// Moves for `dt`: the puck slides in `direction` (0: without friction), or friction holds it.
    fn pass(&self, y: &mut State, dt: f64, direction: Option<f64>, ledger: &mut Ledger) {
        let flow = if direction.is_some() { &self.now.sliding } else { &self.now.stuck };
        let (motor, held) = (y[MOTOR], self.friction * direction.unwrap_or(0.0));
        y[MOTOR] -= held;
        let fresh;
        let Propagator { change, works } = match flow.usual.iter().find(|(length, _)| *length == dt) {
            Some((_, propagator)) => propagator,
            None => {
                fresh = flow.propagator_for(y, dt);
                &fresh
            }
        };
        let works = works.each_ref().map(|form| {
            let row = |i: usize| y[i] * (i..STATES).map(|j| form[i][j] * y[j]).sum::<f64>();
            (0..STATES).map(row).sum::<f64>()
        });
        let mut end = applied(change, y);
        let along = |row: usize| change[row].iter().zip(&*y).map(|(x, y)| x * y).sum::<f64>();
        let (travel, bend) = (along(X), along(S));
        self.account(y, &end, (motor, held), [travel, travel + bend], works, ledger);
        end[MOTOR] = motor;
        *y = end;
    }

    /// The hand's work beyond that of its damper and its torques: of a grip less what its spring and its inertia take up, of a prescribed
    /// motion what the handle's inertia does. `way` is the handle's.
    fn kept(&self, y: &State, end: &State, way: f64) -> f64 {
        let moving = |inertia: f64| 0.5 * inertia * (end[W] - y[W]) * (end[W] + y[W]);
        match self.now.grasp {
            Grasp::Free => 0.0,
            Grasp::Grip(grip) => {
                let places = end[X] + end[S] + y[X] + y[S];
                -0.5 * grip.stiffness * places * way - moving(grip.inertia)
            }
            Grasp::Prescribed => moving(self.handle.inertia),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn or_zero(of: core::ops::Range<f64>) -> impl Strategy<Value = f64> {
        prop_oneof![Just(0.0), of]
    }

    proptest! {
        #![proptest_config(hapt_testing::cases(400))]

        /// The states that a motion needs give the bits of all, and the series of a short one its exponential.
        #[test]
        fn states_that_are_0_may_be_left_out(
            (inertia, stiffness, damping) in (1e-5_f64..1e-2, 0.3_f64..1e4, or_zero(1e-6..1.0)),
            (motor, friction, lag) in (1e-5_f64..1e-2, or_zero(1e-4..0.1), or_zero(1e-4..5e-3)),
            grip in prop::option::of((1e-5_f64..1e-2, 0.0_f64..0.1, 0.0_f64..10.0)), stuck in any::<bool>(),
            y in prop::array::uniform8(or_zero(-1.0..1.0)), sine in or_zero(0.1..1.0), dt in 1e-5_f64..1e-2,
        ) {
            let device = Inertia { inertia: motor, damping: 1e-3, stiffness: 0.0 };
            let handle = Handle { inertia, stiffness, damping };
            let mut shaft = Shaft::boxed(handle, device, (friction, None), lag, [1e-3; 2]);
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
