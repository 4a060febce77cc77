//! A handle on a flexible shaft, exactly: the motor turns the puck, the hand holds the handle.
//!
//! ```text
//! J v̇ = f + d - b v - friction + τ,   τ = k s + c (w - v),   s = h - x
//! M ẇ = g + ramp t + sine σ + cosine κ - τ - (the grip's damping) w - (the grip's stiffness) h
//! ```
//!
//! with the puck's x and v, the handle's h and w; M is its inertia and the grip's. A hand that prescribes the handle's motion gives ẇ itself.
//! As for a puck without a shaft, the torques are states too, and one matrix exponential gives motion and works. While friction holds the puck,
//! the handle still moves: that is another such equation, with v = 0.

mod flow;

use alloc::boxed::Box;

use flow::{Flow, GAP, MOTOR, Propagator, S, STATES, State, V, W, X};

use crate::exponential::applied;
use crate::field::Fielded;
use crate::friction::{MAX_EVENTS, ROUNDING};
use crate::ledger::Ledger;
use crate::own::Own;
use crate::puck::{Lengths, decay};
use crate::push::{Grasp, Inertia, NO_SINE, Push, Sine};
use crate::spec::Handle;

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
    /// The device's own torques on the puck.
    own: Own,
    /// The rate in 1/s at which the motor approaches its command; 0: at once.
    decay: f64,
    lengths: Lengths,
    now: Dynamics,
    /// For a hand that alternately opens and closes: the dynamics of its other position, open or closed.
    other: Option<Dynamics>,
}

/// The equations of puck, shaft and handle in a hand: while the puck slides, and while friction holds it.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Dynamics {
    grasp: Grasp,
    sine: Sine,
    sliding: Flow,
    stuck: Flow,
}

impl Shaft {
    /// A free handle at rest on an unloaded shaft. Not inlined, so that a device without one does not use its stack.
    #[inline(never)]
    pub fn boxed(handle: Handle, device: Inertia, own: Own, lag: f64, lengths: Lengths) -> Box<Self> {
        let now = Dynamics { grasp: Grasp::Free, sine: NO_SINE, sliding: Flow::zero(), stuck: Flow::zero() };
        let decay = decay(lag);
        let mut shaft = Shaft { deflection: 0.0, velocity: 0.0, handle, device, own, decay, lengths, now, other: None };
        shaft.take(Grasp::Free, NO_SINE, false);
        Box::new(shaft)
    }

    fn dynamics(&self, grasp: Grasp, sine: Sine) -> Dynamics {
        Dynamics {
            grasp,
            sine,
            sliding: Flow::new(self, grasp, sine, false),
            stuck: Flow::new(self, grasp, sine, true),
        }
    }

    /// A hand holds the handle with this grasp and `sine` (a torque, or the acceleration of a prescribed motion). A hand that `switches` alternately
    /// opens and closes: open, only its inertia stays. Allocates nothing.
    pub fn take(&mut self, grasp: Grasp, sine: Sine, switches: bool) {
        self.now = self.dynamics(grasp, sine);
        self.other = match grasp {
            Grasp::Grip(grip) if switches => {
                Some(self.dynamics(Grasp::Grip(Inertia { damping: 0.0, stiffness: 0.0, ..grip }), NO_SINE))
            }
            Grasp::Free | Grasp::Grip(_) | Grasp::Prescribed => None,
        };
    }

    /// The same hand on another device. Allocates nothing.
    pub fn refit(&mut self, device: Inertia, own: Own, lag: f64, lengths: Lengths) {
        (self.device, self.own) = (device, own);
        (self.decay, self.lengths) = (decay(lag), lengths);
        self.now = self.dynamics(self.now.grasp, self.now.sine);
        self.other = self.other.as_ref().map(|other| self.dynamics(other.grasp, other.sine));
    }

    /// Sets the device's own torques after the puck's 0 has moved.
    pub fn place(&mut self, own: Own) {
        self.own = own;
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
        // The direction of a slip that starts is known from its event: there the net torque equals friction, and its comparison is rounding.
        let mut slips = None;
        // Each pass ends in a stop or a start.
        for _ in 0..MAX_EVENTS {
            if left <= 0.0 {
                break;
            }
            // At rest the device's own torque counts in the balance with friction.
            let mut held = y;
            held[MOTOR] += self.own.torque_at(y[X]);
            let direction = slips.take().or_else(|| self.direction(&held));
            if let Some(direction) = direction.filter(|_| !self.own.is_coulomb()) {
                left = self.slide_in_piece(&mut y, left, direction, ledger);
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
            // More events than that in one period: the puck stays at rest, and the handle moves on.
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
        if self.own.is_frictionless() {
            Some(0.0)
        } else if y[V] != 0.0 {
            Some(y[V].signum())
        } else if net.abs() > self.hold(y, net) {
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

    /// The largest net torque toward this `side` under which the puck stays at rest: friction, plus the rounding error of the torques that balance there.
    fn hold(&self, y: &State, side: f64) -> f64 {
        let friction = self.own.rest(y[X]).toward(side);
        let shaft = (self.handle.stiffness * y[S]).abs() + (self.handle.damping * y[W]).abs();
        friction + ROUNDING * (friction + y[MOTOR].abs() + y[GAP].abs() + shaft + self.own.rounded(y[X]))
    }

    /// The first instant in (0, dt] at which a slide in `direction` comes to rest.
    fn first_stop(&self, y: &State, dt: f64, direction: f64) -> Option<f64> {
        let mut sliding = *y;
        sliding[MOTOR] -= self.own.friction.against(direction);
        let flow = &self.now.sliding;
        flow.first_crossing(&sliding, dt, |y| {
            let acceleration: f64 = flow.n[V].iter().zip(y).map(|(n, y)| n * y).sum();
            (-direction * y[V], -direction * acceleration)
        })
    }

    /// The first instant in (0, dt] at which the net torque on the puck at rest exceeds friction, and its sign, ±1.
    fn first_slip(&self, y: &State, dt: f64) -> Option<(f64, f64)> {
        let over = |side: f64| {
            let start = self
                .now
                .stuck
                .first_crossing(y, dt, |y| (side * self.net(y) - self.hold(y, side), side * self.net_slope(y)));
            start.map(|start| (start, side))
        };
        match (over(1.0), over(-1.0)) {
            (Some(up), Some(down)) => Some(if up.0 <= down.0 { up } else { down }),
            (up, down) => up.or(down),
        }
    }

    /// The puck slides in `direction` (0: without friction) for `left` s, or to the end of this piece of the motion; returns the remaining
    /// time.
    fn slide_in_piece(&self, y: &mut State, mut left: f64, direction: f64, ledger: &mut Ledger) -> f64 {
        let (flow, mass) = (&self.now.sliding, self.device.inertia);
        let regime = self.own.regime([y[X], y[V]], Some(direction).filter(|direction| *direction != 0.0));
        let n = regime.linear(&flow.n, mass, (V, X));
        let field = self.own.field.unwrap_or_default();
        let (motor, lags) = (y[MOTOR], y[GAP].abs());
        while left > 0.0 {
            // A gap that has decayed to rounding no longer limits the step.
            if y[GAP].abs() <= 1e-3 * f64::EPSILON * lags {
                y[GAP] = 0.0;
            }
            let rate = if y[GAP] != 0.0 { flow.rate } else { flow.settled_rate } + regime.rate(mass);
            let [field, changes] = [field, regime.changes].map(|field| field.felt(y[V], left));
            let fielded = Fielded { field: &field.and(&changes), n: &n, rate, mass, v: V, x: X };
            y[MOTOR] += regime.torque;
            let series = fielded.series(y, left);
            let event = regime.first_event(&fielded, &series);
            let taken = event.map_or(series.length, |(at, _)| at);
            let mut end = series.after(taken);
            let [speed, works @ ..] = series.works(taken, |y| {
                let along = |row: &State| row.iter().zip(y).map(|(gain, y)| gain * y).sum::<f64>();
                let [a, b, c, d] = flow.powers.each_ref().map(|[p, q]| along(p) * along(q));
                [y[V] * y[V], a, b, c, d]
            });
            let (travel, handle_travel) = (end[X] - y[X], end[X] - y[X] + (end[S] - y[S]));
            self.account(y, &end, (motor, regime.friction), [travel, handle_travel], works, ledger);
            regime.account([y[X], end[X]], speed, ledger);
            ledger.field += field.work(y[X], end[X]);
            ledger.friction -= changes.work(y[X], end[X]);
            end[MOTOR] = motor;
            if event.is_some_and(|(_, rests)| rests) {
                end[V] = 0.0;
            }
            *y = end;
            left = if taken < left { left - taken } else { 0.0 };
            if event.is_some() || !y[X].is_finite() {
                break;
            }
        }
        left
    }

    /// Adds the works of a stretch from `y` to `end`, over these displacements of puck and handle.
    fn account(
        &self,
        y: &State,
        end: &State,
        (motor, held): (f64, f64),
        [travel, handle_travel]: [f64; 2],
        [lagging, damping, shaft, hand]: [f64; 4],
        ledger: &mut Ledger,
    ) {
        ledger.motor += motor * travel + lagging;
        ledger.friction += held * travel;
        ledger.damping += damping;
        ledger.shaft += shaft;
        ledger.hand += hand + self.kept(y, end, handle_travel);
    }

    /// Moves for `dt`: the puck slides in `direction` (0: without friction), or friction holds it.
    fn pass(&self, y: &mut State, dt: f64, direction: Option<f64>, ledger: &mut Ledger) {
        let flow = if direction.is_some() { &self.now.sliding } else { &self.now.stuck };
        let (motor, held) = (y[MOTOR], self.own.friction.against(direction.unwrap_or(0.0)));
        y[MOTOR] -= held;
        let fresh;
        let Propagator { change, works } = match flow.recurring.iter().find(|(length, _)| *length == dt) {
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

    /// The hand's work beyond that of its damper and its torques: of a grip less the energy of its spring and its inertia, of a prescribed
    /// motion that of the handle's inertia. `handle_travel` is the handle's displacement.
    fn kept(&self, y: &State, end: &State, handle_travel: f64) -> f64 {
        let moving = |inertia: f64| 0.5 * inertia * (end[W] - y[W]) * (end[W] + y[W]);
        match self.now.grasp {
            Grasp::Free => 0.0,
            Grasp::Grip(grip) => {
                let places = end[X] + end[S] + y[X] + y[S];
                -0.5 * grip.stiffness * places * handle_travel - moving(grip.inertia)
            }
            Grasp::Prescribed => moving(self.handle.inertia),
        }
    }
}
