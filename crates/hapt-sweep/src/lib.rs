//! Parameter studies of worlds and networks: grids of their numbers, boundaries in the plane of two keys, and the worst passive hand.
//!
//! * [`Grid`] holds the axes, each a key of the world file with its values, and their combinations, the cells.
//! * [`Measure`] is a number of a cell: peaks, energies and settling of a run, growth and damping of the loop.
//! * [`Sweep`] is a grid of a world or network with its measures: [`Sweep::rows`] computes a stretch of cells on all cores, in the order of
//!   the table, bit-identical for any number of threads.
//! * [`boundary`] finds the edges of stability and passivity in the plane of two keys, without a grid.
//! * [`worst`] searches for the passive hand that draws most energy from a loop.
//! * [`table`] names the columns and writes them as CSV.
//!
//! ```
//! use hapt_model::Source;
//! use hapt_sweep::{Measure, Sweep};
//!
//! let file = r#"
//! loop.period = "1 ms"
//! loop.method = "forward-euler"
//! device.inertia = "6.4e-4 kg m^2"
//! [bodies.wheel]
//! inertia = "0.0258 kg m^2"
//! [[couplings]]
//! kind = "spring"
//! between = ["puck", "wheel"]
//! stiffness = "17.8 N mm/deg"
//! "#;
//! let source = Source::from_text("wheel.toml", file);
//! let axes = ["loop.period=1ms..10ms:10".to_string()];
//! let sweep = Sweep::new(&source, &[], &axes, &[Measure::HeldGrowth], None)?;
//! let rows = sweep.rows(0..sweep.cells());
//! // Forward Euler's growth is very nearly in proportion to the period: ln(1 + (ωT)²)/(2T).
//! let growth = |cell: usize| rows[cell][1].unwrap();
//! assert!((growth(9) / growth(0) - 10.0).abs() < 0.05);
//! # Ok::<(), hapt_sweep::Error>(())
//! ```
#![forbid(unsafe_code)]
// Every match names all variants, so that a new one does not compile by default.
#![warn(clippy::wildcard_enum_match_arm)]

mod axis;
pub mod boundary;
mod error;
mod shard;
mod sweep;
pub mod worst;

pub use axis::{Axis, Grid, Ticks};
pub use boundary::Boundary;
pub use error::Error;
pub use shard::Shard;
pub use sweep::{Lines, Measure, Rows, Sweep, table};
