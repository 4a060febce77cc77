//! The loop, without or with its device, from one communication point to the next.

use std::sync::Arc;

use hapt_core::spec::{Coupling, Estimator, Law, Output, Spec};
use hapt_core::{Body, Error};
use hapt_model::World;
use hapt_sim::{DesktopLoop, DesktopState, Row, VirtualDevice};
use serde::{Deserialize, Serialize};

use crate::Kind;
use crate::clock::Clock;

/// The loop with its state, and the device where the FMU contains it.
#[derive(Clone, Debug)]
pub struct Engine {
    compiled: Arc<DesktopLoop>,
    state: Box<DesktopState>,
    device: Option<VirtualDevice>,
    /// The number of samples taken.
    taken: u64,
    /// The last sample, and the puck's motion now.
    row: Row,
}

/// An engine's state, as data.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Memory {
    state: Box<DesktopState>,
    device: Option<VirtualDevice>,
    taken: u64,
    /// Puck, measured, torque, command, applied.
    signals: [f64; 7],
    bodies: Vec<(f64, f64)>,
}

impl Engine {
    /// Before sample 0.
    ///
    /// # Errors
    /// The core refuses the world.
    pub fn new(kind: Kind, world: &World) -> Result<Engine, Error> {
        let compiled = DesktopLoop::new(&world.spec())?;
        let device = (kind == Kind::Whole).then(|| VirtualDevice::new(&world.device_spec()));
        Ok(Engine {
            state: Box::new(compiled.start()),
            compiled: Arc::new(compiled),
            taken: 0,
            row: Row {
                bodies: world.bodies.iter().map(|body| (body.position, body.velocity)).collect(),
                handle: device.as_ref().and_then(VirtualDevice::handle),
                ..Row::default()
            },
            device,
        })
    }

    /// T in s.
    pub fn period(&self) -> f64 {
        self.compiled.period()
    }

    /// The last sample, and the puck's motion now.
    pub fn row(&self) -> &Row {
        &self.row
    }

    /// The row with these inputs at an instant whose sample is not taken yet; the engine is unchanged.
    pub fn preview(&self, inputs: [f64; 2]) -> Row {
        let mut ahead = self.clone();
        ahead.sample(inputs);
        ahead.row
    }

    /// Whether the sample of this instant is not taken yet.
    pub fn is_due(&self, clock: &Clock) -> bool {
        clock.part == 0.0 && self.taken == clock.sample
    }

    /// One sample: with the device's puck, or with the puck of the inputs.
    fn sample(&mut self, inputs: [f64; 2]) {
        let (position, velocity) = self.device.as_ref().map_or(inputs.into(), VirtualDevice::puck);
        let sample = self.compiled.step(&mut self.state, position, velocity);
        let row = &mut self.row;
        for (place, body) in row.bodies.iter_mut().zip(self.state.now.position.iter().zip(&self.state.now.velocity)) {
            *place = (*body.0, *body.1);
        }
        (row.puck, row.puck_velocity) = (position, velocity);
        (row.measured, row.measured_velocity) = (sample.puck.position, sample.puck.velocity);
        (row.torque, row.command, row.applied) = (sample.torque, sample.command, sample.command);
        if let Some(device) = &mut self.device {
            device.command(sample.command);
            row.applied = device.applied();
            row.handle = device.handle();
        }
        self.taken += 1;
    }

    /// Sample 0 of a loop on its device, whose torque the hand can no longer change. A loop without a device takes each sample in the step
    /// that begins with it, because its puck is an input.
    pub fn begin(&mut self) {
        if self.device.is_some() {
            self.sample([0.0; 2]);
        }
    }

    /// Advances from `from` to `to` with held inputs. Without a device a loop takes every sample from `from` up to `to`, without that of
    /// `to`.
    ///
    /// # Errors
    /// The instant in s at which a number is no longer finite.
    pub fn advance(&mut self, from: &Clock, to: &Clock, inputs: [f64; 2]) -> Result<(), f64> {
        if self.device.is_none() {
            let end = to.sample + u64::from(to.part > 0.0);
            while self.taken < end {
                self.sample(inputs);
                self.finite(to)?;
            }
            return Ok(());
        }
        if let Some(device) = &mut self.device {
            device.push(inputs[0]);
        }
        for _ in from.sample..to.sample {
            if let Some(device) = &mut self.device {
                device.travel_on();
            }
            self.sample(inputs);
            self.finite(to)?;
        }
        if to.part > 0.0
            && let Some(device) = &mut self.device
        {
            device.travel_to(to.part);
            (self.row.puck, self.row.puck_velocity) = device.puck();
            self.row.applied = device.applied();
            self.row.handle = device.handle();
        }
        self.finite(to)
    }

    fn finite(&self, clock: &Clock) -> Result<(), f64> {
        let last = self.taken.saturating_sub(1);
        if self.row.is_finite() { Ok(()) } else { Err(Clock { sample: last, part: 0.0, ..*clock }.time()) }
    }

    /// Continues from the world `before` in one with other numbers, between two samples: a bumpless transfer. A loop whose numbers are the
    /// same goes on as it was.
    ///
    /// # Errors
    /// The core refuses the world; the engine is unchanged.
    pub fn change(&mut self, before: &World, world: &World) -> Result<(), Error> {
        let spec = world.spec();
        if spec != before.spec() {
            let compiled = DesktopLoop::new(&spec)?;
            *self.state = compiled.transfer(&self.compiled, &self.state, Some, Some);
            self.compiled = Arc::new(compiled);
        }
        if let Some(device) = &mut self.device {
            device.refit(&mut VirtualDevice::new(&world.device_spec()));
        }
        Ok(())
    }

    /// Its state.
    pub fn memory(&self) -> Memory {
        let Row { puck, puck_velocity, measured, measured_velocity, torque, command, applied, .. } = self.row;
        Memory {
            state: self.state.clone(),
            device: self.device.clone(),
            taken: self.taken,
            signals: [puck, puck_velocity, measured, measured_velocity, torque, command, applied],
            bodies: self.row.bodies.clone(),
        }
    }

    /// Continues from the state of another engine of the same world.
    pub fn resume(&mut self, memory: &Memory) {
        self.state.clone_from(&memory.state);
        self.device.clone_from(&memory.device);
        self.taken = memory.taken;
        let [puck, puck_velocity, measured, measured_velocity, torque, command, applied] = memory.signals;
        let mut bodies = self.row.bodies.clone();
        bodies.iter_mut().zip(&memory.bodies).for_each(|(place, body)| *place = *body);
        self.row = Row {
            puck,
            puck_velocity,
            measured,
            measured_velocity,
            torque,
            command,
            applied,
            bodies,
            handle: self.device.as_ref().and_then(VirtualDevice::handle),
            ..Row::default()
        };
    }
}

/// The response of the linear part of a loop without its device, at rest, to a puck at `motion`: the outputs' derivatives in that
/// direction. Encoder, levels, limits and nonlinear couplings are left out; FOAW has its shortest window, and levant is the difference. Where the bodies step at every
/// n-th sample, it is one at which they do not step.
///
/// # Errors
/// The core refuses the linear part.
pub fn linear_response(world: &World, motion: [f64; 2]) -> Result<Row, Error> {
    let rest = |body: &Body| Body { position: 0.0, velocity: 0.0, ..*body };
    let bodies: Vec<Body> = world.bodies.iter().map(rest).collect();
    let couplings: Vec<Coupling> = world.couplings.iter().filter_map(linear).collect();
    let estimator = match world.sampling.velocity_estimator() {
        Estimator::Foaw { .. } | Estimator::FoawBest { .. } | Estimator::Levant { .. } => Estimator::Difference,
        linear @ (Estimator::Exact
        | Estimator::Difference
        | Estimator::DifferenceOver { .. }
        | Estimator::LowPass { .. }
        | Estimator::Kalman { .. }) => linear,
    };
    let spec = Spec {
        estimator,
        count: None,
        limit: None,
        levels: None,
        bodies: &bodies,
        couplings: &couplings,
        output: if world.sampling.method.takes_new_sample_first() { Output::Start } else { world.sampling.output },
        ..world.spec()
    };
    let compiled = DesktopLoop::new(&spec)?;
    let state = Box::new(compiled.start());
    let row = Row { bodies: vec![(0.0, 0.0); bodies.len()], ..Row::default() };
    let mut engine = Engine { compiled: Arc::new(compiled), state, device: None, taken: 0, row };
    engine.sample([0.0; 2]);
    Ok(engine.preview(motion))
}

/// The linear part of a coupling about its own rest; `None` for a constant torque.
fn linear(coupling: &Coupling) -> Option<Coupling> {
    // An integral term without a limit is linear, but has a state, and is no matrix of stiffness and damping.
    if let (Law::Integral { stiffness, time, .. }, None) = (coupling.law, coupling.limit) {
        return Some(Coupling { law: Law::Integral { stiffness, time, rest: 0.0 }, ..*coupling });
    }
    // So is a torque along the acceleration.
    if let (Law::Acceleration { .. }, None) = (coupling.law, coupling.limit) {
        return Some(*coupling);
    }
    let linear = coupling.linear()?;
    let law = if linear.stiffness == 0.0 {
        Law::Damper { damping: linear.damping }
    } else {
        Law::Spring { stiffness: linear.stiffness, rest: 0.0 }
    };
    Some(Coupling { law, ..*coupling })
}
