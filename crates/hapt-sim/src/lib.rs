//! The exact device between the samples, the hand that moves it, and the run as a stream of rows.
//!
//! [`Run`] runs one scenario of a system, and gives the rows of its stations; [`Simulation`] is the run of a single world. The loop is
//! hapt-core's own, unchanged, and between its samples the physical puck moves exactly. [`Row`] holds every signal at a sample.
//! [`SystemSummary`] reduces a run to a few numbers, with a [`Summary`] for each station; [`CsvWriter`] writes the rows. Names, units and
//! meanings of all columns come from one list, [`Signal`]; [`SIGNALS`] are those of a run, in the order of the columns.
//!
//! ```
//! use hapt_model::{Source, World};
//! use hapt_sim::{Simulation, Summary};
//!
//! let file = r#"
//! [loop]
//! period = "1 ms"
//!
//! [device]
//! inertia = "6.4e-4 kg m^2"
//!
//! [bodies.wheel]
//! inertia = "0.0258 kg m^2"
//!
//! [[couplings]]
//! kind = "spring"
//! between = ["puck", "wheel"]
//! stiffness = "17.8 N mm/deg"
//!
//! [scenarios.step]
//! duration = "1 s"
//! hand = { kind = "step", to = "45 deg" }
//! "#;
//! let world = World::read(&Source::from_text("wheel.toml", file), &[])?;
//! let mut run = Simulation::new(&world, world.scenario("step")?)?;
//! let mut summary = Summary::new(&world, &run);
//! while let Some(row) = run.next() {
//!     summary.add(row?);
//! }
//! assert_eq!(summary.rows, 1001);
//! assert!((summary.peak_torque - 0.801).abs() < 1e-3); // N·m: 17.8 N·mm/deg over 45 deg
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

// Matches on laws, methods and estimators are exhaustive: no default arm.
#![warn(clippy::wildcard_enum_match_arm)]

mod batch;
mod channel;
mod control;
mod csv;
mod energy;
mod growth;
mod row;
mod run;
mod schedule;
mod summary;
mod system;

pub use batch::{LANES, Outcome, run_batch};
pub use channel::Channel;
pub use control::{DesktopController, DesktopControllerState, DesktopLoop, DesktopState, DesktopSupervisor};
pub use csv::CsvWriter;
pub use energy::{DelayWork, world_energy};
pub use hapt_plant::{Grip, Ledger, Motor, Script, VirtualDevice};
pub use row::{BODY_SIGNALS, Column, Measures, Row, RowSignal, SIGNALS, Signal, body_columns, columns, loop_columns};
pub use run::{Error, Simulation, check, rows, script};
pub use schedule::uniform;
pub use summary::{Summary, SystemSummary};
pub use system::{Run, StationRow, station_columns};
