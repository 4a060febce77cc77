//! The loop with its state, compiled for the smallest capacity that the world fits into.
//!
//! Results are bit-identical for every capacity; a smaller one runs faster.

use hapt_core::{Controller, ControllerState, Coupling, Error, Loop, Sample, Spec, State, Supervisor};

/// The loop with a PC's capacity: 32 bodies, 64 couplings, a FOAW window of 256.
pub type DesktopLoop = Loop<f64, 32, COUPLINGS, COUNTS>;

/// Its state.
pub type DesktopState = State<f64, 32, COUPLINGS, COUNTS>;

/// The same loop with its supervisor.
pub type DesktopController = Controller<f64, 32, COUPLINGS, COUNTS>;

/// The state of both.
pub type DesktopControllerState = ControllerState<f64, 32, COUPLINGS, COUNTS>;

/// The supervisor of the same capacity, without the loop.
pub type DesktopSupervisor = Supervisor<f64, 32, COUPLINGS>;

const COUPLINGS: usize = 64;
const COUNTS: usize = 257;

#[derive(Clone, Debug)]
pub(crate) struct Running<const B: usize> {
    compiled: Loop<f64, B, COUPLINGS, COUNTS>,
    state: State<f64, B, COUPLINGS, COUNTS>,
    /// The number of couplings up to the last one with a bristle.
    bristles: usize,
}

/// A compiled world with its state.
#[derive(Clone, Debug)]
pub(crate) enum Control {
    One(Box<Running<1>>),
    Two(Box<Running<2>>),
    Four(Box<Running<4>>),
    Eight(Box<Running<8>>),
    Many(Box<Running<32>>),
}

/// The same code for each capacity.
macro_rules! for_each_capacity {
    ($control:expr, $running:ident => $do:expr) => {
        match $control {
            Control::One($running) => $do,
            Control::Two($running) => $do,
            Control::Four($running) => $do,
            Control::Eight($running) => $do,
            Control::Many($running) => $do,
        }
    };
}

impl Control {
    pub fn new(spec: &Spec) -> Result<Self, Error> {
        Ok(match spec.bodies.len() {
            0 | 1 => Control::One(Running::new(spec)?),
            2 => Control::Two(Running::new(spec)?),
            3..=4 => Control::Four(Running::new(spec)?),
            5..=8 => Control::Eight(Running::new(spec)?),
            _ => Control::Many(Running::new(spec)?),
        })
    }

    /// The motor's command for this torque on the puck: after levels and limit.
    pub fn command(&self, torque: f64) -> f64 {
        for_each_capacity!(self, running => running.compiled.command(torque))
    }

    /// The number of steps whose iteration for the nonlinear torques has not converged.
    #[inline]
    pub fn unsettled(&self) -> u32 {
        for_each_capacity!(self, running => running.state.contacts.unsettled)
    }

    /// One sample at the puck's true position and velocity, with x_k and the bristles of it.
    #[inline]
    pub fn step(
        &mut self,
        position: f64,
        velocity: f64,
        bodies: &mut [(f64, f64)],
        bristles: &mut [f64],
    ) -> Sample<f64> {
        // Most worlds have one body: its results stay in registers, those of the other capacities are copied.
        if let Control::One(running) = self {
            return running.sample(position, velocity, bodies, bristles);
        }
        let Sample { puck, torque, command } =
            for_each_capacity!(self, running => running.step(position, velocity, bodies, bristles));
        Sample { puck, torque, command }
    }
}

impl<const B: usize> Running<B> {
    /// Not inlined, so that a small capacity does not use the stack of the largest.
    #[inline(never)]
    fn new(spec: &Spec) -> Result<Box<Self>, Error> {
        let compiled = Loop::new(spec)?;
        let state = compiled.start();
        let has_bristle = |coupling: &Coupling| coupling.law.has_bristle();
        let bristles = spec.couplings.iter().rposition(has_bristle).map_or(0, |last| last + 1);
        Ok(Box::new(Running { compiled, state, bristles }))
    }

    /// [`Control::step`]. Not inlined either, so that each capacity uses only the registers and the stack that it needs.
    #[inline(never)]
    fn step(&mut self, position: f64, velocity: f64, bodies: &mut [(f64, f64)], bristles: &mut [f64]) -> Sample<f64> {
        self.sample(position, velocity, bodies, bristles)
    }

    #[inline(always)]
    fn sample(&mut self, position: f64, velocity: f64, bodies: &mut [(f64, f64)], bristles: &mut [f64]) -> Sample<f64> {
        let state = &mut self.state;
        let sample = self.compiled.step(state, position, velocity);
        for (place, (w, v)) in bodies.iter_mut().zip(state.now.position.iter().zip(&state.now.velocity)) {
            *place = (*w, *v);
        }
        if self.bristles > 0 {
            for (place, bristle) in bristles.iter_mut().zip(&state.bristles).take(self.bristles) {
                *place = *bristle;
            }
        }
        sample
    }
}
