//! The verdict on passivity.

use hapt_model::World;
use serde::Serialize;

use crate::error::Error;
use crate::passivity::proof;
use crate::passivity::required::{Cause, linear_requirement};

/// The result of the passivity analysis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Passivity {
    /// The least device damping, N·m·s/rad (linear: N·s/m); `None` where no finite damping suffices.
    pub required_damping: Option<f64>,
    /// The device damping, in the same unit.
    pub device_damping: f64,
    /// The lowest frequency that requires all of it; 0 when it is the limit toward 0, `None` when all frequencies require the same.
    pub at_hz: Option<f64>,
    /// Whether the device damping is sufficient.
    pub passive: bool,
    /// Whether the verdict is proved for the whole loop, not only for its linear part.
    pub proved: bool,
    /// The reasons why it is not proved, one sentence each.
    pub not_proved: Vec<String>,
    /// Why `required_damping` is `None`.
    #[serde(skip)]
    pub cause: Option<Cause>,
}

/// Whether the loop of a world is passive on its device against every passive hand.
///
/// # Errors
/// [`Error::InFlight`] for a delay of too many periods, [`Error::Search`], and as [`crate::held()`].
pub fn passivity(world: &World) -> Result<Passivity, Error> {
    let found = linear_requirement(world)?;
    let required_damping = found.damping.ok();
    let device_damping = world.device.damping;
    let passive = required_damping.is_some_and(|b| b <= device_damping);
    let not_proved = proof::unproved(world, &found, 1.0)?;
    Ok(Passivity {
        required_damping,
        device_damping,
        at_hz: found.at_hz,
        passive,
        proved: not_proved.is_empty(),
        not_proved,
        cause: found.damping.err(),
    })
}
