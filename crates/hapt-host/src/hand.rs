//! The hand on a simulated puck: its target, and the commands that the device has received.

use hapt_model::World;
use hapt_rt::{HandCommand, Hands};
use hapt_sim::{Grip, Script};

/// Natural frequency of hand and puck together, in Hz: well above a pointer's motion, well below what a loop at 1 kHz detects as a jump.
const FREQUENCY: f64 = 10.0;
/// The hand's inertia, as a multiple of the puck's.
const INERTIA_RATIO: f64 = 2.0;

/// A hand on a simulated puck; on a real one it does nothing.
pub struct VirtualHand {
    /// `None`: a real puck.
    hands: Option<Hands>,
    grip: Grip,
    /// The next command to send.
    pending: Pending,
    /// The last command that was sent.
    last_sent: LastSent,
}

enum Pending {
    Release,
    /// Hold the puck at this position.
    At(f64),
    /// Play a scenario that has not been sent.
    Play(Box<Script>),
    /// Nothing to send: the last command stays in effect.
    Nothing,
}

#[derive(Clone, Copy, PartialEq)]
enum LastSent {
    Released,
    Grabbed,
    At(f64),
    Played,
}

impl VirtualHand {
    /// A hand for the puck of this world: critically damped with it at 10 Hz, so that it follows a pointer and yields at walls.
    pub fn new(world: &World, hands: Option<Hands>) -> Self {
        VirtualHand { hands, grip: grip(world), pending: Pending::Release, last_sent: LastSent::Released }
    }

    /// Moves the hand, in rad (linear: m); `None` releases the puck.
    pub fn move_to(&mut self, position: Option<f64>) {
        self.pending = position.map_or(Pending::Release, Pending::At);
    }

    /// Plays a scenario.
    pub fn play(&mut self, script: Script) {
        self.pending = Pending::Play(Box::new(script));
    }

    /// Puts the puck at rest at 0, hands-off; `false`: the queue is full, or the puck is real.
    pub fn restart(&mut self) -> bool {
        let done = self.hands.as_mut().is_some_and(|hands| hands.push(HandCommand::Restart).is_ok());
        if done {
            (self.pending, self.last_sent) = (Pending::Release, LastSent::Released);
        }
        done
    }

    /// Whether the puck is simulated.
    pub fn is_simulated(&self) -> bool {
        self.hands.is_some()
    }

    /// Sends the pending commands. Those that find the queue full are sent by the next call, so that a release is never lost.
    pub fn send(&mut self) {
        let Some(hands) = &mut self.hands else { return };
        match std::mem::replace(&mut self.pending, Pending::Nothing) {
            Pending::Release => {
                if self.last_sent != LastSent::Released && hands.push(HandCommand::Release).is_ok() {
                    self.last_sent = LastSent::Released;
                }
                self.pending = Pending::Release;
            }
            Pending::At(position) => {
                if !matches!(self.last_sent, LastSent::Grabbed | LastSent::At(_))
                    && hands.push(HandCommand::Grab(self.grip)).is_ok()
                {
                    self.last_sent = LastSent::Grabbed;
                }
                let is_new = matches!(self.last_sent, LastSent::Grabbed)
                    || matches!(self.last_sent, LastSent::At(at) if at != position);
                if is_new && hands.push(HandCommand::Move(position)).is_ok() {
                    self.last_sent = LastSent::At(position);
                }
                self.pending = Pending::At(position);
            }
            Pending::Play(script) => match hands.push(HandCommand::Scenario(script)) {
                Ok(()) => self.last_sent = LastSent::Played,
                Err(HandCommand::Scenario(script)) => self.pending = Pending::Play(script),
                Err(_) => {}
            },
            Pending::Nothing => {}
        }
    }
}

/// See [`VirtualHand::new`].
fn grip(world: &World) -> Grip {
    let inertia = INERTIA_RATIO * world.device.inertia;
    let (mass, swing) = (world.device.inertia + inertia, std::f64::consts::TAU * FREQUENCY);
    Grip { inertia, damping: 2.0 * mass * swing, stiffness: mass * swing * swing }
}

#[cfg(test)]
mod tests {
    use hapt_rt::{Device, SimulatedDevice};

    use super::*;
    use crate::testing::world;

    /// The puck after this number of periods of 1 ms, with the motor off and the hand updated every fourth period.
    fn goes(device: &mut SimulatedDevice, hand: &mut VirtualHand, periods: u32) -> (f64, f64) {
        for period in 0..periods {
            if period % 4 == 0 {
                hand.send();
            }
            device.read().unwrap();
            device.passed(1);
        }
        let at = device.read().unwrap();
        (at.position, at.velocity)
    }

    #[test]
    fn a_hand_reaches_its_target_and_hands_off_the_puck_coasts() {
        let world = world();
        let (mut device, hands) = SimulatedDevice::new(&world);
        let mut hand = VirtualHand::new(&world, Some(hands));
        assert_eq!(goes(&mut device, &mut hand, 100), (0.0, 0.0));
        hand.move_to(Some(0.2));
        let (position, velocity) = goes(&mut device, &mut hand, 1000);
        assert!((position - 0.2).abs() < 1e-6 && velocity.abs() < 1e-6, "{position} {velocity}");
        hand.move_to(Some(0.5));
        let (_, fast) = goes(&mut device, &mut hand, 20);
        hand.move_to(None);
        // Only damping and inertia of the device: e^{-bt/J} of the velocity is left.
        let (_, slower) = goes(&mut device, &mut hand, 400);
        let left = (-world.device.damping / world.device.inertia * 0.4_f64).exp();
        assert!(fast > 1.0 && (slower / fast - left).abs() < 0.02, "{fast} {slower}");
    }

    #[test]
    fn a_scenario_is_played_and_a_page_that_grabs_ends_it() {
        let world = world();
        let (mut device, hands) = SimulatedDevice::new(&world);
        let mut hand = VirtualHand::new(&world, Some(hands));
        hand.play(hapt_sim::script(world.scenario("step").unwrap(), world.sampling.period));
        let (position, _) = goes(&mut device, &mut hand, 10);
        assert_eq!(position, std::f64::consts::FRAC_PI_4, "a step is prescribed");
        hand.move_to(Some(0.1));
        let (position, _) = goes(&mut device, &mut hand, 1000);
        assert!((position - 0.1).abs() < 1e-6);
    }

    #[test]
    fn the_grip_is_critically_damped_with_the_puck() {
        let world = world();
        let grip = grip(&world);
        let mass = world.device.inertia + grip.inertia;
        assert!((grip.damping - 2.0 * (grip.stiffness * mass).sqrt()).abs() < 1e-12);
    }
}
