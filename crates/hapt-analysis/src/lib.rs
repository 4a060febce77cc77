//! Stability, passivity and impedance of a haptic loop, computed from its equations without running it.
//!
//! This crate shares only plain data with the loop in hapt-core. A test that compares the two therefore compares two independent
//! derivations.
//!
//! | folder | contents |
//! | --- | --- |
//! | [`network`] | [`check_network()`]: the passivity of stations joined by links; [`check_system()`] of any file |
//! | [`certificate`] | [`check()`] of a world, [`is_certified`], [`proof()`] for others to check, [`remedies()`] and their [`proposal()`] as lines for the file |
//! | [`theorems`] | the [`theorems::Theorem`]s that claim [`passivity()`] and [`uneven()`], and nothing else does: [`Claimed`] |
//! | [`passivity`](mod@passivity) | the damping that passivity against every passive hand requires, [`quantisation()`], [`worst_grip()`] |
//! | [`boundary`] | stability boundaries in a plane of two parameters: [`Decomposition`], [`z_width()`] |
//! | [`impedance`](mod@impedance) | the [`Impedance`] at the puck against frequency |
//! | [`batch`] | verdicts on many [`Loops`] of one body in vector lanes, [`Variants`] of one world |
//! | [`stability`] | eigenvalues, growth, modes and critical period, [`held()`] and [`free()`]; the [`worst_pattern()`] of intervals and delays |
//! | [`equations`] | the linearised equations: [`Continuous`], [`Discrete`], the closed loop |
//! | [`design`] | the wheel on a spring of the notes: its specification and its [`closed_form`] responses |
//! | [`numerics`] | eigenvalues, roots, series and searches |
//!
//! Each folder uses only folders below it in the table.
//!
//! All numbers are f64 in SI. Equation numbers such as (2.14) are those of J. S. Freudenberg, "Notes on the Virtual Spring Mass
//! System", EECS 461, 2008.
//!
//! ```
//! use hapt_analysis::{Verdict, check, required_damping};
//! use hapt_model::{Source, World};
//!
//! // A virtual spring of 2 N·m/rad at 1 ms requires a device damping of KT/2 (Colgate and Schenkel 1997).
//! let source = r#"
//!     [loop]
//!     period = "1 ms"
//!     [device]
//!     inertia = 6.4e-4
//!     damping = 1.2e-3
//!     [[couplings]]
//!     kind = "spring"
//!     between = ["puck", "ground"]
//!     stiffness = 2.0
//!     [scenarios.step]
//!     duration = "1 s"
//!     hand = { kind = "step", to = "45 deg" }
//! "#;
//! let world = World::read(&Source::from_text("spring", source), &[])?;
//! let required = required_damping(&world)?.unwrap();
//! assert!((required - 1e-3).abs() < 1e-9);
//! let check = check(&world)?;
//! assert!(check.certified.holds() && check.free.verdict == Verdict::Stable);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]
// Matches on laws, methods and estimators name every variant.
#![warn(clippy::wildcard_enum_match_arm)]

pub mod batch;
pub mod boundary;
pub mod certificate;
pub mod design;
pub mod equations;
pub mod error;
pub mod impedance;
pub mod network;
pub mod numerics;
pub mod passivity;
pub mod stability;
pub mod theorems;

mod text;
mod until;

pub use batch::loops::{Loops, sign};
pub use batch::variants::{Parameter, Variants};
pub use boundary::d_decomposition::{Decomposition, Keys, Line};
pub use boundary::z_width::{self, ZWidth, z_width};
pub use certificate::check::{Check, Status, TheoremUse, check, quick_check};
pub use certificate::proof::{self, Proof, proof};
pub use certificate::proposal::{self, Proposal, Remedy, proposal};
pub use certificate::remedies::{Remedies, certified_interval, remedies};
pub use certificate::{excess, is_certified};
pub use design::{Design, closed_form};
pub use equations::continuous::{self, Continuous, Slopes};
pub use equations::delay::MAX_IN_FLIGHT;
pub use equations::discrete::Discrete;
pub use equations::grip::Grip;
pub use equations::laws::felt_at;
pub use error::Error;
pub use impedance::rendered::{Elements, Impedance};
pub use network::{
    Demands, FixedExcess, FixedRates, LinkCheck, Linked, NetworkCheck, NetworkRemedies, Rounded, StationCheck,
    StationFindings, SystemCheck, check_links, check_network, check_system, rounded,
};
pub use numerics::eigenvalues::eigenvalues;
pub use numerics::nelder_mead;
pub use passivity::Cause;
pub use passivity::quantisation::{Quantisation, quantisation};
pub use passivity::worst_grip::{BreakingGrip, WorstGrip, breaking_damping, worst_grip};
pub use stability::clamped::{held_world, held_world_eigenvalues, held_world_growth};
pub use stability::critical::Critical;
pub use stability::free::{free, free_eigenvalues, free_growth, gripped_growth, shortest_period};
pub use stability::held::{held, held_eigenvalues, held_growth, multipliers};
pub use stability::patterns::{Pattern, played, with_worst_pattern, worst_pattern};
pub use stability::{MARGINAL, Stability, Verdict};
pub use theorems::passivity::{passivity, required_damping};
pub use theorems::{Claimed, FreePatterns, Passivity, PatternVerdict, Theorem, Uneven, uneven, uneven_damping};
pub use until::until;
