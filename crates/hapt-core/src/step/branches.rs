//! The parts of a sample that branch on its numbers: the steps that find torques at bodies, FOAW's window, couplings of different laws in
//! different lanes. A single number branches; lanes, which would branch differently, are computed one after the other ([`crate::Batch`]).

use crate::gradient::{Contacts, Step};
use crate::matrix::Vector;
use crate::sense::{Memory, Puck};
use crate::step::Loop;
use crate::{End, Number, Real};

/// The places of a sample that branch on its numbers.
pub(crate) trait Branches<F, const B: usize, const C: usize, const W: usize> {
    /// Whether the world is known to be linear and ideal ([`LinearFastPath`]).
    const IS_LINEAR: bool = false;

    /// The velocity from this position and those before.
    fn estimate(&self, memory: &mut Memory<F, W>, position: F) -> F;

    /// Every LuGre bristle over one period, with q̇ as it is at this sample held, and every integral and low-passed velocity by this sample.
    fn bend(&self, bristles: &mut [F; C], puck: Puck<F>, bodies: &Vector<F, B>);

    /// x_{k+1} - x_k of the method for n bodies, from x_k, u_k and, with the methods that look at it, u_{k-1}, into its place. A returned
    /// value would be stored in parts, and the next sample, which reads positions and velocities as one vector, would wait for them.
    #[allow(clippy::too_many_arguments)] // What a step is made from, and where it goes.
    fn change(
        &self,
        n: usize,
        change: &mut Vector<F, B>,
        x: &Vector<F, B>,
        old: Option<Puck<F>>,
        new: Puck<F>,
        bristles: &[F; C],
        contacts: &mut Contacts<F, C>,
    );

    /// The linear `torque` on the puck with the nonlinear couplings'.
    fn with_nonlinear_torque<const L: usize>(
        &self,
        torque: F,
        bodies: &Vector<F, L>,
        puck: Puck<F>,
        bristles: &[F; C],
        contacts: &Contacts<F, C>,
    ) -> F;

    /// The command to the motor.
    fn command(&self, torque: F) -> F;
}

impl<F: Real, const B: usize, const C: usize, const W: usize> Branches<F, B, C, W> for Loop<F, B, C, W> {
    #[inline(always)]
    fn estimate(&self, memory: &mut Memory<F, W>, position: F) -> F {
        self.sensor.estimate(memory, position)
    }

    #[inline(always)]
    fn bend(&self, bristles: &mut [F; C], puck: Puck<F>, bodies: &Vector<F, B>) {
        if self.nonlinear_count > 0 {
            self.bend_all(bristles, puck, bodies);
        }
    }

    #[inline(always)]
    fn change(
        &self,
        n: usize,
        change: &mut Vector<F, B>,
        x: &Vector<F, B>,
        old: Option<Puck<F>>,
        new: Puck<F>,
        bristles: &[F; C],
        contacts: &mut Contacts<F, C>,
    ) {
        self.linear(n, change, x, old, new);
        if self.nonlinear_count > 0 {
            if let Some(force) = &self.force {
                self.force_on(change, force, x, old, new, bristles, contacts);
            }
        }
    }

    #[inline(always)]
    fn with_nonlinear_torque<const L: usize>(
        &self,
        torque: F,
        bodies: &Vector<F, L>,
        puck: Puck<F>,
        bristles: &[F; C],
        contacts: &Contacts<F, C>,
    ) -> F {
        if self.nonlinear_count == 0 {
            return torque;
        }
        // A copy: a borrowed value does not stay in registers.
        let bodies = *bodies;
        torque + self.nonlinear_torque(&bodies, puck, bristles, contacts)
    }

    #[inline(always)]
    fn command(&self, torque: F) -> F {
        self.actuator.command_one(torque)
    }
}

/// The common case, checked once a sample: linear, with an ideal encoder and the true velocity, by a method
/// that holds u_k, with the torque from the end of the step ([`Loop::has_fast_path`]). The sample is the same, with its branches decided in
/// advance.
pub(crate) struct LinearFastPath<'l, F, const B: usize, const C: usize, const W: usize>(pub &'l Loop<F, B, C, W>);

impl<F: Real, const B: usize, const C: usize, const W: usize> Branches<F, B, C, W> for LinearFastPath<'_, F, B, C, W> {
    const IS_LINEAR: bool = true;

    #[inline(always)]
    fn estimate(&self, _: &mut Memory<F, W>, _: F) -> F {
        F::ZERO
    }

    #[inline(always)]
    fn bend(&self, _: &mut [F; C], _: Puck<F>, _: &Vector<F, B>) {}

    #[inline(always)]
    fn change(
        &self,
        n: usize,
        change: &mut Vector<F, B>,
        x: &Vector<F, B>,
        _: Option<Puck<F>>,
        new: Puck<F>,
        _: &[F; C],
        _: &mut Contacts<F, C>,
    ) {
        self.0.linear(n, change, x, None, new);
    }

    #[inline(always)]
    fn with_nonlinear_torque<const L: usize>(
        &self,
        torque: F,
        _: &Vector<F, L>,
        _: Puck<F>,
        _: &[F; C],
        _: &Contacts<F, C>,
    ) -> F {
        torque
    }

    #[inline(always)]
    fn command(&self, torque: F) -> F {
        self.0.actuator.command_one(torque)
    }
}

/// Out of line, as all code that only some worlds need: inlined it would take registers that all worlds need.
impl<F: Real, const B: usize, const C: usize, const W: usize> Loop<F, B, C, W> {
    #[cold]
    pub(crate) fn bend_all(&self, bristles: &mut [F; C], puck: Puck<F>, bodies: &Vector<F, B>) {
        self.bend_each(bristles, puck, bodies);
    }

    /// Takes `change`, the motion of the bodies without nonlinear torques, to the motion with them; `force` is the response to them.
    #[cold]
    #[inline(never)]
    #[allow(clippy::too_many_arguments)] // Those of `change`, and what it has found out.
    pub(crate) fn force_on(
        &self,
        change: &mut Vector<F, B>,
        force: &[Vector<F, B>; B],
        x: &Vector<F, B>,
        old: Option<Puck<F>>,
        new: Puck<F>,
        bristles: &[F; C],
        contacts: &mut Contacts<F, C>,
    ) {
        if let Some(gradient) = &self.gradient {
            let couplings = self.nonlinear.get(..self.nonlinear_count).unwrap_or(&self.nonlinear);
            let step = Step { bodies: self.bodies, force, couplings, puck: (new.position, new.velocity), x };
            gradient.step(&step, change, contacts);
            return;
        }
        *change = self.pushed(*change, force, x, new, bristles);
        if self.staged {
            *change = self.runge_kutta(*change, force, x, old, new, bristles);
        }
    }

    /// The change with the nonlinear torques evaluated at x.
    fn pushed(
        &self,
        mut change: Vector<F, B>,
        force: &[Vector<F, B>; B],
        x: &Vector<F, B>,
        new: Puck<F>,
        bristles: &[F; C],
    ) -> Vector<F, B> {
        let torques = self.nonlinear_torques(x, new, bristles);
        for (response, torque) in force.iter().zip(&torques).take(self.bodies) {
            change.add(self.bodies, *torque, response);
        }
        change
    }

    /// Runge-Kutta's four stages, each an Euler increment T f; the first is there.
    #[cold]
    fn runge_kutta(
        &self,
        first: Vector<F, B>,
        force: &[Vector<F, B>; B],
        x: &Vector<F, B>,
        old: Option<Puck<F>>,
        new: Puck<F>,
        bristles: &[F; C],
    ) -> Vector<F, B> {
        let n = self.bodies;
        let two = F::ONE + F::ONE;
        let mut stage = first;
        let mut sum = first;
        for (reach, weight) in [(F::HALF, two), (F::HALF, two), (F::ONE, F::ONE)] {
            let mut at = *x;
            at.add(n, reach, &stage);
            self.linear(n, &mut stage, &at, old, new);
            stage = self.pushed(stage, force, &at, new, bristles);
            sum.add(n, weight, &stage);
        }
        let sixth = F::ONE / F::from_f64(6.0);
        sum.map(|x| sixth * x)
    }

    /// The nonlinear couplings' torques on the bodies.
    #[cold]
    fn nonlinear_torques(&self, x: &Vector<F, B>, puck: Puck<F>, bristles: &[F; C]) -> [F; B] {
        let mut torques = [F::ZERO; B];
        for (coupling, bristle) in self.nonlinear.iter().zip(bristles).take(self.nonlinear_count) {
            if let Some(coupling) = coupling {
                let torque = coupling.torque(coupling.relative((puck.position, puck.velocity), x), *bristle);
                for (end, torque) in [(coupling.first, torque), (coupling.second, -torque)] {
                    if let End::Body(i) = end {
                        if let Some(sum) = torques.get_mut(i) {
                            *sum += torque;
                        }
                    }
                }
            }
        }
        torques
    }

    /// The nonlinear couplings' torque on the puck.
    #[cold]
    pub(crate) fn nonlinear_torque<const L: usize>(
        &self,
        bodies: &Vector<F, L>,
        puck: Puck<F>,
        bristles: &[F; C],
        contacts: &Contacts<F, C>,
    ) -> F {
        self.sum_at_puck(bodies, puck, bristles, contacts)
    }
}

/// For numbers and for lanes: the nonlinear couplings, each in turn.
impl<F: Number, const B: usize, const C: usize, const W: usize> Loop<F, B, C, W> {
    #[inline(always)]
    pub(crate) fn bend_each(&self, bristles: &mut [F; C], puck: Puck<F>, bodies: &Vector<F, B>) {
        for (nonlinear, bristle) in self.nonlinear.iter().zip(bristles).take(self.nonlinear_count) {
            if let Some(coupling) = nonlinear {
                let q = coupling.relative((puck.position, puck.velocity), bodies);
                *bristle = coupling.bend(*bristle, q, self.period);
            }
        }
    }

    /// The nonlinear couplings' torque on the puck.
    #[inline(always)]
    pub(crate) fn sum_at_puck<const L: usize>(
        &self,
        bodies: &Vector<F, L>,
        puck: Puck<F>,
        bristles: &[F; C],
        contacts: &Contacts<F, C>,
    ) -> F {
        let mut torque = F::ZERO;
        let found = bristles.iter().zip(&contacts.torques);
        for (coupling, (bristle, found)) in self.nonlinear.iter().zip(found).take(self.nonlinear_count) {
            if let Some(coupling) = coupling {
                let sign = coupling.sign_at_puck();
                if sign != 0.0 {
                    let q = coupling.relative((puck.position, puck.velocity), bodies);
                    torque += F::from_f64(sign) * if coupling.is_found { *found } else { coupling.torque(q, *bristle) };
                }
            }
        }
        torque
    }
}
