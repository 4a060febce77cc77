//! The fall of a released puck, where gravity or cogging of the device pushes it away.

use hapt_model::{Law, World};

use crate::equations::grip::Grip;
use crate::error::Error;
use crate::stability::MARGINAL;
use crate::stability::free::{Extent, analyse_anchored};

/// How the puck leaves a place where gravity or cogging pushes it away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fall {
    /// The torque that pushes it.
    pub by: &'static str,
    /// The growth of its motion there, in 1/s.
    pub growth_per_s: f64,
    /// The speed that it reaches from rest at most where the loop is passive, in rad/s (linear: m/s): all its energy then comes from that
    /// torque. `None` where the world has more than dampers: other couplings may give energy, too.
    pub speed: Option<f64>,
}

/// The fall of the hands-off puck from where gravity or cogging pushes it away the most; `None` where the springs of the world hold it, or where
/// there is no such torque.
///
/// # Errors
/// As [`crate::free`].
pub(crate) fn fall(world: &World) -> Result<Option<Fall>, Error> {
    let torque = &world.device.torque;
    let steepest = torque.steepest();
    if steepest == 0.0 {
        return Ok(None);
    }
    // An origin that slips lets the springs go slack.
    let slack = world.sampling.recentre.map(|_| World { couplings: Vec::new(), ..world.clone() });
    let growth =
        match analyse_anchored(slack.as_ref().unwrap_or(world), &Grip::default(), -steepest, Extent::Eigenvalues) {
            Ok((found, _)) => found.growth_per_s.filter(|growth| *growth > MARGINAL),
            // It leaves double precision within a sample: no world holds it.
            Err(Error::Eigenvalues { .. }) => Some((steepest / world.device.inertia).sqrt()),
            Err(error) => return Err(error),
        };
    let puck = world.device.inertia * (1.0 - world.device.tolerances.inertia);
    let lightest = world.device.handle.map_or(puck, |handle| puck.min(handle.inertia));
    let by = match (torque.gravity.is_some(), torque.cogging.is_some()) {
        (true, true) => "gravity or cogging",
        (true, false) => "gravity",
        (false, _) => "cogging",
    };
    let damps = world.couplings.iter().all(|c| matches!(c.law, Law::Damper { .. }));
    let speed = damps.then(|| (2.0 * torque.depth() / lightest).sqrt());
    Ok(growth.map(|growth_per_s| Fall { by, growth_per_s, speed }))
}
