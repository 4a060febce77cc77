//! The exact simulation as a device in real time, with a hand that somebody moves from outside.

use hapt_model::World;
use hapt_sim::{Grip, Script, VirtualDevice};
use rtrb::{Consumer, Producer, RingBuffer};

use crate::{Device, Failure, Plan, Position};

/// Touches on their way, and old scripts on their way back.
const TOUCHES: usize = 64;
/// After a longer pause than so many periods the simulation does not catch up: it has stood still.
const LONGEST_PAUSE: u32 = 1 << 20;

/// What a hand on the simulated puck does.
#[derive(Debug, PartialEq)]
pub enum HandCommand {
    /// Takes hold where the puck is.
    Grab(Grip),
    /// Means to be at this position, in rad (linear: m).
    Move(f64),
    /// Lets go, whoever holds it.
    Release,
    /// The puck is at rest at 0 again, in nobody's hand.
    Restart,
    /// A scenario's hand takes hold, at its t = 0.
    Scenario(Box<Script>),
}

/// Where the hands on a simulated puck are told what to do.
pub struct Hands {
    /// Toward the device.
    pub touches: Producer<HandCommand>,
    /// Scripts that are over, to be freed on this side; with 64 of them here no further one begins.
    pub spent: Consumer<Box<Script>>,
}

impl Hands {
    /// A touch for the next sample; it comes back where 64 are on their way already.
    pub fn push(&mut self, touch: HandCommand) -> Result<(), HandCommand> {
        while self.spent.pop().is_ok() {}
        self.touches.push(touch).map_err(|rtrb::PushError::Full(touch)| touch)
    }
}

/// A simulated device.
pub struct SimulatedDevice {
    device: VirtualDevice,
    touches: Consumer<HandCommand>,
    back: Producer<Box<Script>>,
    announced: bool,
    /// The world's 0 in what is read, rad (linear: m); hands count from there.
    zero: f64,
    /// What the motor was last asked for, in N·m (linear: N).
    asked: f64,
}

impl SimulatedDevice {
    /// The world's device, and what moves its hand.
    pub fn new(world: &World) -> (Self, Hands) {
        let (producer, touches) = RingBuffer::new(TOUCHES);
        let (back, spent) = RingBuffer::new(TOUCHES);
        let mut device = VirtualDevice::new(&world.device_spec());
        device.reserve();
        (
            SimulatedDevice { device, touches, back, announced: false, zero: 0.0, asked: 0.0 },
            Hands { touches: producer, spent },
        )
    }

    fn is_touched(&mut self) {
        // An old script is not freed here: without room on the way back the new one waits.
        while !matches!(self.touches.peek(), Ok(HandCommand::Scenario(_))) || !self.back.is_full() {
            match self.touches.pop() {
                Ok(HandCommand::Grab(grip)) => self.device.hold(Some(grip)),
                Ok(HandCommand::Move(position)) => self.device.intend(position),
                Ok(HandCommand::Release) => self.device.hold(None),
                Ok(HandCommand::Restart) => {
                    self.device.restart();
                    self.announced = true;
                }
                Ok(HandCommand::Scenario(mut script)) => {
                    self.device.begin(&mut script);
                    let _ = self.back.push(script);
                }
                Err(_) => return,
            }
        }
    }
}

impl Device for SimulatedDevice {
    fn read(&mut self) -> Result<Position, Failure> {
        self.is_touched();
        let (position, velocity) = self.device.puck();
        if !(position.is_finite() && velocity.is_finite()) {
            // It has run away. That is shown once, for the supervisor to fault; the simulation itself begins anew.
            self.device.restart();
            return Ok(Position { position: f64::NAN, velocity: 0.0, announced: false });
        }
        let announced = std::mem::take(&mut self.announced) || self.device.announced();
        // A zero that was never moved takes no digit.
        let position = if self.zero == 0.0 { position } else { self.zero + position };
        Ok(Position { position, velocity, announced })
    }

    fn write(&mut self, torque: f64) -> Result<(), Failure> {
        self.asked = torque;
        self.device.command(torque);
        Ok(())
    }

    fn applied(&self) -> Option<f64> {
        Some(self.device.applied())
    }

    fn passed(&mut self, periods: u32) {
        for period in 0..periods.min(LONGEST_PAUSE) {
            if period > 0 {
                // At an instant that was missed it is asked for what it was: a delay is a time, and no number of commands.
                self.device.command(self.asked);
            }
            self.device.travel();
            self.announced |= self.device.announced();
        }
    }

    fn homed(&mut self, zero: f64) {
        self.device.shift(zero - self.zero);
        self.zero = zero;
    }

    fn adopt(&mut self, plan: &mut Plan) {
        self.device.refit(&mut plan.device);
    }
}

#[cfg(test)]
mod tests {
    use hapt_model::Source;

    use super::*;

    #[test]
    fn samples_that_are_missed_make_no_delay_longer() {
        let file = "[loop]\nperiod = \"1 ms\"\ndelay = \"2.4 ms\"\n[device]\ninertia = 6.4e-4\n";
        let world = World::read(&Source::from_text("late.toml", file), &[]).unwrap();
        let (mut steady, _hands) = SimulatedDevice::new(&world);
        let (mut late, _more_hands) = SimulatedDevice::new(&world);
        for (torque, missed) in [(0.1, 0), (-0.3, 3), (0.2, 1), (0.5, 7), (0.0, 0), (0.4, 2)] {
            late.write(torque).unwrap();
            late.passed(missed + 1);
            for _ in 0..=missed {
                steady.write(torque).unwrap();
                steady.passed(1);
            }
            assert_eq!(late.read().unwrap(), steady.read().unwrap(), "after {missed} missed");
        }
    }
}
