//! The exact simulation as a device in real time, with a hand that commands move.

use hapt_model::World;
use hapt_sim::{Grip, Script, VirtualDevice};
use rtrb::{Consumer, Producer, RingBuffer};

use crate::{Device, Failure, Plan, Position};

/// Capacity of the rings of hand commands and of old scripts.
const HAND_COMMANDS: usize = 64;
/// The largest number of missed periods that the simulation catches up; beyond it the simulated time lags.
const MAX_CAUGHT_UP_PERIODS: u32 = 1 << 20;

/// A command to the hand on the simulated puck.
#[derive(Debug, PartialEq)]
pub enum HandCommand {
    /// Grip the puck at its present position.
    Grab(Grip),
    /// Move the target of the hand to this position, in rad (linear: m).
    Move(f64),
    /// Release the puck.
    Release,
    /// Reset the puck to rest at 0, released.
    Restart,
    /// Start a scenario's hand at its t = 0.
    Scenario(Box<Script>),
}

/// The sender of commands to the hand on a simulated puck.
pub struct Hands {
    /// Commands to the device.
    pub touches: Producer<HandCommand>,
    /// Finished scripts, to be freed on this side; while 64 of them are here, no further script starts.
    pub spent: Consumer<Box<Script>>,
}

impl Hands {
    /// Sends a command for the next sample; it is returned where 64 are queued.
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
    /// The position that is read at the world's 0, rad (linear: m); hands count from there.
    zero: f64,
    /// The last command of the motor, in N·m (linear: N).
    commanded: f64,
}

impl SimulatedDevice {
    /// The world's device, and the sender of commands to its hand.
    pub fn new(world: &World) -> (Self, Hands) {
        let (producer, touches) = RingBuffer::new(HAND_COMMANDS);
        let (back, spent) = RingBuffer::new(HAND_COMMANDS);
        let mut device = VirtualDevice::new(&world.device_spec());
        device.reserve();
        (
            SimulatedDevice { device, touches, back, announced: false, zero: 0.0, commanded: 0.0 },
            Hands { touches: producer, spent },
        )
    }

    fn is_touched(&mut self) {
        // The loop's thread frees no script: while the ring back is full, a new scenario waits.
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
            // The simulation diverged. The supervisor receives one NaN, and faults; the simulation restarts.
            self.device.restart();
            return Ok(Position { position: f64::NAN, velocity: 0.0, announced: false });
        }
        let announced = std::mem::take(&mut self.announced) || self.device.announced();
        // An offset of 0 leaves the position exact.
        let position = if self.zero == 0.0 { position } else { self.zero + position };
        Ok(Position { position, velocity, announced })
    }

    fn write(&mut self, torque: f64) -> Result<(), Failure> {
        self.commanded = torque;
        self.device.command(torque);
        Ok(())
    }

    fn applied(&self) -> Option<f64> {
        Some(self.device.applied())
    }

    fn passed(&mut self, periods: u32) {
        for period in 0..periods.min(MAX_CAUGHT_UP_PERIODS) {
            if period > 0 {
                // At a missed instant the last command is repeated: the delay is a time, not a number of commands.
                self.device.command(self.commanded);
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
    fn missed_samples_do_not_lengthen_the_delay() {
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
