//! The loop: a world compiled once, and one sample of it.

use crate::actuate::Actuator;
use crate::branches::Branches;
use crate::gradient::{Contacts, Gradient};
use crate::matrix::{ROWS, Response, Vector};
use crate::nonlinear::Nonlinear;
use crate::sense::{Memory, Puck, Sensor};
use crate::{Number, Output, Real};

/// A world compiled for at most B bodies, C couplings and W remembered counts (a FOAW window of W - 1), on numbers F.
///
/// A PC holds `Loop<f64, 32, 64, 257>`, a microcontroller `Loop<f32, 4, 8, 17>`. The bits are those of the numbers alone,
/// whatever the room.
#[derive(Clone, Copy, Debug)]
pub struct Loop<F, const B: usize, const C: usize, const W: usize> {
    pub(crate) bodies: usize,
    pub(crate) period: F,
    pub(crate) rate: F,
    pub(crate) new_sample_first: bool,
    pub(crate) staged: bool,
    pub(crate) output: Output,
    pub(crate) advance: u32,
    pub(crate) start: Vector<F, B>,
    /// The method's matrix: what each body does to all.
    pub(crate) state: [Response<F, B>; B],
    /// What the puck does to them, as seen at this sample and at the last.
    pub(crate) input_new: Response<F, B>,
    pub(crate) input_old: Response<F, B>,
    pub(crate) drift: Vector<F, B>,
    /// The response to a nonlinear torque on each body; `None` when there are none.
    pub(crate) force: Option<[Vector<F, B>; B]>,
    /// There where the method finds these torques over the step, rather than taking them where it stands.
    pub(crate) gradient: Option<Gradient<F, B>>,
    pub(crate) port: Port<F, B>,
    pub(crate) nonlinear: [Option<Nonlinear<F>>; C],
    /// No nonlinear coupling stands from here on.
    pub(crate) nonlinear_count: usize,
    pub(crate) sensor: Sensor<F>,
    pub(crate) actuator: Actuator<F>,
}

/// The linear torque on the puck: from its own position and velocity, from the bodies', and from nothing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Port<F, const B: usize> {
    pub puck: [F; 2],
    pub bodies: Vector<F, B>,
    pub offset: F,
}

/// Everything that changes from sample to sample.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(serialize = "F: serde::Serialize", deserialize = "F: crate::Number + serde::Deserialize<'de>"))
)]
pub struct State<F, const B: usize, const C: usize, const W: usize> {
    /// x_k of the last sample taken: what rows show.
    pub now: Vector<F, B>,
    /// x_{k+1} - x_k; 0 before the first sample, and with the methods that take the new sample first.
    pub change: Vector<F, B>,
    /// s of each coupling, in rad (linear: m); 0 where it is not LuGre friction.
    #[cfg_attr(feature = "serde", serde(with = "crate::array"))]
    pub bristles: [F; C],
    /// The torques found over the step, with the methods that find them.
    pub contacts: Contacts<F, C>,
    /// What the sensor remembers.
    pub memory: Memory<F, W>,
}

/// What one sample gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample<F> {
    /// u_k: the puck as the loop saw it.
    pub puck: Puck<F>,
    /// The couplings' torque on the puck in N·m (linear: N), before levels and limit.
    pub torque: F,
    /// What the motor is asked for, after levels and limit.
    pub command: F,
}

impl<F: Number, const B: usize, const C: usize, const W: usize> Loop<F, B, C, W> {
    /// The state before sample 0.
    pub fn start(&self) -> State<F, B, C, W> {
        let bristles = [F::ZERO; C];
        State { now: self.start, change: Vector::ZERO, bristles, contacts: Contacts::NONE, memory: Memory::EMPTY }
    }

    /// How many bodies the world has.
    pub fn bodies(&self) -> usize {
        self.bodies
    }

    /// T in s.
    pub fn period(&self) -> F {
        self.period
    }

    /// The method's matrices on one state.
    #[inline(always)]
    pub(crate) fn linear(&self, x: &Vector<F, B>, old: Puck<F>, new: Puck<F>) -> Vector<F, B> {
        if B < ROWS {
            return self.rows(0, x, old, new);
        }
        let mut change = Vector::ZERO;
        for i in 0..B.div_ceil(ROWS) {
            if i * ROWS >= self.bodies {
                break;
            }
            // The last rows may be some of those before: made twice, they are the same.
            let at = (i * ROWS).min(B - ROWS);
            change.set_rows(at, &self.rows::<ROWS>(at, x, old, new));
        }
        change
    }

    /// L rows of the linear part. The bodies come after the puck: a sum should not wait where it can begin.
    #[inline(always)]
    fn rows<const L: usize>(&self, at: usize, x: &Vector<F, B>, old: Puck<F>, new: Puck<F>) -> Vector<F, L> {
        let mut sums = self.drift.rows(at);
        if self.new_sample_first {
            self.input_old.apply(at, old.position, old.velocity, &mut sums);
        }
        self.input_new.apply(at, new.position, new.velocity, &mut sums);
        for ((response, w), v) in self.state.iter().zip(&x.position).zip(&x.velocity).take(self.bodies) {
            response.apply(at, *w, *v, &mut sums);
        }
        sums
    }

    /// (w_{k+1} - w_k)/T
    #[inline(always)]
    fn mean_velocities(&self, change: &Vector<F, B>) -> [F; B] {
        change.position.map(|distance| distance * self.rate)
    }
}

impl<F: Real, const B: usize, const C: usize, const W: usize> Loop<F, B, C, W> {
    /// Sample k at the puck's true position in rad (linear: m) and velocity in rad/s (m/s), which only the exact estimator
    /// looks at.
    #[inline]
    pub fn step(&self, state: &mut State<F, B, C, W>, position: F, velocity: F) -> Sample<F> {
        self.sample(state, position, velocity)
    }
}

/// One source for numbers and for lanes: what a sample is.
#[allow(private_bounds)] // Nothing here is public.
impl<F: Number, const B: usize, const C: usize, const W: usize> Loop<F, B, C, W>
where
    Self: Branches<F, B, C, W>,
{
    #[inline(always)]
    pub(crate) fn sample(&self, state: &mut State<F, B, C, W>, position: F, velocity: F) -> Sample<F> {
        let estimate = |memory: &Memory<F, W>, position| self.estimate(memory, position);
        let puck = self.sensor.read(&mut state.memory, position, velocity, estimate);
        if !self.new_sample_first {
            state.now.add(self.bodies, F::ONE, &state.change);
        }
        self.bend(&mut state.bristles, puck, &state.now);
        let State { now, change, bristles, contacts, memory } = state;
        if !self.new_sample_first {
            self.change(change, now, puck, puck, bristles, contacts);
        } else if let Some(last) = memory.last {
            let mut change = Vector::ZERO;
            self.change(&mut change, now, last, puck, bristles, contacts);
            state.now.add(self.bodies, F::ONE, &change);
        }
        state.memory.last = Some(puck);
        let torque = self.torque(state, puck);
        Sample { puck, torque, command: self.actuator.command(torque) }
    }

    /// The torque on the puck from the state that the output names.
    #[inline(always)]
    fn torque(&self, state: &State<F, B, C, W>, puck: Puck<F>) -> F {
        let (mut bodies, change, bristles) = (state.now, &state.change, &state.bristles);
        match self.output {
            Output::Start => {}
            Output::Middle => bodies.add(self.bodies, F::HALF, change),
            Output::End if self.advance > 0 => return self.torque_ahead(state, puck),
            Output::End => {
                bodies.add(self.bodies, F::ONE, change);
                bodies.velocity = self.mean_velocities(change);
            }
        }
        self.torque_at(&bodies, puck, bristles, &state.contacts)
    }

    /// The torque on the puck `advance` steps further on: the world goes on without the loop, the puck held where it was seen.
    #[cold]
    fn torque_ahead(&self, state: &State<F, B, C, W>, puck: Puck<F>) -> F {
        let (mut bodies, mut bristles, mut contacts) = (state.now, state.bristles, state.contacts);
        bodies.add(self.bodies, F::ONE, &state.change);
        let held = Puck { position: puck.position, velocity: F::ZERO };
        let mut change = Vector::ZERO;
        for _ in 0..self.advance {
            self.bend(&mut bristles, held, &bodies);
            self.change(&mut change, &bodies, held, held, &bristles, &mut contacts);
            bodies.add(self.bodies, F::ONE, &change);
        }
        bodies.velocity = self.mean_velocities(&change);
        self.torque_at(&bodies, puck, &bristles, &contacts)
    }

    /// The couplings' torque on the puck with the bodies as given.
    #[inline(always)]
    fn torque_at(&self, bodies: &Vector<F, B>, puck: Puck<F>, bristles: &[F; C], contacts: &Contacts<F, C>) -> F {
        let mut torque = self.port.offset + self.port.puck[0] * puck.position + self.port.puck[1] * puck.velocity;
        // All products before the first sum, which then has only itself to wait for.
        let port = &self.port.bodies;
        let products: [F; B] =
            core::array::from_fn(|i| port.position[i] * bodies.position[i] + port.velocity[i] * bodies.velocity[i]);
        for product in products.iter().take(self.bodies) {
            torque += *product;
        }
        self.bent(torque, bodies, puck, bristles, contacts)
    }
}
