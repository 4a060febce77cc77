//! Errors of writing and reading logs.

use std::io;

/// An error of a log.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// It cannot be written.
    #[error("cannot write {path}: {error}")]
    Write {
        /// The file.
        path: String,
        /// The error of the system or of the format.
        error: String,
    },
    /// It cannot be read.
    #[error("cannot be read: {0}")]
    Unreadable(#[from] io::Error),
    /// It is not a log of hapt.
    #[error("{0}")]
    Foreign(String),
    /// Its world is invalid, or cannot be compiled.
    #[error("the world in the log: {0}")]
    World(String),
    /// It contains nothing that can be replayed.
    #[error("{0}")]
    NoReplay(String),
}
