//! A loop under its supervisor, and the states of both.

use crate::supervisor::{
    ExternalTorqueInput, Limits, Reading, Reason, Request, SafeOutput, Supervisor, SupervisorState,
};
use crate::{Error, Loop, Real, Spec, State};

/// A world compiled with its supervisor: what a thread, a timer's interrupt or a page runs, once a period.
///
/// It is `&self`, and [`ControllerState`] is everything that changes. Every torque of a controller passes the supervisor.
///
/// ```
/// use hapt_core::{CertifiedTime, Controller, Coupling, End, Estimator, Heat, Law, Limits, Phase, Reading, Request, Spec};
///
/// let couplings =
///     [Coupling { first: End::Puck, second: End::Ground, law: Law::Spring { stiffness: 1.0, rest: 0.0 }, limit: None }];
/// let spec = Spec { estimator: Estimator::Difference, limit: Some(0.8), couplings: &couplings, ..Spec::new(1e-3) };
/// let heat = Heat { rms: f64::INFINITY, time: 1.0 };
/// let limits = Limits {
///     fade: 0.1, velocity: 100.0, jump: 0.03, overspeed: 50.0, stuck: 1.0, stuck_torque: 0.05, torque: 0.8,
///     slew: f64::INFINITY, motor: heat, driver: heat, stall: 5e-3, time: CertifiedTime::NOT_STATED, link: 0.3, link_faults: false, energy: 0.04,
///     world_trips: true, port_trips: true, pulse: 0.0, brake: 0.0, recentre: 0.0, zero_where_armed: true, announcements: false,
///     inertia: 6.4e-4, damping: 1.2e-3, friction: 5e-3, delay: 0.0,
/// };
/// let controller = Controller::<f64, 4, 8, 16>::new(&spec, &limits)?;
/// let mut state = controller.start();
/// let reading = |position| Reading { position, velocity: 0.0, announced: false, late: 0.0, missed: 0, silent: 0.0 };
/// let safe = controller.step(&mut state, &reading(0.2), Some(Request::Arm));
/// assert_eq!((safe.phase, safe.output), (Phase::FadingIn, 0.0)); // armed where the puck is, which is the spring's rest
/// # Ok::<(), hapt_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Controller<F, const B: usize, const C: usize, const W: usize> {
    world: Loop<F, B, C, W>,
    supervisor: Supervisor<F, B, C>,
}

/// Everything that a controller remembers from sample to sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControllerState<F, const B: usize, const C: usize, const W: usize> {
    /// The world's.
    pub world: State<F, B, C, W>,
    /// The supervisor's.
    pub supervisor: SupervisorState<F>,
}

impl<F: Real, const B: usize, const C: usize, const W: usize> Controller<F, B, C, W> {
    /// Compiles a world and its limits. Errors where the core does not take one of them.
    // Within its caller's frame: a board's stack has no room for a second copy of a controller.
    #[inline(always)]
    pub fn new(spec: &Spec, limits: &Limits) -> Result<Self, Error> {
        Ok(Controller { world: Loop::new(spec)?, supervisor: Supervisor::new(limits, spec)? })
    }

    /// The state before sample 0: disarmed.
    pub fn start(&self) -> ControllerState<F, B, C, W> {
        ControllerState { world: self.world.start(), supervisor: SupervisorState::START }
    }

    /// The compiled world.
    pub fn world(&self) -> &Loop<F, B, C, W> {
        &self.world
    }

    /// The supervisor.
    pub fn supervisor(&self) -> &Supervisor<F, B, C> {
        &self.supervisor
    }

    /// T in s.
    pub fn period(&self) -> F {
        self.world.period()
    }

    /// The longest time in s that the motor may hold a torque: see [`Supervisor::longest_hold`].
    pub fn longest_hold(&self) -> F {
        self.supervisor.longest_hold()
    }

    /// One sample, guarded: see [`Supervisor::step`].
    #[inline]
    pub fn step(
        &self,
        state: &mut ControllerState<F, B, C, W>,
        reading: &Reading<F>,
        request: Option<Request>,
    ) -> SafeOutput<F> {
        self.supervisor.step(&mut state.supervisor, &self.world, &mut state.world, reading, request)
    }

    /// The same with an external torque on the puck: see [`Supervisor::step_with`].
    pub fn step_with(
        &self,
        state: &mut ControllerState<F, B, C, W>,
        reading: &Reading<F>,
        request: Option<Request>,
        torque: impl FnOnce(ExternalTorqueInput<F>) -> Option<F>,
    ) -> SafeOutput<F> {
        self.supervisor.step_with(&mut state.supervisor, &self.world, &mut state.world, reading, request, torque)
    }

    /// The state with which this controller replaces `before`, whose state is `state`, between two samples: a bumpless transfer. The torque
    /// fades from the old world's to the new one's. `bodies` and `bristles` are those of [`Loop::transfer`].
    pub fn transfer(
        &self,
        before: &Self,
        state: &ControllerState<F, B, C, W>,
        bodies: impl Fn(usize) -> Option<usize>,
        bristles: impl Fn(usize) -> Option<usize>,
    ) -> ControllerState<F, B, C, W> {
        let mut supervisor = state.supervisor;
        supervisor.swap(before.period(), self.period());
        ControllerState { world: self.world.transfer(&before.world, &state.world, bodies, bristles), supervisor }
    }

    /// The same where the puck enters another world: the new world begins at its start, and its origin is placed so that the puck is at
    /// `at` in it ([`Spec::entry`]), wherever the device is. The torque fades from one to the other, and the estimate of the puck's
    /// velocity continues.
    pub fn enter(&self, before: &Self, state: &ControllerState<F, B, C, W>, at: F) -> ControllerState<F, B, C, W> {
        let mut supervisor = state.supervisor;
        supervisor.enter(before.period(), self.period(), at);
        ControllerState { world: self.world.transfer(&before.world, &state.world, |_| None, |_| None), supervisor }
    }
}

impl<F: Real, const B: usize, const C: usize, const W: usize> ControllerState<F, B, C, W> {
    /// The device had the command of the last sample this long after it, in s: see [`SupervisorState::commanded`].
    pub fn commanded(&mut self, delay: F) {
        self.supervisor.commanded(delay);
    }

    /// The device itself reports a fault: see [`SupervisorState::trip`].
    pub fn trip(&mut self, reason: Reason) {
        self.supervisor.trip(reason);
    }
}
