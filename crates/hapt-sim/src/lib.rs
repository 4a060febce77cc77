//! The exact device between the samples, the hand that moves it, and the run as a stream of rows.
//!
//! [`Simulation`] runs one scenario of a world: the loop is hapt-core's own, unchanged, and between its samples the physical
//! puck moves exactly. [`Row`] is what it says at each sample; [`Summary`] is what remains of a run that is not written down;
//! [`CsvWriter`] writes it. Names, units and order of all columns come from one table, [`SIGNALS`].

mod csv;
mod curve;
mod energy;
mod hand;
mod plant;
mod puck;
mod row;
mod run;
mod summary;

pub use csv::CsvWriter;
pub use energy::{Ledger, world_energy};
pub use row::{BODY_SIGNALS, Column, Measures, Row, SIGNALS, Signal, columns};
pub use run::{DesktopLoop, Error, Simulation, rows};
pub use summary::Summary;
