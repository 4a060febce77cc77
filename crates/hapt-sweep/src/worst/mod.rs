//! The passive hand that draws most energy from a loop: the other side of the certificate.
//!
//! A certificate states that no passive hand can draw energy. This search tries to find one that does: masses, springs and dampers, also
//! ones that release and grip again. For the linear loop with a hand the result is exact ([`hapt_analysis::worst_grip`]). For the whole
//! loop, with limit, counts, friction and walls, it is a run on the exact simulation, and its ledger ([`drawn`]).
//!
//! * [`search`] runs the whole search on one world and returns a [`Worst`].
//! * [`Hand`] is a hand with its initial kick, and the scenario that shows it.
//! * [`HandMotion`] is a prescribed path, for worlds from which no grip draws energy: the one for which the motor's work is largest, or one
//!   against counts, levels and samples.
//! * [`work_motion`] is the former of a linear loop, by the largest eigenvalue of the work as a quadratic form of the motion.
//! * [`search_together`] is the search for the hands at all stations of a network, and returns a [`WorstTogether`].
//! * [`Drawn`] is the energy that the hand has drawn from the loop, from a run's ledger.
//!
//! No hand may draw energy from a certified world. Some hand should from a refused one; where none does, [`Worst::gap`] is the distance
//! between the certificate and the worst hand found.

mod drawn;
mod form;
mod hand;
mod motion;
mod moved;
mod network;
mod search;

pub use drawn::{Drawn, drawn};
pub use form::{WorkMotion, work_motion};
pub use hand::Hand;
pub use motion::{Exploit, HandMotion};
pub use moved::{FILE, Moved, best_motion};
pub use network::{DrawnTogether, MOST_TOGETHER, WorstTogether, search_together};
pub use search::{Error, Gap, Watch, Worst, most_runs, search, search_watched};
