//! A world compiled for the loop's thread, with all memory that it needs there.

use hapt_core::{ExternalTorqueInput, Reading, Request, SafeOutput, SafetyProfile};
use hapt_model::{CouplingKind, End, World};
use hapt_sim::{DesktopController, DesktopControllerState, Motor, VirtualDevice};

/// The state of a plan's controller between samples.
pub type PlanState = DesktopControllerState;

/// How a world takes another's place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Change {
    /// Puck and bodies stay where they are: some of its numbers are others.
    #[default]
    Follows,
    /// The puck enters another world: that begins at its start, its origin placed where nothing pushes the puck ([`hapt_core::Spec::entry`]).
    /// A page without a server has one world.
    #[cfg(not(target_family = "wasm"))]
    Enters,
}

/// A compiled world with its supervisor, and its device for simulations.
#[derive(Clone, Debug)]
pub struct Plan {
    pub(crate) controller: DesktopController,
    pub(crate) device: VirtualDevice,
    /// The delay line of the motor's torque.
    pub(crate) motor: Motor<f64>,
    profile: SafetyProfile,
    /// The names by which the following plan matches its parts.
    names: Names,
    /// The index of each body in the previous plan; `None`: the body starts from its initial state.
    bodies: Vec<Option<usize>>,
    /// The same for each bristle.
    bristles: Vec<Option<usize>>,
    /// Where the puck enters it; `None`: it continues at its position in the previous plan.
    entry: Option<f64>,
}

/// The names of a world's parts, by which another world can match them.
#[derive(Clone, Debug, PartialEq)]
struct Names {
    bodies: Vec<String>,
    /// For each coupling with a state its ends, its kind, and its number between these ends; `None` for other couplings.
    bristles: Vec<Option<(String, String, CouplingKind, usize)>>,
}

impl Plan {
    /// Compiles a world for this safety profile. Errors where the core does.
    pub fn new(world: &World, profile: SafetyProfile) -> Result<Self, hapt_core::Error> {
        let spec = world.spec();
        let mut plan = Plan {
            controller: DesktopController::new(&spec, &world.limits(profile))?,
            device: VirtualDevice::new(&world.device_spec()),
            motor: Motor::new(world.sampling.delay_s(), world.sampling.period),
            profile,
            names: Names::new(world),
            bodies: vec![None; world.bodies.len()],
            bristles: vec![None; world.couplings.len()],
            entry: None,
        };
        plan.reserve();
        Ok(plan)
    }

    /// Reserves the delay line, which a clone of a plan lacks.
    pub(crate) fn reserve(&mut self) {
        self.device.reserve();
        self.motor.reserve();
    }

    /// Compiles a world that replaces `before`: bodies of the same name keep their states, and so do couplings of the same kind
    /// between the same two ends. The safety profile stays.
    pub fn following(world: &World, before: &Plan) -> Result<Self, hapt_core::Error> {
        let mut plan = Plan::new(world, before.profile)?;
        let (now, then) = (&plan.names, &before.names);
        plan.bodies = now.bodies.iter().map(|name| then.bodies.iter().position(|other| other == name)).collect();
        let same = |bristle: &Option<_>| then.bristles.iter().position(|other| bristle.is_some() && other == bristle);
        plan.bristles = now.bristles.iter().map(same).collect();
        Ok(plan)
    }

    /// Compiles a world that takes the place of `before` in this way. The safety profile stays.
    pub fn replacing(world: &World, before: &Plan, change: Change) -> Result<Self, hapt_core::Error> {
        match change {
            Change::Follows => Plan::following(world, before),
            #[cfg(not(target_family = "wasm"))]
            Change::Enters => Ok(Plan { entry: Some(world.spec().entry()), ..Plan::new(world, before.profile)? }),
        }
    }

    /// T in s.
    pub fn period(&self) -> f64 {
        self.controller.period()
    }

    /// The state before the first sample: disarmed.
    pub fn start(&self) -> PlanState {
        self.controller.start()
    }

    /// One guarded sample: the computation between reading and writing the device, also used by replays.
    pub fn step(&self, state: &mut PlanState, reading: &Reading<f64>, request: Option<Request>) -> SafeOutput<f64> {
        self.controller.step(state, reading, request)
    }

    /// The same with an external torque on the puck: see [`hapt_core::Controller::step_with`].
    pub fn step_with(
        &self,
        state: &mut PlanState,
        reading: &Reading<f64>,
        request: Option<Request>,
        torque: impl FnOnce(ExternalTorqueInput<f64>) -> Option<f64>,
    ) -> SafeOutput<f64> {
        self.controller.step_with(state, reading, request, torque)
    }

    /// Advances the delay line by periods with the command `torque`, that of the last sample.
    pub(crate) fn hold(&mut self, periods: u32, torque: f64) {
        // Once the delay line is full of it, further periods change nothing.
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

    /// The state with which this plan replaces `before`, whose state is `state`: see [`hapt_core::Controller::transfer`] and
    /// [`hapt_core::Controller::enter`]. Allocates nothing.
    pub fn transfer(&self, before: &Plan, state: &PlanState) -> PlanState {
        // Never in a page without a server: its program is kept small.
        if let (Some(at), false) = (self.entry, cfg!(target_family = "wasm")) {
            return self.controller.enter(&before.controller, state, at);
        }
        let at = |list: &[Option<usize>], i: usize| list.get(i).copied().flatten();
        let (body, bristle) = (|i| at(&self.bodies, i), |i| at(&self.bristles, i));
        self.controller.transfer(&before.controller, state, body, bristle)
    }
}

impl Names {
    fn new(world: &World) -> Self {
        let end = |end: End| match end {
            End::Puck => "puck",
            End::Ground => "ground",
            End::Body(i) => world.names.get(i).map_or("", String::as_str),
        };
        let mut bristles: Vec<Option<(String, String, CouplingKind, usize)>> = Vec::new();
        for coupling in &world.couplings {
            let ends = (end(coupling.first), end(coupling.second));
            let before =
                bristles.iter().flatten().filter(|(first, second, ..)| (first.as_str(), second.as_str()) == ends);
            let nth = before.count();
            let (law, kind) = (&coupling.law, coupling.law.kind());
            bristles.push(law.has_state().then(|| (ends.0.into(), ends.1.into(), kind, nth)));
        }
        Names { bodies: world.names.clone(), bristles }
    }
}
