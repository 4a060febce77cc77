//! What runs the loop, and how it starts.

use hapt_core::SafetyProfile;
#[cfg(not(target_family = "wasm"))]
use hapt_core::{Phase, Reason};
use hapt_model::World;
#[cfg(not(target_family = "wasm"))]
use hapt_rt::Settings;
use hapt_rt::{Device, Hands, Outside, SimulatedDevice};

use crate::config::WorldConfig;
use crate::error::Error;
use crate::local::LocalLoop;
use crate::messages::{Controls, NetworkChange, NetworkInfo, WheelInfo};
use crate::runner::Runner;

/// What runs the loop of a session, and its safety profile.
pub struct Machine {
    /// Its address: `sim`, `moteus:/dev/ttyACM0#1`.
    pub name: String,
    /// What runs the loop.
    pub backend: Backend,
    /// What moves the hand of a simulated device; `None` for a real one.
    pub hands: Option<Hands>,
    /// The network that its loop is a station of, for its pages.
    pub network: Option<Box<dyn StationView>>,
    /// The wheel that games see of its device, for its pages.
    pub wheel: Option<Box<dyn WheelView>>,
    /// The supervisor's profile. With [`SafetyProfile::Certified`] no key is set to a value that is not certified.
    pub profile: SafetyProfile,
}

/// What the pages of a station see of its network, and change of it.
pub trait StationView: Send {
    /// Its numbers, its verdict, its links, and what is unusual of them.
    fn info(&self) -> NetworkInfo;
    /// Changes it for all stations.
    fn change(&self, change: &NetworkChange);
    /// The station's world is another one from now on.
    fn change_world(&self, world: &World);
}

/// What the pages see of a wheel for games, and press on it.
pub trait WheelView: Send {
    /// What plays, and what was given, since the last call.
    fn info(&self) -> WheelInfo;
    /// Presses its pedals and buttons.
    fn press(&self, controls: Controls);
}

/// Where the loop runs.
pub enum Backend {
    /// On a thread of this computer.
    #[cfg(not(target_family = "wasm"))]
    Local {
        /// Started, and without a torque.
        device: Box<dyn Device>,
        /// The scheduling of the thread.
        settings: Settings,
        /// Torques from outside of its world.
        outside: Outside,
    },
    /// Wherever [`crate::Session::poll`] is called: each call takes the samples that are due then.
    Stepped {
        /// Simulated.
        device: Box<dyn Device>,
        /// Torques from outside of its world.
        outside: Outside,
    },
    /// On a board, which receives the world.
    #[cfg(not(target_family = "wasm"))]
    Board {
        /// After the handshake, disarmed.
        link: Box<crate::board::Link>,
        /// The time between two samples of telemetry, in s; the line may carry fewer. 0: every sample.
        every: f64,
    },
}

impl Backend {
    /// Starts the loop with the world of `config`, disarmed.
    pub(crate) fn start(self, config: &WorldConfig, profile: SafetyProfile) -> Result<Box<dyn Runner>, Error> {
        Ok(match self {
            #[cfg(not(target_family = "wasm"))]
            Backend::Local { device, settings, outside } => {
                Box::new(LocalLoop::start(config, profile, device, settings, outside)?)
            }
            Backend::Stepped { device, outside } => Box::new(LocalLoop::stepped(config, profile, device, outside)?),
            #[cfg(not(target_family = "wasm"))]
            Backend::Board { link, every } => {
                Box::new(crate::board_loop::BoardLoop::start(config, profile, *link, every)?)
            }
        })
    }
}

impl Machine {
    /// The exact simulation of this world's device, with a hand.
    #[cfg(not(target_family = "wasm"))]
    pub fn simulated(world: &World) -> Self {
        Machine::simulation(world, |device| Backend::Local {
            device,
            settings: Settings::default(),
            outside: Outside::default(),
        })
    }

    /// The same without a thread, for a page: [`Backend::Stepped`].
    pub fn stepped(world: &World) -> Self {
        Machine::simulation(world, |device| Backend::Stepped { device, outside: Outside::default() })
    }

    /// The same loop with torques from outside of its world; `None` where a board runs it.
    pub fn beside(mut self, torques: Outside) -> Option<Self> {
        match &mut self.backend {
            #[cfg(not(target_family = "wasm"))]
            Backend::Local { outside, .. } => *outside = torques,
            Backend::Stepped { outside, .. } => *outside = torques,
            #[cfg(not(target_family = "wasm"))]
            Backend::Board { .. } => return None,
        }
        Some(self)
    }

    /// Clears the fault that an earlier session has left on a board; `None`: there was none. A loop of this computer starts without one.
    ///
    /// # Errors
    /// The board does not clear it.
    #[cfg(not(target_family = "wasm"))]
    pub fn clear_fault(&mut self) -> Result<Option<&'static str>, crate::board::Error> {
        let Backend::Board { link, .. } = &mut self.backend else { return Ok(None) };
        if link.board().phase != Some(Phase::Faulted) {
            return Ok(None);
        }
        let why = link.board().reason.map_or("The board reports no reason.", Reason::sentence);
        link.clear()?;
        Ok(Some(why))
    }

    fn simulation(world: &World, backend: impl FnOnce(Box<dyn Device>) -> Backend) -> Self {
        let (device, hands) = SimulatedDevice::new(world);
        Machine {
            name: "sim".into(),
            backend: backend(Box::new(device)),
            hands: Some(hands),
            network: None,
            wheel: None,
            profile: SafetyProfile::Simulated,
        }
    }
}
