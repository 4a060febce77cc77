//! The puck without a shaft: pushed by motor and hand, held by Coulomb friction ([`crate::friction`]).

use crate::field::Fielded;
use crate::friction::{Friction, MAX_EVENTS, drives_after};
use crate::ledger::Ledger;
use crate::own::Own;
use crate::plant::{F, GAP, Plant, Propagator, State, Stretch, V, X};
use crate::push::{Inertia, NO_SINE, Push, Sine};

/// The physical puck and, while it is held, the hand's inertia, damping and stiffness on it.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Puck {
    /// Position in rad and velocity in rad/s (linear: m and m/s).
    pub position: f64,
    pub velocity: f64,
    device: Inertia,
    own: Own,
    /// The rate in 1/s at which the motor approaches its command; 0: at once.
    decay: f64,
    /// `None`: works are not computed.
    lengths: Option<Lengths>,
    now: Dynamics,
    /// For a hand that alternately opens and closes: the dynamics of its other position, open or closed.
    other: Option<Dynamics>,
}

/// The equation of the puck, with the inertia, damping and stiffness of a grip where there is one.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Dynamics {
    /// The hand's share of the plant, where it grips.
    grip: Option<Inertia>,
    plant: Plant,
    /// The propagators of the recurring time steps: a period (twice), or its parts before and after the motor's delay. `None`: works are not
    /// computed, and no propagator is kept.
    recurring: Option<[(f64, Propagator); 2]>,
}

/// The recurring time steps, in s; equal where there is one.
pub(crate) type Lengths = [f64; 2];

impl Dynamics {
    fn new(device: Inertia, grip: Option<Inertia>, sine: Sine, decay: f64, lengths: Option<Lengths>) -> Self {
        let plant = Plant::new(device, grip, sine, decay);
        let recurring = lengths.map(|[first, second]| {
            let long = Propagator::new(&plant, first);
            let short = if second == first { long.clone() } else { Propagator::new(&plant, second) };
            [(first, long), (second, short)]
        });
        Dynamics { grip, plant, recurring }
    }

    /// The propagator of a recurring time step.
    #[inline(always)] // As `slide`.
    fn recurring(&self, dt: f64) -> Option<&Propagator> {
        let recurring = self.recurring.as_ref()?;
        recurring.iter().find(|(length, _)| *length == dt).map(|(_, propagator)| propagator)
    }

    /// The motion after `dt`, for predictions.
    fn after(&self, y: &State, dt: f64) -> State {
        match self.recurring(dt) {
            _ if dt == 0.0 => *y,
            Some(propagator) => propagator.after(y),
            None => self.plant.after(y, dt),
        }
    }

    /// The same on another device.
    fn refitted(&self, device: Inertia, decay: f64, lengths: Option<Lengths>) -> Self {
        Dynamics::new(device, self.grip, (self.plant.sine, self.plant.cosine, self.plant.omega), decay, lengths)
    }
}

impl Puck {
    /// A free puck at rest at 0. Without `lengths` it computes no works and keeps no propagators: faster to construct, slower for recurring time steps.
    pub fn new(device: Inertia, own: Own, lag: f64, lengths: Option<Lengths>) -> Self {
        let decay = decay(lag);
        let now = Dynamics::new(device, None, NO_SINE, decay, lengths);
        Puck { position: 0.0, velocity: 0.0, device, own, decay, lengths, now, other: None }
    }

    /// A hand grips the puck, with this `grip` and `sine`. One that `switches` alternately opens and closes: open, only its inertia stays
    /// on the puck. Allocates nothing.
    pub fn take(&mut self, grip: Option<Inertia>, sine: Sine, switches: bool) {
        let now = &self.now;
        if (grip, sine) != (now.grip, (now.plant.sine, now.plant.cosine, now.plant.omega)) {
            self.now = Dynamics::new(self.device, grip, sine, self.decay, self.lengths);
        }
        let open = grip.filter(|_| switches).map(|grip| Inertia { damping: 0.0, stiffness: 0.0, ..grip });
        self.other = open.map(|open| Dynamics::new(self.device, Some(open), NO_SINE, self.decay, self.lengths));
    }

    /// The same puck, in the same hand, on another device. Allocates nothing.
    pub fn refit(&mut self, device: Inertia, own: Own, lag: f64, lengths: Option<Lengths>) {
        (self.device, self.own) = (device, own);
        (self.decay, self.lengths) = (decay(lag), lengths);
        self.now = self.now.refitted(device, self.decay, lengths);
        self.other = self.other.as_ref().map(|other| other.refitted(device, self.decay, lengths));
    }

    /// Sets the device's own torques after the puck's 0 has moved.
    pub fn place(&mut self, own: Own) {
        self.own = own;
    }

    /// Moves for `dt` under the motor's torque and the hand's push; the works go to the ledger. The motor's torque is `motor`, and `gap`
    /// beyond it, which decays.
    #[inline]
    pub fn advance(&mut self, dt: f64, motor: f64, gap: f64, push: Push, ledger: &mut Ledger) {
        // The most frequent case stays in registers: a held torque over a recurring time step, without friction.
        let held = gap == 0.0 && push.slope == 0.0 && self.own.is_nothing();
        match self.now.recurring(dt) {
            Some(recurring) if held && !recurring.has_sine() => {
                [self.position, self.velocity] = self.slide_held(recurring, motor, push.value, ledger);
            }
            _ => self.advance_any(dt, motor, gap, push, ledger),
        }
    }

    /// Whether [`Puck::advance_free_period`] applies under held torques: no grip, no sine, no friction or other torque of the device's own.
    pub fn slides_freely_each_period(&self) -> bool {
        let free = |recurring: &Propagator| !recurring.has_sine() && !recurring.has_spring();
        self.own.is_nothing()
            && self.now.grip.is_none()
            && self.now.recurring.as_ref().is_some_and(|[(_, recurring), _]| free(recurring))
    }

    /// [`Puck::advance`] over the first recurring time step, where [`Puck::slides_freely_each_period`] holds; it does not check that.
    #[inline(always)] // As `slide_held`.
    pub fn advance_free_period(&mut self, motor: f64, push: f64, ledger: &mut Ledger) {
        if let Some([(_, recurring), _]) = &self.now.recurring {
            let y = [self.velocity, motor + push, self.position, 0.0, 0.0, 0.0, 0.0];
            let stretch = recurring.free_stretch(&y);
            self.account(&y, &stretch, y[F] - motor, (motor, 0.0), None, ledger);
            [self.position, self.velocity] = stretch.end;
        }
    }

    /// Position and velocity after torques that are held, without friction and without a sine.
    #[inline(always)] // So that few states never leave the registers.
    fn slide_held(&self, recurring: &Propagator, motor: f64, push: f64, ledger: &mut Ledger) -> [f64; 2] {
        let y = [self.velocity, motor + push, self.position, 0.0, 0.0, 0.0, 0.0];
        let stretch = recurring.held_stretch(&y);
        self.account(&y, &stretch, y[F] - motor, (motor, 0.0), self.now.grip, ledger);
        stretch.end
    }

    /// The same for every torque, every length, and with friction.
    #[inline(never)]
    fn advance_any(&mut self, dt: f64, motor: f64, gap: f64, push: Push, ledger: &mut Ledger) {
        let y = [self.velocity, motor + push.value, self.position, push.slope, push.sin, push.cos, gap];
        [self.position, self.velocity] = if !self.own.is_coulomb() {
            self.move_in_pieces(y, dt, motor, ledger)
        } else if self.own.is_nothing() {
            self.slide(y, dt, motor, 0.0, ledger)
        } else {
            let after = |y: &State, t| self.now.after(y, t);
            Friction { plant: &self.now.plant, levels: self.own.friction, rounded: 0.0 }.advance(
                y,
                dt,
                after,
                |y, taken, direction| self.slide(*y, taken, motor, direction, ledger),
            )
        };
    }

    /// Position and velocity after `dt`, from piece to piece of the device's motion.
    #[inline(never)]
    fn move_in_pieces(&self, mut y: State, dt: f64, motor: f64, ledger: &mut Ledger) -> [f64; 2] {
        let plant = &self.now.plant;
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
            held[F] += self.own.torque_at(y[X]);
            let friction = Friction { plant, levels: self.own.rest(y[X]), rounded: self.own.rounded(y[X]) };
            let direction = || slips.take().unwrap_or_else(|| friction.direction(&held));
            let direction = (!self.own.is_frictionless()).then(direction);
            if direction == Some(0.0) {
                let slip = friction.first_slip(&held, left);
                let taken = slip.map_or(left, |(start, _)| start);
                slips = slip.map(|(_, side)| side);
                y = drives_after(plant, &y, taken);
                left -= taken;
            } else {
                left = self.slide_in_piece(&mut y, left, (motor, direction), ledger);
            }
        }
        [y[X], y[V]]
    }

    /// Slides for `left` s, or to the end of this piece, where friction is against `direction`; returns the remaining time.
    fn slide_in_piece(
        &self,
        y: &mut State,
        mut left: f64,
        (motor, direction): (f64, Option<f64>),
        ledger: &mut Ledger,
    ) -> f64 {
        let plant = &self.now.plant;
        let regime = self.own.regime([y[X], y[V]], direction);
        let (n, lags) = (regime.linear(&plant.generator(), plant.mass, (V, X)), y[GAP].abs());
        let field = self.own.field.unwrap_or_default();
        while left > 0.0 {
            // A gap that has decayed to rounding no longer limits the step.
            if y[GAP].abs() <= 1e-3 * f64::EPSILON * lags {
                y[GAP] = 0.0;
            }
            let rate = if y[GAP] != 0.0 { plant.rate() } else { plant.rate_without_lag() } + regime.rate(plant.mass);
            let [field, changes] = [field, regime.changes].map(|field| field.felt(y[V], left));
            let fielded = Fielded { field: &field.and(&changes), n: &n, rate, mass: plant.mass, v: V, x: X };
            let mut sliding = *y;
            sliding[F] += regime.torque;
            let series = fielded.series(&sliding, left);
            let event = regime.first_event(&fielded, &series);
            let taken = event.map_or(series.length, |(at, _)| at);
            let mut end = series.after(taken);
            let [speed, varying, lagging] = series.works(taken, |y| {
                let drive = plant.drive(y) - y[GAP] - sliding[F];
                [y[V] * y[V], drive * y[V], y[GAP] * y[V]]
            });
            let travel = end[X] - y[X];
            let stretch = Stretch { end: [end[X], end[V]], travel, speed, varying, lagging };
            self.account(&sliding, &stretch, y[F] - motor, (motor, regime.friction), self.now.grip, ledger);
            regime.account([y[X], end[X]], speed, ledger);
            ledger.field += field.work(y[X], end[X]);
            ledger.friction -= changes.work(y[X], end[X]);
            end[F] -= regime.torque;
            if event.is_some_and(|(_, rests)| rests) {
                end[V] = 0.0;
            }
            *y = end;
            // Whole steps leave no time below rounding.
            left = if taken < left { left - taken } else { 0.0 };
            if event.is_some() || !y[X].is_finite() {
                break;
            }
        }
        left
    }

    /// Slides for `dt` with friction against `direction` (0: none); gives position and velocity at the end.
    fn slide(&self, mut y: State, dt: f64, motor: f64, direction: f64, ledger: &mut Ledger) -> [f64; 2] {
        let push = y[F] - motor;
        let held = self.own.friction.against(direction);
        y[F] -= held;
        let fresh;
        let propagator = match self.now.recurring(dt) {
            Some(propagator) => propagator,
            None if self.now.recurring.is_none() => return self.now.plant.end(&y, dt),
            None => {
                fresh = Propagator::for_motion(&self.now.plant, &y, dt);
                &fresh
            }
        };
        let stretch = propagator.stretch(y);
        self.account(&y, &stretch, push, (motor, held), self.now.grip, ledger);
        stretch.end
    }

    /// The works of a stretch from `y`, under the hand's `push` and `grip`, the torque of the motor and `held` by friction.
    #[inline(always)] // As `advance`.
    fn account(
        &self,
        y: &State,
        stretch: &Stretch,
        push: f64,
        (motor, held): (f64, f64),
        grip: Option<Inertia>,
        ledger: &mut Ledger,
    ) {
        let &Stretch { end, travel, speed, varying, lagging } = stretch;
        ledger.motor += motor * travel + lagging;
        ledger.friction += held * travel;
        ledger.damping += self.device.damping * speed;
        ledger.hand += push * travel + varying;
        if let Some(grip) = grip {
            // The hand's torque on the puck follows from its intended motion, spring, damper and inertia.
            let square = |x: f64| x * x;
            ledger.hand -= grip.damping * speed
                + 0.5 * grip.stiffness * (end[0] + y[X]) * travel
                + 0.5 * grip.inertia * (square(end[1]) - square(y[V]));
        }
    }

    /// Opens or closes a switching hand.
    pub fn switch(&mut self) {
        if let Some(other) = &mut self.other {
            core::mem::swap(&mut self.now, other);
        }
    }

    /// Releases the puck: removes the hand's inertia, damping and stiffness; position and velocity stay.
    pub fn release(&mut self) {
        self.take(None, NO_SINE, false);
    }
}

/// The rate in 1/s that belongs to a lag in s; 0 where there is none.
pub(crate) fn decay(lag: f64) -> f64 {
    if lag > 0.0 { 1.0 / lag } else { 0.0 }
}
