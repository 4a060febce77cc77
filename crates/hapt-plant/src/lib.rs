//! The physical device between the samples, exactly: the puck with its friction, the motor, and the hand that holds it.
//!
//! A [`VirtualDevice`] is made from a [`spec::DeviceSpec`]. A loop reads its puck, sets the command, and advances it by a period: no step
//! size, no integration error, every stop and start of Coulomb friction located.
//!
//! ```
//! use hapt_plant::{Grip, VirtualDevice, spec::DeviceSpec};
//!
//! let spec = DeviceSpec {
//!     period: 1e-3, delay: 0.0, lag: 0.0, inertia: 6.4e-4, damping: 1.2e-3, friction: 0.0, friction_backward: None, friction_by_position: None, stribeck: None, stops: None, handle: None, torque: Default::default(),
//! };
//! let mut device = VirtualDevice::new(&spec);
//! // A hand grips the wheel and moves its target to half a radian, against a spring.
//! device.hold(Some(Grip { inertia: 1e-4, damping: 0.02, stiffness: 3.0 }));
//! for _ in 0..2000 {
//!     device.intend(0.5);
//!     let (position, _) = device.puck();
//!     device.command(-1.0 * position);
//!     device.travel();
//! }
//! assert!((device.puck().0 - 3.0 * 0.5 / (3.0 + 1.0)).abs() < 1e-3);
//! ```
#![no_std]
#![warn(clippy::wildcard_enum_match_arm)]
#![forbid(unsafe_code)]

extern crate alloc;

mod device;
mod energy;
mod exponential;
mod field;
mod friction;
mod hand;
mod ledger;
mod motor;
mod own;
mod plant;
mod puck;
mod push;
mod root;
mod shaft;
pub mod spec;
mod stop;
mod trajectory;

pub use device::{Grip, VirtualDevice};
pub use energy::stored_energy;
pub use friction::{slide_under, sliding_direction};
pub use hand::{Hand, Script};
pub use ledger::Ledger;
pub use motor::Motor;
pub use plant::change_under;
pub use push::Push;
pub use trajectory::Piece;
