//! What the ends of a link keep to.

use hapt_core::LinkTerms;

use crate::kinds::Motion;
use crate::network::Network;

/// What brings ends together is this part of what motors and links can do at most.
const SOFT: f64 = 0.1;

impl Network {
    /// The terms of a link's end, at its first station (`side` 0) or its second: the largest age, how long a torque is held there, how often the
    /// other end sends, and the torque with which ends that are apart are brought together: a tenth of the link's `limit` and of both
    /// motors', and no more than the link's stiffness times 0.05 rad (linear: 5 mm).
    ///
    /// # Panics
    /// There is no such link.
    pub fn end(&self, link: usize, side: usize) -> LinkTerms {
        let link = &self.links[link];
        let [own, other] = [side, 1 - side].map(|side| &self.stations[link.between[side]]);
        let apart = match self.motion {
            Motion::Rotary => 0.05,
            Motion::Linear => 5e-3,
        };
        let limits = [link.limit, own.world.device.limit, other.world.device.limit];
        let soft = limits.into_iter().flatten().map(|limit| SOFT * limit).fold(apart * link.stiffness(), f64::min);
        LinkTerms {
            age_max: link.age_max,
            hold: own.hold(),
            period: link.period.unwrap_or(other.world.sampling.period),
            soft,
        }
    }
}
