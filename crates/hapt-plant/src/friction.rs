//! Coulomb friction on the puck: the direction of sliding, and the instants of stops and starts.

use hapt_core::Number;

use crate::plant::{COS, F, GAP, Plant, RAMP, SIN, State, V, X};
use crate::push::Inertia;
use crate::root::{root, root_between};

/// The largest number of stops and starts within one stretch; more of them are chatter at the edge of friction. A puck swung at the limits that
/// world files allow turns two thousand times.
pub(crate) const MAX_EVENTS: usize = 10_000;

/// Rounding of a sum of torques and of their image under an exponential, relative to their sizes.
pub(crate) const ROUNDING: f64 = 256.0 * f64::EPSILON;

/// The levels of Coulomb friction in N·m (linear: N), zero or more.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Levels {
    /// Against motion toward larger positions.
    pub forward: f64,
    /// Against motion toward smaller ones.
    pub backward: f64,
}

impl Levels {
    pub fn is_none(&self) -> bool {
        self.forward == 0.0 && self.backward == 0.0
    }

    /// The torque that friction subtracts from the net torque while the puck slides in `direction`; 0 for direction 0.
    pub fn against(&self, direction: f64) -> f64 {
        if direction < 0.0 { self.backward * direction } else { self.forward * direction }
    }

    /// The level in a direction, ±1.
    pub fn toward(&self, direction: f64) -> f64 {
        if direction < 0.0 { self.backward } else { self.forward }
    }

    /// The energy that is dissipated on a path of this length whose end is `travel` from its start.
    pub fn lost(&self, path: f64, travel: f64) -> f64 {
        if self.forward == self.backward {
            return self.forward * path;
        }
        0.5 * (self.forward * (path + travel) + self.backward * (path - travel))
    }
}

/// A puck under friction.
#[derive(Clone, Copy)]
pub(crate) struct Friction<'p> {
    pub plant: &'p Plant,
    pub levels: Levels,
    /// The sizes of further torques whose rounding counts at rest: parts of the levels and of the net torque.
    pub rounded: f64,
}

/// The direction in which a puck slides, ±1; 0 while friction holds it: at rest under a `net` torque that is not above friction, up to the
/// rounding of the `torques` that balance there (the sum of their sizes). The friction is that toward larger positions and that toward smaller
/// ones. In N·m (linear: N) and rad/s (m/s).
#[inline(always)]
pub fn sliding_direction<N: Number>(velocity: N, net: N, [forward, backward]: [N; 2], torques: N) -> N {
    let back = (-net).if_above(hold(backward, torques), -N::ONE, N::ZERO);
    let start = net.if_above(hold(forward, torques), N::ONE, back);
    velocity.if_above(N::ZERO, N::ONE, N::ZERO.if_above(velocity, -N::ONE, start))
}

/// The largest net torque under which the puck stays at rest: friction, plus the rounding error of the torques that balance there.
/// Without that margin rounding would start and stop the slip in an endless sequence.
#[inline(always)]
fn hold<N: Number>(friction: N, torques: N) -> N {
    friction + N::from_f64(ROUNDING) * (friction + torques)
}

/// The position in rad and velocity in rad/s (linear: m, m/s) after `dt` s of a puck of this inertia and damping that a held torque moves
/// against friction, from `puck` on: those of [`crate::VirtualDevice`], to the bit. The friction is that toward larger positions and that
/// toward smaller ones. In SI.
pub fn slide_under(
    (inertia, damping, [forward, backward]): (f64, f64, [f64; 2]),
    puck: (f64, f64),
    torque: f64,
    dt: f64,
) -> (f64, f64) {
    let plant = Plant::free(Inertia { inertia, damping, stiffness: 0.0 });
    let y = [puck.1, torque, puck.0, 0.0, 0.0, 0.0, 0.0];
    let friction = Friction { plant: &plant, levels: Levels { forward, backward }, rounded: 0.0 };
    let [position, velocity] = friction.advance(
        y,
        dt,
        |y, t| plant.after(y, t),
        |y, taken, direction| {
            let mut sliding = *y;
            sliding[F] -= friction.levels.against(direction);
            plant.end(&sliding, taken)
        },
    );
    (position, velocity)
}

impl Friction<'_> {
    /// Position and velocity after `dt` s from `y` on, from stop to start to stop. `after` predicts the motion without friction's torque
    /// after a time in s, and `slide` gives position and velocity after a time in s against friction in a direction.
    pub fn advance(
        &self,
        mut y: State,
        dt: f64,
        after: impl Fn(&State, f64) -> State,
        mut slide: impl FnMut(&State, f64, f64) -> [f64; 2],
    ) -> [f64; 2] {
        let mut left = dt;
        // Each pass ends in a stop or a start; more of them than this in one period is rest.
        for _ in 0..MAX_EVENTS {
            if left <= 0.0 {
                break;
            }
            let direction = self.direction(&y);
            let taken = if direction == 0.0 {
                self.first_slip(&y, left).map_or(left, |(start, _)| start)
            } else {
                let stop = self.first_stop(&y, left, direction, &after);
                let taken = stop.unwrap_or(left);
                [y[X], y[V]] = slide(&y, taken, direction);
                // A velocity against the slide's direction is rounding: a slide ends at velocity 0.
                if stop.is_some() || direction * y[V] < 0.0 {
                    y[V] = 0.0;
                }
                taken
            };
            y = drives_after(self.plant, &y, taken);
            left -= taken;
        }
        [y[X], y[V]]
    }

    /// The motor's lag in s where it has not settled, else 0.
    fn lag(&self, y: &State) -> f64 {
        if y[GAP] != 0.0 { 1.0 / self.plant.decay } else { 0.0 }
    }

    pub fn direction(&self, y: &State) -> f64 {
        sliding_direction(y[V], self.net(y), [self.levels.forward, self.levels.backward], self.torques(y))
    }

    /// Motor, hand and the hand's spring; friction aside, at rest.
    fn net(&self, y: &State) -> f64 {
        self.plant.drive(y) - self.plant.stiffness * y[X]
    }

    /// The sizes of these torques.
    fn torques(&self, y: &State) -> f64 {
        let Plant { stiffness, sine, cosine, .. } = *self.plant;
        let hand = (sine * y[SIN]).abs() + (cosine * y[COS]).abs() + (stiffness * y[X]).abs();
        y[F].abs() + hand + y[GAP].abs() + self.rounded
    }

    /// The derivative of the net torque at rest.
    fn net_slope(&self, y: &State) -> f64 {
        let Plant { sine, cosine, omega, decay, .. } = *self.plant;
        y[RAMP] + omega * (sine * y[COS] - cosine * y[SIN]) - decay * y[GAP]
    }

    /// The first instant in (0, dt] at which a slide in `direction` comes to rest.
    fn first_stop(&self, y: &State, dt: f64, direction: f64, after: impl Fn(&State, f64) -> State) -> Option<f64> {
        let mut sliding = *y;
        sliding[F] -= self.levels.against(direction);
        if self.plant.slides_freely(y) {
            return self.plant.free_stop(sliding[V], sliding[F]).filter(|stop| *stop < dt);
        }
        let course = |t| {
            let y = after(&sliding, t);
            (-direction * y[V], -direction * self.plant.acceleration(&y))
        };
        let wide = Slices::new(self.plant, dt, self.lag(y));
        let slices = wide.settling(self.plant.mass / self.plant.damping);
        let first = first_crossing(&slices, course)?;
        // Finer slices find the same instant with other last bits; the wider slices' result is used unless they have missed it.
        let again = if slices == wide { None } else { first_crossing(&wide, course) };
        Some(first.root(again, |t| course(t).0))
    }

    /// The first instant in (0, dt] at which the net torque on the puck at rest exceeds friction, and its sign, ±1.
    pub fn first_slip(&self, y: &State, dt: f64) -> Option<(f64, f64)> {
        // A torque that is held, and is not above friction now, never is.
        if self.plant.slides_freely(y) {
            return None;
        }
        let slices = Slices::new(self.plant, dt, self.lag(y));
        let over = |side: f64| {
            let course = |t| {
                let y = drives_after(self.plant, y, t);
                (side * self.net(&y) - hold(self.levels.toward(side), self.torques(&y)), side * self.net_slope(&y))
            };
            first_crossing(&slices, course).map(|crossing| (crossing.root(None, |t| course(t).0), side))
        };
        match (over(1.0), over(-1.0)) {
            (Some(up), Some(down)) => Some(if up.0 <= down.0 { up } else { down }),
            (up, down) => up.or(down),
        }
    }
}

/// The state after `dt` with the puck at rest: only the drives change.
pub(crate) fn drives_after(plant: &Plant, y: &State, dt: f64) -> State {
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

/// Parts of a stretch, short enough that nothing swings more than a quarter radian: a derivative changes sign at most once. A decay is cut
/// into parts that begin with half of its time constant and grow with the time since, as the decay slows.
#[derive(Clone, Copy, PartialEq)]
struct Slices {
    dt: f64,
    length: f64,
    /// The shortest time constant of what decays, in s; 0: nothing does.
    decay: f64,
}

impl Slices {
    /// With the motor's lag in s; 0: none.
    fn new(plant: &Plant, dt: f64, lag: f64) -> Self {
        let slices = libm::ceil(plant.swing() * dt / 0.25).clamp(1.0, 1e6);
        Slices { dt, length: dt / slices, decay: lag }
    }

    /// The same for a velocity that damping settles in `time` s too, where that is shorter than two slices.
    fn settling(self, time: f64) -> Self {
        if 0.5 * time >= self.length || self.decay > 0.0 && self.decay <= time {
            return self;
        }
        Slices { decay: time, ..self }
    }

    /// The end of part i, from 1, which begins at `from`; the last ends at dt.
    fn end(&self, i: u64, from: f64) -> f64 {
        if self.decay > 0.0 {
            return (from + self.length.min(0.5 * self.decay.max(from))).min(self.dt);
        }
        if i as f64 >= libm::round(self.dt / self.length) { self.dt } else { self.length * i as f64 }
    }
}

/// Two instants between which a function becomes positive, and its values there.
struct Crossing {
    before: (f64, f64),
    after: (f64, f64),
}

impl Crossing {
    /// The instant, looked for in `wider` where that is a crossing at the same instant.
    fn root(self, wider: Option<Crossing>, f: impl Fn(f64) -> f64) -> f64 {
        let within = |t: &f64| *t >= self.before.0 && *t <= self.after.0;
        let same = wider.map(|wider| root_between(wider.before, wider.after, &f)).filter(within);
        same.unwrap_or_else(|| root_between(self.before, self.after, f))
    }
}

/// The first t in (0, dt] at which g, negative or zero at 0, becomes positive. `g` gives value and derivative. A rise and fall
/// within a slice is found at its summit, where the derivative changes sign.
fn first_crossing(slices: &Slices, g: impl Fn(f64) -> (f64, f64)) -> Option<Crossing> {
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
            return Some(Crossing { before: (from, from_value), after: (positive, end) });
        }
        // Negated, so that a NaN also ends the search.
        if !(to < slices.dt && to > from) {
            break;
        }
        (from, from_value, slope) = (to, value, next_slope);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    proptest! {
        #![proptest_config(hapt_testing::cases(2000))]

        /// From nearly no damping to one that stops the puck nearly by itself.
        #[test]
        fn a_slide_has_no_velocity_at_the_instant_of_its_stop(
            inertia in 1e-5_f64..1.0, damped in -18_i32..4, velocity in -50.0_f64..50.0, time in -7_i32..0, undamped in any::<bool>(),
        ) {
            // As long as it takes without damping, and how much of that damping would take.
            let time = 10_f64.powi(time);
            let damping = if undamped { 0.0 } else { 10_f64.powi(damped) * inertia / time };
            let plant = Plant::free(Inertia { inertia, damping, stiffness: 0.0 });
            let torque = -velocity * inertia / time;
            let stop = plant.free_stop(velocity, torque).unwrap();
            let [by_velocity, by_torque] = plant.free_change(stop)[1];
            let end = velocity + by_velocity * velocity + by_torque * torque;
            let lost = (by_velocity * velocity).abs() + (by_torque * torque).abs();
            prop_assert!(end.abs() <= 1e-14 * (velocity.abs() + lost), "{end:e} of {velocity} after {stop} s");
            prop_assert!(plant.free_stop(velocity, -torque).is_none());
        }

        #[test]
        fn friction_stops_a_puck_for_good_or_until_the_torque_turns_it_around(
            inertia in 1e-5_f64..1e-2, damping in 0.0_f64..1e-2, friction in 1e-3_f64..0.1, velocity in -10.0_f64..10.0, part in -3.0_f64..3.0,
        ) {
            let (device, torque) = ((inertia, damping, [friction; 2]), part * friction);
            // Longer than friction takes to stop the puck.
            let (period, away) = (velocity.abs() * inertia / friction, -velocity.signum());
            let (position, end) = slide_under(device, (0.0, velocity), torque, 1e3 * period);
            if part.abs() <= 1.0 {
                prop_assert_eq!(end, 0.0);
                // Where it is to rest there, a longer period changes nothing.
                if part * away >= 0.0 {
                    prop_assert_eq!((position, end), slide_under(device, (0.0, velocity), torque, 2e3 * period));
                    prop_assert!(position * velocity >= 0.0);
                }
            } else if part * away > 1.0 {
                prop_assert!(end * away > 0.0);
            }
        }
    }
}
