//! The device on its own, for whoever runs the loop beside it: the exact puck, and a hand that is told what to do as it goes.

use hapt_model::World;

use crate::energy::Ledger;
use crate::puck::{Inertia, Puck, Push};
use crate::run::Motor;

/// A hand on the puck: its inertia moves with the puck, spring and damper stand between the puck and what it intends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grip {
    /// kg·m² (linear: kg), zero or more.
    pub inertia: f64,
    /// N·m·s/rad, zero or more.
    pub damping: f64,
    /// N·m/rad, zero or more.
    pub stiffness: f64,
}

/// A world's device, period after period, from rest at 0.
#[derive(Clone, Debug)]
pub struct VirtualDevice {
    period: f64,
    device: Inertia,
    friction: f64,
    motor: Motor<f64>,
    puck: Puck,
    grip: Option<Grip>,
    /// What the hand intends now, and its velocity over the next period.
    intended: f64,
    slope: f64,
    /// The device's works up to here.
    pub ledger: Ledger,
}

impl VirtualDevice {
    /// The device of a world, nobody's hand on it.
    pub fn new(world: &World) -> Self {
        let device = Inertia { inertia: world.device.inertia, damping: world.device.damping, stiffness: 0.0 };
        let motor = Motor::new(world.sampling.delay, world.sampling.period);
        let puck = Puck::new(device, None, world.device.friction, (0.0, 0.0, 0.0), &[world.sampling.period]);
        VirtualDevice {
            period: world.sampling.period,
            device,
            friction: world.device.friction,
            motor,
            puck,
            grip: None,
            intended: 0.0,
            slope: 0.0,
            ledger: Ledger::default(),
        }
    }

    /// The puck's true position and velocity.
    pub fn puck(&self) -> (f64, f64) {
        (self.puck.position, self.puck.velocity)
    }

    /// What the motor holds.
    pub fn applied(&self) -> f64 {
        self.motor.applied
    }

    /// A hand takes hold where the puck is, or lets go.
    pub fn hold(&mut self, grip: Option<Grip>) {
        let hand = grip.map(|g| Inertia { inertia: g.inertia, damping: g.damping, stiffness: g.stiffness });
        let (position, velocity) = self.puck();
        self.puck = Puck::new(self.device, hand, self.friction, (0.0, 0.0, 0.0), &[self.period]);
        (self.puck.position, self.puck.velocity) = (position, velocity);
        (self.grip, self.intended, self.slope) = (grip, position, 0.0);
    }

    /// The hand means to be at `position` one period from now.
    pub fn intend(&mut self, position: f64) {
        self.slope = (position - self.intended) / self.period;
    }

    /// The loop's command.
    pub fn command(&mut self, torque: f64) {
        self.motor.command(torque);
    }

    /// One period.
    pub fn travel(&mut self) {
        let push = self.grip.map_or(Push::default(), |hand| Push {
            value: hand.stiffness * self.intended + hand.damping * self.slope,
            slope: hand.stiffness * self.slope,
            ..Push::default()
        });
        self.puck.advance(self.period, self.motor.applied, push, &mut self.ledger);
        self.intended += self.slope * self.period;
        self.slope = 0.0;
    }
}
