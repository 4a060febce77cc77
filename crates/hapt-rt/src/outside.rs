//! Torques on the puck that do not come from the world.

use hapt_core::ExternalTorqueInput;

use crate::{EffectsPort, LinkPort};

/// Torques on the puck from outside of the loop's world.
#[derive(Default)]
pub struct Outside {
    /// Its ends of links to other stations.
    pub links: Vec<LinkPort>,
    /// What a host plays on a wheel for games.
    pub effects: Option<Box<EffectsPort>>,
}

impl Outside {
    /// Those of links.
    pub fn linked(links: Vec<LinkPort>) -> Self {
        Outside { links, ..Outside::default() }
    }

    /// Those of a host's effects.
    pub fn playing(effects: EffectsPort) -> Self {
        Outside { effects: Some(Box::new(effects)), ..Outside::default() }
    }

    /// Whether there are none.
    pub fn is_none(&self) -> bool {
        self.links.is_empty() && self.effects.is_none()
    }

    /// Their sum in the sample that is taken at `now`, in ns by the loop's clock.
    pub(crate) fn sample(&mut self, beside: ExternalTorqueInput<f64>, now: u64) -> f64 {
        let links: f64 = self.links.iter_mut().map(|port| port.sample(&beside, now)).sum();
        let beside = ExternalTorqueInput { torque: beside.torque + links, ..beside };
        // A page has no host, and its program stays small.
        let effects = self.effects.as_mut().filter(|_| !cfg!(target_family = "wasm"));
        links + effects.map_or(0.0, |effects| effects.sample(beside, now))
    }
}
