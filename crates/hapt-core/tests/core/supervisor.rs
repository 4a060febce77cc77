//! The supervisor on constructed readings: every limit, every recovery, both ledgers in closed form, for f32 and f64.

use hapt_core::{
    CertifiedTime, Coupling, End, Estimator, Heat, Law, Limits, Loop, Method, Output, Phase, Reading, Real, Request,
    SafeOutput, Spec, State, Supervisor, SupervisorState,
};

/// For f32 and f64.
macro_rules! for_both {
    ($($name:ident)*) => {
        mod single { $(#[test] fn $name() { super::$name::<f32>(); })* }
        mod double { $(#[test] fn $name() { super::$name::<f64>(); })* }
    };
}

mod any_reading;
mod arming;
mod fades;
mod ledger;
mod recentre;
mod stuck;
mod swap;
mod trips;
mod uneven;

const T: f64 = 1e-3;
const K: f64 = 1.0;

const LIMITS: Limits = Limits {
    fade: 0.01,
    velocity: 100.0,
    jump: 0.026,
    overspeed: 50.0,
    stuck: f64::INFINITY,
    stuck_torque: 0.1,
    torque: 0.8,
    slew: f64::INFINITY,
    motor: Heat { rms: f64::INFINITY, time: 30.0 },
    driver: Heat { rms: f64::INFINITY, time: 1.0 },
    stall: 5e-3,
    time: CertifiedTime::NOT_STATED,
    link: 0.3,
    link_faults: false,
    energy: 0.04,
    world_trips: true,
    port_trips: true,
    pulse: 0.0,
    brake: 0.0,
    recentre: 0.0,
    zero_where_armed: false,
    announcements: true,
    inertia: 6.4e-4,
    damping: 1.2e-3,
    friction: 5e-3,
    delay: 0.0,
};

const SPRING: &[Coupling] =
    &[Coupling { first: End::Puck, second: End::Ground, law: Law::Spring { stiffness: K, rest: 0.0 }, limit: None }];

const WORLD: Spec = Spec { estimator: Estimator::Difference, limit: Some(0.8), couplings: SPRING, ..Spec::new(T) };

fn reading<F: Real>(position: f64) -> Reading<F> {
    let zero = F::ZERO;
    Reading { position: F::from_f64(position), velocity: zero, announced: false, late: zero, missed: 0, silent: zero }
}

/// A loop, its supervisor, and the states of both.
struct Guard<F> {
    world: Loop<F, 4, 8, 17>,
    supervisor: Supervisor<F, 4, 8>,
    state: State<F, 4, 8, 17>,
    watch: SupervisorState<F>,
}

impl<F: Real> Guard<F> {
    fn new(limits: &Limits, spec: &Spec) -> Self {
        let world = Loop::new(spec).unwrap();
        let supervisor = Supervisor::new(limits, spec).unwrap();
        Guard { state: world.start(), world, supervisor, watch: SupervisorState::START }
    }

    fn step(&mut self, reading: &Reading<F>, request: Option<Request>) -> SafeOutput<F> {
        self.supervisor.step(&mut self.watch, &self.world, &mut self.state, reading, request)
    }

    /// At a position, without a request.
    fn at(&mut self, position: f64) -> SafeOutput<F> {
        self.step(&reading(position), None)
    }

    /// Running, the puck at rest at `position`.
    fn running(limits: &Limits, spec: &Spec, position: f64) -> Self {
        let mut guard = Self::new(limits, spec);
        for _ in 0..20 {
            guard.at(position);
        }
        guard.step(&reading(position), Some(Request::Arm));
        for _ in 0..(2.0 * limits.fade / T) as u32 {
            guard.at(position);
        }
        assert_eq!(guard.watch.phase, Phase::Running, "{:?}", guard.watch.reason);
        guard
    }
}
