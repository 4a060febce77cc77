//! The puck alone: pushed by motor and hand, held by Coulomb friction, every stop and start located.

use crate::ledger::Ledger;
use crate::plant::{COS, F, GAP, Motion, Plant, Propagator, RAMP, SIN, Stretch, V, X};

/// The physical puck and, while it is held, the hand's inertia, damping and stiffness on it.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Puck {
    /// Position in rad and velocity in rad/s (linear: m and m/s).
    pub position: f64,
    pub velocity: f64,
    device: Inertia,
    friction: f64,
    /// The rate in 1/s at which the motor approaches its command; 0: at once.
    decay: f64,
    /// `None`: the motion alone, without its works.
    lengths: Option<Lengths>,
    now: Held,
    /// Of a hand that alternately opens and closes: whether it is open.
    other: Option<Held>,
}

/// The puck, with the inertia, damping and stiffness of a grip where there is one.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Held {
    /// The hand's share of the plant, where it grips.
    grip: Option<Inertia>,
    plant: Plant,
    /// The propagators of the recurring time steps: a period (twice), or its parts around a delay. `None`: the motion alone, without its works,
    /// and no time step recurs.
    usual: Option<[(f64, Propagator); 2]>,
}

/// The recurring time steps, in s; equal where there is one.
pub(crate) type Lengths = [f64; 2];

/// A hand's push per unit of σ and of κ, and its ω in rad/s; zeros where there is no sine.
pub(crate) type Sine = (f64, f64, f64);

/// Inertia, damping and stiffness.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Inertia {
    pub inertia: f64,
    pub damping: f64,
    pub stiffness: f64,
}

/// The push on the puck over a time step: value + slope · t, and the sine's σ and κ at its start.
#[derive(Clone, Copy, Debug, Default)]
pub struct Push {
    /// N·m (N)
    pub value: f64,
    /// N·m/s (N/s)
    pub slope: f64,
    /// σ
    pub sin: f64,
    /// κ
    pub cos: f64,
}

impl Held {
    fn new(device: Inertia, grip: Option<Inertia>, sine: Sine, decay: f64, lengths: Option<Lengths>) -> Self {
        let plant = Plant::new(device, grip, sine, decay);
        let usual = lengths.map(|[first, second]| {
            let long = Propagator::new(&plant, first);
            let short = if second == first { long.clone() } else { Propagator::new(&plant, second) };
            [(first, long), (second, short)]
        });
        Held { grip, plant, usual }
    }

    /// The propagator of a recurring time step.
    #[inline(always)] // As `slide`.
    fn usual(&self, dt: f64) -> Option<&Propagator> {
        let usual = self.usual.as_ref()?;
        usual.iter().find(|(length, _)| *length == dt).map(|(_, propagator)| propagator)
    }

    /// The motion after `dt`, for predictions.
    fn after(&self, y: &Motion, dt: f64) -> Motion {
        match self.usual(dt) {
            _ if dt == 0.0 => *y,
            Some(propagator) => propagator.after(y),
            None => self.plant.after(y, dt),
        }
    }

    /// The same where a spring, a ramp, a sine or a lag is; without them the velocity alone goes on, and the rest stays as it is.
    fn after_slide(&self, y: &Motion, dt: f64) -> Motion {
        if dt == 0.0 || !self.plant.slides_freely(y) {
            return self.after(y, dt);
        }
        let [by_velocity, by_torque] = match self.usual(dt) {
            Some(propagator) => propagator.velocity(),
            None => self.plant.free_change(dt)[1],
        };
        let mut out = *y;
        out[V] += by_velocity * y[V];
        out[V] += by_torque * y[F];
        out
    }

    /// The same on another device.
    fn refitted(&self, device: Inertia, decay: f64, lengths: Option<Lengths>) -> Self {
        Held::new(device, self.grip, (self.plant.sine, self.plant.cosine, self.plant.omega), decay, lengths)
    }
}

impl Puck {
    /// Resets it to rest at 0, free. Without `lengths` the motion alone, without its works: sooner made, and slower where time steps recur.
    pub fn new(device: Inertia, friction: f64, lag: f64, lengths: Option<Lengths>) -> Self {
        let decay = decay(lag);
        let now = Held::new(device, None, NO_SINE, decay, lengths);
        Puck { position: 0.0, velocity: 0.0, device, friction, decay, lengths, now, other: None }
    }

    /// A hand grips the puck, with this `grip` and `sine`. One that `switches` alternately opens and closes: open, only its inertia stays
    /// on the puck. Allocates nothing.
    pub fn take(&mut self, grip: Option<Inertia>, sine: Sine, switches: bool) {
        let now = &self.now;
        if (grip, sine) != (now.grip, (now.plant.sine, now.plant.cosine, now.plant.omega)) {
            self.now = Held::new(self.device, grip, sine, self.decay, self.lengths);
        }
        let open = grip.filter(|_| switches).map(|grip| Inertia { damping: 0.0, stiffness: 0.0, ..grip });
        self.other = open.map(|open| Held::new(self.device, Some(open), NO_SINE, self.decay, self.lengths));
    }

    /// The same puck, in the same hand, on another device. Allocates nothing.
    pub fn refit(&mut self, device: Inertia, friction: f64, lag: f64, lengths: Option<Lengths>) {
        (self.device, self.friction, self.decay, self.lengths) = (device, friction, decay(lag), lengths);
        self.now = self.now.refitted(device, self.decay, lengths);
        self.other = self.other.as_ref().map(|other| other.refitted(device, self.decay, lengths));
    }

    /// Moves for `dt` under the motor's torque and the hand's push; the works go to the ledger. The motor's torque is `motor`, and `gap`
    /// beyond it, which decays.
    #[inline]
    pub fn advance(&mut self, dt: f64, motor: f64, gap: f64, push: Push, ledger: &mut Ledger) {
        // What most periods are never leaves the registers: a held torque over a usual length, without friction.
        let held = gap == 0.0 && push.slope == 0.0 && self.friction == 0.0;
        match self.now.usual(dt) {
            Some(usual) if held && !usual.has_sine() => {
                let y = [self.velocity, motor + push.value, self.position, 0.0, 0.0, 0.0, 0.0];
                let stretch = usual.held_stretch(&y);
                self.account(&y, &stretch, y[F] - motor, (motor, 0.0), ledger);
                [self.position, self.velocity] = stretch.end;
            }
            _ => self.advance_any(dt, motor, gap, push, ledger),
        }
    }

    /// The same for every torque, every length, and with friction.
    #[inline(never)]
    fn advance_any(&mut self, dt: f64, motor: f64, gap: f64, push: Push, ledger: &mut Ledger) {
        let y = [self.velocity, motor + push.value, self.position, push.slope, push.sin, push.cos, gap];
        [self.position, self.velocity] = if self.friction == 0.0 {
            self.slide(y, dt, motor, 0.0, ledger)
        } else {
            self.stick_and_slide(y, dt, motor, ledger)
        };
    }

    /// The same with Coulomb friction.
    fn stick_and_slide(&self, mut y: Motion, dt: f64, motor: f64, ledger: &mut Ledger) -> [f64; 2] {
        let mut left = dt;
        // Each pass ends in a stop or a start; more of them than this in one period is rest.
        for _ in 0..MOST_EVENTS {
            if left <= 0.0 {
                break;
            }
            let taken = match self.direction(&y) {
                None => self.first_slip(&y, left).unwrap_or(left),
                Some(direction) => {
                    let stop = self.first_stop(&y, left, direction);
                    let taken = stop.unwrap_or(left);
                    [y[X], y[V]] = self.slide(y, taken, motor, direction, ledger);
                    if stop.is_some() {
                        y[V] = 0.0;
                    }
                    taken
                }
            };
            y = drives_after(&self.now.plant, &y, taken);
            left -= taken;
        }
        [y[X], y[V]]
    }

    /// The direction in which the puck slides, ±1; `None` while friction holds it: at rest and |net torque| ≤ friction, up to rounding.
    fn direction(&self, y: &Motion) -> Option<f64> {
        let net = self.net(y);
        if y[V] != 0.0 {
            Some(y[V].signum())
        } else if net.abs() > self.hold(y) {
            Some(net.signum())
        } else {
            None
        }
    }

    /// Motor, hand and the hand's spring; friction aside, at rest.
    fn net(&self, y: &Motion) -> f64 {
        self.now.plant.drive(y) - self.now.plant.stiffness * y[X]
    }

    /// The most net torque that holds the puck at rest: friction, and what rounding can leave of the torques that balance there.
    /// Without that margin, rounding alone would start and stop the slip in an endless sequence.
    fn hold(&self, y: &Motion) -> f64 {
        let Plant { stiffness, sine, cosine, .. } = self.now.plant;
        let torques =
            y[F].abs() + (sine * y[SIN]).abs() + (cosine * y[COS]).abs() + (stiffness * y[X]).abs() + y[GAP].abs();
        self.friction + ROUNDING * (self.friction + torques)
    }

    /// The derivative of the net torque at rest.
    fn net_slope(&self, y: &Motion) -> f64 {
        let Plant { sine, cosine, omega, decay, .. } = self.now.plant;
        y[RAMP] + omega * (sine * y[COS] - cosine * y[SIN]) - decay * y[GAP]
    }

    /// Slides for `dt` with friction against `direction` (0: none); gives position and velocity at the end.
    fn slide(&self, mut y: Motion, dt: f64, motor: f64, direction: f64, ledger: &mut Ledger) -> [f64; 2] {
        let push = y[F] - motor;
        let held = self.friction * direction;
        y[F] -= held;
        let fresh;
        let propagator = match self.now.usual(dt) {
            Some(propagator) => propagator,
            None if self.now.usual.is_none() => return self.now.plant.end(&y, dt),
            None => {
                fresh = Propagator::for_motion(&self.now.plant, &y, dt);
                &fresh
            }
        };
        let stretch = propagator.stretch(y);
        self.account(&y, &stretch, push, (motor, held), ledger);
        stretch.end
    }

    /// The works of a stretch from `y`, under the hand's `push`, the torque of the motor and `held` by friction.
    #[inline(always)] // As `advance`.
    fn account(&self, y: &Motion, stretch: &Stretch, push: f64, (motor, held): (f64, f64), ledger: &mut Ledger) {
        let &Stretch { end, travel, speed, varying, lagging } = stretch;
        ledger.motor += motor * travel + lagging;
        ledger.friction += held * travel;
        ledger.damping += self.device.damping * speed;
        ledger.hand += push * travel + varying;
        if let Some(grip) = self.now.grip {
            // The hand's torque on the puck follows from its intended motion, spring, damper and inertia.
            let square = |x: f64| x * x;
            ledger.hand -= grip.damping * speed
                + 0.5 * grip.stiffness * (end[0] + y[X]) * travel
                + 0.5 * grip.inertia * (square(end[1]) - square(y[V]));
        }
    }

    /// The first instant in (0, dt] at which a slide in `direction` comes to rest.
    fn first_stop(&self, y: &Motion, dt: f64, direction: f64) -> Option<f64> {
        let mut sliding = *y;
        sliding[F] -= self.friction * direction;
        let plant = &self.now.plant;
        first_crossing(Slices::new(plant, dt, y), |t| {
            let y = self.now.after_slide(&sliding, t);
            (-direction * y[V], -direction * plant.acceleration(&y))
        })
    }

    /// The first instant in (0, dt] at which the net torque on the puck at rest exceeds friction.
    fn first_slip(&self, y: &Motion, dt: f64) -> Option<f64> {
        let over = |side: f64| {
            first_crossing(Slices::new(&self.now.plant, dt, y), |t| {
                let y = drives_after(&self.now.plant, y, t);
                (side * self.net(&y) - self.hold(&y), side * self.net_slope(&y))
            })
        };
        match (over(1.0), over(-1.0)) {
            (Some(up), Some(down)) => Some(up.min(down)),
            (up, down) => up.or(down),
        }
    }

    /// Opens or closes a switching hand.
    pub fn switch(&mut self) {
        if let Some(other) = &mut self.other {
            core::mem::swap(&mut self.now, other);
        }
    }

    /// Releases the puck: the inertia, damping and stiffness of the hand go, position and velocity stay.
    pub fn release(&mut self) {
        self.take(None, NO_SINE, false);
    }
}

pub(crate) const NO_SINE: Sine = (0.0, 0.0, 0.0);

/// More stops and starts than this within one stretch is chatter at the edge of friction.
pub(crate) const MOST_EVENTS: usize = 1000;

/// Rounding of a sum of torques and of what an exponential makes of them, in parts of their sizes.
pub(crate) const ROUNDING: f64 = 256.0 * f64::EPSILON;

/// The drives alone move on while the puck rests.
fn drives_after(plant: &Plant, y: &Motion, dt: f64) -> Motion {
    let mut out = *y;
    out[F] += y[RAMP] * dt;
    if plant.omega != 0.0 {
        let (sin, cos) = libm::sincos(plant.omega * dt);
        (out[SIN], out[COS]) = (y[SIN] * cos + y[COS] * sin, y[COS] * cos - y[SIN] * sin);
    }
    if y[GAP] != 0.0 {
        out[GAP] *= libm::exp(-plant.decay * dt);
    }
    out
}

/// The rate in 1/s that belongs to a lag in s; 0 where there is none.
pub(crate) fn decay(lag: f64) -> f64 {
    if lag > 0.0 { 1.0 / lag } else { 0.0 }
}

/// Parts of a stretch, short enough that nothing swings more than a quarter radian: a derivative changes sign at most once. A decay is cut
/// into parts that begin with half of its time constant and grow with the time since, as the decay slows.
struct Slices {
    dt: f64,
    length: f64,
    /// In s; 0: nothing decays.
    lag: f64,
}

impl Slices {
    fn new(plant: &Plant, dt: f64, y: &Motion) -> Self {
        let slices = libm::ceil(plant.swing() * dt / 0.25).clamp(1.0, 1e6);
        Slices { dt, length: dt / slices, lag: if y[GAP] != 0.0 { 1.0 / plant.decay } else { 0.0 } }
    }

    /// The end of part i, from 1, which begins at `from`; the last ends at dt.
    fn end(&self, i: u64, from: f64) -> f64 {
        if self.lag > 0.0 {
            return (from + self.length.min(0.5 * self.lag.max(from))).min(self.dt);
        }
        if i as f64 >= libm::round(self.dt / self.length) { self.dt } else { self.length * i as f64 }
    }
}

/// The first t in (0, dt] at which g, negative or zero at 0, becomes positive. `g` gives value and derivative. A rise and fall
/// within a slice is found at its summit, where the derivative changes sign.
fn first_crossing(slices: Slices, g: impl Fn(f64) -> (f64, f64)) -> Option<f64> {
    let (mut from, (mut from_value, mut slope)) = (0.0, g(0.0));
    for i in 1.. {
        let to = slices.end(i, from);
        let (value, next_slope) = g(to);
        let positive = if value > 0.0 {
            Some(to)
        } else if slope > 0.0 && next_slope < 0.0 {
            let summit = root(from, to, |t| -g(t).1);
            (g(summit).0 > 0.0).then_some(summit)
        } else {
            None
        };
        if let Some(positive) = positive {
            let end = if positive == to { value } else { g(positive).0 };
            return Some(root_between((from, from_value), (positive, end), |t| g(t).0));
        }
        // The negation ends the search at a number that is none, too.
        if !(to < slices.dt && to > from) {
            break;
        }
        (from, from_value, slope) = (to, value, next_slope);
    }
    None
}

/// Where f, not positive at `low` and positive at `high`, changes sign: the end on which it is positive, to the last bits. By
/// false position after Illinois, with bisection wherever that stalls.
pub(crate) fn root(low: f64, high: f64, f: impl Fn(f64) -> f64) -> f64 {
    root_between((low, f(low)), (high, f(high)), f)
}

/// The same where f is known at both ends.
fn root_between((mut low, f_low): (f64, f64), (mut high, mut f_high): (f64, f64), f: impl Fn(f64) -> f64) -> f64 {
    let mut f_low = f_low.min(0.0);
    let (mut bisect, mut last_was_high) = (false, None);
    for _ in 0..200 {
        let width = high - low;
        if width <= 4.0 * f64::EPSILON * high {
            break;
        }
        let secant = low + width * (-f_low / (f_high - f_low));
        let inside = secant > low && secant < high;
        let middle = if bisect || !inside { low + 0.5 * width } else { secant };
        let value = f(middle);
        let is_high = value > 0.0;
        // The end that stays twice in a row counts half, so that the other comes over.
        let stays = last_was_high == Some(is_high);
        if is_high {
            (high, f_high) = (middle, value);
            f_low *= if stays { 0.5 } else { 1.0 };
        } else {
            (low, f_low) = (middle, value);
            f_high *= if stays { 0.5 } else { 1.0 };
        }
        last_was_high = Some(is_high);
        bisect = high - low > 0.5 * width;
    }
    high
}
