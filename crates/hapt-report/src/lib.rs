//! A world or network and its runs as figures and pages.
//!
//! * [`Report`] is a system's page: diagram, verdict, eigenvalues, growth against period, and for each [`Run`] motion, torque
//!   and energy over time. Its figures are also files ([`Drawing`]), and several systems have an index ([`index_page`]).
//!   Of a network of stations it has the links too.
//! * [`ConformanceReport`] shows how a force-feedback wheel renders each effect.
//! * [`Traces`] holds a run's signals for drawing, from the simulation or, by [`read_csv`], from a file.
//! * [`Figure`](figure::Figure) is a figure as plain data; [`svg`](figure::Figure::svg) renders it.
//! * [`PlotScript`] makes the runs' figures on a page interactive: they can be panned and zoomed. Without it, and without JavaScript, they
//!   are static.
//!
//! A run is reduced to its [`Extremes`] while it streams: the memory does not depend on its length, and no peak disappears.
#![forbid(unsafe_code)]
// Every match names all variants, so that a new one does not compile by default.
#![warn(clippy::wildcard_enum_match_arm)]

mod conformance;
mod csv;
mod diagram;
mod extremes;
pub mod felt;
pub mod figure;
mod index;
mod map;
mod network;
mod page;
#[cfg(feature = "usvg")]
mod picture;
mod recorded;
mod run;
pub mod stability;
mod style;
mod svg;
pub mod ticks;
mod traces;
mod units;

pub use conformance::{ConformanceCase, ConformanceReport};
pub use csv::{CsvError, read_csv};
pub use diagram::{Diagram, diagram};
pub use extremes::{Extremes, Point, Stretches};
pub use index::{index_drawings, index_page};
pub use map::{Map, Scale};
pub use page::{Drawing, Report};
#[cfg(feature = "usvg")]
pub use picture::Picture;
#[cfg(feature = "pdf")]
pub use picture::pdf;
#[cfg(feature = "png")]
pub use picture::png;
pub use recorded::PlotScript;
pub use run::Run;
pub use style::STYLE;
pub use svg::{Paper, Width};
pub use traces::{Envelope, Signal, Traces};
