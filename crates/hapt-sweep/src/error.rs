//! Errors of sweeps.

/// An error of a sweep's axes or measures.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The world or network, or that at a corner of the grid.
    #[error("{0}")]
    Model(#[from] hapt_model::Error),
    /// An axis.
    #[error("{0}")]
    Axis(String),
    /// A claim that does not apply to such a file.
    #[error("{0}")]
    Claim(String),
    /// A measure, or the scenario that it needs.
    #[error("{0}")]
    Measure(String),
    /// No verdict at a point of a plane.
    #[error("at {at}: {error}")]
    At {
        /// The keys and their values.
        at: String,
        /// The cause.
        error: hapt_analysis::Error,
    },
    /// It was stopped.
    #[error("interrupted")]
    Interrupted,
}
