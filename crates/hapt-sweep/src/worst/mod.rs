//! The passive hand that draws most energy from a loop: a test of the certificate by counterexamples.
//!
//! A certificate states that no passive hand can draw energy. This search tries to find one that does: masses, springs and dampers, also
//! ones that release and grip again. For the linear loop with a hand the result is exact ([`hapt_analysis::worst_grip`]). For the whole
//! loop, with limit, counts, friction and walls, it is a run on the exact simulation, and its ledger ([`drawn`]).
//!
//! * [`search`] runs the whole search on a system and returns a [`Worst`]: of a world the hand of [`search_world`], of a network those of
//!   [`search_network`], one at each station.
//! * [`Hand`] is a hand with its initial kick, and the scenario that shows it.
//! * [`HandMotion`] is a prescribed path, for worlds from which no grip draws energy: the one for which the motor's work is largest, or one
//!   against counts, levels and samples.
//! * [`work_motion`] is the former of a linear loop, by the largest eigenvalue of the work as a quadratic form of the motion.
//! * [`Drawn`] is the energy that the hand has drawn from the loop, from a run's ledger.
//!
//! No hand may draw energy from a certified world. From a refused world some hand should; where none does, [`WorstOfWorld::gap`] is the distance
//! between the certificate and the worst hand found.

mod drawn;
mod form;
mod hand;
mod motion;
mod moved;
mod network;
mod search;

use hapt_model::System;
use serde::Serialize;

pub use drawn::{Drawn, drawn};
pub use form::{WorkMotion, work_motion};
pub use hand::Hand;
pub use motion::{Exploit, HandMotion};
pub use moved::{FILE, Moved, best_motion};
pub use network::{DrawnFromNetwork, WorstOfNetwork, search_network};
pub use search::{Error, Gap, Watch, WorstOfWorld, most_runs_of_world, search_world};

/// The worst hands of a system. It serialises to the output of `hapt worst --json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Worst {
    /// Of a world.
    World(Box<WorstOfWorld>),
    /// Of a network.
    Network(Box<WorstOfNetwork>),
}

impl Worst {
    /// Whether hands draw energy.
    pub fn is_broken(&self) -> bool {
        match self {
            Worst::World(worst) => worst.broken,
            Worst::Network(worst) => worst.broken,
        }
    }
}

/// Searches for the passive hands that draw most energy from a system; `watch` may end the search.
///
/// # Errors
/// [`Error`].
pub fn search(system: &System, watch: &Watch<'_>) -> Result<Worst, Error> {
    Ok(match system.world() {
        Some(world) => Worst::World(Box::new(search_world(world, watch)?)),
        None => Worst::Network(Box::new(search_network(system, watch)?)),
    })
}

/// The largest number of runs of [`search`].
///
/// # Errors
/// As [`search`].
pub fn most_runs(system: &System) -> Result<usize, Error> {
    system.world().map_or(Ok(network::MAX_RUNS), most_runs_of_world)
}
