//! The numbers of a device as a world's file has them.

use hapt_model::{DeviceSpec, Handle, World};
use hapt_plant::spec::{DeviceTorque, FrictionByPosition, Stops, Stribeck};

use crate::device::Device;
use crate::puck::Puck;
use crate::record::Record;
use crate::start::{Begin, begins};

/// A record whose sample period differs by this part from the world's belongs to another loop.
const PERIOD: f64 = 0.05;

/// The numbers of a device as a file has them: least and largest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Claims {
    /// J in kg·m² (linear: kg).
    pub inertia: [f64; 2],
    /// b in N·m·s/rad (N·s/m).
    pub damping: [f64; 2],
    /// Coulomb's, in N·m (N).
    pub friction: [f64; 2],
    /// Half of the difference between the friction toward smaller positions and that toward larger ones, in the same unit; the friction is
    /// then the mean of the two.
    pub lean: f64,
    /// The time constant of the motor, in s.
    pub lag: [f64; 2],
    /// The delay of the torque, in s.
    pub delay: [f64; 2],
    /// The loop's period in s.
    pub period: f64,
    /// On a flexible shaft; its numbers have no tolerance.
    pub handle: Option<Handle>,
    /// Friction that falls with the speed; its numbers have no tolerance.
    pub stribeck: Option<Stribeck>,
    /// End stops; their numbers have no tolerance.
    pub stops: Option<Stops>,
    /// Gravity and cogging; their numbers have no tolerance.
    pub torque: DeviceTorque,
    /// How friction changes with the position; its numbers have no tolerance.
    pub friction_by_position: Option<FrictionByPosition>,
}

impl Claims {
    /// The claims of a world's file.
    pub fn of(world: &World) -> Self {
        let device = &world.device;
        let [forward, backward] = device.frictions_range();
        Claims {
            inertia: device.inertia_range(),
            damping: device.damping_range(),
            friction: [0, 1].map(|i| 0.5 * (forward[i] + backward[i])),
            lean: 0.5 * (device.frictions()[1] - device.frictions()[0]),
            lag: device.lag_range(),
            delay: [world.sampling.delay_s(), world.sampling.delay_max_s()],
            period: world.sampling.period,
            handle: device.handle,
            stribeck: device.stribeck.filter(|stribeck| stribeck.torque > 0.0),
            stops: device.stops,
            torque: device.torque,
            friction_by_position: device.friction_by_position,
        }
    }

    /// The median time between two samples of a record, in s, where it differs from the loop's: the record is then of another loop.
    pub fn other_period(&self, record: &Record) -> Option<f64> {
        let mut apart: Vec<f64> = record.times().windows(2).map(|pair| pair[1] - pair[0]).collect();
        apart.sort_by(f64::total_cmp);
        apart.get(apart.len() / 2).copied().filter(|own| (own / self.period - 1.0).abs() > PERIOD)
    }
}

pub(super) fn middle([low, high]: [f64; 2]) -> f64 {
    0.5 * (low + high)
}

impl Claims {
    /// A puck with the middle of each range, and with the first position and velocity of the record.
    pub(super) fn puck(&self, record: &Record) -> Puck {
        let gain = middle(self.inertia).recip();
        let Begin { position, velocity } = begins(record, record.first())[0];
        Puck {
            gain,
            damping: gain * middle(self.damping),
            friction: gain * middle(self.friction),
            delay: middle(self.delay) + middle(self.lag),
            offset: gain * self.lean,
            position,
            velocity,
            lag: 0.0,
        }
    }

    /// Whether a torque or the friction depends on the position.
    pub(super) fn moves_by_position(&self) -> bool {
        !self.torque.is_none() || self.changes()
    }

    /// Whether friction changes with the position.
    fn changes(&self) -> bool {
        self.friction_by_position.is_some_and(|changes| changes.most() > 0.0)
    }

    /// The device with the middle of each range.
    pub(super) fn device(&self) -> DeviceSpec {
        self.device_at(middle)
    }

    /// The device with one number of each range.
    pub(super) fn device_at(&self, of: impl Fn([f64; 2]) -> f64) -> DeviceSpec {
        let friction = of(self.friction);
        DeviceSpec {
            inertia: of(self.inertia),
            damping: of(self.damping),
            friction: friction - self.lean,
            friction_backward: Some(friction + self.lean).filter(|_| self.lean != 0.0),
            friction_by_position: self.friction_by_position,
            stribeck: self.stribeck,
            stops: self.stops,
            lag: of(self.lag),
            delay: of(self.delay),
            period: self.period,
            handle: self.handle,
            torque: self.torque,
        }
    }
}

/// The device of a file with Stribeck friction, end stops, torques of the position or friction that changes with it; `None` where it has none
/// of them.
pub(super) fn device_of(claims: &Claims) -> Option<Device> {
    let is_richer = claims.stribeck.is_some() || claims.stops.is_some() || claims.moves_by_position();
    is_richer.then(|| Device::of_spec(&claims.device()))
}
