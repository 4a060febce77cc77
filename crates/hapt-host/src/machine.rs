//! The machine that runs the loop, and its start.

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

/// The machine that runs the loop of a session, and its safety profile.
pub struct Machine {
    /// Its address: `sim`, `moteus:/dev/ttyACM0#1`.
    pub name: String,
    /// Where the loop runs.
    pub backend: Backend,
    /// The sender of commands to a simulated device's hand; `None` for a real one.
    pub hands: Option<Hands>,
    /// For its pages: the network of which its loop is a station.
    pub network: Option<Box<dyn StationView>>,
    /// For its pages: its device as a game wheel.
    pub wheel: Option<Box<dyn WheelView>>,
    /// The supervisor's profile. With [`SafetyProfile::Certified`] no key is set to a value that is not certified.
    pub profile: SafetyProfile,
}

/// The network of a station, for its pages to display and change.
pub trait StationView: Send {
    /// Its numbers, its verdict, its links, and warnings.
    fn info(&self) -> NetworkInfo;
    /// Changes it for all stations.
    fn change(&self, change: &NetworkChange);
    /// Replaces the station's world from now on.
    fn change_world(&self, world: &World);
}

/// A game wheel, for its pages to display and operate.
pub trait WheelView: Send {
    /// The effects that play, and the given torques since the last call.
    fn info(&self) -> WheelInfo;
    /// Sets its pedals and buttons.
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
    /// On the caller's thread: each call of [`crate::Session::poll`] takes the samples that are due.
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

    /// The same loop with external torques; `None` where a board runs it.
    pub fn with_outside(mut self, torques: Outside) -> Option<Self> {
        match &mut self.backend {
            #[cfg(not(target_family = "wasm"))]
            Backend::Local { outside, .. } => *outside = torques,
            Backend::Stepped { outside, .. } => *outside = torques,
            #[cfg(not(target_family = "wasm"))]
            Backend::Board { .. } => return None,
        }
        Some(self)
    }

    /// Clears the fault of an earlier session on a board; `None`: there was none. A loop of this computer starts without one.
    ///
    /// # Errors
    /// The board refuses to clear it.
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
