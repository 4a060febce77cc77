//! A device of hapt-plant's, its commanded torques, and the values of its encoder.

use std::f64::consts::TAU;

use fastrand::Rng;
use hapt_plant::VirtualDevice;
use hapt_plant::spec::{DeviceSpec, DeviceTorque};

pub const WHEEL: DeviceSpec = DeviceSpec {
    delay: 2.4e-3,
    damping: 1.2e-3,
    friction: 5e-3,
    torque: DeviceTorque { gravity: None, cogging: None },
    ..DeviceSpec::new(1e-3, 6.4e-4)
};

/// Torques that step up and down at random, in N·m.
pub fn steps(rng: &mut Rng, samples: usize, size: f64) -> Vec<f64> {
    let mut level = 0.0;
    let mut left = 0;
    let step = |_| {
        if left == 0 {
            left = rng.usize(5..150);
            level = size * (2.0 * rng.f64() - 1.0);
        }
        left -= 1;
        level
    };
    (0..samples).map(step).collect()
}

/// The position of the device at each sample.
pub fn motion(rig: &DeviceSpec, torques: &[f64]) -> Vec<f64> {
    let mut device = VirtualDevice::new(rig);
    let step = |torque: &f64| {
        let position = device.puck().0;
        device.command(*torque);
        device.travel();
        position
    };
    torques.iter().map(step).collect()
}

pub fn times(rig: &DeviceSpec, samples: usize) -> Vec<f64> {
    (0..samples).map(|k| k as f64 * rig.period).collect()
}

pub fn counted(positions: &[f64], counts: f64, noise: f64, rng: &mut Rng) -> Vec<f64> {
    let count = TAU / counts;
    // The sum of twelve uniform numbers less six is nearly normal.
    let mut normal = || (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0;
    positions.iter().map(|z| (z / count + noise * normal()).round() * count).collect()
}
