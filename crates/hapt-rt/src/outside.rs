//! External torques on the puck, in addition to the world's.

use hapt_core::ExternalTorqueInput;

use crate::{EffectsPort, LinkPort};

/// External torques on the puck, in addition to those of the loop's world.
#[derive(Default)]
pub struct Outside {
    /// Its ends of links to other stations.
    pub links: Vec<LinkPort>,
    /// The effects that a host plays on a game wheel.
    pub effects: Option<Box<EffectsPort>>,
}

impl Outside {
    /// The torques of links.
    pub fn linked(links: Vec<LinkPort>) -> Self {
        Outside { links, ..Outside::default() }
    }

    /// The torque of a host's effects.
    pub fn playing(effects: EffectsPort) -> Self {
        Outside { effects: Some(Box::new(effects)), ..Outside::default() }
    }

    /// Whether there are none.
    pub fn is_none(&self) -> bool {
        self.links.is_empty() && self.effects.is_none()
    }

    /// Their sum in the sample that is taken at `now`, in ns by the loop's clock.
    pub(crate) fn sample(&mut self, input: ExternalTorqueInput<f64>, now: u64) -> f64 {
        let links: f64 = self.links.iter_mut().map(|port| port.sample(&input, now)).sum();
        let input = ExternalTorqueInput { torque: input.torque + links, ..input };
        // The page has no host; leaving this out keeps its program small.
        let effects = self.effects.as_mut().filter(|_| !cfg!(target_family = "wasm"));
        links + effects.map_or(0.0, |effects| effects.sample(input, now))
    }
}
