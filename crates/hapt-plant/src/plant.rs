//! The puck between two events, exactly: a linear differential equation and its matrix exponential.
//!
//! ```text
//! ẋ = v,    mass v̇ = -stiffness x - damping v + f + sine σ + cosine κ + d
//! ḟ = f',   σ̇ = ω κ,   κ̇ = -ω σ,   ḋ = -decay d
//! ```
//!
//! The torques are states too, so that one matrix exponential covers a held torque, a ramp (f'), a sine (σ, κ), and the difference between a
//! lagging motor's torque and its command (d), also where rates coincide. The works are integrals of products of these states, and exact in
//! the same way.
//!
//! The states are in the order in which they are needed, so that the first few suffice in simple cases: v and f for a free puck
//! under a held torque, x for a spring, f' for a ramp, σ and κ for a sine, d for a lag.

use crate::exponential::{GAUSS, Square, applied, congruent, doubled, folded, halved, series, widened};
use crate::hand::Hand;
use crate::push::{Grasp, Inertia, NO_SINE, Sine};

/// How many states there are.
pub(crate) const STATES: usize = 7;
/// v, f, x, f', σ, κ, d.
pub(crate) type State = [f64; STATES];
/// Their indices.
pub(crate) const V: usize = 0;
pub(crate) const F: usize = 1;
pub(crate) const X: usize = 2;
pub(crate) const RAMP: usize = 3;
pub(crate) const SIN: usize = 4;
pub(crate) const COS: usize = 5;
pub(crate) const GAP: usize = 6;
/// The states that occur under a held torque, under a ramp, and under a sine; each also with a lag. Position and velocity are in all.
const HELD: [usize; 3] = [V, F, X];
const RAMPED: [usize; 4] = [V, F, X, RAMP];
const DRIVEN: [usize; 6] = [V, F, X, RAMP, SIN, COS];
const LAGGING: [usize; 4] = [V, F, X, GAP];
const RAMPED_LAGGING: [usize; 5] = [V, F, X, RAMP, GAP];
const ALL: [usize; STATES] = [V, F, X, RAMP, SIN, COS, GAP];

/// The same code for the states that occur.
macro_rules! for_occurring {
    ($lags:expr, $sine:expr, $ramps:expr, $states:ident => $do:expr) => {
        match ($lags, $sine, $ramps) {
            (true, true, _) => {
                const $states: [usize; STATES] = ALL;
                $do
            }
            (true, false, true) => {
                const $states: [usize; 5] = RAMPED_LAGGING;
                $do
            }
            (true, false, false) => {
                const $states: [usize; 4] = LAGGING;
                $do
            }
            (false, true, _) => {
                const $states: [usize; 6] = DRIVEN;
                $do
            }
            (false, false, true) => {
                const $states: [usize; 4] = RAMPED;
                $do
            }
            (false, false, false) => {
                const $states: [usize; 3] = HELD;
                $do
            }
        }
    };
}
type Matrix = Square<STATES>;

/// The constants of the equation.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Plant {
    pub mass: f64,
    pub damping: f64,
    pub stiffness: f64,
    /// The drive's per unit of σ and κ.
    pub sine: f64,
    pub cosine: f64,
    /// rad/s; 0 where there is no sine.
    pub omega: f64,
    /// 1/s; 0 where the motor does not lag.
    pub decay: f64,
}

/// The map of a motion over a time step.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Propagator {
    /// exp(N dt) - I
    change: Matrix,
    /// ∫ v² dt as a quadratic form of the motion at the start; the upper triangle holds all of it.
    speed: Matrix,
    /// ∫ (drive - f) v dt, where drive = f + sine σ + cosine κ, and f is that at the start; as well.
    varying: Matrix,
    /// ∫ d v dt for d = 1 at the start, on the motion at the start.
    lagging: State,
    /// Whether x, and whether σ and κ, occur.
    spring: bool,
    sine: bool,
}

/// The end of a time step, and the works over it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stretch {
    /// Position and velocity.
    pub end: [f64; 2],
    /// The displacement from the start.
    pub travel: f64,
    /// ∫ v² dt
    pub speed: f64,
    /// ∫ (drive - f) v dt: the work beyond that of the initial f, which is f · travel.
    pub varying: f64,
    /// ∫ d v dt
    pub lagging: f64,
}

impl Plant {
    /// A puck, in a grip or not, under a `sine` per unit of σ and κ; `decay` in 1/s is the motor's.
    pub fn new(device: Inertia, grip: Option<Inertia>, (sine, cosine, omega): Sine, decay: f64) -> Self {
        let hand = grip.unwrap_or_default();
        Plant {
            mass: device.inertia + hand.inertia,
            damping: device.damping + hand.damping,
            stiffness: device.stiffness + hand.stiffness,
            sine,
            cosine,
            omega,
            decay,
        }
    }

    /// A puck without a hand.
    pub fn free(device: Inertia) -> Self {
        Plant::new(device, None, NO_SINE, 0.0)
    }

    /// ẏ = N y; rows of N by state.
    pub fn generator(&self) -> Matrix {
        let m = self.mass;
        let mut n = [[0.0; STATES]; STATES];
        n[X][V] = 1.0;
        n[V] = [-self.damping / m, 1.0 / m, -self.stiffness / m, 0.0, self.sine / m, self.cosine / m, 1.0 / m];
        n[F][RAMP] = 1.0;
        n[SIN][COS] = self.omega;
        n[COS][SIN] = -self.omega;
        n[GAP][GAP] = -self.decay;
        n
    }

    /// The fastest rate in it once the motor has settled, in 1/s.
    pub fn rate_without_lag(&self) -> f64 {
        (self.damping / self.mass).max(self.swing())
    }

    /// The fastest rate in it, in 1/s.
    pub fn rate(&self) -> f64 {
        self.rate_without_lag().max(self.decay)
    }

    /// The highest frequency of oscillation, in rad/s; damping decays without oscillation.
    pub fn swing(&self) -> f64 {
        libm::sqrt(self.stiffness / self.mass).max(self.omega)
    }

    /// Motor and hand in N·m (linear: N): everything but the puck's own spring and damper.
    pub fn drive(&self, y: &State) -> f64 {
        y[F] + self.sine * y[SIN] + self.cosine * y[COS] + y[GAP]
    }

    /// v̇
    pub fn acceleration(&self, y: &State) -> f64 {
        (self.drive(y) - self.stiffness * y[X] - self.damping * y[V]) / self.mass
    }

    /// The motion after `dt`, for predictions; [`Propagator`] advances.
    pub fn after(&self, y: &State, dt: f64) -> State {
        let (lags, ramps) = (y[GAP] != 0.0, y[RAMP] != 0.0);
        for_occurring!(lags, self.has_sine(), ramps, OCCURRING => self.after_of(OCCURRING, y, dt))
    }

    /// Position and velocity after `dt`: the end of [`Propagator::stretch`], to the bit, without the works.
    pub fn end(&self, y: &State, dt: f64) -> [f64; 2] {
        if self.slides_freely(y) {
            let [x, v] = self.free_change(dt).map(|row| row[0] * y[V] + row[1] * y[F]);
            return [y[X] + x, y[V] + v];
        }
        let (lags, ramps) = (y[GAP] != 0.0, y[RAMP] != 0.0);
        for_occurring!(lags, self.has_sine(), ramps, OCCURRING => {
            let change = self.change(OCCURRING, dt);
            let row = |row: usize| {
                OCCURRING.iter().zip(&change[row]).map(|(state, x)| x * y[*state]).sum::<f64>()
            };
            // v, f and x are the first three of all.
            [y[X] + row(X), y[V] + row(V)]
        })
    }

    /// Whether its velocity depends only on velocity and held torque.
    pub fn slides_freely(&self, y: &State) -> bool {
        self.stiffness == 0.0 && !self.has_sine() && y[RAMP] == 0.0 && y[GAP] == 0.0
    }

    /// The effect of velocity and held torque on position and velocity over `dt`, without a spring, a ramp, a sine or a lag: the corresponding four
    /// entries of [`Plant::change`], bit-identical.
    pub fn free_change(&self, dt: f64) -> [[f64; 2]; 2] {
        let (by_velocity, by_torque) = (-self.damping / self.mass, 1.0 / self.mass);
        let (h, halvings) = halved(self.rate(), dt);
        let (mut x, mut v) = ([0.0; 2], [0.0; 2]);
        for j in (1..=16).rev() {
            let part = h / f64::from(j);
            x = [(v[0] + 1.0) * part, v[1] * part];
            v = [by_velocity * (v[0] + 1.0) * part, (by_velocity * v[1] + by_torque) * part];
        }
        for _ in 0..halvings {
            x = [x[0] * v[0] + 2.0 * x[0], x[0] * v[1] + 2.0 * x[1]];
            v = [v[0] * v[0] + 2.0 * v[0], v[0] * v[1] + 2.0 * v[1]];
        }
        [x, v]
    }

    /// The instant in s at which that motion comes to rest, from v against the torque f: where v e^(-at) + (1 - e^(-at)) f/b = 0, with a = b/m,
    ///
    /// ```text
    /// t = ln(1 + r)/a = -m v/f · ln(1 + r)/r,    r = -b v/f
    /// ```
    ///
    /// `None` where no torque is against it.
    pub fn free_stop(&self, velocity: f64, torque: f64) -> Option<f64> {
        let time = -velocity / torque;
        let (r, straight) = (self.damping * time, self.mass * time);
        (time > 0.0).then(|| if r > 0.0 { straight * (libm::log1p(r) / r) } else { straight })
    }

    fn after_of<const N: usize>(&self, states: [usize; N], y: &State, dt: f64) -> State {
        let mut out = *y;
        for (state, x) in states.into_iter().zip(applied(&self.change(states, dt), &states.map(|state| y[state]))) {
            out[state] = x;
        }
        out
    }

    fn has_sine(&self) -> bool {
        self.sine != 0.0 || self.cosine != 0.0
    }

    /// exp(N dt) - I of these states, bit-identical to the one of all states: the others only add zeros.
    fn change<const N: usize>(&self, states: [usize; N], dt: f64) -> Square<N> {
        let (n, h, halvings) = self.start(states, dt);
        let mut change = series(&n, h);
        for _ in 0..halvings {
            change = doubled(&change);
        }
        change
    }

    /// The generator of these states, a step of a quarter radian at most, and how often to double it.
    fn start<const N: usize>(&self, states: [usize; N], dt: f64) -> (Square<N>, f64, u32) {
        let (h, halvings) = halved(self.rate(), dt);
        let all = self.generator();
        (states.map(|i| states.map(|j| all[i][j])), h, halvings)
    }
}

/// x and v after `dt` s less those before, on the states v, torque, x, the torque's slope, σ and κ of a sine: of a puck of `inertia` and
/// `damping` without a hand, or with a hand that pushes or grips. In SI.
pub fn change_under(inertia: f64, damping: f64, hand: Option<&Hand>, dt: f64) -> [[f64; 6]; 2] {
    let (grasp, sine) = hand.map_or((Grasp::Free, NO_SINE), Hand::grasp);
    let grip = match grasp {
        Grasp::Grip(grip) => Some(grip),
        Grasp::Free | Grasp::Prescribed => None,
    };
    let plant = Plant::new(Inertia { inertia, damping, stiffness: 0.0 }, grip, sine, 0.0);
    if plant.stiffness == 0.0 && !plant.has_sine() && hand.is_none_or(Hand::is_steady) {
        return plant.free_change(dt).map(|[v, f]| [v, f, 0.0, 0.0, 0.0, 0.0]);
    }
    let change: Square<STATES> = for_occurring!(false, plant.has_sine(), hand.is_some_and(|hand| !hand.is_steady()), OCCURRING => {
        widened(OCCURRING, &plant.change(OCCURRING, dt))
    });
    [X, V].map(|row| core::array::from_fn(|state| change[row][state]))
}

impl Propagator {
    /// One for every motion: without a lag or a sine their states are 0 always.
    pub fn new(plant: &Plant, dt: f64) -> Self {
        for_occurring!(plant.decay != 0.0, plant.has_sine(), true, OCCURRING => Self::of(OCCURRING, plant, dt))
    }

    /// One that suffices for the motion from `y` on, with the bits of one of all states.
    pub fn for_motion(plant: &Plant, y: &State, dt: f64) -> Self {
        let (lags, ramps) = (y[GAP] != 0.0, y[RAMP] != 0.0);
        for_occurring!(lags, plant.has_sine(), ramps, OCCURRING => Self::of(OCCURRING, plant, dt))
    }

    /// Of these states, the first three among them; the rows and columns of the others are 0. Not inlined, so that few states do not use the
    /// stack of all.
    #[inline(never)]
    fn of<const N: usize>(states: [usize; N], plant: &Plant, dt: f64) -> Self {
        let (n, h, halvings) = plant.start(states, dt);
        let varies = N > HELD.len();
        let gap = states.iter().position(|state| *state == GAP);
        let output = [0.0, 1.0, 0.0, 0.0, plant.sine, plant.cosine, 0.0];
        let output = states.map(|state| output[state]);
        let (mut speed, mut drive, mut lagging) = ([[0.0; N]; N], [[0.0; N]; N], [0.0; N]);
        for (node, weight) in GAUSS {
            let change = series(&n, node * h);
            let mut v = change[V];
            v[V] += 1.0;
            let mut f = output;
            for (row, gain) in change.iter().zip(output) {
                for (f, x) in f.iter_mut().zip(row) {
                    *f += gain * x;
                }
            }
            for i in 0..N {
                for j in 0..N {
                    speed[i][j] += weight * h * v[i] * v[j];
                    if varies {
                        drive[i][j] += weight * h * f[i] * v[j];
                    }
                }
                if let Some(gap) = gap {
                    lagging[i] += weight * h * (1.0 + change[gap][gap]) * v[i];
                }
            }
        }
        let mut change = series(&n, h);
        for _ in 0..halvings {
            // The second half starts at the end of the first: G(2h) = G + ΦᵀGΦ.
            let forms = [&mut speed, &mut drive];
            for form in forms.into_iter().take(if varies { 2 } else { 1 }) {
                let later = congruent(&change, form);
                for (row, later) in form.iter_mut().zip(later) {
                    for (x, later) in row.iter_mut().zip(later) {
                        *x += later;
                    }
                }
            }
            if let Some(gap) = gap {
                let (later, left) = (lagging, 1.0 + change[gap][gap]);
                for (i, (row, later_i)) in change.iter().zip(later).enumerate() {
                    for (sum, x) in lagging.iter_mut().zip(row) {
                        *sum += left * later_i * x;
                    }
                    lagging[i] += left * later_i;
                }
            }
            change = doubled(&change);
        }
        let mut varying = folded(&drive);
        if varies {
            for (j, travel) in change[X].iter().enumerate() {
                varying[F.min(j)][F.max(j)] -= travel;
            }
        }
        let mut whole = [0.0; STATES];
        for (state, x) in states.into_iter().zip(lagging) {
            whole[state] = x;
        }
        Propagator {
            change: widened(states, &change),
            speed: widened(states, &folded(&speed)),
            varying: widened(states, &varying),
            lagging: whole,
            spring: plant.stiffness != 0.0,
            sine: plant.has_sine(),
        }
    }

    /// The motion at the end, from `y` on.
    pub fn after(&self, y: &State) -> State {
        applied(&self.change, y)
    }

    /// The stretch from `y` on.
    pub fn stretch(&self, y: State) -> Stretch {
        if self.sine || y[RAMP] != 0.0 || y[GAP] != 0.0 { self.varying_stretch(y) } else { self.held_stretch(&y) }
    }

    /// Whether a sine drives it.
    #[inline]
    pub fn has_sine(&self) -> bool {
        self.sine
    }

    /// Whether a spring holds the puck.
    pub fn has_spring(&self) -> bool {
        self.spring
    }

    /// The same for a torque that is held, without a spring.
    #[inline(always)] // As `held_stretch`.
    pub fn free_stretch(&self, y: &State) -> Stretch {
        self.of_states::<2>(y)
    }

    /// The same for a torque that is held.
    #[inline(always)] // So that the few states never leave the registers.
    pub fn held_stretch(&self, y: &State) -> Stretch {
        if self.spring { self.of_states::<3>(y) } else { self.free_stretch(y) }
    }

    /// The same for a torque that is not held.
    fn varying_stretch(&self, y: State) -> Stretch {
        match (y[GAP] != 0.0, self.sine) {
            (true, _) => self.of_states::<STATES>(&y),
            (false, true) => self.of_states::<6>(&y),
            (false, false) => self.of_states::<4>(&y),
        }
    }

    /// The same, when only the first N states occur.
    #[inline(always)]
    fn of_states<const N: usize>(&self, y: &State) -> Stretch {
        let row = |row: &State| (0..N).map(|j| row[j] * y[j]).sum::<f64>();
        let form = |form: &Matrix| (0..N).map(|i| y[i] * (i..N).map(|j| form[i][j] * y[j]).sum::<f64>()).sum();
        let travel = row(&self.change[X]);
        Stretch {
            end: [y[X] + travel, y[V] + row(&self.change[V])],
            travel,
            speed: form(&self.speed),
            varying: if N > RAMP { form(&self.varying) } else { 0.0 },
            lagging: if N > GAP { y[GAP] * row(&self.lagging) } else { 0.0 },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hapt_testing::prelude::*;

    fn or_zero(of: core::ops::Range<f64>) -> impl Strategy<Value = f64> {
        prop_oneof![Just(0.0), of]
    }

    proptest! {
        #![proptest_config(hapt_testing::cases(1000))]

        /// The states that a motion needs give the bits of all.
        #[test]
        fn states_that_are_0_may_be_left_out(
            (mass, damping, stiffness) in (1e-5_f64..1.0, or_zero(1e-5..10.0), or_zero(1e-2..1e3)),
            (sine, cosine, omega) in (or_zero(-1.0..1.0), or_zero(-1.0..1.0), 1.0_f64..1e3), decay in or_zero(1.0..1e5),
            y in prop::array::uniform5(or_zero(-1.0..1.0)), turned in 0.0_f64..6.3, dt in 1e-6_f64..1e-2,
        ) {
            let plant = Plant { mass, damping, stiffness, sine, cosine, omega, decay };
            let [v, f, x, ramp, gap] = y;
            let y = [v, f, x, ramp, turned.sin(), turned.cos(), if decay > 0.0 { gap } else { 0.0 }];
            let (few, all) = (Propagator::for_motion(&plant, &y, dt).stretch(y), Propagator::of(ALL, &plant, dt).stretch(y));
            prop_assert_eq!(few, all);
            prop_assert_eq!(Propagator::new(&plant, dt).stretch(y), all);
            prop_assert_eq!(plant.end(&y, dt).map(f64::to_bits), all.end.map(f64::to_bits));
            let free = Plant { stiffness: 0.0, sine: 0.0, cosine: 0.0, ..plant };
            let all = Propagator::of(ALL, &free, dt).change;
            prop_assert_eq!(free.free_change(dt), [X, V].map(|row| [V, F].map(|state| all[row][state])));
            let y = [v, f, x, 0.0, 0.0, 0.0, 0.0];
            let end = Propagator::of(ALL, &free, dt).stretch(y).end;
            prop_assert_eq!(free.end(&y, dt), end);
            let (few, all) = (plant.after(&y, dt), plant.after_of(ALL, &y, dt));
            let own = Propagator::new(&plant, dt).after(&y);
            prop_assert_eq!((few[V], few[X], own[V], own[X]), (all[V], all[X], all[V], all[X]));
        }
    }
}
