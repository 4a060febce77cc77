//! The exact simulation as a device in real time, with a hand that somebody moves from outside.

use hapt_model::World;
use hapt_sim::{Grip, VirtualDevice};
use rtrb::{Consumer, Producer, RingBuffer};

use crate::{Device, Failure, Position};

/// What a hand on the simulated puck does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Touch {
    /// Takes hold where the puck is.
    Grab(Grip),
    /// Means to be at this position, in rad (linear: m).
    Move(f64),
    /// Lets go.
    Release,
}

/// A simulated device.
pub struct Simulated {
    device: VirtualDevice,
    hand: Consumer<Touch>,
}

impl Simulated {
    /// The world's device, and the ring through which its hand is moved.
    pub fn new(world: &World) -> (Self, Producer<Touch>) {
        let (producer, hand) = RingBuffer::new(64);
        (Simulated { device: VirtualDevice::new(world), hand }, producer)
    }
}

impl Device for Simulated {
    fn read(&mut self) -> Result<Position, Failure> {
        while let Ok(touch) = self.hand.pop() {
            match touch {
                Touch::Grab(grip) => self.device.hold(Some(grip)),
                Touch::Move(position) => self.device.intend(position),
                Touch::Release => self.device.hold(None),
            }
        }
        let (position, velocity) = self.device.puck();
        Ok(Position { position, velocity, announced: false })
    }

    fn write(&mut self, torque: f64) -> Result<(), Failure> {
        self.device.command(torque);
        Ok(())
    }

    fn passed(&mut self, periods: u32) {
        for _ in 0..periods {
            self.device.travel();
        }
    }
}
