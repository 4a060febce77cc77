//! The passive hand that draws most energy from a loop: the other side of the certificate.
//!
//! A certificate says that no passive hand can draw energy. Here a hand is looked for that does: masses, springs and dampers, and such
//! that open and take hold again. What the linear loop does with a hand is exact ([`hapt_analysis::worst_grip`]); what the whole loop
//! does with it, limit, counts, friction and walls among it, is a run on the exact simulation, and its ledger ([`drawn`]).
//!
//! * [`search`] is the whole answer on one world: a [`Worst`].
//! * [`Hand`] is a hand with the kick that it begins with, and the scenario that shows it.
//! * [`Motion`] is what a hand does against counts, levels and samples, where no grip draws anything: a path that it prescribes.
//! * [`Drawn`] is what a run's ledger says of the energy that the hand has had from the loop.
//!
//! A certified world has to survive. A refused one should fall; where it does not, what is between the certificate and the worst
//! hand found is the gap that [`Worst::gap`] gives.
// No law, method or estimator falls into an arm for the rest.
#![warn(clippy::wildcard_enum_match_arm)]

mod drawn;
mod hand;
mod motion;
mod search;

pub use drawn::{Drawn, drawn};
pub use hand::Hand;
pub use motion::{Motion, Trick};
pub use search::{Error, FILE, Gap, Moved, Worst, best_motion, most_runs, search, search_seen};
