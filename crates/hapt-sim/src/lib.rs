//! The exact device between the samples, the hand that moves it, and the run as a stream of rows.
//!
//! [`Simulation`] runs one scenario of a world: the loop is hapt-core's own, unchanged, and between its samples the physical
//! puck moves exactly. [`Row`] is what it says at each sample; [`Summary`] is what remains of a run that is not written down;
//! [`CsvWriter`] writes it. Names, units and order of all columns come from one table, [`SIGNALS`].
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

// No law, method or estimator falls into an arm for the rest.
#![warn(clippy::wildcard_enum_match_arm)]

mod control;
mod csv;
mod energy;
mod row;
mod run;
mod side;
mod summary;

pub use control::{DesktopController, DesktopControllerState, DesktopLoop, DesktopState, DesktopSupervisor};
pub use csv::CsvWriter;
pub use energy::{Lent, world_energy};
pub use hapt_plant::{Grip, Ledger, Motor, Script, VirtualDevice};
pub use row::{BODY_SIGNALS, Column, Measures, Row, SIGNALS, Signal, columns};
pub use run::{Error, Simulation, check, rows, script};
pub use side::{Outcome, SIDE, side_by_side};
pub use summary::Summary;
