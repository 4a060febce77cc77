//! The loop in a hand that holds its end still.
//!
//! Without a handle the hand holds the puck, and what remains are the bodies: [`held`]. With a handle on a shaft it holds the handle, and
//! the puck still moves: the free loop with the shaft as a spring and a damper from the puck to ground.

use hapt_model::{Handle, World};

use crate::equations::grip::Grip;
use crate::error::Error;
use crate::stability::free::{Extent, analyse};
use crate::stability::held::{held, held_eigenvalues, held_growth};
use crate::stability::{Eigenvalue, NOT_SEARCHED, Stability};

/// Only the bodies, whose step is several periods where they do not step at every sample.
fn of_bodies(world: &World) -> Result<Stability, Error> {
    let sampling = &world.sampling;
    let found = held(&world.bodies, &world.couplings, sampling.method, sampling.step())?;
    let critical_period_s = found.critical_period_s.map(|step| step / f64::from(sampling.bodies_every));
    Ok(Stability { critical_period_s, ..found })
}

/// The world without its handle, and the shaft as a hand on the puck; `None` without a handle.
fn clamped(world: &World) -> Option<(World, Grip)> {
    let Handle { stiffness, damping, .. } = world.device.handle?;
    let mut without_handle = world.clone();
    without_handle.device.handle = None;
    Some((without_handle, Grip { inertia: 0.0, damping, stiffness }))
}

/// Eigenvalues, growth, critical period and modes with the puck held, or with a handle on a shaft the handle.
///
/// # Errors
/// As [`held`], with a handle as [`crate::free()`].
pub fn held_world(world: &World) -> Result<Stability, Error> {
    match clamped(world) {
        None => of_bodies(world),
        Some((without_handle, shaft)) => analyse(&without_handle, &shaft, Extent::Whole),
    }
}

/// As [`held_world`]; with a handle without the search for the critical period, whose reason is then [`NOT_SEARCHED`].
///
/// # Errors
/// As [`held_world`].
pub(crate) fn held_world_at_this_period(world: &World) -> Result<Stability, Error> {
    match clamped(world) {
        None => of_bodies(world),
        Some((without_handle, shaft)) => {
            let found = analyse(&without_handle, &shaft, Extent::ThisPeriod)?;
            Ok(Stability { critical_period_s: None, critical_period_reason: Some(NOT_SEARCHED), ..found })
        }
    }
}

/// Only the growth of [`held_world`], in 1/s.
///
/// # Errors
/// As [`held_world`].
pub fn held_world_growth(world: &World) -> Result<Option<f64>, Error> {
    match clamped(world) {
        None => held_growth(&world.bodies, &world.couplings, world.sampling.method, world.sampling.step()),
        Some((without_handle, shaft)) => Ok(analyse(&without_handle, &shaft, Extent::Eigenvalues)?.growth_per_s),
    }
}

/// Only the eigenvalues of [`held_world`].
///
/// # Errors
/// As [`held_world`].
pub fn held_world_eigenvalues(world: &World) -> Result<Vec<Eigenvalue>, Error> {
    match clamped(world) {
        None => held_eigenvalues(&world.bodies, &world.couplings, world.sampling.method, world.sampling.step()),
        Some((without_handle, shaft)) => Ok(analyse(&without_handle, &shaft, Extent::Eigenvalues)?.eigenvalues),
    }
}
