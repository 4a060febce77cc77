//! The hand on a simulated puck: what a page wants of it, and what the device has been told.

use hapt_model::World;
use hapt_rt::{Hands, Touch};
use hapt_sim::{Grip, Script};

/// How fast it swings with the puck, in Hz, when nothing else pulls: well above what a pointer does, well below what a loop at 1 kHz
/// sees as a jump.
const SWING: f64 = 10.0;
/// What of the hand moves with the puck, as a multiple of its inertia.
const HEAVY: f64 = 2.0;

/// A hand, and how the device feels it.
pub struct VisitorsHand {
    /// `None`: the puck is a real one, and so is its hand.
    hands: Option<Hands>,
    grip: Grip,
    /// What it is to do.
    wanted: Wanted,
    /// What the device knows.
    told: Told,
}

enum Wanted {
    Nothing,
    /// To hold, and to be there.
    At(f64),
    /// To play a scenario that the device has not been given yet.
    Play(Box<Script>),
    /// To go on with the one that it has.
    GoOn,
}

#[derive(Clone, Copy, PartialEq)]
enum Told {
    LetGo,
    Grabbed,
    At(f64),
    Played,
}

impl VisitorsHand {
    /// A hand for this world's device.
    pub fn new(world: &World, hands: Option<Hands>) -> Self {
        VisitorsHand { hands, grip: grip(world), wanted: Wanted::Nothing, told: Told::LetGo }
    }

    /// The hand means to be there, holding; `None`: it lets go.
    pub fn want(&mut self, position: Option<f64>) {
        self.wanted = position.map_or(Wanted::Nothing, Wanted::At);
    }

    /// The hand plays a scenario.
    pub fn play(&mut self, script: Script) {
        self.wanted = Wanted::Play(Box::new(script));
    }

    /// The puck is at rest at 0 again, in nobody's hand; `false`: there is no room just now, or the puck is a real one.
    pub fn restart(&mut self) -> bool {
        let done = self.hands.as_mut().is_some_and(|hands| hands.push(Touch::Restart).is_ok());
        if done {
            (self.wanted, self.told) = (Wanted::Nothing, Told::LetGo);
        }
        done
    }

    /// Whether there is a hand that a page can move.
    pub fn is_there(&self) -> bool {
        self.hands.is_some()
    }

    /// Tells the device. What finds no room on the way is told the next time: a release is never lost.
    pub fn tell(&mut self) {
        let Some(hands) = &mut self.hands else { return };
        match std::mem::replace(&mut self.wanted, Wanted::GoOn) {
            Wanted::Nothing => {
                if self.told != Told::LetGo && hands.push(Touch::Release).is_ok() {
                    self.told = Told::LetGo;
                }
                self.wanted = Wanted::Nothing;
            }
            Wanted::At(position) => {
                if !matches!(self.told, Told::Grabbed | Told::At(_)) && hands.push(Touch::Grab(self.grip)).is_ok() {
                    self.told = Told::Grabbed;
                }
                let is_new = matches!(self.told, Told::Grabbed) || matches!(self.told, Told::At(at) if at != position);
                if is_new && hands.push(Touch::Move(position)).is_ok() {
                    self.told = Told::At(position);
                }
                self.wanted = Wanted::At(position);
            }
            Wanted::Play(script) => match hands.push(Touch::Scenario(script)) {
                Ok(()) => self.told = Told::Played,
                Err(Touch::Scenario(script)) => self.wanted = Wanted::Play(script),
                Err(_) => {}
            },
            Wanted::GoOn => {}
        }
    }
}

/// A hand that goes well with a puck: critically damped with it at [`SWING`], so that it follows a pointer and is felt by walls.
pub(crate) fn grip(world: &World) -> Grip {
    let inertia = HEAVY * world.device.inertia;
    let (mass, swing) = (world.device.inertia + inertia, std::f64::consts::TAU * SWING);
    Grip { inertia, damping: 2.0 * mass * swing, stiffness: mass * swing * swing }
}

#[cfg(test)]
mod tests {
    use hapt_rt::{Device, Simulated};

    use super::*;
    use crate::testing::world;

    /// The puck after so many periods of 1 ms, the motor off and the hand told every fourth of them.
    fn goes(device: &mut Simulated, hand: &mut VisitorsHand, periods: u32) -> (f64, f64) {
        for period in 0..periods {
            if period % 4 == 0 {
                hand.tell();
            }
            device.read().unwrap();
            device.passed(1);
        }
        let at = device.read().unwrap();
        (at.position, at.velocity)
    }

    #[test]
    fn a_hand_goes_where_it_means_to_and_let_go_the_puck_coasts() {
        let world = world();
        let (mut device, hands) = Simulated::new(&world);
        let mut hand = VisitorsHand::new(&world, Some(hands));
        assert_eq!(goes(&mut device, &mut hand, 100), (0.0, 0.0));
        hand.want(Some(0.2));
        let (position, velocity) = goes(&mut device, &mut hand, 1000);
        assert!((position - 0.2).abs() < 1e-6 && velocity.abs() < 1e-6, "{position} {velocity}");
        hand.want(Some(0.5));
        let (_, fast) = goes(&mut device, &mut hand, 20);
        hand.want(None);
        // Damping and inertia of the device alone: e^{-bt/J} of the velocity is left.
        let (_, slower) = goes(&mut device, &mut hand, 400);
        let left = (-world.device.damping / world.device.inertia * 0.4_f64).exp();
        assert!(fast > 1.0 && (slower / fast - left).abs() < 0.02, "{fast} {slower}");
    }

    #[test]
    fn a_scenario_is_played_and_a_page_that_grabs_ends_it() {
        let world = world();
        let (mut device, hands) = Simulated::new(&world);
        let mut hand = VisitorsHand::new(&world, Some(hands));
        hand.play(hapt_sim::script(world.scenario("step").unwrap(), world.sampling.period));
        let (position, _) = goes(&mut device, &mut hand, 10);
        assert_eq!(position, std::f64::consts::FRAC_PI_4, "a step is prescribed");
        hand.want(Some(0.1));
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
