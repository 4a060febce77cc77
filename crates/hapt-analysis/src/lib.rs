//! The laboratory: what a world does when its loop runs, computed from its differential equations and never by running the
//! loop. The loop and this crate share plain data only, so that a test which compares them compares two derivations.
//!
//! * [`check()`] is the whole answer on one world: eigenvalues, growth, critical period, modes, passivity, notes.
//! * [`Continuous`] holds the equations of motion, [`Discrete`] one sample of them under a method.
//! * [`held()`] and [`free()`] are its two halves: the bodies while the puck stands, and the whole loop let go.
//! * [`Loops`] are many held loops of one body, asked at once; [`Wheels`] those of one world with other numbers.
//! * [`Design`] and [`closed_form`] are the notes' wheel on a spring: its specification, and what it does exactly.
//!
//! Everything is f64 and SI. Equation numbers such as (2.14) are those of J. S. Freudenberg, "Notes on the Virtual Spring
//! Mass System", EECS 461, 2008.
//!
//! ```
//! use hapt_analysis::Design;
//!
//! // 45 degrees and 800 N mm at 1 Hz, 1 ms: the notes' wheel (section 2.1).
//! let wheel = Design::new(std::f64::consts::FRAC_PI_4, 0.8, 1.0, 1e-3)?;
//! assert!((wheel.stiffness - 1.018592).abs() < 1e-6);
//! assert!((wheel.inertia - 0.02580123).abs() < 1e-8);
//! # Ok::<(), hapt_analysis::Error>(())
//! ```
#![forbid(unsafe_code)]
// No law, method or estimator falls into an arm for the rest.
#![warn(clippy::wildcard_enum_match_arm)]

pub mod batch;
pub mod boundary;
pub mod certificate;
pub mod design;
pub mod equations;
pub mod error;
pub mod impedance;
pub mod numerics;
pub mod passivity;
pub mod stability;

mod text;

pub use batch::loops::{Loops, sign};
pub use batch::worlds::{Number, Wheels};
pub use boundary::d_decomposition::{Decomposition, Keys, Line};
pub use boundary::z_width::{self, ZWidth, z_width};
pub use certificate::check::{Check, check, quick_check};
pub use certificate::is_certified;
pub use certificate::proposal::{self, Proposal, Remedy, proposal};
pub use certificate::remedies::{Remedies, remedies};
pub use design::{Design, closed_form};
pub use equations::continuous::{self, Continuous, Slopes};
pub use equations::delay::IN_FLIGHT;
pub use equations::discrete::Discrete;
pub use equations::grip::Grip;
pub use error::Error;
pub use impedance::rendered::{Elements, Felt};
pub use numerics::eigenvalues::eigenvalues;
pub use numerics::nelder_mead;
pub use passivity::quantisation::{Quantisation, quantisation};
pub use passivity::worst_grip::{Breaking, Worst, breaking_damping, worst_grip};
pub use passivity::{Cause, Passivity, passivity, required_damping};
pub use stability::critical::Critical;
pub use stability::free::{free, free_eigenvalues, free_growth, gripped_growth, shortest_period};
pub use stability::held::{held, held_eigenvalues, held_growth, multipliers};
pub use stability::{MARGINAL, Stability, Verdict};
