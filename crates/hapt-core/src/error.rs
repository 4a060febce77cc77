//! Why a spec cannot be compiled.

use core::fmt;

use crate::Method;

/// Why a [`crate::Spec`] cannot be compiled. Couplings are named by their index.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// More bodies than the capacity of this loop.
    TooManyBodies {
        /// In the spec.
        given: usize,
        /// Of this loop.
        room: usize,
    },
    /// More couplings than the capacity of this loop.
    TooManyCouplings {
        /// In the spec.
        given: usize,
        /// Of this loop.
        room: usize,
    },
    /// A FOAW window longer than this loop remembers.
    WindowTooLong {
        /// In the spec, in samples.
        given: u32,
        /// Of this loop, in samples.
        room: usize,
    },
    /// A number outside its range.
    Value {
        /// Whose number, such as "period".
        what: &'static str,
        /// What was given.
        given: f64,
        /// What would be right, such as "positive".
        wanted: &'static str,
    },
    /// An end that names no body of the spec.
    NoSuchBody {
        /// Which coupling.
        coupling: usize,
    },
    /// A coupling between an end and itself.
    SameEnds {
        /// Which coupling.
        coupling: usize,
    },
    /// A compensating damper without a spring to compensate.
    NoSpring {
        /// Which coupling.
        coupling: usize,
    },
    /// An integral term, an assist or a torque along the acceleration with an end that is a body, or in a loop with an advance.
    AtPuck {
        /// Which coupling.
        coupling: usize,
    },
    /// This method cannot take this coupling at a body.
    Unsupported {
        /// Which coupling.
        coupling: usize,
        /// The method that refuses it.
        method: Method,
    },
    /// `tustin` and `foh` compute the torque from x_k: output start.
    OutputNotStart,
    /// Steps ahead are for the output at the end of the step.
    AdvanceWithoutEnd,
    /// Bodies that do not step at every sample, together with a feature that the loop does not support then.
    BodiesEvery {
        /// The feature.
        feature: &'static str,
    },
    /// The world's numbers leave the range of the loop's.
    NotFinite,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Error::TooManyBodies { given, room } => write!(f, "{given} bodies, where this loop has room for {room}"),
            Error::TooManyCouplings { given, room } => {
                write!(f, "{given} couplings, where this loop has room for {room}")
            }
            Error::WindowTooLong { given, room } => {
                write!(f, "a window of {given} samples, where this loop remembers {}", room.saturating_sub(1))
            }
            Error::Value { what, given, wanted } => write!(f, "{what} is {given}; it must be {wanted}"),
            Error::NoSuchBody { coupling } => write!(f, "coupling {coupling} is tied to a body that is not there"),
            Error::SameEnds { coupling } => write!(f, "coupling {coupling} is tied to the same end twice"),
            Error::NoSpring { coupling } => write!(f, "coupling {coupling} compensates springs, and there is none"),
            Error::AtPuck { coupling } => {
                write!(
                    f,
                    "coupling {coupling} is an integral term, an assist or a torque along the acceleration, which is between puck and ground and \
                     has no advance"
                )
            }
            Error::Unsupported { coupling, method } => {
                write!(f, "{} cannot take coupling {coupling}, which is nonlinear, at a body", method.name())
            }
            Error::OutputNotStart => write!(f, "tustin and foh take the torque from x_k: output must be start"),
            Error::AdvanceWithoutEnd => write!(f, "steps ahead need output end"),
            Error::BodiesEvery { feature } => {
                write!(f, "bodies that step at every n-th sample, n above 1, do not go with {feature}")
            }
            Error::NotFinite => write!(
                f,
                "the compiled world leaves the range of its numbers: an inertia, a stiffness, a damping or the period is far out of scale"
            ),
        }
    }
}

impl core::error::Error for Error {}
