//! One sample of a haptic loop: sense, advance the virtual world, torque, limit.
//!
//! Two types do the work. A [`Loop`] is a world compiled once from a [`Spec`]: the method's rule has become matrices, so that
//! one small step serves every method and every linear world, and the walls, detents and frictions are added to them. A
//! [`State`] is everything that changes, one `Copy` struct of named fields in SI: keep it, replay it, run it twice.
//!
//! ```
//! use hapt_core::{Body, Coupling, End, Estimator, Law, Loop, Method, Output, Spec};
//!
//! // The notes' virtual wheel: 1.0186 N·m/rad and 1 Hz, under forward Euler at 1 ms.
//! let spec = Spec {
//!     period: 1e-3,
//!     method: Method::ForwardEuler,
//!     output: Output::Start,
//!     advance: 0,
//!     bodies_every: 1,
//!     estimator: Estimator::Exact,
//!     filter: None,
//!     count: None,
//!     limit: Some(0.82225),
//!     levels: None,
//!     bodies: &[Body { inertia: 0.0258012, position: 0.0, velocity: 0.0 }],
//!     couplings: &[Coupling {
//!         first: End::Puck,
//!         second: End::Body(0),
//!         law: Law::Spring { stiffness: 1.018592, rest: 0.0 },
//!         limit: None,
//!     }],
//! };
//! // Room for 4 bodies, 8 couplings and a FOAW window of 16; f32 runs as well.
//! let world = Loop::<f64, 4, 8, 16>::new(&spec)?;
//! let mut state = world.start();
//! let sample = world.step(&mut state, 0.7854, 0.0);
//! assert!((sample.torque + 0.8).abs() < 1e-3); // the spring pulls the wheel back
//! # Ok::<(), hapt_core::Error>(())
//! ```
//!
//! The crate allocates nothing, never panics, and calls only libm's mathematics, so that PC, microcontroller and browser
//! agree to the bit. Compilation is in `f64` everywhere and rounds once to the loop's own numbers.
#![no_std]
#![forbid(unsafe_code)]
// Matrices are read by their indices, as on paper.
#![allow(clippy::needless_range_loop)]
// A new law, method, reason or end must be handled at every match: there are no default arms.
#![warn(clippy::wildcard_enum_match_arm)]

mod actuate;
#[cfg(feature = "serde")]
mod array;
mod batch;
mod compile;
mod constants;
mod contact;
mod controller;
mod display;
mod entry;
mod error;
mod gradient;
mod kalman;
mod lanes;
mod law;
mod line;
mod link;
mod matrix;
mod named;
mod nonlinear;
mod real;
mod rules;
mod sense;
pub mod spec;
mod step;
mod supervisor;
mod transfer;
pub mod wheel;

pub use batch::Batch;
pub use constants::{Constants, GROUND, PUCK};
pub use controller::{Controller, ControllerState};
pub use error::Error;
pub use gradient::Contacts;
pub use kalman::kalman_gains;
pub use lanes::Lanes;
pub use link::{LASTING, LinkEnd, LinkTerms, RemoteState, Strength};
pub use matrix::Vector;
pub use real::{Number, Real};
pub use sense::{Memory, Puck, Tracked};
pub use spec::{Body, Coupling, Damping, End, Estimator, HARMONICS, Law, Method, Output, Side, Spec, Waveform};
pub use step::{Loop, Sample, State};
pub use supervisor::{
    CertifiedTime, ExternalTorqueInput, Heat, Limits, Phase, Reading, Reason, Request, SafeOutput, SafetyProfile,
    Supervisor, SupervisorState, WhenLate,
};

/// A hash of this crate's source: programs with the same hash compute the same.
pub const SOURCE: u32 = match u32::from_str_radix(env!("HAPT_CORE_SOURCE"), 16) {
    Ok(hash) => hash,
    Err(_) => 0,
};
