//! The world file: quantities with units, keys, checks, errors with line and caret.
//!
//! [`Source`] is the text of a world file, [`World::read`] makes it a [`World`] in SI or an [`Error`] that says what is
//! wrong, where, and what would be right. [`parse_quantity`] reads quantities elsewhere, as on a command line;
//! [`keys::KEYS`] lists every key.
//!
//! ```
//! use hapt_model::{Source, World};
//!
//! let file = r#"
//! [loop]
//! period = "1 ms"
//!
//! [device]
//! inertia = "6.4e-4 kg m^2"
//! "#;
//! let world = World::read(&Source::from_text("wheel.toml", file), &["loop.period=2ms".to_string()])?;
//! assert_eq!(world.sampling.period, 0.002);
//!
//! let error = World::read(&Source::from_text("wheel.toml", file), &["loop.period=2 kg".to_string()]).unwrap_err();
//! assert_eq!(
//!     error.to_string(),
//!     r#"loop.period: "2 kg" is a mass (kg); expected a time (s), such as "1 ms"
//!  --> --set:1:13
//!   |
//! 1 | loop.period=2 kg
//!   |             ^^^^"#
//! );
//! # Ok::<(), hapt_model::Error>(())
//! ```

pub mod builtin;
mod compensation;
mod counts;
mod device;
mod dimension;
mod document;
mod edit;
mod error;
mod fields;
pub mod input;
pub mod keys;
mod kinds;
mod limits;
pub mod motor;
mod numbers;
mod overrides;
mod parameters;
mod path;
mod quantity;
mod read;
pub mod safety;
mod sampling;
mod schema;
mod source;
mod spelling;
mod support;
mod syntax;
pub mod system;
mod timing;
mod unit;
pub mod vectors;
mod waveform;
mod words;
pub mod world;
mod write;

pub use dimension::Dimension;
pub use error::{Error, ErrorKind, Location, visible};
pub use hapt_core::named;
pub use hapt_core::spec::{
    Body, Coupling, CouplingKind, Damping, End, Estimator, HARMONICS, Law, Linear, Method, Output, Side, Spec, Waveform,
};
pub use hapt_core::{LASTING, SafetyProfile, kalman_gains};
pub use hapt_plant::spec::{
    Cogging, DeviceSpec, DeviceTorque, Drive, FrictionByPosition, Gravity, Hand, Handle, Shape, Stops, Stribeck,
    Switching,
};
pub use kinds::{Compensated, EstimatorKind, HandKind, Motion, ShapeKind, TimingKind};
pub use parameters::{Parameter, parameters, parameters_of, unit, unit_size};
pub use quantity::{Fault, Quantity, QuantityError, parse_positive, parse_quantity};
pub use safety::Safety;
pub use sampling::{Delay, Sampling};
pub use schema::schema;
pub use source::{LARGEST_SOURCE, Source};
pub use system::{Link, Station, System, is_network};
pub use timing::{Timing, of_pattern};
pub use unit::{UNITS, Unit, UnitError};
pub use words::{did_you_mean, nearest};
pub use world::{Compensation, Device, Mounting, Scenario, Tolerances, World};
