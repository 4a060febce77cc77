//! The verdict on passivity, and what it leaves unproved.

use hapt_model::World;
use serde::Serialize;

use crate::error::Error;
use crate::passivity::proof;
use crate::passivity::required::{Cause, found};

/// The answer on passivity.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Passivity {
    /// The least device damping, N·m·s/rad (linear: N·s/m); `None` where no finite damping will do.
    pub required_damping: Option<f64>,
    /// What the device has.
    pub device_damping: f64,
    /// The lowest frequency that asks for all of it; 0 when it is approached toward 0, `None` when all ask for the same.
    pub at_hz: Option<f64>,
    /// Whether the device has enough.
    pub passive: bool,
    /// Whether the verdict holds for the whole loop, not only for its linear part.
    pub proved: bool,
    /// Why not, a sentence each.
    pub not_proved: Vec<String>,
    /// Why `required_damping` is `None`.
    #[serde(skip)]
    pub cause: Option<Cause>,
}

/// Whether a world's loop is passive on its device against every passive hand.
///
/// # Errors
/// [`Error::InFlight`] for a delay of too many periods, [`Error::Search`], and as [`crate::held()`].
pub fn passivity(world: &World) -> Result<Passivity, Error> {
    let found = found(world)?;
    let required_damping = found.damping.ok();
    let device_damping = world.device.damping;
    let passive = required_damping.is_some_and(|b| b <= device_damping);
    let not_proved = proof::missing(world, &found)?;
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
