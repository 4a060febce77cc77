//! The certificate of a system: of a world file that of its world, of a network that of its stations and links.

use hapt_model::{Station, System};
use serde::Serialize;

use super::{NetworkCheck, check_network};
use crate::certificate::check::{Check, check};
use crate::certificate::proposal::{Proposal, proposal};
use crate::certificate::remedies::remedies;
use crate::error::Error;

/// The result of `hapt check` on a system. It serialises to the output of `hapt check --json`, where a world's fields are at the top level.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum SystemCheck {
    /// Of a world file.
    World(Box<Check>),
    /// Of a network.
    Network(Box<NetworkCheck>),
}

/// The certificate of a system, with the remedies of its worlds, and of its links, where they are `wanted`.
///
/// # Errors
/// As [`check`] and [`remedies`] of a station's world.
pub fn check_system(system: &System, wanted: bool) -> Result<SystemCheck, Error> {
    match system.world() {
        Some(world) => {
            let mut check = check(world)?;
            check.remedies = wanted.then(|| remedies(world)).transpose()?;
            Ok(SystemCheck::World(Box::new(check)))
        }
        None => Ok(SystemCheck::Network(Box::new(check_network(system)?.with_remedies(system, wanted)?))),
    }
}

impl SystemCheck {
    /// Whether the system is certified.
    pub fn is_certified(&self) -> bool {
        match self {
            SystemCheck::World(check) => check.certified.holds(),
            SystemCheck::Network(check) => check.certified,
        }
    }

    /// The remedies of a world as lines for its file; `None` of a network, whose certificate has its own, and where they were left out.
    /// `system` is the one whose certificate this is.
    ///
    /// # Errors
    /// As [`proposal`].
    pub fn proposal(&self, system: &System) -> Result<Option<Proposal>, hapt_model::Error> {
        let SystemCheck::World(check) = self else { return Ok(None) };
        let Some(found) = &check.remedies else { return Ok(None) };
        let Station { world, source, sets, .. } = &system.stations[0];
        proposal(world, source, sets, check, found)
    }

    /// As `hapt check` prints it under a title; with `why` the reasons why something is not proved, and notes.
    ///
    /// # Errors
    /// As [`SystemCheck::proposal`].
    pub fn text(&self, system: &System, title: &str, why: bool) -> Result<String, hapt_model::Error> {
        let proposal = self.proposal(system)?;
        Ok(match self {
            SystemCheck::World(check) => check.text(title, &system.stations[0].world.sampling, proposal.as_ref(), why),
            SystemCheck::Network(check) => check.text(title, why),
        })
    }
}
