//! A guarded loop on the simulated device and a virtual clock, with faults on every wire in between.

use std::collections::VecDeque;

use anyhow::{Result, anyhow};
use hapt_core::{
    Controller, ControllerState, Phase, Reading, Reason, Request, SafeOutput, SafetyProfile, SupervisorState,
};
use hapt_model::World;
use hapt_sim::VirtualDevice;

/// Room for the campaign's worlds.
type Core = Controller<f64, 4, 8, 17>;

/// The faults on the wires between loop and device.
#[derive(Clone, Debug)]
pub struct Wires {
    /// The loop receives `scale` times the device's position, plus `offset`.
    pub scale: f64,
    pub offset: f64,
    /// It is this many samples old.
    pub age: usize,
    /// The position does not change.
    pub frozen: bool,
    /// Replaces the position, once.
    pub instead: Option<f64>,
    /// This bit of the position's count is flipped, once.
    pub flipped: Option<u32>,
    /// The motor's torque is this many times the commanded one.
    pub gain: f64,
    /// Samples that the loop misses before the next.
    pub missed: u32,
    /// How late the next sample is, s.
    pub late: f64,
    /// How long the link has been silent, s; it grows when it is cut.
    pub silent: f64,
    pub cut: bool,
}

impl Wires {
    pub const WHOLE: Wires = Wires {
        scale: 1.0,
        offset: 0.0,
        age: 0,
        frozen: false,
        instead: None,
        flipped: None,
        gain: 1.0,
        missed: 0,
        late: 0.0,
        silent: 0.0,
        cut: false,
    };
}

/// Positions that the wires may hold back.
const AGES: usize = 32;

pub struct TestBench {
    pub world: World,
    pub device: VirtualDevice,
    pub wires: Wires,
    controller: Box<Core>,
    state: Box<ControllerState<f64, 4, 8, 17>>,
    positions: VecDeque<f64>,
    count: f64,
}

impl TestBench {
    pub fn new(world: &World, profile: SafetyProfile) -> Result<Self> {
        let controller = compiled(world, profile)?;
        Ok(TestBench {
            device: VirtualDevice::new(&world.device_spec()),
            wires: Wires::WHOLE,
            state: Box::new(controller.start()),
            controller,
            positions: VecDeque::with_capacity(AGES),
            count: world.count().unwrap_or(1e-5),
            world: world.clone(),
        })
    }

    /// The state of the supervisor.
    pub fn supervisor(&self) -> &SupervisorState<f64> {
        &self.state.supervisor
    }

    /// One sample, and the period after it.
    pub fn sample(&mut self, request: Option<Request>) -> SafeOutput<f64> {
        let reading = self.reading();
        let guarded = self.controller.step(&mut self.state, &reading, request);
        self.device.command(self.wires.gain * guarded.output);
        self.device.travel();
        guarded
    }

    /// Whether it has ended because the puck truly is too fast: driven by the hand or the world, without a fault.
    pub fn is_too_fast(&self) -> bool {
        let fastest = self.world.limits(SafetyProfile::Certified).overspeed;
        self.supervisor().reason == Some(Reason::Overspeed) && self.device.puck().1.abs() > 0.8 * fastest
    }

    /// Disarmed for a while.
    pub fn rest(&mut self) {
        for _ in 0..20 {
            self.sample(None);
        }
    }

    /// The same, then armed with a free puck, until it has faded in or faulted.
    pub fn arm(&mut self) -> SafeOutput<f64> {
        self.rest();
        let mut guarded = self.sample(Some(Request::Arm));
        while guarded.phase == Phase::FadingIn {
            guarded = self.sample(None);
        }
        guarded
    }

    /// Another world from the next sample on, on the same device.
    pub fn swap(&mut self, world: &World, profile: SafetyProfile) -> Result<()> {
        let controller = compiled(world, profile)?;
        let mut state = controller.transfer(&self.controller, &self.state, |_| None, |_| None);
        state.world = controller.world().start();
        state.world.now = self.state.world.now;
        (self.controller, *self.state) = (controller, state);
        Ok(())
    }

    fn reading(&mut self) -> Reading<f64> {
        let wires = &mut self.wires;
        let missed = std::mem::take(&mut wires.missed);
        let late = std::mem::take(&mut wires.late);
        for _ in 0..missed {
            self.device.travel();
        }
        let period = self.world.sampling.period;
        wires.silent = if wires.cut { wires.silent + period * f64::from(1 + missed) } else { 0.0 };
        let position = self.device.puck().0;
        if self.positions.len() == AGES {
            self.positions.pop_back();
        }
        if !wires.frozen || self.positions.is_empty() {
            self.positions.push_front(position);
        } else {
            self.positions.push_front(self.positions[0]);
        }
        let mut seen = *self.positions.get(wires.age).unwrap_or(&self.positions[self.positions.len() - 1]);
        seen = wires.scale * seen + wires.offset;
        if let Some(bit) = wires.flipped.take() {
            let counts = (seen / self.count).round() as i64;
            seen = (counts ^ (1 << bit)) as f64 * self.count;
        }
        let position = wires.instead.take().unwrap_or(seen);
        Reading { position, velocity: 0.0, announced: false, late, missed, silent: wires.silent }
    }
}

fn compiled(world: &World, profile: SafetyProfile) -> Result<Box<Core>> {
    let controller = Core::new(&world.spec(), &world.limits(profile)).map_err(|error| anyhow!("{error}"))?;
    Ok(Box::new(controller))
}
