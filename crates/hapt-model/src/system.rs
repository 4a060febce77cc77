//! What a file describes: a world, or a network of several.

use crate::error::Error;
use crate::keys::Key;
use crate::kinds::Motion;
use crate::network::{Network, is_network};
use crate::source::Source;
use crate::world::World;

/// A world, or a network of worlds that links join: what a sweep, or a boundary, changes the numbers of.
///
/// ```
/// use hapt_model::{Source, System};
///
/// let file = "loop.period = \"1 ms\"\ndevice.inertia = \"6.4e-4 kg m^2\"\n";
/// let mut system = System::read(&Source::from_text("w.toml", file), &[])?;
/// assert!(system.set_number("loop.period", 2e-3) && system.number("loop.period") == Some(2e-3));
/// assert!(!system.set_number("links.0.stiffness", 1.0), "it is a world");
/// # Ok::<(), hapt_model::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum System {
    /// One loop on one device.
    World(Box<World>),
    /// Several of them.
    Network(Network),
}

impl System {
    /// Reads and checks a world, or a network where the file has stations, with the overrides `sets`, each `KEY=VALUE`.
    ///
    /// # Errors
    /// As [`World::read`] and [`Network::read`].
    pub fn read(source: &Source, sets: &[String]) -> Result<System, Error> {
        Ok(match is_network(source) {
            true => System::Network(Network::read(source, sets)?),
            false => System::World(Box::new(World::read(source, sets)?)),
        })
    }

    /// What it is called: "world" or "network".
    pub fn kind(&self) -> &'static str {
        match self {
            System::World(_) => "world",
            System::Network(_) => "network",
        }
    }

    /// What the file calls itself.
    pub fn title(&self) -> Option<&str> {
        match self {
            System::World(world) => world.title.as_deref(),
            System::Network(network) => network.title.as_deref(),
        }
    }

    /// Rotary or linear.
    pub fn motion(&self) -> Motion {
        match self {
            System::World(world) => world.motion,
            System::Network(network) => network.motion,
        }
    }

    /// The scenarios' names.
    pub fn scenarios(&self) -> Vec<&str> {
        match self {
            System::World(world) => world.scenarios.iter().map(|scenario| scenario.name.as_str()).collect(),
            System::Network(network) => network.scenarios(),
        }
    }

    /// As [`World::key`] and [`Network::key`].
    pub fn key(&self, path: &str) -> Option<&'static Key> {
        match self {
            System::World(world) => world.key(path),
            System::Network(network) => network.key(path),
        }
    }

    /// As [`World::number`] and [`Network::number`].
    pub fn number(&self, path: &str) -> Option<f64> {
        match self {
            System::World(world) => world.number(path),
            System::Network(network) => network.number(path),
        }
    }

    /// As [`World::set_number`] and [`Network::set_number`].
    pub fn set_number(&mut self, path: &str, value: f64) -> bool {
        match self {
            System::World(world) => world.set_number(path, value),
            System::Network(network) => network.set_number(path, value),
        }
    }
}
