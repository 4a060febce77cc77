//! The loop without its device, and the device without its loop, stepped sample by sample from other simulators.

use std::sync::Arc;

use hapt_model::{Scenario, World};
use hapt_sim::{DesktopLoop, DesktopState, VirtualDevice, script};
use pyo3::exceptions::{PyOverflowError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::value;

/// The loop of a world with its state.
#[pyclass(module = "hapt._hapt")]
#[derive(Clone)]
pub struct Loop {
    world: Arc<World>,
    compiled: Arc<DesktopLoop>,
    state: Box<DesktopState>,
    command: f64,
    measured: (f64, f64),
}

impl Loop {
    pub fn new(world: Arc<World>) -> PyResult<Loop> {
        let compiled = Arc::new(DesktopLoop::new(&world.spec()).map_err(value)?);
        let state = Box::new(compiled.start());
        Ok(Loop { world, compiled, state, command: 0.0, measured: (0.0, 0.0) })
    }

    fn sample(&mut self, position: f64, velocity: f64) -> f64 {
        let sample = self.compiled.step(&mut self.state, position, velocity);
        self.command = sample.command;
        self.measured = (sample.puck.position, sample.puck.velocity);
        sample.torque
    }

    /// The condition of [`hapt_sim::Row::is_finite`].
    fn is_finite(&self, torque: f64) -> bool {
        let bodies = self.state.now.position.iter().zip(&self.state.now.velocity).take(self.world.bodies.len());
        let own = [torque, self.command, self.measured.0, self.measured.1];
        own.iter().all(|x| x.is_finite()) && bodies.into_iter().all(|(w, v)| w.is_finite() && v.is_finite())
    }
}

#[pymethods]
impl Loop {
    /// Takes one sample, and returns the couplings' torque on the puck.
    #[pyo3(signature = (position, velocity=0.0))]
    fn step(&mut self, position: f64, velocity: f64) -> PyResult<f64> {
        let input = [("position", position), ("velocity", velocity)];
        if let Some((name, value)) = input.iter().find(|(_, value)| !value.is_finite()) {
            return Err(PyValueError::new_err(format!("{name} is {value}, but must be a finite number")));
        }
        let torque = self.sample(position, velocity);
        if !self.is_finite(torque) {
            return Err(PyOverflowError::new_err(
                "the loop's state stops being finite at this sample; reset() sets it to the beginning",
            ));
        }
        Ok(torque)
    }

    /// Sets the state to the world's initial state.
    fn reset(&mut self) {
        *self.state = self.compiled.start();
        (self.command, self.measured) = (0.0, (0.0, 0.0));
    }

    #[getter]
    fn command(&self) -> f64 {
        self.command
    }

    #[getter]
    fn measured(&self) -> (f64, f64) {
        self.measured
    }

    #[getter]
    fn period(&self) -> f64 {
        self.world.sampling.period
    }

    /// `(name, position, velocity)` of each body at the last sample.
    #[getter]
    fn bodies(&self) -> Vec<(String, f64, f64)> {
        let now = self.state.now.position.iter().zip(&self.state.now.velocity);
        self.world.names.iter().zip(now).map(|(name, (w, v))| (name.clone(), *w, *v)).collect()
    }

    fn copy(&self) -> Loop {
        self.clone()
    }

    /// The state as bytes, to the bit.
    fn get_state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        written(py, &(&*self.state, self.command, self.measured))
    }

    /// Sets the state from the bytes of `get_state`, of the same world and version of hapt.
    fn set_state(&mut self, bytes: &[u8]) -> PyResult<()> {
        let (state, command, measured) = read::<(DesktopState, f64, (f64, f64))>(bytes)?;
        *self.state = state;
        (self.command, self.measured) = (command, measured);
        Ok(())
    }
}

/// A state as bytes.
fn written<'py>(py: Python<'py>, state: &impl Serialize) -> PyResult<Bound<'py, PyBytes>> {
    let bytes = postcard::to_extend(state, Vec::new());
    Ok(PyBytes::new(py, &bytes.map_err(value)?))
}

/// The state from bytes, all of which it must use.
fn read<T: DeserializeOwned>(bytes: &[u8]) -> PyResult<T> {
    match postcard::take_from_bytes(bytes) {
        Ok((state, [])) => Ok(state),
        _ => Err(PyValueError::new_err("the bytes hold no state of this class in this version of hapt")),
    }
}

/// The device of a world, integrated exactly from sample to sample.
#[pyclass(module = "hapt._hapt")]
#[derive(Clone)]
pub struct Device {
    fresh: Box<VirtualDevice>,
    now: Box<VirtualDevice>,
}

impl Device {
    /// The device with the hand of a scenario, whose samples must be even, or without a hand.
    pub fn new(world: &World, scenario: Option<&Scenario>) -> Device {
        let mut device = VirtualDevice::new(&world.device_spec());
        if let Some(scenario) = scenario {
            device.begin(&mut script(scenario, world.sampling.period));
        }
        let fresh = Box::new(device);
        Device { now: fresh.clone(), fresh }
    }
}

#[pymethods]
impl Device {
    /// Commands `torque` to the motor for a period, and returns the puck's position and velocity at the period's end.
    fn step(&mut self, torque: f64) -> PyResult<(f64, f64)> {
        if !torque.is_finite() {
            return Err(PyValueError::new_err(format!("torque is {torque}, but must be a finite number")));
        }
        self.now.command(torque);
        self.now.travel();
        let (position, velocity) = self.now.puck();
        if !(position.is_finite() && velocity.is_finite()) {
            return Err(PyOverflowError::new_err(
                "the puck's motion stops being finite in this period; reset() sets it to the beginning",
            ));
        }
        Ok((position, velocity))
    }

    /// Sets the state to the beginning.
    fn reset(&mut self) {
        self.now = self.fresh.clone();
    }

    #[getter]
    fn puck(&self) -> (f64, f64) {
        self.now.puck()
    }

    #[getter]
    fn handle(&self) -> Option<(f64, f64)> {
        self.now.handle()
    }

    #[getter]
    fn applied(&self) -> f64 {
        self.now.applied()
    }

    fn copy(&self) -> Device {
        self.clone()
    }

    /// The state as bytes, to the bit.
    fn get_state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        written(py, &*self.now)
    }

    /// Sets the state from the bytes of `get_state`, of the same world, scenario and version of hapt.
    fn set_state(&mut self, bytes: &[u8]) -> PyResult<()> {
        *self.now = read(bytes)?;
        Ok(())
    }
}
