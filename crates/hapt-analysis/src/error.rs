//! What can be wrong.

use hapt_model::{Method, Output};

/// Why there is no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The QR algorithm did not converge within its bound, or met a number that is not finite.
    #[error(
        "no eigenvalues: a matrix of order {order} has entries beyond double precision, or its iteration did not converge"
    )]
    Eigenvalues {
        /// Rows of the matrix.
        order: usize,
    },
    /// A step's matrix has entries that are not finite, or cannot be inverted.
    #[error("no step: the matrices of {method} at this period go beyond double precision", method = method.name())]
    Step {
        /// The method.
        method: Method,
    },
    /// A coupling names a body that is not there.
    #[error("coupling {coupling} is tied to body {body}, but there are {bodies} (both count from 0)")]
    NoSuchBody {
        /// Index of the coupling.
        coupling: usize,
        /// The index it names.
        body: usize,
        /// How many bodies there are.
        bodies: usize,
    },
    /// A number outside its range.
    #[error("{what} is {value}, but must be {wanted}")]
    Value {
        /// The quantity.
        what: &'static str,
        /// What it is.
        value: f64,
        /// What would be right.
        wanted: &'static str,
    },
    /// More commands on their way to the motor than the analysis carries.
    #[error(
        "a delay of {delay} s is {:.0} periods of {period} s, but the analysis carries {limit} commands in flight at most: \
         take a longer period or a shorter delay",
        delay / period
    )]
    InFlight {
        /// The delay in s.
        delay: f64,
        /// The period in s.
        period: f64,
        /// The most commands.
        limit: usize,
    },
    /// The search for the least damping did not end within its bound.
    #[error("no least damping: its search did not end after looking at {looks} intervals of frequency")]
    Search {
        /// How many it looked at.
        looks: usize,
    },
    /// The edge of a Z-width that no search has reached.
    #[error(
        "no edge: no {what} makes the loop grow, up to 1e9 times what the inertia and damping of the device and the period set"
    )]
    Far {
        /// "spring" or "damper".
        what: &'static str,
    },
    /// An output that the method does not have.
    #[error(
        "{method} takes the new sample first and the torque from x_k: its output is \"start\", without advance, not \"{output}\"",
        method = method.name(),
        output = output.name()
    )]
    Output {
        /// The method.
        method: Method,
        /// The output asked for.
        output: Output,
    },
}

/// `value`, when it is finite and above 0.
pub(crate) fn positive(what: &'static str, value: f64) -> Result<f64, Error> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(Error::Value { what, value, wanted: "a finite number above 0" })
    }
}
