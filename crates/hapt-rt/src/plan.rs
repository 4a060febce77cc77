//! A world compiled for the loop's thread, with everything that it will need there.

use hapt_core::{Estimator, Guarded, Guarding, Law, Reading, Request, State, Watch};
use hapt_model::{End, Method, World};
use hapt_sim::{DesktopLoop, DesktopSupervisor, Motor, VirtualDevice};

/// Everything that changes in a plan's world from sample to sample.
pub type PlanState = State<f64, 32, 64, 257>;

/// A world compiled, with its supervisor, and its device for whoever simulates one.
#[derive(Clone, Debug)]
pub struct Plan {
    pub(crate) world: DesktopLoop,
    pub(crate) supervisor: DesktopSupervisor,
    pub(crate) device: VirtualDevice,
    /// When its motor takes which torque.
    pub(crate) motor: Motor<f64>,
    guarding: Guarding,
    /// What it is known by to the plan that follows it.
    names: Names,
    /// Where each body's state comes from in the plan before; `None`: from its start.
    bodies: Vec<Option<usize>>,
    /// The same for each bristle.
    bristles: Vec<Option<usize>>,
    /// The sensor goes on with what it remembers, periods shorter by so much, in s.
    remembers: Option<f64>,
}

/// Whatever can be found again in another world.
#[derive(Clone, Debug, PartialEq)]
struct Names {
    bodies: Vec<String>,
    /// The ends of each LuGre friction, and which one it is between them; `None` where it is another coupling.
    bristles: Vec<Option<(String, String, usize)>>,
    /// What the sensor's memory is a memory of.
    sensor: (Option<f64>, Estimator),
    new_sample_first: bool,
    period: f64,
}

impl Plan {
    /// Compiles a world, to be guarded so. Errors where the core does.
    pub fn new(world: &World, guarding: Guarding) -> Result<Self, hapt_core::Error> {
        let spec = world.spec();
        let compiled = DesktopLoop::new(&spec)?;
        let supervisor = DesktopSupervisor::new(&world.limits(guarding), &spec)?;
        let mut plan = Plan {
            world: compiled,
            supervisor,
            device: VirtualDevice::new(&world.rig()),
            motor: Motor::new(world.sampling.delay, world.sampling.period),
            guarding,
            names: Names::new(world),
            bodies: vec![None; world.bodies.len()],
            bristles: vec![None; world.couplings.len()],
            remembers: None,
        };
        plan.reserve();
        Ok(plan)
    }

    /// Makes room for all torques on their way to the motor, which a copy of a plan has not.
    pub(crate) fn reserve(&mut self) {
        self.device.reserve();
        self.motor.reserve();
    }

    /// The same, to follow `before`: bodies of the same name go on where they are, and so do the bristles of LuGre friction between the
    /// same two ends. It is guarded as that was.
    pub fn following(world: &World, before: &Plan) -> Result<Self, hapt_core::Error> {
        let mut plan = Plan::new(world, before.guarding)?;
        let (now, then) = (&plan.names, &before.names);
        plan.bodies = now.bodies.iter().map(|name| then.bodies.iter().position(|other| other == name)).collect();
        let same = |bristle: &Option<_>| then.bristles.iter().position(|other| bristle.is_some() && other == bristle);
        plan.bristles = now.bristles.iter().map(same).collect();
        let shorter = then.period - now.period;
        // A method that takes the new sample first would take the last one twice; counts of another period are no counts of this one.
        let same = now.sensor == then.sensor && now.new_sample_first == then.new_sample_first;
        let foaw = matches!(now.sensor.1, Estimator::Foaw { .. } | Estimator::FoawBest { .. });
        plan.remembers = (same && (shorter == 0.0 || !foaw)).then_some(shorter);
        Ok(plan)
    }

    /// T in s.
    pub fn period(&self) -> f64 {
        self.world.period()
    }

    /// The world's state before its first sample.
    pub fn start(&self) -> PlanState {
        self.world.start()
    }

    /// One sample, guarded: what the loop's thread does between its device's two calls, and a replay again.
    pub fn step(
        &self,
        watch: &mut Watch<f64>,
        state: &mut PlanState,
        reading: &Reading<f64>,
        request: Option<Request>,
    ) -> Guarded<f64> {
        self.supervisor.step(watch, &self.world, state, reading, request)
    }

    /// Periods pass, in which the motor is asked for `torque`, as it was at the last sample.
    pub(crate) fn hold(&mut self, periods: u32, torque: f64) {
        // After as many as are on their way it holds that and nothing else.
        let longest = u32::try_from(self.motor.samples + 2).unwrap_or(u32::MAX);
        for period in 0..periods.min(longest) {
            if period > 0 {
                self.motor.command(torque);
            }
            if self.motor.rest > 0.0 {
                self.motor.change();
            }
        }
    }

    /// The state to go on with where `state` was, of the plan before. Allocates nothing.
    pub fn carry(&self, state: &PlanState) -> PlanState {
        let mut next = self.start();
        for (to, from) in self.bodies.iter().enumerate() {
            let Some(from) = *from else { continue };
            // x_{k+1}, where the method knows it already: this is the sample after.
            next.now.position[to] = state.now.position[from] + state.change.position[from];
            next.now.velocity[to] = state.now.velocity[from] + state.change.velocity[from];
        }
        for (to, from) in self.bristles.iter().enumerate() {
            if let Some(from) = *from {
                next.bristles[to] = state.bristles[from];
            }
        }
        if let Some(shorter) = self.remembers {
            next.memory = state.memory;
            if let Some(last) = &mut next.memory.last {
                // Where the puck, at its velocity, was one new period ago.
                last.position += shorter * last.velocity;
            }
        }
        next
    }
}

impl Names {
    fn new(world: &World) -> Self {
        let end = |end: End| match end {
            End::Puck => "puck",
            End::Ground => "ground",
            End::Body(i) => world.names.get(i).map_or("", String::as_str),
        };
        let mut bristles: Vec<Option<(String, String, usize)>> = Vec::new();
        for coupling in &world.couplings {
            let ends = (end(coupling.first), end(coupling.second));
            let before =
                bristles.iter().flatten().filter(|(first, second, _)| (first.as_str(), second.as_str()) == ends);
            let nth = before.count();
            let is_bristle = matches!(coupling.law, Law::Lugre { .. });
            bristles.push(is_bristle.then(|| (ends.0.into(), ends.1.into(), nth)));
        }
        let sampling = &world.sampling;
        Names {
            bodies: world.names.clone(),
            bristles,
            sensor: (world.count(), sampling.velocity_estimator()),
            period: sampling.period,
            new_sample_first: matches!(sampling.method, Method::Tustin | Method::Foh),
        }
    }
}
