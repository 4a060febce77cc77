//! Logs of haptic loops, as MCAP files that Foxglove and PlotJuggler open as they are.
//!
//! A log is one channel, `/hapt/sample`, with one message a sample: a Protocol Buffers message whose fields are the columns of the
//! CSV files ([`columns`]), doubles with all of their bits. It includes the world, and for a loop in real time all inputs of the loop, so
//! that [`replay`] can run them through the present core and compare the torques bit by bit. A log that begins in the middle of a
//! session contains the loop's state there.
//!
//! * [`LogWriter`] writes runs of the simulation and records of the loop, in chunks that are complete or absent.
//! * [`Recorder`] does that on a thread of lower priority, for which the loop never waits.
//! * [`Log`] reads a log, up to its end or to the point where it was cut.
//!
//! ```
//! use hapt_log::{Header, Log, LogWriter, Origin, replay};
//! use hapt_model::{Source, World};
//! use hapt_sim::Simulation;
//!
//! let file = r#"
//! loop.period = "1 ms"
//! device.inertia = "6.4e-4 kg m^2"
//! [bodies.wheel]
//! inertia = "0.0258 kg m^2"
//! [[couplings]]
//! kind = "spring"
//! between = ["puck", "wheel"]
//! stiffness = "17.8 N mm/deg"
//! [scenarios.step]
//! duration = "1 s"
//! hand = { kind = "step", to = "45 deg" }
//! "#;
//! let world = World::read(&Source::from_text("wheel.toml", file), &[])?;
//! let header = Header { world_text: file.into(), device: "sim".into(), ..Header::default() };
//! let mut writer = LogWriter::new(Vec::new(), &world, &header, Origin::Run)?;
//! let mut run = Simulation::new(&world, world.scenario("step")?)?;
//! while let Some(row) = run.next() {
//!     writer.write_row(row?)?;
//! }
//! let bytes = writer.finish()?;
//!
//! let mut log = Log::read(&bytes[..])?;
//! let same = replay(&mut log)?;
//! assert_eq!((same.compared, same.first), (1001, None));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]
// Every match names all variants, so that a new one does not compile by default.
#![warn(clippy::wildcard_enum_match_arm)]

mod board;
mod comparison;
mod complete;
mod container;
mod descriptor;
mod error;
mod log;
mod mcap_writer;
mod recorder;
mod replay;
mod schema;
mod state;
mod wire;
mod writer;

pub use board::inputs;
pub use comparison::{Difference, Replay};
pub use container::Ending;
pub use descriptor::descriptor;
pub use error::Error;
pub use log::{Inputs, Log, LoggedPlan, Sample, is_log};
pub use recorder::{RECORDED, Recorder, RecorderState, Summary, is_recorded};
pub use replay::replay;
pub use schema::{Choice, Column, Kind, columns};
pub use writer::{Header, LogWriter, Origin, TOPIC};
