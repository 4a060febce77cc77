//! The loop: a world compiled once, and one sample of it.

mod branches;

use crate::actuate::Actuator;
use crate::gradient::{Contacts, Gradient};
use crate::matrix::{ROWS, Response, Vector, each_place};
use crate::nonlinear::Nonlinear;
use crate::sense::{Memory, Puck, Sensor};
use crate::{Number, Real};
pub(crate) use branches::Branches;
use branches::LinearFastPath;

/// A world compiled for at most B bodies, C couplings and W remembered counts (a FOAW window of W - 1), on numbers F.
///
/// A PC holds `Loop<f64, 32, 64, 257>`, a microcontroller `Loop<f32, 4, 8, 17>`. Results are bit-identical for every capacity.
#[derive(Clone, Copy, Debug)]
pub struct Loop<F, const B: usize, const C: usize, const W: usize> {
    pub(crate) bodies: usize,
    /// From sample to sample, in s.
    pub(crate) period: F,
    /// 1 over the bodies' step.
    pub(crate) rate: F,
    pub(crate) new_sample_first: bool,
    /// How many samples after each step of the bodies they stand still: `bodies_every` less 1.
    pub(crate) skips: u32,
    pub(crate) staged: bool,
    /// Whether its samples take the [`LinearFastPath`].
    pub(crate) has_fast_path: bool,
    pub(crate) moment: Moment,
    pub(crate) start: Vector<F, B>,
    /// The method's matrix: the effect of each body on all.
    pub(crate) state: [Response<F, B>; B],
    /// The effect of the puck on them, as seen at this sample and at the last.
    pub(crate) input_new: Response<F, B>,
    pub(crate) input_old: Response<F, B>,
    pub(crate) drift: Vector<F, B>,
    /// The response to a nonlinear torque on each body; `None` when there are none.
    pub(crate) force: Option<[Vector<F, B>; B]>,
    /// Present when the method solves for nonlinear torques over the step (discrete gradient).
    pub(crate) gradient: Option<Gradient<F, B>>,
    pub(crate) port: Port<F, B>,
    pub(crate) nonlinear: [Option<Nonlinear<F>>; C],
    /// The nonlinear couplings are before this index.
    pub(crate) nonlinear_count: usize,
    pub(crate) sensor: Sensor<F>,
    pub(crate) actuator: Actuator<F>,
}

/// Which state of the bodies gives the torque: [`crate::Output`], with `advance` further steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Moment {
    Start,
    Middle,
    End,
    Ahead(u32),
}

/// The linear torque on the puck: from its own position and velocity, from the bodies', and a constant part.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Port<F, const B: usize> {
    pub puck: [F; 2],
    pub bodies: Vector<F, B>,
    pub offset: F,
}

/// Everything that changes from sample to sample.
///
/// A copy of it is a snapshot: the same readings give the same torques again, to the bit.
///
/// ```
/// use hapt_core::{Coupling, End, Estimator, Law, Loop, Spec};
///
/// let law = Law::Spring { stiffness: 1.0, rest: 0.0 };
/// let spring = Coupling { first: End::Puck, second: End::Ground, law, limit: None };
/// let spec = Spec { estimator: Estimator::Difference, couplings: &[spring], ..Spec::new(1e-3) };
/// let world = Loop::<f64, 4, 8, 17>::new(&spec)?;
/// let mut state = world.start();
/// world.step(&mut state, 0.1, 0.0);
/// let mut snapshot = state;
/// assert_eq!(world.step(&mut state, 0.2, 0.0).torque, world.step(&mut snapshot, 0.2, 0.0).torque);
/// assert_eq!(state, snapshot);
/// # Ok::<(), hapt_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(serialize = "F: serde::Serialize", deserialize = "F: crate::Number + serde::Deserialize<'de>"))
)]
pub struct State<F, const B: usize, const C: usize, const W: usize> {
    /// x_k of the last sample taken, or of the last at which the bodies stepped: what rows show.
    pub now: Vector<F, B>,
    /// x_{k+1} - x_k, of a step of the bodies; 0 before the first sample, and with the methods that take the new sample first.
    pub change: Vector<F, B>,
    /// How many more samples come before the one at which the bodies step; 0 where they step at every sample.
    pub until_step: u32,
    /// s of each coupling: of LuGre friction its bristle in rad (linear: m), of an integral term its sum in rad·s (m·s), of a
    /// torque along the acceleration its low-passed velocity in rad/s (m/s); 0 of the others.
    #[cfg_attr(feature = "serde", serde(with = "crate::array"))]
    pub bristles: [F; C],
    /// The torques found over the step, with the methods that find them.
    pub contacts: Contacts<F, C>,
    /// The memory of the sensor.
    pub memory: Memory<F, W>,
}

/// The result of one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample<F> {
    /// u_k: the puck as the loop saw it.
    pub puck: Puck<F>,
    /// The couplings' torque on the puck in N·m (linear: N), before levels and limit.
    pub torque: F,
    /// The command to the motor, after levels and limit.
    pub command: F,
}

impl<F: Number, const B: usize, const C: usize, const W: usize> State<F, B, C, W> {
    /// The state of an empty world: every number 0, and no memory.
    pub const EMPTY: Self = State {
        now: Vector::ZERO,
        change: Vector::ZERO,
        until_step: 0,
        bristles: [F::ZERO; C],
        contacts: Contacts::NONE,
        memory: Memory::EMPTY,
    };
}

impl<F: Number, const B: usize, const C: usize, const W: usize> Loop<F, B, C, W> {
    /// The state before sample 0.
    pub fn start(&self) -> State<F, B, C, W> {
        State { now: self.start, ..State::EMPTY }
    }

    /// Whether the [`LinearFastPath`] gives the same sample.
    pub(crate) fn allows_fast_path(&self) -> bool {
        let ideal = self.sensor.count.is_none() && self.sensor.filter.is_none() && self.sensor.velocity.is_none();
        ideal && !self.new_sample_first && self.skips == 0 && self.moment == Moment::End && self.nonlinear_count == 0
    }

    /// How many bodies the world has.
    pub fn bodies(&self) -> usize {
        self.bodies
    }

    /// T in s.
    pub fn period(&self) -> F {
        self.period
    }

    /// The method's matrices on one state of n bodies: other entries stay unchanged, or become 0. `old` is there for the methods that take
    /// the new sample first.
    #[inline(always)]
    pub(crate) fn linear(
        &self,
        n: usize,
        change: &mut Vector<F, B>,
        x: &Vector<F, B>,
        old: Option<Puck<F>>,
        new: Puck<F>,
    ) {
        if n == 1 {
            change.set_rows(0, &self.rows::<1>(n, 0, x, old, new));
        } else if B < ROWS {
            *change = self.rows(n, 0, x, old, new);
        } else {
            for i in 0..B.div_ceil(ROWS) {
                if i * ROWS >= n {
                    break;
                }
                // The last rows may overlap those before: computed twice, they are the same.
                let at = (i * ROWS).min(B - ROWS);
                change.set_rows(at, &self.rows::<ROWS>(n, at, x, old, new));
            }
        }
    }

    /// L rows of the linear part. The bodies come after the puck, so that the sums can begin without waiting for them.
    #[inline(always)]
    fn rows<const L: usize>(
        &self,
        n: usize,
        at: usize,
        x: &Vector<F, B>,
        old: Option<Puck<F>>,
        new: Puck<F>,
    ) -> Vector<F, L> {
        let mut sums = self.drift.rows(at);
        if let Some(old) = old {
            self.input_old.apply(n, at, old.position, old.velocity, &mut sums);
        }
        self.input_new.apply(n, at, new.position, new.velocity, &mut sums);
        for ((response, w), v) in self.state.iter().zip(&x.position).zip(&x.velocity).take(n) {
            response.apply(n, at, *w, *v, &mut sums);
        }
        sums
    }

    /// (w_{k+1} - w_k)/T, T the bodies' step.
    #[inline(always)]
    fn mean_velocities<const L: usize>(&self, n: usize, change: &Vector<F, L>) -> [F; L] {
        let mut means = [F::ZERO; L];
        each_place!(F, L, n, i => means[i] = change.position[i] * self.rate);
        means
    }
}

impl<F: Real, const B: usize, const C: usize, const W: usize> Loop<F, B, C, W> {
    /// Sample k at the puck's true position in rad (linear: m) and velocity in rad/s (m/s), which only the exact estimator
    /// looks at.
    #[inline]
    pub fn step(&self, state: &mut State<F, B, C, W>, position: F, velocity: F) -> Sample<F> {
        if self.has_fast_path {
            return self.sample(&LinearFastPath(self), state, position, velocity);
        }
        self.step_of_any(state, position, velocity)
    }

    /// Out of line, so that the fast path keeps its registers.
    #[inline(never)]
    fn step_of_any(&self, state: &mut State<F, B, C, W>, position: F, velocity: F) -> Sample<F> {
        self.sample(self, state, position, velocity)
    }

    /// The command to the motor for a torque on the puck in N·m (linear: N): after levels and limit.
    pub fn command(&self, torque: F) -> F {
        self.actuator.command_one(torque)
    }
}

/// The sample, in one source for numbers and for lanes.
impl<F: Number, const B: usize, const C: usize, const W: usize> Loop<F, B, C, W> {
    /// Most worlds have one body: the sample is monomorphised for it, and results are bit-identical. Lanes with room for more have more.
    /// `with` decides what branches on the numbers: the loop itself, or the loops of all lanes, with their S couplings.
    #[inline(always)]
    pub(crate) fn sample<X: Branches<F, B, S, W>, const S: usize>(
        &self,
        with: &X,
        state: &mut State<F, B, S, W>,
        position: F,
        velocity: F,
    ) -> Sample<F> {
        let n = self.bodies;
        if n == 1 && (B == 1 || !F::IS_VECTOR) {
            self.sample_of(with, 1, state, position, velocity)
        } else if B == 1 {
            self.sample_of(with, 0, state, position, velocity)
        } else {
            self.sample_of(with, n, state, position, velocity)
        }
    }

    /// The sample of a world of n bodies.
    #[inline(always)]
    fn sample_of<X: Branches<F, B, S, W>, const S: usize>(
        &self,
        with: &X,
        n: usize,
        state: &mut State<F, B, S, W>,
        position: F,
        velocity: F,
    ) -> Sample<F> {
        let position = if X::IS_LINEAR { position } else { self.sensor.position(&mut state.memory, position) };
        let is_true = X::IS_LINEAR || self.sensor.velocity.is_none();
        let velocity = if is_true { velocity } else { with.estimate(&mut state.memory, position) };
        let measured = Puck { position, velocity };
        let puck = if X::IS_LINEAR {
            measured
        } else {
            Puck { position: self.sensor.seen(&state.memory, position), velocity }
        };
        let State { now, change, until_step, bristles, contacts, memory } = state;
        if X::IS_LINEAR || !self.new_sample_first {
            // The state may come from a caller.
            let waits = if X::IS_LINEAR { 0 } else { (*until_step).min(self.skips) };
            if waits == 0 {
                now.add(n, F::ONE, change);
            }
            with.bend(bristles, puck, now);
            if waits == 0 {
                with.change(n, change, now, None, puck, bristles, contacts);
            }
            if !X::IS_LINEAR {
                *until_step = if waits == 0 { self.skips } else { waits - 1 };
            }
        } else {
            with.bend(bristles, puck, now);
            if let Some(last) = self.sensor.seen_last(memory) {
                let mut change = Vector::ZERO;
                with.change(n, &mut change, now, Some(last), puck, bristles, contacts);
                now.add(n, F::ONE, &change);
            }
        }
        state.memory.last = Some(measured);
        if !X::IS_LINEAR && self.sensor.filter.is_some() {
            state.memory.filtered = puck.position;
        }
        let torque = if n == 1 {
            self.torque::<X, 1, S>(with, n, state, puck)
        } else {
            self.torque::<X, B, S>(with, n, state, puck)
        };
        Sample { puck: measured, torque, command: with.command(torque) }
    }

    /// The torque on the puck from the state that the output names, of n bodies in the first L places.
    #[inline(always)]
    fn torque<X: Branches<F, B, S, W>, const L: usize, const S: usize>(
        &self,
        with: &X,
        n: usize,
        state: &State<F, B, S, W>,
        puck: Puck<F>,
    ) -> F {
        let (mut bodies, change) = (state.now.rows::<L>(0), state.change.rows::<L>(0));
        // The default is tested first.
        if X::IS_LINEAR || self.moment == Moment::End {
            bodies.add(n, F::ONE, &change);
            bodies.velocity = self.mean_velocities(n, &change);
        } else if self.moment == Moment::Middle {
            bodies.add(n, F::HALF, &change);
        } else if let Moment::Ahead(advance) = self.moment {
            return self.torque_ahead(with, advance, state, puck);
        }
        self.torque_at(with, n, &bodies, puck, &state.bristles, &state.contacts)
    }

    /// The torque on the puck a number of steps ahead: the world continues without the loop, the puck held where it was seen.
    #[cold]
    fn torque_ahead<X: Branches<F, B, S, W>, const S: usize>(
        &self,
        with: &X,
        advance: u32,
        state: &State<F, B, S, W>,
        puck: Puck<F>,
    ) -> F {
        let (mut bodies, mut bristles, mut contacts) = (state.now, state.bristles, state.contacts);
        bodies.add(self.bodies, F::ONE, &state.change);
        let held = Puck { position: puck.position, velocity: F::ZERO };
        let mut change = Vector::ZERO;
        for _ in 0..advance {
            with.bend(&mut bristles, held, &bodies);
            with.change(self.bodies, &mut change, &bodies, None, held, &bristles, &mut contacts);
            bodies.add(self.bodies, F::ONE, &change);
        }
        bodies.velocity = self.mean_velocities(self.bodies, &change);
        self.torque_at(with, self.bodies, &bodies, puck, &bristles, &contacts)
    }

    /// The couplings' torque on the puck with the bodies as given.
    #[inline(always)]
    fn torque_at<X: Branches<F, B, S, W>, const L: usize, const S: usize>(
        &self,
        with: &X,
        n: usize,
        bodies: &Vector<F, L>,
        puck: Puck<F>,
        bristles: &[F; S],
        contacts: &Contacts<F, S>,
    ) -> F {
        let mut torque = self.port.offset + self.port.puck[0] * puck.position + self.port.puck[1] * puck.velocity;
        // All products come before the first sum, which then waits only for the sums before.
        let port = self.port.bodies.rows::<L>(0);
        let mut products = [F::ZERO; L];
        each_place!(F, L, n, i => {
            products[i] = port.position[i] * bodies.position[i] + port.velocity[i] * bodies.velocity[i];
        });
        for product in products.iter().take(n) {
            torque += *product;
        }
        with.with_nonlinear_torque(torque, bodies, puck, bristles, contacts)
    }
}
