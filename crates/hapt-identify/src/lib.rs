//! The parameters of a device from a record of its motion: inertia, viscous damping, Coulomb friction, delay, the motor's lag and sign, and
//! the encoder's counts, each with a 95 % interval.
//!
//! A [`Record`] is positions and commanded torques over time. [`identify`] fits the puck's own differential equation to it,
//!
//! ```text
//! J v̇ = m + τ0 - b v - f sign v,    at rest while |m + τ0| <= f,
//! λ ṁ = τ(t - d) - m,
//! ```
//!
//! solved exactly from one change of torque to the next, every stop and start located ([`Puck`]). The fit is the one with the least sum
//! of squared position errors over the whole record, with damping, friction and delay of 0 or more: the most likely one where the
//! positions carry independent noise.
//!
//! ```
//! use hapt_identify::{Known, Record, identify};
//!
//! // A square wave of torque on J = 1e-3 kg m², with a little friction; the positions are those of the solution, in counts.
//! let period = 1e-3;
//! let torque = |k: usize| if (k / 170) % 2 == 0 { 0.05 } else { -0.04 };
//! let puck = hapt_identify::Puck { gain: 1e3, damping: 2.0, friction: 5.0, delay: 2.3e-3, offset: 0.0, position: 0.0, velocity: 0.0, lag: 0.0 };
//! let times: Vec<f64> = (0..3000).map(|k| k as f64 * period).collect();
//! let torques: Vec<f64> = (0..3000).map(torque).collect();
//! let truth = puck.positions(&times, &torques);
//! let count = std::f64::consts::TAU / 4000.0;
//! let noise = |k: usize| ((k * 7919 % 1000) as f64 / 1000.0 - 0.5) * 2.0 * count;
//! let seen = truth.iter().enumerate().map(|(k, z)| ((z + noise(k)) / count).round() * count).collect();
//!
//! let found = identify(&Record::new(times, seen, torques)?, &Known::default())?;
//! let inertia = found.inertia.unwrap();
//! assert!(inertia.low < 1e-3 && 1e-3 < inertia.high, "{inertia:?}");
//! assert_eq!(found.counts.unwrap().value, 4000.0);
//! # Ok::<(), hapt_identify::Error>(())
//! ```
#![forbid(unsafe_code)]
// Every match names all variants, so that a new one does not compile by default.
#![warn(clippy::wildcard_enum_match_arm)]

mod against;
mod arrivals;
mod best;
mod bound;
mod columns;
mod counts;
mod device;
mod equation;
mod error;
mod estimate;
mod experiment;
mod explained;
mod factor;
mod fit;
mod handle;
mod identified;
mod interval;
mod intervals;
mod json;
mod lag;
mod lagging;
mod long_run;
mod mat;
mod misfit;
mod multiples;
mod noise;
mod position;
mod predicted;
mod puck;
mod quantile;
mod record;
mod remainder;
mod ringing;
mod shaft;
mod spectrum;
mod start;
mod stretch;
mod terms;
mod torque;
mod warnings;

pub use against::{Claims, Compared, Comparison, Verdict, against, against_until};
pub use columns::{Columns, Read, Scale, text_of};
pub use counts::{Lattice, lattice};
pub use equation::Errors;
pub use error::{Error, LargeResidual};
pub use estimate::{identify, identify_until, identify_with};
pub use experiment::{Bounds, Push};
pub use handle::{WithHandle, identify_handle, identify_handle_until};
pub use identified::{CorrelatedPair, FoundStops, FoundStribeck, Identified, Known, PositionTorque, Residual};
pub use interval::Interval;
pub use mat::{MatTable, is_mat, mat_table};
pub use misfit::{Kind, Misfit, Part};
pub use predicted::PREDICTION_S;
pub use puck::{Puck, Sensitivity};
pub use record::{LONGEST_DELAY, Record};
pub use terms::{Term, TermKind};
#[doc(hidden)]
pub use torque::fit_torque_by;
pub use torque::{BestFit, TorqueFit, Window, fit_torque, fit_torque_until};
