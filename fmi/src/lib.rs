//! A world as an FMU (Functional Mock-up Unit) for co-simulation, by FMI 2.0 and FMI 3.0: <https://fmi-standard.org>.
//!
//! [`write()`] makes an FMU of a world. The same crate, built as a C library, is the FMU's binary: `fmi2.rs` and `fmi3.rs` are the
//! functions of the two standards over one [`Instance`], which reads the world from the FMU's resources.
//!
//! An FMU is of one [`Kind`]: the loop without its device, whose inputs are the puck's motion and whose output is the torque on it; or the
//! loop on its exact device, with the hand's torque as input and the columns of a run as outputs.
#![deny(unsafe_code)]

mod c;
mod clock;
mod description;
mod engine;
pub mod fmi2;
pub mod fmi3;
mod instance;
mod kind;
mod log;
mod model;
mod package;
mod units;
mod variable;

pub use clock::Clock;
pub use instance::{Instance, Phase, Saved};
pub use kind::Kind;
pub use log::{CATEGORIES, Log, Sink, Status};
pub use model::Model;
pub use package::{LIBRARY, Platform, Version, places, write};
pub use variable::{Role, Value, Variable};

/// The reader's error without its position in a text.
fn named(error: &hapt_model::Error) -> String {
    match error.key.is_empty() {
        true => error.message.clone(),
        false => format!("{}: {}", error.key, error.message),
    }
}
