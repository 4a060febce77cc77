//! Torques whose work the device's friction takes, whatever their law (docs/theory.md, (T76)).
//!
//! A coupling between puck and ground whose torque never exceeds L gives at most L times the path, and Coulomb friction of L takes as much. So a
//! world is as passive as it is without the coupling on a device with that much less friction: for any law, estimator, delay, hold and lag
//! of the coupling, and with a motor that saturates too, since a clipped sum differs from the clipped rest by no more than L.

use std::borrow::Cow;

use hapt_model::{Coupling, Law, World};

use crate::equations::laws::{self, Kind, most};

/// The largest torque of a coupling between puck and ground that no theorem but (T76) covers: friction, an integral term, a compensation of friction, a torque
/// along the acceleration with a limit. `None` of any other. The torque of an integral term without a limit has no bound.
fn torque(coupling: &Coupling) -> Option<f64> {
    let is_covered = match Kind::of(coupling) {
        Kind::Coulomb | Kind::Assist => true,
        Kind::Integral => laws::integral_gain(&coupling.law) > 0.0,
        Kind::Acceleration => coupling.limit.is_some(),
        Kind::Linear | Kind::Constant | Kind::Potential | Kind::Lugre => false,
    };
    (is_covered && laws::at_puck(coupling) && !laws::at_body(coupling)).then(|| most(coupling))
}

/// The sum of such torques, N·m (linear: N); infinite where one has no bound.
pub(crate) fn taken(couplings: &[Coupling]) -> f64 {
    couplings.iter().filter_map(torque).sum()
}

/// The world that the claim is about: without the couplings that friction takes, on the friction that they leave. The world itself where there
/// are none, where the friction is less, or where the origin of the world slips: it follows their torque, so that the rest does not depend
/// only on the position.
pub(crate) fn beyond_friction(world: &World) -> Cow<'_, World> {
    let taken = taken(&world.couplings);
    let friction = world.device.least_friction();
    let is_there = world.couplings.iter().any(|coupling| torque(coupling).is_some());
    if !is_there || taken > friction || world.sampling.recentre.is_some() {
        return Cow::Borrowed(world);
    }
    let mut rest = world.clone();
    // Replaced in place, so that the other couplings keep their indices.
    for coupling in rest.couplings.iter_mut().filter(|coupling| torque(coupling).is_some()) {
        *coupling = Law::Constant { torque: 0.0 }.between(coupling.first, coupling.second);
    }
    if taken > 0.0 {
        rest.device.set_friction(friction - taken);
    }
    Cow::Owned(rest)
}

/// The part of a world that decides whether it grows hands-off, where the friction of every device within its tolerances takes torques of the
/// world; `None` where it takes none. They keep no large motion going, and eigenvalues, which have no friction, say nothing about
/// small ones.
pub(crate) fn beyond_least_friction(world: &World) -> Option<World> {
    let mut least = world.clone();
    least.device.set_friction(world.device.friction_range()[0]);
    match beyond_friction(&least) {
        Cow::Owned(rest) => Some(rest),
        Cow::Borrowed(_) => None,
    }
}
