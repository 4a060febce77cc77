//! Errors of the analysis.

use hapt_model::{Method, Output, Sampling};

/// Why the analysis has no result.
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
    /// The matrix of a step has entries that are not finite, or is singular.
    #[error("no step: the matrices of {method} at this period go beyond double precision", method = method.name())]
    Step {
        /// The method.
        method: Method,
    },
    /// A coupling names a body that does not exist.
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
        /// Its value.
        value: f64,
        /// The valid range.
        wanted: &'static str,
    },
    /// The delay is longer than the analysis supports.
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
        /// Largest supported number of commands in flight.
        limit: usize,
    },
    /// The caller of [`crate::until()`] set its flag.
    #[error("the analysis was ended from outside")]
    Stopped,
    /// The search for the required damping did not converge within its limit.
    #[error("no least damping: its search did not end after looking at {intervals} intervals of frequency")]
    Search {
        /// Intervals of frequency that were bounded.
        intervals: usize,
    },
    /// The search for an edge of the Z-width reached its limit.
    #[error(
        "no edge: no {what} makes the loop grow, up to 1e9 times what the inertia and damping of the device and the period set"
    )]
    Far {
        /// "spring" or "damper".
        what: &'static str,
    },
    /// The bodies step at every n-th sample, and the analysis is about loops in which they step at every one.
    #[error(
        "loop.bodies_every is {every}: {what} is about loops whose bodies step at every sample, loop.bodies_every = 1"
    )]
    BodiesEvery {
        /// The requested analysis.
        what: &'static str,
        /// n.
        every: u32,
    },
    /// The method does not support this output.
    #[error(
        "{method} takes the new sample first and the torque from x_k: its output is \"start\", without advance, not \"{output}\"",
        method = method.name(),
        output = output.name()
    )]
    Output {
        /// The method.
        method: Method,
        /// The requested output.
        output: Output,
    },
}

/// Refuses bodies that do not step at every sample, which `what` does not cover.
///
/// # Errors
/// [`Error::BodiesEvery`].
pub fn at_one_rate(sampling: &Sampling, what: &'static str) -> Result<(), Error> {
    match sampling.bodies_every {
        1 => Ok(()),
        every => Err(Error::BodiesEvery { what, every }),
    }
}

/// Returns `value` if it is finite and above 0.
pub(crate) fn positive(what: &'static str, value: f64) -> Result<f64, Error> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(Error::Value { what, value, wanted: "a finite number above 0" })
    }
}
